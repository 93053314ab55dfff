import reference as ref
from catalogue import BOTH, rows_of

row = rows_of(
    "ward", ref.ward, "alpha", diffuse_reflectance=0.5, specular_reflectance=0.2, alpha=0.1, variant="balanced"
)

ROWS = [
    row("default"),
    row("balanced rough", alpha=0.5, **BOTH),
    row("balanced roughest", alpha=1.0, **BOTH),
    row("balanced sharp", sharp=True, alpha=0.02, **BOTH),
    row("balanced anisotropic", alpha_u=0.08, alpha_v=0.4, **BOTH),
    row("ward", variant="ward", alpha=0.2, **BOTH),
    row("ward anisotropic turned", variant="ward", alpha_u=0.5, alpha_v=0.1, rotation=0.15, **BOTH),
    row("ward-duer anisotropic", variant="ward-duer", alpha_u=0.15, alpha_v=0.5, **BOTH),
    row("approximate anisotropic", variant="approximate", alpha_u=0.1, alpha_v=0.6, **BOTH),
    row("approximate roughest", variant="approximate", alpha=1.0, **BOTH),
]

EXTREME = [
    row(f"{variant} alpha {α:g}", variant=variant, alpha_u=α, alpha_v=3 * α, **BOTH)
    for variant in ("balanced", "ward", "ward-duer", "approximate")
    for α in (1e-3, 0.3)
]

TURNED = {"alpha_u": 0.12, "alpha_v": 0.4, "rotation": 0.1}
SMOOTH = {
    f"ward {variant}": {"type": "ward", "variant": variant, **TURNED, **BOTH}
    for variant in ("balanced", "ward", "ward-duer", "approximate")
} | {"ward isotropic": {"type": "ward", "alpha": 0.2, **BOTH}}
