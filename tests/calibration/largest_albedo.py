"""Compare the largest albedos that some manual pages state with an independent search: differential evolution on
integrals of the float64 reference. ``mi-brdfs energy --check`` compares all of them with the search that found them.

    python tests/calibration/largest_albedo.py [--check] [MODEL ...]

``--check`` exits with 1 if an albedo found exceeds the stated one, or falls 2 % short of it.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from scipy.optimize import differential_evolution

sys.path.insert(0, str(Path(__file__).parents[1]))
from reference_albedos import REFERENCES, Reference

from mi_brdfs.mitsuba.registry import find_model
from mi_brdfs.probe.parameter_space import Dimension, axes
from mi_brdfs.probe.stated_energy import fault


def evolved(reference: Reference, sides: list[Dimension]) -> tuple[float, dict[str, float]]:
    """The largest albedo of a reference over some axes, and its numbers."""

    def numbers(point):
        return {axis.name: float(axis.at(t)) for axis, t in zip(sides, point, strict=True)}

    result = differential_evolution(
        lambda point: -reference.albedo(numbers(point), 12),
        [(0, 1)] * len(sides), maxiter=400, popsize=8, tol=1e-4, seed=1,
    )  # fmt: skip
    found = numbers(result.x)
    return reference.albedo(found, 20), found


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("models", nargs="*", metavar="MODEL")
    parser.add_argument("--check", action="store_true")
    arguments = parser.parse_args()
    problems = []
    for reference in REFERENCES:
        if arguments.models and reference.model not in arguments.models:
            continue
        model = find_model(reference.model)
        (stated,) = (albedo for given, albedo in model.energy.largest if given == reference.given)
        albedo, numbers = evolved(reference, axes(model, reference.given))
        problems.append(fault(stated, albedo))
        shown = " ".join(f"{name}={value:.4g}" for name, value in numbers.items())
        verdict = f", but {problems[-1]}" if problems[-1] else ""
        print(f"{reference}: stated {stated:.4g}{verdict}; found {albedo:.5g} at {shown}", flush=True)
    sys.exit(arguments.check and any(problems))


if __name__ == "__main__":
    main()
