"""Cold fits beside published ones: how often a fit that knows no published material is at least as good.

python tests/fit_published.py [--starts N] FILE…

The files are tables of materials that Ngan et al. 2005 and Löw et al. 2012 fitted (MERL's, by their names), or like
these. For each set of published parameters, its model is fitted to the files without any published start, and both are
compared in the metric of that publication, on the pairs of directions that were fitted.
"""

from __future__ import annotations

import argparse
from collections import defaultdict
from pathlib import Path
from unittest.mock import patch

import numpy as np

import mi_brdfs
from mi_brdfs.fit import METRICS, Observations, fit, observe
from mi_brdfs.mitsuba.registry import find_model
from mi_brdfs.probe.arrays import interaction, numbers

import mitsuba as mi  # after mi_brdfs, which chooses the LLVM that it loads  # isort: skip

BATCH = 10
"""Materials fitted at a time."""


def metric_of(group: str) -> str:
    """Return the metric that a set of published parameters was fitted with."""
    return "ngan" if group.startswith("ngan/") else "l2" if group.endswith("-e1") else "log"


def error(material: Observations, bsdf: dict, metric: str) -> float:
    """Return the error of a plugin dict on the pairs that were fitted."""
    rows, own = slice(0, material.fitted), METRICS[metric]
    wi, wo = material.wi[rows], material.wo[rows]
    cosines = wi[:, 2:].astype(float)
    value = numbers(mi.load_dict(bsdf).eval(mi.BSDFContext(), interaction(wi), mi.Vector3f(wo.T))) / wo[:, 2:]
    residual = own.transform(material.f[rows] * cosines) - own.transform(value * cosines)
    weight = own.weights(wo, material.solid_angle[rows])[:, None] * material.usable[rows]
    return float(np.sqrt((weight * residual**2).sum() / weight.sum()))


def compare(group: str, published: dict[str, dict], materials: dict[str, Observations], starts: int) -> None:
    """Fit one set; print how many cold fits are at least as good as the published ones, and by what the others miss."""
    metric, names = metric_of(group), [name for name in published if name in materials]
    first = published[names[0]]
    fixed = {name: value for name, value in first.items() if isinstance(value, str) or name == "ext_ior"}
    del fixed["type"]
    if "int_ior" in first and any(it.name == "fresnel" for it in find_model(first["type"]).declared()):
        fixed["fresnel"] = "dielectric"
    ratios = []
    for k in range(0, len(names), BATCH):
        batch = [materials[name] for name in names[k : k + BATCH]]
        with patch("mi_brdfs.fit.starts.presets", return_value=[]):
            fits = fit(batch, first["type"], metric=metric, given=fixed, starts=starts)
        assert not any(it.starts.warm for it in fits)
        for name, material, it in zip(names[k:], batch, fits, strict=False):
            ratios.append(error(material, it.bsdf, metric) / error(material, published[name], metric))
    good = sum(ratio <= 1 for ratio in ratios)
    print(f"{group:28} {metric:5} {good} of {len(ratios)} ({good / len(ratios):.0%}), median ratio "
          f"{np.median(ratios):.3f}, worst {max(ratios):.3f}", flush=True)  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("paths", nargs="+", type=Path, metavar="FILE")
    parser.add_argument("--starts", default=4, type=int, metavar="N")
    arguments = parser.parse_args()
    mi.set_variant("llvm_ad_rgb")
    materials = {path.stem: observe(path) for path in arguments.paths}
    groups: dict[str, dict[str, dict]] = defaultdict(dict)
    for full in mi_brdfs.presets():
        group, _, name = full.rpartition("/")
        groups[group][name] = dict(mi_brdfs.preset(full))
    for group, published in groups.items():
        compare(group, published, materials, arguments.starts)


if __name__ == "__main__":
    main()
