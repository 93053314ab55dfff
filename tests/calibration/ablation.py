"""What samplers of half vectors, and each of their constants, are worth: η and the largest weight over models and terms
at parameters that no constant was fitted to, and over dielectrics of about the index outside; with fixed variates.

    python tests/calibration/ablation.py [--record FILE] [--against FILE] [--without]

``--record`` writes the tables, ``--against`` compares with some written before. ``--without`` goes through the
constants: with each at the value that switches off what it scales.
"""

from __future__ import annotations

import argparse
import json
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from harness import directions, replaced

from mi_brdfs.microfacet import sampling
from mi_brdfs.microfacet.forward import ForwardDirections
from mi_brdfs.microfacet.shadowing import Implicit, SchlickSmith, Shadowing
from mi_brdfs.microfacet.visible import VisibleNormals
from mi_brdfs.models.microfacet import Microfacet
from mi_brdfs.probe.arrays import luminance
from mi_brdfs.probe.bsdf import BSDFProbe
from mi_brdfs.probe.variates import lattice, sampling_efficiency

import mitsuba as mi  # after mi_brdfs, which chooses the LLVM that they load  # isort: skip

ANGLES = 5, 30, 60, 80, 88
AZIMUTH = 33
LOG2_POINTS = 10

Plugin = dict[str, Any]

FACETS: dict[str, Plugin] = {
    "beckmann": {"alpha": 0.17},
    "ggx": {"alpha": 0.23},
    "blinn": {"exponent": 34.0},
    "gtr": {"alpha": 0.19, "gamma": 1.4},
    "abc": {"b": 340.0, "c": 1.1},
    "hepd": {"kappa": -3.0, "gamma": 47.0},
    "epd": {"alpha": 0.14, "gamma": 0.6},
}
METALS = [*product(({"distribution": "beckmann", "alpha": 0.37}, {"distribution": "ggx", "alpha": 0.43}),
                 ("vcavity", "smith-correlated", "implicit", "neumann", "ashikhmin-shirley"))]  # fmt: skip
ROUGH: list[Plugin] = [
    {"distribution": "beckmann", "alpha_u": 0.12, "alpha_v": 0.47, "shadowing": "smith"},
    {"distribution": "beckmann", "alpha_u": 1.7, "alpha_v": 0.06, "shadowing": "vcavity"},
    {"distribution": "beckmann", "alpha": 1.3, "shadowing": "kelemen"},
    {"distribution": "ggx", "alpha_u": 0.14, "alpha_v": 0.6, "shadowing": "smith-correlated"},
    {"distribution": "ggx", "alpha_u": 1.4, "alpha_v": 0.07, "shadowing": "ashikhmin-premoze"},
    {"distribution": "ggx", "alpha": 0.9, "shadowing": "schlick", "int_ior": 1.6},
    {"distribution": "blinn", "exponent": 1.7, "shadowing": "vcavity", "int_ior": 1.4},
]
MODELS: dict[str, list[Plugin]] = {
    "ashikhminshirley": [{"exponent": 37.0}, {"exponent_u": 6.0, "exponent_v": 900.0, "specular_reflectance": 0.4}],
    "blinnphong": [{"exponent": 23.0}, {"exponent": 4.0, "normalization": "original"}],
    "brady": [{"exponent": 1.3, "beta": 0.43}, {"exponent": 0.9, "beta": 0.2, "f0": 0.7, "diffuse_reflectance": 0.0}],
    "burley": [{"roughness": 0.33}, {"roughness": 0.62, "clearcoat": 0.7, "clearcoat_gloss": 0.3},
               {"roughness": 0.7, "metallic": 1.0, "anisotropic": 0.7}, {"roughness": 0.45, "sheen": 0.8}],
    "cooktorrance": [{"alpha": 0.23}, {"alpha": 0.62, "int_ior": 1.4, "diffuse_reflectance": 0.3},
                     {"alpha": 0.2, "distribution": "ggx", "material": "Au"},
                     {"alpha": 0.35, "distribution": "blinn", "material": "Cu"}],
    "kurt": [{"alpha": 0.16}, {"alpha_u": 0.07, "alpha_v": 0.33, "f0": 0.6, "kurt_exponent": 0.15}],
    "low": [{"b": 470.0, "c": 1.3}, {"b": 30.0, "c": 0.9, "normalization": "unit", "int_ior": 1.8},
            {"variant": "smooth", "b": 220.0, "c": 1.4}],
    "metallicroughness": [{"roughness": 0.37}, {"roughness": 0.66, "metallic": 1.0},
                          {"roughness": 0.55, "shadowing": "smith"}],
    "nishino": [{"kappa": -9.0, "gamma": 55.0}, {"kappa": 3.0, "gamma": 31.0, "material": "Al"},
                {"kappa": -4.0, "gamma": 70.0, "variant": "dsbrdf"}],
    "schlick": [{"roughness": 0.09}, {"roughness": 0.2, "isotropy": 0.3, "specular_reflectance": 0.5},
                {"roughness": 0.03, "variant": "plain"}, {"roughness": 0.12, "variant": "interreflection"}],
    "walter": [{"alpha": 0.23}, {"alpha": 0.68, "int_ior": 1.4, "diffuse_reflectance": 0.4},
               {"alpha_u": 0.15, "alpha_v": 0.6, "material": "Cu"}, {"alpha": 0.4, "shadowing": "correlated"}],
    "ward": [{"alpha": 0.13}, {"alpha_u": 0.06, "alpha_v": 0.37, "variant": "ward"},
             {"alpha": 0.42, "variant": "ward-duer"}, {"alpha": 0.24, "variant": "approximate"}],
}  # fmt: skip


