"""Checks of what else Mitsuba's integrators rely on: inactive lanes, light tracing, the reflectance for denoisers."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import replace
from itertools import pairwise
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from ..mitsuba.errors import unwrapped_ctrl_c
from ..probe.arrays import Array, all_numbers, context, interaction, numbers, sample_arguments, vectors
from ..probe.bsdf import BSDFProbe, Part
from ..probe.directions import beside, hemisphere, on_side, scattered
from ..probe.variates import random
from . import sampling
from .deltas import deltas
from .outcome import KNOWN, Outcome, Skipped, skipping, told
from .run import Run, of_each, of_whole
from .traced import gradient, traced_floats
from .values import compare_joint, eval_pdf

COUNT = 2000
EVALUATED = "eval", "pdf", "eval_pdf"
AFTER_EACH_OTHER = "eval", "eval", "pdf", "eval", "sample", "pdf", "pdf", "sample", "sample", "eval"
"""Methods in an order in which each follows each."""
UNKNOWN = "no_such_attribute"


@of_whole
def active(run: Run, part: Part, outcome: Outcome) -> str:
    """Check that lanes that are not active get no light: what ``eval``, ``eval_pdf`` and ``eval_pdf_sample`` return and
    the weights of samples are zero there, for masks as for ``False``, and so are the densities and
    ``eval_diffuse_reflectance`` of plugins of ours (Mitsuba's own rely on it that calls of a scene mask them); others
    get what they get when all are active. And no derivative comes from them, whatever directions they have."""
    probe, wi, u = run.probe, scattered(COUNT, 61, part.sides), random(COUNT, 62)
    wo = np.where(np.arange(COUNT)[:, None] % 3, probe.sample(part, wi, u).wo, beside(wi, 63))
    half = np.random.default_rng(64).random(COUNT) < 0.5
    every = _results(probe, wi, wo, u, True)
    for mask, lit, words in (
        (mi.Bool(half), half, "where half of the lanes are not active"),
        (mi.Bool(False), np.zeros(COUNT, bool), "where no lane is active"),
        (False, np.zeros(COUNT, bool), "where active is False"),
    ):
        for name, value in _results(probe, wi, wo, u, mask).items():
            stray = (value != 0) & ~lit[:, None]
            if probe.is_ours or not (name == "pdf" or "density" in name or "reflectance" in name):
                outcome.wrong(stray, name, value, f"{words}, but must be 0", wi, wo, seed=62)
            why = "when all are"
            outcome.differing(1e-5, f"{words}, {name}", value, every[name], why, wi, wo, where=lit, seed=62)
    _check_derivatives(run, outcome, wi, wo, half)
    return "Inactive lanes get no light, no weight and no derivative."


def _results(probe: BSDFProbe, wi: Array, wo: Array, u: Array, mask: bool | mi.Bool) -> dict[str, Array]:
    """Return what all methods return where a mask is active, by name, without the weights of type Null, which Mitsuba's
    own plugins do not mask."""

    def stops(bs: mi.BSDFSample3f) -> mi.Bool:
        return (bs.sampled_type & int(mi.BSDFFlags.Null)) == 0

    def given() -> bool | mi.Bool:
        return mask if isinstance(mask, bool) else mi.Bool(mask)  # plugins in Python may change theirs in place

    bsdf, ctx, si, towards = probe.bsdf, mi.BSDFContext(), interaction(wi), vectors(wo)
    value, density = bsdf.eval_pdf(ctx, si, towards, given())
    bs, weight = bsdf.sample(ctx, si, *sample_arguments(u), given())
    also = bsdf.eval_pdf_sample(ctx, si, towards, *sample_arguments(u), given())
    found = {
        "eval": bsdf.eval(ctx, si, towards, given()),
        "pdf": bsdf.pdf(ctx, si, towards, given()),
        "eval_pdf's value": value,
        "eval_pdf's density": density,
        "the weight of sample": dr.select(stops(bs), weight, 0),
        "the density of sample": bs.pdf,
        "eval_pdf_sample's value": also[0],
        "eval_pdf_sample's density": also[1],
        "the weight of eval_pdf_sample": dr.select(stops(also[2]), also[3], 0),
        "the density of eval_pdf_sample": also[2].pdf,
    }
    reflectance = {"eval_diffuse_reflectance": probe.diffuse_reflectance(wi, active=given())}
    return dict(zip(found, all_numbers(found.values(), len(wo)), strict=True)) | reflectance


def _check_derivatives(run: Run, outcome: Outcome, wi: Array, wo: Array, lit: Array) -> None:
    """Check that reverse derivatives of all parameters are those of the values of active lanes alone. Some inactive
    lanes have directions of length 0, as those of rays that hit nothing."""
    parameters, _ = traced_floats(run, "active", differentiable=True)
    kept = (lit | (np.arange(len(lit)) % 4 > 0))[:, None]

    def gradients(wi: Array, wo: Array, mask: bool | mi.Bool, counted: bool | Array) -> tuple[list[Array], float]:
        """Return the derivatives of the sum of the values in the lanes that are counted, and the sum."""
        attached = [each.attach() for each in parameters]
        value = run.probe.bsdf.eval(run.probe.whole.context, interaction(wi), vectors(wo), mask)
        value = dr.select(mi.Bool(counted), value, 0)
        if dr.grad_enabled(value):
            dr.backward(value)
        return [gradient(each) for each in attached], float(np.sum(np.array(dr.detach(value), np.float64)))

    with ExitStack() as stack:
        for each in parameters:
            stack.enter_context(each.restored())
        # Both have the same lanes in the same order: large terms of a sum that is 0 cancel alike.
        found, _ = gradients(wi * kept, wo * kept, mi.Bool(lit), True)
        expected, total = gradients(wi, wo, True, lit)
    for each, masked, alone in zip(parameters, found, expected, strict=True):
        if not np.isfinite(masked).all() and np.isfinite(alone).all():
            outcome.fault(f"the derivative for {each.key} is not finite with inactive lanes", np.inf)
        elif abs(masked - alone).max(initial=0) > 1e-3 * abs(alone).max(initial=0) + 1e-6 * total:
            words = f"is {masked.sum():.4g} with inactive lanes, but {alone.sum():.4g} without"
            outcome.fault(f"the derivative for {each.key} {words}", abs(masked - alone).max())


@of_each(lambda probe: [*probe.parts, *probe.deltas])
def mode(run: Run, part: Part, outcome: Outcome) -> str:
    """Check the mode ``TransportMode.Importance``, in which light is traced from the emitters: light reflected, or
    transmitted where both sides are seen, is what it is the other way, f with its directions exchanged, times the
    cosine of ``wo``: Mitsuba's ``eval`` and ``sample`` are those of the adjoint then, without which ``ptracer`` and
    ``path`` give different pictures. That is the same unless the component is flagged NonSymmetric; the flag alone does
    not do. And in this mode, too, the weight of ``sample`` is ``eval``/``pdf``, ``eval_pdf`` and ``eval_pdf_sample``
    say what the others do, and if the two modes are the same, samples carry as much light to the same directions. Delta
    functions draw the same, and weigh it without the factor 1/η² of refracted radiance."""
    traced = part._replace(context=context(part.component))
    traced.context.mode = mi.TransportMode.Importance
    if part not in run.probe.deltas:
        _check_traced(run, outcome, part, traced)
    elif not sampling.failing(run, part, deltas):  # what is wrong with it in any mode is said once
        _check_traced_samples(run, outcome, part, traced)
    return "Light may be traced from either end."


def _check_traced(run: Run, outcome: Outcome, part: Part, traced: Part) -> None:
    """Check values and weights in the mode Importance, of the part that is ``traced``."""
    if not part.passages:
        raise Skipped("Not checked, as it transmits from one side only.")
    tolerance, symmetric = 10 * run.rounding(part), not part.has(mi.BSDFFlags.NonSymmetric)
    said = sampling.failing(run, part, eval_pdf, sampling.weight)  # what is wrong in any mode, once
    for sides in part.passages:
        wi, wo = run.probe.pairs(traced, COUNT, 65, sides)
        got = run.probe.eval(traced, wi, wo)
        if symmetric:
            expected, why = run.probe.eval(part, wi, wo), "is needed, as it is not flagged NonSymmetric"
        else:
            expected = run.probe.eval(part, wo, wi) * abs(wo[:, 2:].astype(np.float64) / wi[:, 2:])
            why = "is needed, as that is its adjoint, f from wo to wi"
        name = "in the mode Importance eval"
        # What grazing facets transmit is faint and has few digits.
        outcome.differing(tolerance, name, got, expected, why, wi, wo, floor=1e-3, unknown=0, but_for=1e-3)
        samples = run.probe.sample(traced, wi, u := random(COUNT, 67))
        if "eval_pdf" not in said:
            compare_joint(
                run.probe, traced, outcome, tolerance, wi, wo, u, samples,
                when="in the mode Importance ", floor=1e-3, unknown=0, but_for=1e-3, seed=67,
            )  # fmt: skip
        if "weight" not in said:
            name, reflected = "in the mode Importance a weight times pdf", samples.weight * samples.pdf[:, None]
            pair, lit = (reflected, samples.value), samples.lit
            outcome.differing(
                tolerance, name, *pair, "is eval", wi, samples.wo, unknown=0, where=lit, but_for=0.01, seed=67
            )
        # Delta functions, which need not be symmetric, are looked at by themselves.
        own, usual = (
            it._replace(weight=it.weight * it.smooth[:, None]) for it in (samples, run.probe.sample(part, wi, u))
        )
        if symmetric and (error := sampling.strays(own, usual, wi)):
            told = "samples carry other light, or to other directions, than in the other"
            outcome.fault(f"in the mode Importance {told}", error, seed=67)


def _check_traced_samples(run: Run, outcome: Outcome, part: Part, traced: Part) -> None:
    """Check that a delta function draws the same in the mode Importance, and how it weighs it."""
    wi, u = scattered(COUNT, 66, part.sides), random(COUNT, 67)
    got, usual = (run.probe.sample(each, wi, u) for each in (traced, part))
    name, why = "in the mode Importance a sample's weight", "is needed: that of radiance times η²"
    pair = got.weight, usual.weight * usual.eta[:, None] ** 2
    outcome.differing(KNOWN, name, *pair, why, wi, got.wo, floor=1e-3, seed=67)
    outcome.astray("in the mode Importance", got.wo, usual.wo, "in the other", wi, 67)


def _methods(bsdf: mi.BSDF | mi.BSDFPtr, ctx: mi.BSDFContext) -> dict[str, Callable[..., Any]]:
    """Return the methods as functions of a surface point, a direction and variates."""
    return {
        "eval": lambda si, wo, u, v: bsdf.eval(ctx, si, wo, True),
        "pdf": lambda si, wo, u, v: bsdf.pdf(ctx, si, wo, True),
        "eval_pdf": lambda si, wo, u, v: bsdf.eval_pdf(ctx, si, wo, True),
        "sample": lambda si, wo, u, v: bsdf.sample(ctx, si, u, v, True),
    }


@of_whole
def recorded(run: Run, part: Part, outcome: Outcome) -> str:
    """Check that renderers can record it in their loops: ``eval``, ``pdf``, ``eval_pdf`` and ``sample`` ask for no
    values of arrays. There are none in a loop that is recorded, where it is an error to read an array, to branch by one
    in Python, or to take a mean over the lanes. And as renderers call them, by a pointer and for one lane, they return
    the same, to float32's rounding, for 99 in a hundred."""
    wi, wo, variates = scattered(COUNT, 68, part.sides), scattered(COUNT, 69, part.sides), random(COUNT, 70)
    rendered, returned = _methods(mi.BSDFPtr(run.probe.bsdf), part.context), list[tuple[str, Any, Any]]()
    for name, call in _methods(run.probe.bsdf, part.context).items():
        si, *others = interaction(wi), vectors(wo), *sample_arguments(variates)
        dr.eval(call(si, *others))  # what it prepares once
        si.wi, *others = (each * mi.Float(0.9999999) for each in (si.wi, *others))  # not computed yet
        with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
            dr.kernel_history_clear()
            usual = call(si, *others)
            if dr.kernel_history([dr.KernelType.JIT, dr.KernelType.BlockReduce]):
                outcome.fault(f"{name} asks for the values of an array, so that no renderer can record it in a loop")
                continue
        pairs = zip(_flat(rendered[name](si, *others)), _flat(usual), strict=True)
        returned += [(name, got, expected) for got, expected in pairs]
    found = iter(all_numbers((each for _, *pair in returned for each in pair), COUNT))
    for (name, *_), got, expected in zip(returned, found, found, strict=True):
        tolerance, words = 10 * run.rounding(part), f"recorded, as renderers call it, what {name} returns"
        outcome.differing(tolerance, words, got, expected, "else", wi, wo, floor=1e-3, but_for=0.01, seed=70)
    return "It asks for no values of arrays, and returns the same if it is recorded."


def _flat(returned: Any) -> list[Any]:
    """Return the arrays that a method returns: of a sample, the direction and the density, where it has one, and the
    weight."""
    if not isinstance(returned, tuple):
        return [returned]
    if isinstance(returned[0], mi.BSDFSample3f):
        bs, weight = returned
        return [dr.select(bs.pdf > 0, each, 0) for each in (bs.wo, bs.pdf, weight)]
    return list(returned)


@of_whole
def calls(run: Run, part: Part, outcome: Outcome) -> str:
    """Check that calls depend on what they are given alone: ``eval``, ``pdf`` and ``sample`` return the same for the
    same arguments whatever was called before, in whatever lane, to float32's rounding, for 99 in a hundred. Where the
    surface is turned in the world, values and densities are the same, too, also of ``eval_pdf``, as directions are
    local. And they leave the surface point, directions and context as they are; where Python defines ``to_string``,
    ``str`` of the BSDF does not raise; and ``has_attribute`` does not say yes to any name."""
    probe = run.probe
    elsewhere = replace(probe, turned=True)
    wi, wo, u = scattered(COUNT, 76, part.sides), scattered(COUNT, 77, part.sides), random(COUNT, 78)
    uv = random(COUNT, 79)[:, :2]
    wo[::2] = probe.sample(part, wi, u, uv).wo[::2]

    def called(method: str, probe: BSDFProbe = probe, order: slice = slice(None)) -> tuple[dict[str, Array], Array]:
        """Return what a method returns, by name, and the directions that it goes to, in the usual order."""
        i, o, variates, at = (it[order] for it in (wi, wo, u, uv))
        if method == "sample":
            it = probe.sample(part, i, variates, at)
            wanted = {"a sample's weight": it.weight, "a sample's density": it.density[:, None]}
            lit = (it.weight != 0).any(axis=1, keepdims=True)[order]
            return {name: value[order] * lit for name, value in wanted.items()}, it.wo[order] * lit
        if method == "eval_pdf":
            value, density = probe.eval_pdf(part, i, o, at)
            return {"eval_pdf's value": value[order], "eval_pdf's density": density[order, None]}, wo
        return {method: getattr(probe, method)(part, i, o, at).reshape(COUNT, -1)[order]}, wo

    first = {method: called(method) for method in ("sample", *EVALUATED)}

    def compare(when: str, method: str, got: dict[str, Array], towards: Array) -> None:
        usual, usually_towards = first[method]
        for name, value in got.items():
            pair, tolerance = (value, usual[name]), 10 * run.rounding(part)
            outcome.differing(tolerance, f"{when} {name}", *pair, "else", wi, towards, but_for=0.01, seed=78)
        outcome.astray(when, towards, usually_towards, "by the same variates else", wi, 78)

    for k, (before, method) in enumerate(pairwise(AFTER_EACH_OTHER)):
        order = slice(None, None, 1 if k % 2 else -1)
        before = "sample and eval" if before == "sample" else before  # as the probe calls them
        compare(f"after a call of {before} for other directions and points", method, *called(method, order=order))
    for method in EVALUATED:
        compare("where the surface is turned in the world", method, *called(method, elsewhere))
    # Which direction belongs to which variates may depend on the tangent, as in bumpmap: judge the samples that stay.
    (got, towards), (usual, usually_towards) = called("sample", elsewhere), first["sample"]
    stay = np.linalg.norm(towards - usually_towards, axis=1, keepdims=True) < 1e-3
    got = {name: np.where(stay, value, usual[name]) for name, value in got.items()}
    compare("where the surface is turned in the world", "sample", got, usually_towards)
    _check_arguments(run, outcome, wi, wo, u)
    try:
        with unwrapped_ctrl_c():
            if hasattr(probe.bsdf, "to_string"):  # a plugin in Python need not have one
                str(probe.bsdf)
    except Exception as error:
        outcome.fault(f"str of it raises {told(error)}", np.inf)
    if np.any(probe.bsdf.has_attribute(UNKNOWN, True)):
        outcome.fault(f'has_attribute says that it has "{UNKNOWN}", as it may of any name', np.inf)
    return "Calls depend on what they are given alone, and change nothing."


def _check_arguments(run: Run, outcome: Outcome, wi: Array, wo: Array, u: Array) -> None:
    """Check that methods leave their arguments as they are, also directions on the other side."""
    wi = wi * np.where(np.arange(COUNT)[:, None] % 5, 1, np.array([1, 1, -1])).astype(np.float32)
    wo = wo * np.where(np.arange(COUNT)[:, None] % 3, 1, np.array([1, 1, -1])).astype(np.float32)
    ctx, si, towards, variates = context(), interaction(wi), vectors(wo), sample_arguments(u)

    def given() -> dict[str, Array]:
        fields = {f"si.{name}": getattr(si, name) for name in ("wi", "uv", "n", "p")}
        fields |= {"si.sh_frame.n": si.sh_frame.n, "wo": towards, "sample1": variates[0], "sample2": variates[1]}
        numbered = {name: numbers(value, COUNT) for name, value in fields.items()}
        return numbered | {"the context": np.array([[ctx.mode.value, ctx.type_mask, ctx.component]])}

    for method, call in _methods(run.probe.bsdf, ctx).items():
        before = given()
        call(si, towards, *variates)
        for name, after in given().items():
            lanes = (after != before[name]).any(axis=1)
            if lanes.any():
                k = int(np.argmax(lanes))
                was, now = (", ".join(f"{x:.4g}" for x in each[name][k]) for each in (before, {name: after}))
                words = f"{method} changes {name} of its caller, from ({was}) to ({now})"
                outcome.fault(words, np.inf, wi=wi[k], wo=wo[k])


@of_whole
def null(run: Run, part: Part, outcome: Outcome) -> str:
    """Check that samples of type Null go straight on, and that ``eval_null_transmission``, by which shadow rays go
    through, is their weight, and 0 if no flag is Null."""
    probe, u = run.probe, random(1 << 14, 75)
    if not int(probe.bsdf.flags()) & int(mi.BSDFFlags.Null):
        with skipping("Nothing goes straight through: eval_null_transmission raises "):
            got = numbers(probe.bsdf.eval_null_transmission(interaction(hemisphere(1, 76)), True), 1).max()
        if got == 0:
            raise Skipped("Nothing goes straight through.")
        outcome.fault(f"eval_null_transmission is {got:.4g}, but no component is flagged Null", got)
        return ""
    for incident in run.incidents(part):
        wi = np.tile(incident.wi, (len(u), 1))
        si = interaction(wi)
        bs, weight = probe.bsdf.sample(mi.BSDFContext(), si, *sample_arguments(u), True)
        through = (bs.sampled_type & int(mi.BSDFFlags.Null)) != 0
        wo, each = (numbers(dr.select(through, it, 0), len(u)) for it in (bs.wo, weight))
        outcome.astray("of type Null", wo, -wi, "is straight on", wi, 75, but_for=0)
        got = numbers(probe.bsdf.eval_null_transmission(si, True), len(u))[0]
        # Six standard errors: a false alarm once in 1e8.
        error = abs(got - each.mean(axis=0)) - 6 * each.std(axis=0) / np.sqrt(len(u)) - 1e-4
        if (error > 0).any():
            k = int(np.argmax(error))
            words = f"eval_null_transmission is {got[k]:.4g} for light from {incident.name}"
            other = f"but samples that go straight through weigh {each[:, k].mean():.4g} in the mean"
            outcome.fault(f"{words}, {other}", float(error[k]), wi=incident.wi, seed=75)
    return "As much as its samples."


LAMBERTIAN = 1e-3
"""How far f may change for a reflectance to be known exactly."""


@of_each(lambda probe: probe.parts[:1])
def reflectance(run: Run, part: Part, outcome: Outcome) -> str:
    """Check that ``eval_diffuse_reflectance``, which denoisers and renderers of albedos ask for, is finite and in [0,
    1]. Where f is constant it is π f, and of other diffuse plugins of ours, the albedo at normal incidence within 5 %.
    What is Mitsuba's stand-in, π times ``eval`` towards the normal, is not judged otherwise: it has no bound."""
    probe, normal = run.probe, np.array([0, 0, part.sides[0]], np.float32)
    with skipping("It is not implemented, or raises "):
        found = [
            numbers(probe.bsdf.eval_diffuse_reflectance(interaction(wi), True), 1)[0]
            for wi in (normal, on_side(hemisphere(1, 71)[0], part.sides[0]))
        ]
    got = found[0]
    wi, wo = (on_side(hemisphere(200, seed), part.sides[0]) for seed in (72, 73))
    f = probe.eval(part, wi, wo) / abs(wo[:, 2:].astype(np.float64))
    stand_in = np.pi * probe.eval(part, normal, np.array([[0, 0, 1]], np.float32))[0]
    is_stand_in = np.allclose(got, stand_in, rtol=1e-4) and not probe.is_ours
    diffuse = not any(int(probe.bsdf.flags()) & int(kind) for kind in (mi.BSDFFlags.Glossy, mi.BSDFFlags.Delta))
    diffuse = diffuse and not probe.deltas
    constant = diffuse and (np.ptp(f, axis=0) <= LAMBERTIAN * f.max(axis=0)).all() and f.any()
    expected = np.pi * f.mean(axis=0)
    if not np.isfinite(found).all() or np.min(found) < 0:
        outcome.fault(f"it is {next(v for v in np.ravel(found) if not v >= 0 or v == np.inf):.4g}", np.inf)
    elif is_stand_in and not (constant and np.allclose(got, expected, rtol=2 * LAMBERTIAN)):
        raise Skipped("It is Mitsuba's stand-in, π times eval towards the normal.")
    elif constant:
        _compare(outcome, got, expected, 2 * LAMBERTIAN, "π f is")
    else:
        if np.max(found) > 1 + 1e-4:
            outcome.fault(f"it is {np.max(found):.4g}, but nothing reflects more than 1", np.inf)
        if diffuse and probe.is_ours:
            wo = on_side(hemisphere(1 << 14, 74, 0), part.sides[0])
            albedo = 2 * np.pi * probe.eval(part, normal, wo).mean(axis=0)
            why = "the albedo at normal incidence, which estimated_albedo of the lobes stands for, is"
            _compare(outcome, got, np.minimum(albedo, 1), 0.05, why)
    return f"It is {', '.join(f'{channel:.3g}' for channel in got)}."


def _compare(outcome: Outcome, got: Array, expected: Array, tolerance: float, words: str) -> None:
    """Add a fault if a channel is off."""
    error = abs(got - expected) / np.maximum(expected, 1e-6)
    if (error > tolerance).any():
        k = int(np.argmax(error))
        outcome.fault(f"it is {got[k]:.4g} in channel {k + 1}, but {words} {expected[k]:.4g}", error[k])
