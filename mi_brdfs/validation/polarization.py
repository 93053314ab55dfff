"""The check of Mueller matrices, in polarized variants."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import drjit as dr
import mitsuba as mi
import numpy as np

from ..mitsuba.errors import unwrapped_ctrl_c
from ..probe.arrays import Array, interaction, numbers, sample_arguments, vectors
from ..probe.bsdf import BSDFProbe, Part, Value, load
from ..probe.directions import beside
from ..probe.variates import random
from .incidents import all_over
from .outcome import Outcome, Skipped, skipping
from .run import Run, anywhere, failures, of_whole, tell
from .sampling import failing
from .spectral import AGAIN
from .values import reciprocity

COUNT = 2000
TOLERANCE = 1e-3
"""Of elements, in parts of the intensity: they come of differences in float32."""
STATES = 64
SEED = 105
"""Of samples."""
BACK = np.array([1, 1, -1, 1])
"""The signs of the Stokes parameters for light that goes back along its way."""


@of_whole
def polarization(run: Run, part: Part, outcome: Outcome) -> str:
    """Check Mueller matrices: light of any polarization becomes light that is at most fully polarized; if directions
    are exchanged, they are transposed, but for the signs of the third row and column, unless it is flagged NonSymmetric
    or the check reciprocity has failed; and if both turn about the normal, and the intensity does not change, nothing
    else does, in reference frames that turn, too, unless light goes straight through, as through a polarizer. And
    values of ``eval_pdf`` and ``eval_pdf_sample`` and weights of samples polarize light as ``eval`` does, and so does
    ``eval`` in the mode Importance, for exchanged directions. Of delta functions, the weights of samples are looked at,
    and not exchanged.

    The first elements of values, and of the weights of delta functions, are what the unpolarized variant has, if the
    BSDF works there, to float32's rounding; and by them, too, values are finite, weights are eval/pdf, as many samples
    carry light, and ``eval_pdf`` says what ``eval`` and ``pdf`` say. For this the BSDF must be given as a dict."""
    described = run.described("To load it in a polarized variant")
    name = "_".join([*mi.variant().split("_")[:2], "spectral", "polarized"])
    if name not in mi.variants():
        raise Skipped(f"It takes the variant {name}.")
    wi = part.around(COUNT, 101)
    wo = beside(wi, 102)
    # About the mirror direction, where most BSDFs that polarize have their light.
    near = wi * [-1, -1, 1] + 0.1 * beside(wi, 103)
    wo[::2] = (near / np.linalg.norm(near, axis=1, keepdims=True))[::2]
    judged, others = list[Judged](), list[tuple[str, Array, Array, Array]]()
    with mi.variant_context(name), skipping(f"It does not work in {name}: "):
        bsdf = load(described)
        if run.probe.parts:
            of_eval = _judged(bsdf, "eval's", _mueller, wi, wo)
            exchanged = _of_f(_mueller(bsdf, wo, wi), wi)
            others = _others(run, bsdf, wi, wo, of_eval.matrices, exchanged)
            if not (part.has(mi.BSDFFlags.NonSymmetric) or failing(run, part, reciprocity, anew=False)):
                of_eval.same["if its directions are exchanged"] = exchanged.swapaxes(-1, -2) * BACK * BACK[:, None]
            judged.append(of_eval)
        if run.probe.deltas:
            drawn = _directions(_sampled(bsdf, wi)[0], len(wi))
            judged.append(_judged(bsdf, "a delta function's", partial(_weight, run.probe), wi, drawn))
        there = anywhere(run, BSDFProbe(bsdf))
        failed, lit = failures(there, AGAIN), there.samples(part, all_over(part)).lit.mean()
        passages = ((side, other) for side in part.sides for other in part.sides)
        ways = (there.probe.pairs(part, COUNT, 106, passage) for passage in passages)
        pairs = [np.concatenate(each) for each in zip(*ways, strict=True)]
        bright = there.probe.values(*pairs)
    tell(run, outcome, failed, f"in {name}, ")
    if lit < 0.9 * (usual := run.samples(part, all_over(part)).lit.mean()):
        outcome.fault(f"in {name}, {lit:.1%} of the samples carry light, but {usual:.1%} in {mi.variant()}", np.inf)
    _check_intensity(run, outcome, name, bright, *pairs)
    for each in judged:
        _check_physical(outcome, each, wi)
    for name, towards, other, own in others:
        lit = other[:, 0, 0, 0] != 0
        difference = abs(_normalized(other) - _normalized(own)).max(axis=(-2, -1)) * lit[:, None]
        if lit.any() and np.quantile(difference[lit], 0.99) > TOLERANCE:
            name = f"the difference of the Mueller matrices of {name} and of eval"
            outcome.wrong(difference, name, difference, "in parts of their intensities", wi, towards, seed=SEED)
    return "Mueller matrices are physical."


class Judged(NamedTuple):
    """Mueller matrices without the cosine, shape (N, channels, 4, 4), for light from wo."""

    whose: str
    wo: Array
    matrices: Array
    same: dict[str, Array]
    """Those that must be the same, by why."""


def _judged(bsdf: Any, whose: str, mueller: Callable[..., Any], wi: Array, wo: Array) -> Judged:
    """Return matrices, with those of turned directions if they must be the same."""
    matrix = mueller(bsdf, wi, wo)
    if not isinstance(matrix, mi.Spectrum):
        raise Skipped("It returns colours, and Mitsuba keeps the polarization of the light: mi.depolarizer(value).")
    matrices, turned = _of_f(matrix, wo), _of_f(_turned(mueller, bsdf, wi, wo), wo)
    change = abs(turned - matrices)[..., 0, 0] / np.maximum(matrices[..., 0, 0], 1e-30)
    goes_through = int(bsdf.flags()) & int(mi.BSDFFlags.Null)
    same = (
        {}
        if goes_through or np.quantile(change, 0.99) >= TOLERANCE
        else {"if its directions are turned about the normal": turned}
    )
    return Judged(whose, wo, matrices, same)


def _check_physical(outcome: Outcome, judged: Judged, wi: Array) -> None:
    """Check that matrices polarize light at most fully, and are what they must be the same as."""
    matrices, intensity = judged.matrices, np.maximum(judged.matrices[..., 0, 0], 1e-30)
    states = np.random.default_rng(104).normal(size=(STATES, 3))
    states = np.concatenate([np.ones((STATES, 1)), states / np.linalg.norm(states, axis=1, keepdims=True)], axis=1)
    made = matrices @ states.T
    degree = ((np.linalg.norm(made[..., 1:, :], axis=-2) - made[..., 0, :]) / intensity[..., None]).max(axis=-1)
    degree = np.where((matrices[..., 0, 0] > 0) & ~(degree <= TOLERANCE), degree, 0)
    why = "some light would be polarized more than fully"
    outcome.wrong(degree, f"the excess of {judged.whose} Mueller matrix", degree, why, wi, judged.wo)
    for words, other in judged.same.items():
        difference = abs(other - matrices).max(axis=(-2, -1)) / np.maximum(intensity, other[..., 0, 0])
        # Those of grazing facets and of narrow lobes have few digits.
        wrong = difference * (np.quantile(difference, 0.99) > TOLERANCE)
        name = f"the change of {judged.whose} Mueller matrix {words}"
        outcome.wrong(wrong, name, difference, "in parts of the intensity", wi, judged.wo)


def _check_intensity(run: Run, outcome: Outcome, name: str, bright: list[Value], wi: Array, wo: Array) -> None:
    """Check that what is ``bright`` in the polarized variant is as bright in the unpolarized one, if the BSDF works
    there: but for one in a hundred, as near critical angles."""
    plain = name.removesuffix("_polarized")
    try:
        with unwrapped_ctrl_c(), mi.variant_context(plain):
            expected = BSDFProbe(load(run.given or {})).values(wi, wo)
    except Exception:  # of which the check spectral tells
        return
    tolerance = 10 * run.rounding(run.probe.whole)
    for it, own in zip(bright, expected, strict=False):
        words = f"in {name}, {it.name}"
        outcome.differing(tolerance, words, it.value, own.value, f"in {plain}", wi, it.wo, floor=1e-6, but_for=0.01)


def _others(
    run: Run, bsdf: Any, wi: Array, wo: Array, matrices: Array, exchanged: Array
) -> list[tuple[str, Array, Array, Array]]:
    """Return ``(name, wo, elements, those of eval)`` of other methods than ``eval``, of which ``matrices`` are those
    for ``wo``, and where weights are those of delta functions, none; and of ``eval`` in the mode Importance, in which
    light goes from wi to wo, with those of ``exchanged`` directions."""
    context, si, variates = mi.BSDFContext(), interaction(wi), sample_arguments(random(len(wi), SEED))
    pair = bsdf.eval_pdf(context, si, vectors(wo), True)
    triple = bsdf.eval_pdf_sample(context, si, vectors(wo), *variates, True)
    bs, weight = _sampled(bsdf, wi)
    weights = [dr.select(run.probe.is_smooth(each), it, 0) for each, it in ((bs, weight), triple[2:])]
    dr.eval(bs, pair, triple, weights)
    drawn = _directions(bs, len(wi))
    of_drawn = _of_f(_mueller(bsdf, wi, drawn), drawn)
    importance = _of_f(_mueller(bsdf, wi, wo, mi.BSDFContext(mi.TransportMode.Importance)), wo)
    return [
        ("eval in the mode Importance, for exchanged directions,", wo, importance, exchanged),
        ("eval_pdf", wo, _of_f(pair[0], wo), matrices),
        ("eval_pdf_sample", wo, _of_f(triple[0], wo), matrices),
        ("a sample's weight", drawn, _of_f(weights[0], drawn), of_drawn),
        ("the weight of eval_pdf_sample", drawn, _of_f(weights[1], drawn), of_drawn),
    ]


def _normalized(matrices: Array) -> Array:
    intensity = matrices[..., :1, :1]
    return matrices / np.where(intensity == 0, 1, intensity)


def _mueller(bsdf: Any, wi: Array, wo: Array, context: Any = None) -> Any:
    """Return the Mueller matrix of light from wo to wi, in the reference frames that Mitsuba gives these."""
    return bsdf.eval(context or mi.BSDFContext(), interaction(wi), vectors(wo), True)


def _weight(probe: BSDFProbe, bsdf: Any, wi: Array, wo: Array) -> Any:
    """Return that of the samples of delta functions, which go to wo."""
    bs, weight = _sampled(bsdf, wi)
    return dr.select(probe.is_smooth(bs), 0, weight)


def _sampled(bsdf: Any, wi: Array) -> tuple[Any, Any]:
    """Return samples with their weights."""
    return bsdf.sample(mi.BSDFContext(), interaction(wi), *sample_arguments(random(len(wi), SEED)), True)


def _directions(bs: Any, count: int) -> Array:
    """Return where samples go."""
    return numbers(dr.select(bs.pdf > 0, bs.wo, mi.Vector3f(0, 0, 1)), count).astype(np.float32)


def _turned(mueller: Callable[..., Any], bsdf: Any, wi: Array, wo: Array) -> Any:
    """Return the same of directions that are turned about the normal, in frames that are turned with them."""
    turn, basis = np.array([[0.6, -0.8, 0], [0.8, 0.6, 0], [0, 0, 1]], np.float32), mi.mueller.stokes_basis
    light, viewer = vectors(-wo @ turn.T), vectors(wi @ turn.T)
    frames = [vectors(numbers(basis(vectors(w)), len(w)).astype(np.float32) @ turn.T) for w in (-wo, wi)]
    matrix = mueller(bsdf, wi @ turn.T, wo @ turn.T)
    return mi.mueller.rotate_mueller_basis(matrix, light, basis(light), frames[0], viewer, basis(viewer), frames[1])


def _of_f(matrix: Any, wo: Array) -> Array:
    """Return elements, shape (N, channels, 4, 4), without the cosine."""
    dr.eval(matrix)
    rows = [[numbers(mi.UnpolarizedSpectrum(matrix[i, j]), len(wo)) for j in range(4)] for i in range(4)]
    return np.moveaxis(np.array(rows, np.float64), (0, 1), (-2, -1)) / abs(wo[:, 2, None, None, None])