INDICES = 0.8, 0.95, 0.99, 1.01, 1.05, 1.25
OF_INDICES = product(
    ({"distribution": "beckmann", "alpha": 0.3}, {"distribution": "ggx", "alpha": 0.3},
     {"distribution": "ggx", "alpha_u": 0.6, "alpha_v": 0.05}, {"distribution": "blinn", "exponent": 5.0}),
    ("smith-correlated", "vcavity", "schlick", "kelemen"),
)  # fmt: skip


def kit(distribution: str, shading: str, **given: Any) -> Plugin:
    return {"type": "microfacet", "distribution": distribution, "shadowing": shading, **given}


FACETS_AND_MODELS = [
    *(
        kit(name, shading, f0=0.04, **given)
        for name, given in FACETS.items()
        for shading, term in Microfacet.shadowing.terms.items()
        if term.suits(Microfacet.distribution.terms[name])
    ),
    *({"type": "microfacet", "shadowing": shading, **given} for given, shading in METALS),
    *({"type": "microfacet", **given} for given in ROUGH),
    *({"type": name, **given} for name, several in MODELS.items() for given in several),
]
TABLES = {
    "facets and models": FACETS_AND_MODELS,
    "indices": [
        {"type": "microfacet", "shadowing": shading, "int_ior": index, "ext_ior": 1.0, **given}
        for given, shading in OF_INDICES
        for index in INDICES
    ],
}

WITHOUT = [
    (sampling, "SHADOWED", 0),
    (sampling, "RISING", 0),
    (sampling, "MOST", 0.5),
    (sampling, "OUTWARD", 0),
    (sampling, "LEANING", 0),
    (Implicit, "lean", 1),
    (SchlickSmith, "lean", 1),
    (Shadowing, "UNIFORM", 0),
    (VisibleNormals, "BIAS", 0),
    (ForwardDirections, "LARGEST", 0),
    (ForwardDirections, "INDISTINCT", 1),
    (ForwardDirections, "TYPICAL", 0.5),
]


def measured(given: Plugin) -> tuple[list[float], list[float]]:
    """η and the largest weight over the mean, at each angle."""
    probe = BSDFProbe(mi.load_dict(given))
    weights = luminance(probe.weights(probe.whole, directions(ANGLES, (AZIMUTH,)), lattice(LOG2_POINTS, 1)))
    return sampling_efficiency(weights).tolist(), (weights.max(axis=1) / weights.mean(axis=1)).tolist()


def tables(*names: str) -> dict[str, dict[str, tuple[list[float], list[float]]]]:
    return {
        name: {" ".join(map(str, given.values())): measured(given) for given in TABLES[name]}
        for name in names or TABLES
    }


def shown(name: str, now: Any, then: Any) -> None:
    eta, largest = (np.array([row[k] for row in now.values()]) for k in (0, 1))
    change = eta - [then[setting][0] for setting in now]
    print(f"{len(now)} {name}".ljust(24) + "".join(f"{theta:>8}°" for theta in ANGLES))
    rows = {"mean η": eta.mean(axis=0), "worst η": eta.min(axis=0), "largest weight": largest.max(axis=0)}
    if change.any():
        rows |= {"mean change": change.mean(axis=0), "worst change": change.min(axis=0)}
    for label, row in rows.items():
        print(f"    {label:<20}" + "".join(f"{x:>9.4f}" for x in row), flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--record", type=Path)
    parser.add_argument("--against", type=Path)
    parser.add_argument("--without", action="store_true")
    arguments = parser.parse_args()
    mi.set_variant("llvm_ad_rgb")
    now = tables()
    then = json.loads(arguments.against.read_text()) if arguments.against else now
    for name in now:
        shown(name, now[name], then[name])
    if arguments.record:
        arguments.record.write_text(json.dumps(now))
    for owner, name, value in WITHOUT if arguments.without else []:
        print(f"{owner.__name__.rpartition('.')[2]}.{name} = {value}")
        with replaced(owner, {name: value}):
            for table, rows in tables("indices" if owner is ForwardDirections else "facets and models").items():
                shown(table, rows, now[table])


if __name__ == "__main__":
    main()
