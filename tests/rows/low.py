import reference as ref
from catalogue import rows_of

row = rows_of("low", ref.low, diffuse_reflectance=0, a=1, b=100, c=1.5, int_ior=1.5, variant="microfacet")

CHOICES = (
    {"variant": "microfacet", "normalization": "fit"},
    {"variant": "microfacet", "normalization": "unit"},
    {"variant": "smooth"},
)

ROWS = [
    row("default", normalization="fit"),
    row("over diffuse", normalization="fit", diffuse_reflectance=0.4, a=8.0, b=2000, c=1.25),
    row("paper", normalization="paper", diffuse_reflectance=0.4, a=0.5, b=20, c=1),
    row("unit", normalization="unit", diffuse_reflectance=0.4, b=100, c=0.75, int_ior=4),
    row("unit flat", normalization="unit", diffuse_reflectance=0.4, b=0, c=2, int_ior=4),
    row("smooth", variant="smooth"),
    row("smooth over diffuse", variant="smooth", diffuse_reflectance=0.4, a=8.0, b=2000, c=0.75, int_ior=1.25),
    row("smooth flat", variant="smooth", diffuse_reflectance=0.4, a=0.5, b=0, c=1),
    row("smooth sharp", sharp=True, variant="smooth", diffuse_reflectance=0.4, a=50.0, b=2e4, c=1.5, int_ior=4),
]

EXTREME = [
    row(f"{choices['variant']} b {b:g}", **choices, diffuse_reflectance=0.4, a=0.5, b=b, c=c, int_ior=2)
    for choices in CHOICES
    for b, c in ((1.0, 0.5), (8e6, 1.0))
] + [
    row(f"{choices['variant']} of vacuum", **choices, diffuse_reflectance=0.4, a=0.5, int_ior=1)
    for choices in CHOICES[::2]
]

SMOOTH = {
    f"low {' '.join(choices.values())}": {
        "type": "low", **choices, "diffuse_reflectance": 0.3, "a": 0.7, "b": 150.0, "c": 1.3, "int_ior": 2.5,
    }
    for choices in CHOICES
}  # fmt: skip
