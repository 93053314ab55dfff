"""What the calibrations share: constants of the code, what they minimise, and where the minimum is.

A script lists its fits and calls :func:`main`, which prints the best constants that it finds beside those in the code.
With ``--check`` it exits with 1 unless those in the code are as good as the best, within each fit's tolerance: minima
are flat, so constants are round numbers near them, and what a fit declares is a fair share of all uses, not all.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import minimize

from mi_brdfs.lobes import LambertLobe, Lobe, Mixture
from mi_brdfs.probe.arrays import sample_arguments, vectors
from mi_brdfs.probe.directions import direction
from mi_brdfs.probe.variates import lattice, sampling_efficiency

import drjit as dr  # after mi_brdfs, which chooses the LLVM that they load  # isort: skip
import mitsuba as mi  # isort: skip

FINE, COARSE = 2e-3, 0.03
"""How precisely constants are found; a check asks for the least loss alone, which is flat there."""
LOG2_POINTS = 7
"""Of the points of a direction, in each of their shifted copies."""


class Fit(NamedTuple):
    """Some constants, ``code`` as they stand, and a ``loss`` that is called with others in their place."""

    name: str
    code: Sequence[float]
    loss: Callable[..., float]
    tolerance: float = 0.05
    """By which fraction the loss of the code's constants may exceed the least. Of a relative variance of 0.04, which is
    typical, the twentieth is a difference in efficiency of 0.002."""
    search: Callable[[], Sequence[float]] | None = None
    """What finds the constants of least loss, if Nelder and Mead's simplex does not do."""


def attributes(owner: Any, names: str | Sequence[str], loss: Callable[[], float], **options: Any) -> Fit:
    """Fit attributes of a class or a module, numbers or tuples of them, which ``loss`` uses through the code."""
    names = names.split()
    shapes = [np.shape(getattr(owner, name)) for name in names]
    code = [float(x) for name in names for x in np.ravel(getattr(owner, name))]

    def with_values(*values: float) -> float:
        left, new = iter(values), {}
        for name, shape in zip(names, shapes, strict=True):
            new[name] = tuple(number(next(left)) for _ in range(shape[0])) if shape else number(next(left))
        with replaced(owner, new):
            return loss()

    label = ", ".join(f"{owner.__name__.rpartition('.')[2]}.{name}" for name in names)
    return Fit(label, code, with_values, **options)


@contextmanager
def replaced(owner: Any, values: dict[str, Any]) -> Iterator[None]:
    """Give attributes that ``owner`` itself has other values for a while."""
    old = {name: vars(owner)[name] for name in values}
    try:
        for name, value in values.items():
            setattr(owner, name, value)
        yield
    finally:
        for name, value in old.items():
            setattr(owner, name, value)


def number(value: float) -> Any:
    """A number that kernels do not hold as a literal: another one needs no other kernel."""
    return dr.opaque(mi.Float, float(value))


def best(fit: Fit, precision: float) -> tuple[np.ndarray, float]:
    """The constants of least loss, as parts of the largest to some precision, and the loss."""
    if fit.search:
        constants = np.array(fit.search())
        return constants, float(fit.loss(*constants))
    code = np.array(fit.code, float)
    simplex = np.stack([code, *(code + np.diag(np.where(code, 0.15 * code, 0.15)))])
    # Both tolerances must be met, so an infinite one leaves the decision to the constants'.
    options = {"initial_simplex": simplex, "xatol": precision * abs(code).max(), "fatol": np.inf}
    options["maxfev"] = 40 * (len(code) + 1)
    result = minimize(lambda values: fit.loss(*values), code, method="Nelder-Mead", options=options)
    return result.x, float(result.fun)


def parser(doc: str) -> argparse.ArgumentParser:
    result = argparse.ArgumentParser(description=doc, formatter_class=argparse.RawDescriptionHelpFormatter)
    result.add_argument("--check", action="store_true", help="exit with 1 unless the code's choice is as good")
    return result


