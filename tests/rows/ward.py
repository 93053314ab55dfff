import reference as ref
from catalogue import BOTH, Row


def row(name, ρd, ρs, α, variant="balanced", turns=0.0, sharp=False, **given):
    def reference(wi, wo):
        return ref.ward(ref.rotate(wi, turns), ref.rotate(wo, turns), ρd, ρs, *α, variant)

    return Row(f"ward {name}", {"type": "ward", "variant": variant, **given}, reference, sharp=sharp)


ROWS = [
    row("default", 0.5, 0.2, (0.1, 0.1)),
    row("balanced rough", 0.4, 0.5, (0.5, 0.5), alpha=0.5, **BOTH),
    row("balanced roughest", 0.4, 0.5, (1, 1), alpha=1.0, **BOTH),
    row("balanced sharp", 0.4, 0.5, (0.02, 0.02), sharp=True, alpha=0.02, **BOTH),
    row("balanced anisotropic", 0.4, 0.5, (0.08, 0.4), alpha_u=0.08, alpha_v=0.4, **BOTH),
    row("ward", 0.4, 0.5, (0.2, 0.2), "ward", alpha=0.2, **BOTH),
    row("ward anisotropic turned", 0.4, 0.5, (0.5, 0.1), "ward", turns=0.15,
        alpha_u=0.5, alpha_v=0.1, rotation=0.15, **BOTH),
    row("ward-duer anisotropic", 0.4, 0.5, (0.15, 0.5), "ward-duer", alpha_u=0.15, alpha_v=0.5, **BOTH),
    row("approximate anisotropic", 0.4, 0.5, (0.1, 0.6), "approximate", alpha_u=0.1, alpha_v=0.6, **BOTH),
    row("approximate roughest", 0.4, 0.5, (1, 1), "approximate", alpha=1.0, **BOTH),
]  # fmt: skip

EXTREME = [
    row(f"{variant} alpha {α:g}", 0.4, 0.5, (α, 3 * α), variant, alpha_u=α, alpha_v=3 * α, **BOTH)
    for variant in ("balanced", "ward", "ward-duer", "approximate")
    for α in (1e-3, 0.3)
]

TURNED = {"alpha_u": 0.12, "alpha_v": 0.4, "rotation": 0.1}
SMOOTH = {
    f"ward {variant}": {"type": "ward", "variant": variant, **TURNED, **BOTH}
    for variant in ("balanced", "ward", "ward-duer", "approximate")
} | {"ward isotropic": {"type": "ward", "alpha": 0.2, **BOTH}}
