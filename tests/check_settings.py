"""Check models at random settings, and Mitsuba's own plugins: what fails is a false alarm, or a fault to explain.

    python tests/check_settings.py 600 --seed 1        # settings of models, presets and measured files
    python tests/check_settings.py --built-ins

Draws parameters over their whole ranges, both ends included, words, colours, textures and rotations, in rgb and
spectral variants. Prints each failure with the dict that reproduces it, and exits with the number of failures. Those of
``albedo`` and of a few other checks do not count where colours add to more than one, so that a setting gains energy, or
where values are near the end of float32's range.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
import warnings
from pathlib import Path

import mi_brdfs  # isort: skip; it chooses the LLVM library
import drjit as dr
import mitsuba as mi
import numpy as np
from fuzzing import alternatives

from mi_brdfs.mitsuba.registry import all_models
from mi_brdfs.parameters import File, Preset
from mi_brdfs.parameters.colours import evaluate_colour
from mi_brdfs.probe.arrays import interaction, numbers
from mi_brdfs.probe.bsdf import BSDFProbe, load
from mi_brdfs.probe.directions import hemisphere
from mi_brdfs.probe.parameter_space import FARTHEST, Dimension
from mi_brdfs.probe.variates import lattice
from mi_brdfs.validation import check

BRIGHT = "albedo", "reciprocity", "gradients", "updates", "polarization"
"""What fails where a setting is too bright."""
VARIANTS = "llvm_ad_rgb", "llvm_ad_rgb", "llvm_ad_rgb", "llvm_ad_spectral", "llvm_ad_spectral_polarized"
BUMPS = str(Path(__file__).parents[1] / "scenes" / "textures" / "brushed_lathe.png")
BUILT_INS = [
    {"type": "diffuse"},
    {"type": "roughconductor"},
    {"type": "roughconductor", "distribution": "ggx", "alpha": 0.3},
    {"type": "roughconductor", "distribution": "ggx", "alpha_u": 0.05, "alpha_v": 0.3, "material": "Au"},
    {"type": "roughplastic"},
    {"type": "roughplastic", "distribution": "ggx", "nonlinear": True},
    {"type": "roughdielectric", "distribution": "ggx", "alpha": 0.2},
    {"type": "plastic"},
    {"type": "principled"},
    {"type": "principled", "roughness": 0.3, "clearcoat": 0.5, "sheen": 0.5, "spec_tint": 0.5},
    {"type": "principledthin"},
    {"type": "pplastic"},
    {"type": "blendbsdf", "weight": 0.3, "a": {"type": "diffuse"}, "b": {"type": "roughconductor"}},
    {"type": "mask", "opacity": 0.5, "a": {"type": "diffuse"}},
    {"type": "twosided", "a": {"type": "roughconductor", "distribution": "ggx"}},
    {"type": "bumpmap", "arbitrary": {"type": "bitmap", "filename": BUMPS, "raw": True}, "a": {"type": "diffuse"}},
    {"type": "normalmap", "normalmap": {"type": "rgb", "value": (0.5, 0.5, 1)}, "a": {"type": "diffuse"}},
    {"type": "hair"},
]


def colour(rng, low, high):
    return {"type": "rgb", "value": tuple(rng.uniform(low, min(high, 4), 3).tolist())}


def quantity(rng, given):
    """A value of a number or a colour: an end of its range, or between them, in steps of equal ratio."""
    low, high = (float(np.clip(limit, -FARTHEST, FARTHEST)) for limit in given.limits)
    kind = rng.random()
    if given.colour and kind < 0.4:
        return colour(rng, low, high)
    value = float(Dimension(given.name, low, high).at(rng.random()))
    if kind < 0.55:
        value = rng.choice([low, high]) if np.isfinite(given.limits).all() else low
    elif kind < 0.7 and given.name != "rotation":
        other = float(Dimension(given.name, low, high).at(rng.random()))
        if kind < 0.65:
            return (
                {"type": "checkerboard", "color0": value, "color1": other}
                if not given.colour
                else colour(rng, low, high)
            )
        texels = rng.uniform(*sorted((value, other)), (4, 4, 3 if given.colour else 1))
        return {"type": "bitmap", "bitmap": mi.Bitmap(texels.astype(np.float32)), "raw": not given.colour}
    return float(value)


def setting(rng, models, presets, files):
    """A random dict."""
    kind = rng.random()
    if kind < 0.08:
        return mi_brdfs.preset(presets[rng.integers(len(presets))])
    if kind < 0.13 and files:
        return {"type": "tabulated", "filename": str(files[rng.integers(len(files))])}
    model = models[rng.integers(len(models))]
    given = {"type": model.plugins[0]}
    for parameter in model.declared():
        if isinstance(parameter, (File, Preset)):
            continue
        ways = alternatives(parameter)
        way = ways[rng.integers(len(ways))]
        given |= way.words
        for each in way.quantities:
            if rng.random() < 0.7:
                given[each.name] = quantity(rng, each)
    return given


def is_bright(bsdf):
    """Whether the scales of a model's lobes, of which pages say that they add, are more than 1 in sum, or values of it
    near the end of float32's range, where Lafortune's lobes are limited."""
    uv = np.random.default_rng(2).random((500, 2))
    probe, found = BSDFProbe(bsdf), 0
    for model in filter(None, probe.models):
        scales = [*model.named("diffuse", "specular"), *({"a"} & set(model.textures))]
        at = interaction([0, 0, 1], uv)
        found += sum(numbers(evaluate_colour(model.textures, name, at, True)).max() for name in scales)
    samples = probe.sample(probe.whole, hemisphere(4000, 1), lattice(12, 1)[:4000])
    return found > 1 or samples.value.max() > 1e9


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("count", nargs="?", type=int, default=600)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", action="append", help="one of the checks, instead of all")
    parser.add_argument("--built-ins", action="store_true")
    arguments = parser.parse_args()
    warnings.simplefilter("ignore")
    mi.set_variant("llvm_ad_rgb")
    rng = np.random.default_rng(arguments.seed)
    models = [model for model in all_models() if not any(isinstance(it, File) for it in model.declared())]
    presets = sorted(mi_brdfs.presets())
    data = Path(os.environ.get("MI_BRDFS_DATA", "../shared/data"))
    files = [
        f for f in sorted(data.rglob("*")) if f.suffix in (".bsdf", ".brdf", ".mbsdf", ".binary", ".astm", ".alta")
    ]
    failed = done = 0
    for k in range(len(BUILT_INS) if arguments.built_ins else arguments.count):
        start = time.perf_counter()
        mi.set_variant(VARIANTS[k % len(VARIANTS)])
        given = BUILT_INS[k] if arguments.built_ins else setting(rng, models, presets, files)
        try:
            load(given)
        except RuntimeError:  # words that do not go together
            continue
        report = check(given, only=arguments.only)
        done += 1
        bright = bool(report.failures) and is_bright(load(given))
        faults = [it for it in report.failures if not bright or it.check not in BRIGHT]
        failed += bool(faults)
        if report.failures or arguments.built_ins:
            outcome = report.outcome if faults or not report.failures else "bright"
            words = " ".join(str(given).split())  # bitmaps take many lines
            print(f"{k} {mi.variant()} {words} {time.perf_counter() - start:.0f} s: {outcome}", flush=True)
            for finding in report.failures:
                print(f"    {finding.check}, {finding.subject}: {finding.sentence}", flush=True)
        if k % 20 == 19:
            dr.flush_malloc_cache()
            print(f"# {done} checked, {failed} failed", flush=True)
    print(f"{done} checked, {failed} failed")
    return min(failed, 100)


if __name__ == "__main__":
    sys.exit(main())