def main(doc: str, fits: Callable[[], Iterable[Fit]]) -> None:
    options = parser(doc)
    options.add_argument("names", nargs="*", metavar="NAME", help="only fits whose names contain one of these")
    arguments = options.parse_args()
    mi.set_variant("llvm_ad_rgb")
    missed = False
    for fit in fits():
        if arguments.names and not any(name in fit.name for name in arguments.names):
            continue
        start = time.perf_counter()
        now = float(fit.loss(*fit.code))
        constants, least = best(fit, COARSE if arguments.check else FINE)
        excess = now / least - 1
        good = excess <= fit.tolerance
        missed |= not good
        print(
            f"{fit.name}\n    in the code {shown(fit.code)}: {now:.4g}, best {shown(constants)}: {least:.4g}; "
            f"{excess:.1%} above it, {'within' if good else 'NOT within'} {fit.tolerance:.0%} "
            f"({time.perf_counter() - start:.0f} s)",
            flush=True,
        )
    sys.exit(arguments.check and missed)


def shown(values: Iterable[float]) -> str:
    return " ".join(f"{value:.4g}" for value in values)


# --- Lobes ----------------------------------------------------------------------------------------------------------


def directions(angles: Sequence[float], azimuths: Sequence[float] = (0,)) -> np.ndarray:
    """Directions at angles in degrees."""
    return np.array([direction(theta, phi) for theta in angles for phi in azimuths])


def brightness(value: Any) -> Any:
    return mi.luminance(mi.Color3f(value))


class OverDiffuse:
    """A lobe over a diffuse one, sampled as a mixture."""

    def __init__(self, lobe: Lobe, reflectance: float = 0.3):
        self.lobes = LambertLobe(number(reflectance)), lobe

    def sample(self, wi, u, v):
        return Mixture(self.lobes, wi).sample(u, v)[0]

    def eval_pdf(self, wi, wo):
        return Mixture(self.lobes, wi).eval_pdf(wo, transmitted=False)


def weights(lobes: Sequence[Lobe], wi: np.ndarray) -> np.ndarray:
    """The weights of samples at some directions for the same variates, shape (lobes, directions, samples)."""
    points = lattice(LOG2_POINTS, 1)
    incident = vectors(np.repeat(wi, len(points), axis=0))
    u, v = sample_arguments(np.tile(points, (len(wi), 1)))

    def of(lobe):
        wo = lobe.sample(incident, u, v)
        valid = wo.z > 0
        value, pdf = lobe.eval_pdf(incident, dr.select(valid, wo, mi.Vector3f(0, 0, 1)))
        valid &= pdf > 0
        weight = dr.select(valid, brightness(value) / dr.select(valid, pdf, 1), 0)
        return np.array(weight, np.float64).reshape(len(wi), -1)

    # One by one: lobes that differ in numbers alone have one kernel.
    return np.array([of(lobe) for lobe in lobes])


def relative_variance(lobes: Sequence[Lobe], wi: np.ndarray) -> np.ndarray:
    """1/η - 1 of one sample under uniform light, shape (lobes, directions)."""
    return 1 / sampling_efficiency(weights(lobes, wi)) - 1


def variance_loss(lobes: Sequence[Lobe], angles: Sequence[float]) -> Callable[[], float]:
    """The mean of 1/η - 1 over lobes and directions."""
    wi = directions(angles)
    return lambda: float(np.mean(relative_variance(lobes, wi)))


def estimate_loss(lobes: Sequence[Lobe], angles: Sequence[float]) -> Callable[[], float]:
    """The mean square log ratio of the estimated albedo to the measured one, over lobes and angles."""
    wi = directions(angles)
    measured = weights(lobes, wi).mean(axis=-1)
    incident = vectors(wi)

    def loss():
        of_all = [brightness(lobe.estimated_albedo(incident)) + dr.zeros(mi.Float, len(wi)) for lobe in lobes]
        estimated = np.array([np.array(estimate, np.float64) for estimate in of_all])
        return float(np.mean(np.log(np.maximum(estimated, 1e-12) / measured) ** 2))

    return loss
