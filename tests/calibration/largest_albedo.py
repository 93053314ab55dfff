"""Compare the largest albedos that the manual pages state with a thorough search for them, and with ``--independent``
with another optimiser, too: differential evolution on integrals of the float64 reference.

    python tests/calibration/largest_albedo.py [--check] [--independent] [MODEL ...]

``--check`` exits with 1 if an albedo found exceeds the stated one, or falls 2 % short of it.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from scipy.optimize import differential_evolution

sys.path.insert(0, str(Path(__file__).parents[1]))
from albedos import axes, brightest, fault
from reference_albedos import REFERENCES, Reference

from mi_brdfs.mitsuba.registry import own_models

import mitsuba as mi  # after mi_brdfs, which chooses the LLVM that it loads  # isort: skip


def evolved(reference: Reference, sides) -> tuple[float, dict[str, float]]:
    """The largest albedo of a reference over some axes, and its numbers."""

    def numbers(point):
        return {axis.name: float(axis.at(t)) for axis, t in zip(sides, point, strict=True)}

    result = differential_evolution(
        lambda point: -reference.albedo(numbers(point), 12),
        [(0, 1)] * len(sides), maxiter=400, popsize=8, tol=1e-4, seed=1,
    )  # fmt: skip
    found = numbers(result.x)
    return reference.albedo(found, 20), found


def judged(stated: float, found: float, noise: float = 0.0) -> str:
    problem = fault(stated, found, noise)
    return f"stated {stated:.4g}" + (f", but {problem}" if problem else "")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("models", nargs="*", metavar="MODEL")
    parser.add_argument("--check", action="store_true")
    parser.add_argument("--independent", action="store_true")
    arguments = parser.parse_args()
    mi.set_variant("llvm_ad_rgb")
    verdicts = []
    for model in own_models():
        name = model.plugins[0]
        if arguments.models and name not in arguments.models:
            continue
        for given, stated in model.energy.largest:
            found = brightest(model, given, climbs=32, steps=64, rounds=20, log2_counts=(10, 12))
            verdicts.append(judged(stated, found.albedo, found.noise))
            print(f"{name} {given}: {verdicts[-1]}; found {found}", flush=True)
            for reference in REFERENCES if arguments.independent else []:
                if reference.model == name and reference.given == given:
                    albedo, numbers = evolved(reference, axes(model, given))
                    verdicts.append(judged(stated, albedo))
                    shown = " ".join(f"{name}={value:.4g}" for name, value in numbers.items())
                    print(f"    by differential evolution: {verdicts[-1]}; found {albedo:.5g} at {shown}", flush=True)
    sys.exit(arguments.check and any(", but" in verdict for verdict in verdicts))


if __name__ == "__main__":
    main()
