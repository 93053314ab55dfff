from functools import partial

import numpy as np
import reference as ref
from catalogue import BOTH, Row

GLASS = partial(ref.fresnel_dielectric, eta=1.5 / 1.000277)
CONDUCTOR = partial(ref.fresnel_conductor, eta=0.2, k=3.0)
SCHLICK = partial(ref.fresnel_schlick, f0=0.3)

ALPHA = {
    "beckmann": {"alpha": 0.3},
    "ggx": {"alpha": 0.3},
    "blinn": {"exponent": 20},
    "gtr": {"alpha": 0.3, "gamma": 1.5},
    "abc": {"b": 60, "c": 1.2},
    "hepd": {"kappa": -5, "gamma": 30},
    "epd": {"alpha": 0.3, "gamma": 0.7},
}
"""A middling width of each distribution."""


def row(distribution, shadowing, name="", fresnel=None, F=np.ones_like, turns=0.0, κ=0.25, sharp=False, **parameters):
    parameters = parameters or ALPHA[distribution]
    expected = dict(parameters)
    if distribution in ("beckmann", "ggx") and "alpha" in expected:
        expected["alpha_u"] = expected["alpha_v"] = expected.pop("alpha")
    both = BOTH if shadowing in ("smith", "vcavity") else {}
    ρd, ρs = (0.4, 0.5) if both else (0, 1)

    def reference(wi, wo):
        wi, wo = ref.rotate(wi, turns), ref.rotate(wo, turns)
        return ref.microfacet(wi, wo, ρd, ρs, distribution, shadowing, F, kurt_exponent=κ, **expected)

    given = {"rotation": turns} if turns else {}
    given |= {"kurt_exponent": κ} if shadowing == "kurt" else {}
    bsdf = {"type": "microfacet", "distribution": distribution, "shadowing": shadowing, **both, **given}
    return Row(
        f"microfacet {distribution} {shadowing} {name}".strip(), bsdf | parameters | (fresnel or {}), reference,
        sharp=sharp,
    )  # fmt: skip


ROWS = [
    Row("microfacet default", {"type": "microfacet"},
        lambda wi, wo: ref.microfacet(wi, wo, 0, 1, "beckmann", "smith", alpha_u=0.1, alpha_v=0.1)),
    row("beckmann", "smith", "anisotropic", {"f0": 0.3}, SCHLICK, turns=0.1, alpha_u=0.1, alpha_v=0.4),
    row("beckmann", "smith-correlated", "rough", alpha=1.0),
    row("beckmann", "smith-rational", "anisotropic", alpha_u=0.6, alpha_v=0.2),
    row("ggx", "smith-correlated", "anisotropic", turns=0.3, alpha_u=0.1, alpha_v=0.4),
    row("ggx", "schlick", "anisotropic", alpha_u=0.4, alpha_v=0.1),
    row("ggx", "ashikhmin-premoze"),
    row("blinn", "smith"),
    row("blinn", "schlick"),
    row("blinn", "ashikhmin-shirley", "glass", {"int_ior": 1.5}, GLASS),
    row("gtr", "vcavity"),
    row("gtr", "schlick", "rougher than uniform", alpha=1.5, gamma=3),
    row("abc", "neumann"),
    row("hepd", "implicit", "peaked", kappa=5, gamma=10),
    row("epd", "vcavity"),
    row("epd", "neumann", "long tail", alpha=0.1, gamma=0.3),
    row("epd", "kelemen", "steep", alpha=0.5, gamma=3),
    row("ggx", "vcavity", "sharp", sharp=True, alpha=0.02),
    row("epd", "vcavity", "sharp", sharp=True, alpha=0.02, gamma=1.5),
]  # fmt: skip

NARROW = {
    "beckmann": {"alpha": 1e-3},
    "ggx": {"alpha_u": 1e-3, "alpha_v": 5e-3},
    "blinn": {"exponent": 1e5},
    "gtr": {"alpha": 1e-3, "gamma": 1.5},
    "abc": {"b": 8e6, "c": 1.0},
    "hepd": {"kappa": 80, "gamma": 1e3},
    "epd": {"alpha": 1e-3, "gamma": 0.7},
}
BROAD = {
    "beckmann": {"alpha": 2.0},
    "ggx": {"alpha": 2.0},
    "blinn": {"exponent": 0},
    "gtr": {"alpha": 1.0, "gamma": 0},
    "abc": {"b": 0, "c": 0},
    "hepd": {"kappa": -80, "gamma": 0.2},
    "epd": {"alpha": 2.0, "gamma": 0.5},
}

EXTREME = [
    row(distribution, "smith" if distribution in ("beckmann", "ggx", "blinn") else "vcavity", name, **given)
    for name, widths in (("narrow", NARROW), ("broad", BROAD))
    for distribution, given in widths.items()
]
# Entries of the kit whose sampling the named models' rows test.
EXTREME += [
    row("beckmann", "smith", "black where it faces", {"f0": 0.0}, partial(ref.fresnel_schlick, f0=0), alpha=0.3),
    row("beckmann", "kelemen"),
    row("beckmann", "kurt", κ=0.4),
    row("ggx", "smith", "conductor", {"eta": 0.2, "k": 3.0}, CONDUCTOR, alpha=0.2),
    row("blinn", "smith-correlated"),
    row("gtr", "vcavity", "Berry's", alpha=0.1, gamma=1),
    row("abc", "vcavity"),
    row("hepd", "vcavity"),
    row("epd", "schlick"),
]

SMOOTH = {
    f"microfacet {distribution} {shadowing}": {
        "type": "microfacet", "distribution": distribution, "shadowing": shadowing, **BOTH, **given
    }
    for distribution, shadowing, given in (
        ("beckmann", "smith", {"alpha_u": 0.2, "alpha_v": 0.4, "f0": 0.3, "rotation": 0.1}),
        ("ggx", "smith-correlated", {"alpha": 0.3}),
        ("blinn", "smith", {"exponent": 10.0}),
        ("gtr", "schlick", {"alpha": 0.3, "gamma": 1.5}),
        ("abc", "ashikhmin-premoze", {"b": 60.0, "c": 1.2}),
        ("hepd", "kelemen", {"kappa": -10.0, "gamma": 60.0}),
        ("epd", "kurt", {"alpha": 0.3, "gamma": 0.7, "kurt_exponent": 0.3}),
    )
}  # fmt: skip
