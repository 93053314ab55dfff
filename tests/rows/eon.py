import reference as ref
from catalogue import rows_of

row = rows_of("eon", ref.eon, reflectance=0.5, roughness=0.5)

ROWS = [
    row("default"),
    row("smooth", roughness=0, reflectance=0.8),
    row("smoother", roughness=0.1, reflectance=0.8),
    row("rough", roughness=1, reflectance=0.8),
    row("rough white", roughness=1, reflectance=1.0),
    row("rough dark", roughness=1, reflectance=0.02),
]

EXTREME = [row(f"roughness {r:g}", roughness=r, reflectance=1.0) for r in (0.0, 1e-6, 1.0)]

SMOOTH = {"eon": {"type": "eon"}, "eon rough": {"type": "eon", "roughness": 0.9, "reflectance": 0.8}}
