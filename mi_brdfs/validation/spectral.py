"""The checks of colours: channel by channel, and in rgb and spectral variants alike."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import mitsuba as mi
import numpy as np

from ..mitsuba.errors import unwrapped_ctrl_c
from ..parameters.colours import rgb_texture
from ..probe.arrays import Array, hero_wavelengths, interaction, numbers, pinned, texture
from ..probe.bsdf import BSDFProbe, Part, Value, load
from . import contract, sampling, values
from .outcome import Outcome, Skipped, relative, skipping, told
from .run import Run, anywhere, failures, of_whole, tell
from .traced import Parameter, traced_floats
from .updates import loaded_or_none

COUNT = 1000
TOLERANCE = 5e-3
"""Mitsuba fits spectra to rgb colours to about a thousandth."""
BRIGHT = 2.5
"""A grey that no reflectance may have, but other colours may."""
AGAIN = values.finite, sampling.weight, values.eval_pdf
"""The checks to run again in a polarized variant, and in colours in a spectral one, of what passes in rgb as it is."""
EVERY = *AGAIN, contract.mode, contract.reflectance
"""Those to run again in colours in the same variant, which take all lanes to have the same wavelengths."""
OWN = "where all colours are grey of their value there"
HUE = 1, 0.7, 0.45
"""The channels of a colour, as parts of the grey in its place."""


@of_whole
def colours(run: Run, part: Part, outcome: Outcome) -> str:
    """Check that no channels of colour are exchanged: with colours for parameters that are grey or coloured, each
    channel of ``eval``, and of the weights of delta functions, is what it is where all parameters are grey of their
    value in this channel, or at least nearer to that than to what another channel makes: a tint may depend on the
    luminance. And there values are finite, weights are eval/pdf, ``eval_pdf`` says what ``eval`` and ``pdf`` say, light
    may be traced from the emitters, and ``eval_diffuse_reflectance`` is right. For this the BSDF must be given as a
    dict."""
    greys = _greys(run.probe, run.described("To give it other colours"))
    # Colours that are no textures can be set.
    kept = [it for it in traced_floats(run, "colours")[0] if "." not in it.key and isinstance(it.value, mi.Color3f)]
    if not (greys or kept):
        raise Skipped("It has no colours.")
    if greys:
        _check_channels(run, outcome, greys)
        if mi.is_rgb:  # in others, spectral does that
            coloured = BSDFProbe(load((run.given or {}) | _coloured(greys)))
            tell(run, outcome, failures(anywhere(run, coloured), EVERY), "in colours, ")
    for parameter in kept:
        _check_kept(run, outcome, parameter)
    return "Each channel follows its own."


@of_whole
def spectral(run: Run, part: Part, outcome: Outcome) -> str:
    """Check that what is grey is the same in rgb and in spectral variants, to 0.5 %, at all visible wavelengths: all
    rgb colours become grey ones, as bright as they are. Those of plugins of ours are also tried brighter than 1, where
    they may be; Mitsuba's own plugins limit them to 1 in spectral variants.

    And in colours, in the spectral variant, values are finite, weights are eval/pdf, ``eval_pdf`` says what ``eval``
    and ``pdf`` say, directions are drawn as ``pdf`` says, at one angle, and each wavelength follows the value that the
    colours have there, and not that of another wavelength, be it one beside it; their order does not matter. For this
    the BSDF must be given as a dict."""
    described = run.described("To load it in two variants")
    rgb, other = (f"{mi.variant().rpartition('_')[0]}_{kind}" for kind in ("rgb", "spectral"))
    if mi.variant() not in (rgb, other) or not {rgb, other} <= set(mi.variants()):
        raise Skipped(f"It takes the variants {rgb} and {other}.")
    expected: dict[str, list[Value]] = {}
    try:
        with unwrapped_ctrl_c(), mi.variant_context(rgb):
            probe = _load(described)
            greys = _greys(probe, described)
            tried = _tried(probe, described, greys)
            wi, wo = _load(tried[""]).pairs(part, COUNT, 81)
            expected = {words: _load(given).values(wi, wo) for words, given in tried.items()}
    except Exception as failure:  # it was checked in the other
        without = f"It does not work in {rgb}: {told(failure)}. "
        greys, tried = _greys(run.probe, described), {}
    else:
        without = ""
        # Of every lane alone: next to a narrow highlight all else is small.
        spread = [relative(it.value.min(axis=1), it.value.max(axis=1), 1e-12).max() for it in expected[""]]
        if max(spread) > 1e-4:
            # Spectral variants make other colours of them.
            tried, without = {}, "Grey is not compared, as it has colours that cannot be replaced. "
    worst = 0.0
    with mi.variant_context(other), skipping(f"It does not work in {other}: "):
        got = {words: _load(given).values(wi, wo) for words, given in tried.items()}
        coloured = _load(described | _coloured(greys))
        # Few tests, but judged as strictly as those of this run: they are as many more.
        every, single = anywhere(run, coloured), BSDFProbe(coloured.bsdf)
        one = replace(every, probe=single, angles=(30,), at_random=0, significance=run.level)
        failed = failures(every, AGAIN) | failures(one, (sampling.pdf, sampling.chi2))
        _check_channels(run, outcome, greys)
    tell(run, outcome, failed, f"in {other}, in colours, ")
    for words in tried:
        for it, in_rgb in zip(got[words], expected[words], strict=True):
            wanted = np.broadcast_to(in_rgb.value.mean(axis=1, keepdims=True), it.value.shape)
            name, places = f"in {other}, in grey{words}, {it.name}", (wi, it.wo, hero_wavelengths(COUNT))
            worst = max(worst, _compare(outcome, name, it.value, wanted, f"in {rgb}", *places))
    grey = f"Grey is the same in {rgb} and {other}, to {worst:.1g}. " if tried else ""
    return f"{without}{grey}Wavelengths follow their own."


def _check_channels(run: Run, outcome: Outcome, greys: dict[str, float]) -> None:
    """Check that channels, or wavelengths, follow their own values of the colours: of ``eval``, and of the weights of
    delta functions."""
    textures = {name: rgb_texture(colour["value"]) for name, colour in _coloured(greys).items()}
    _check_colours(run, outcome, textures)
    if mi.is_rgb and len(textures) > 1:  # exchanged channels of one are like no channel of all
        for name in textures:
            _check_colours(run, outcome, {name: textures[name]})


def _check_colours(run: Run, outcome: Outcome, textures: dict[str, mi.Texture]) -> None:
    """Check that of some colours, beside which the others stay as they are."""
    given, wavelengths = run.given or {}, hero_wavelengths(COUNT)
    coloured = load(given | textures)
    wi, towards = BSDFProbe(coloured).pairs(run.probe.whole, COUNT, 84)
    si = interaction(wi, wavelengths=wavelengths)

    def evaluated(bsdf: mi.BSDF, wavelengths: Array) -> list[Value]:
        return BSDFProbe(bsdf).values_at(interaction(wi, wavelengths=wavelengths), towards)

    def held(*channel: int) -> mi.BSDF:
        return load(given | {name: pinned(varying, si, *channel) for name, varying in textures.items()})

    got = evaluated(coloured, wavelengths)
    channels = range(got[0].value.shape[1])
    alike = [np.repeat(wavelengths[:, [k]], 4, axis=1) for k in range(4)]
    grey = [evaluated(held(k), alike[k]) for k in channels]
    for at, it in enumerate(got):
        _check_followed(outcome, it, [each[at].value for each in grey], wi)
    if not mi.is_spectral:
        return
    rolled, bound = evaluated(coloured, np.roll(wavelengths, 1, axis=1)), evaluated(held(), wavelengths)
    alone = [evaluated(coloured, alike[k]) for k in channels]
    for at, (name, wo, value) in enumerate(got):
        places, usual = (wi, wo, wavelengths), np.roll(rolled[at].value, -1, axis=1)
        why = "in the first: it takes another's value"
        _compare(outcome, f"in another order of the wavelengths {name}", usual, value, why, *places)
        # Asked at any wavelengths, these textures have the values of the light's, also to make a tint of.
        why = "if all colours have their values of the light's wavelengths: they are looked up at others"
        _compare(outcome, name, value, bound[at].value, why, *places)
        for k in channels:  # of four equal wavelengths no tint can depend on the others
            one, own = (each[k][at].value[:, k] for each in (alone, grey))
            _compare(outcome, name, one, own, OWN, wi, wo, wavelengths[:, k])


def _check_kept(run: Run, outcome: Outcome, parameter: Parameter) -> None:
    """Check that channels follow their own of a colour that the BSDF keeps itself."""
    wi, wo = run.probe.pairs(run.probe.whole, COUNT, 84)
    with parameter.restored() as original:
        bright = float(numbers(original, 1).mean())

        def evaluated(*channels: float) -> list[Value]:
            parameter.set(mi.Color3f(*(bright * each for each in channels)))
            return run.probe.values(wi, wo)

        grey = [evaluated(each, each, each) for each in HUE]
        for at, it in enumerate(evaluated(*HUE)):
            _check_followed(outcome, it, [each[at].value for each in grey], wi)
        failed = failures(anywhere(run, run.probe), EVERY)
    tell(run, outcome, failed, "in colours, ")


def _check_followed(outcome: Outcome, it: Value, grey: list[Array], wi: Array) -> None:
    """Check that a value's channels are nearest to what they are where all colours are grey of their own values."""
    for k, own in enumerate(grey):
        got, expected = it.value[:, k], own[:, k]
        channel = ("red", "green", "blue")[k] if mi.is_rgb else f"the {('1st', '2nd', '3rd', '4th')[k]} wavelength"
        # What 99 in 100 do not exceed.
        errors = [np.quantile(relative(got, other[:, k], 1e-6), 0.99) for other in grey]
        if errors[k] > TOLERANCE and min(errors) < 0.5 * errors[k]:
            name, why = f"{it.name} in {channel}", f"{OWN}: it follows another channel"
            outcome.wrong(abs(got - expected), name, got, why, wi, it.wo, expected=expected)


def _compare(
    outcome: Outcome, name: str, got: Array, expected: Array, why: str, wi: Array, wo: Array, wavelengths: Array
) -> float:
    """Add a fault if values differ; return by how much 99 in 100 do at most."""
    return outcome.differing(
        TOLERANCE, name, got, expected, why, wi, wo, floor=1e-6, but_for=0.01, wavelengths=wavelengths
    )


def _greys(probe: BSDFProbe, given: dict[str, Any]) -> dict[str, float]:
    """Return the colours among constant parameters, what is asked for a spectrum, by name, and how bright they are."""
    params, asked = mi.traverse(probe.bsdf), set[str]()

    def asking(name: str, grey: float) -> mi.Texture:
        def evaluated(self: mi.Texture, _: mi.SurfaceInteraction3f, active: mi.Bool = True) -> Any:
            asked.add(name)
            return mi.UnpolarizedSpectrum(grey)

        return texture(eval=evaluated, eval_1=lambda self, *_: mi.Float(grey), mean=lambda self: mi.Float(grey))

    greys = {}
    for key in params.keys():
        name, _, rest = key.partition(".")
        if rest == "value" and not isinstance(given.get(name), (bool, str)):
            greys[name] = float(f"{numbers(params[key], 1).mean():.6g}")  # in float32 a limit may lie beyond it
    try:
        with unwrapped_ctrl_c():
            bsdf = load(given | {name: asking(name, grey) for name, grey in greys.items()})
            wi = probe.whole.around(16, 87)
            BSDFProbe(bsdf).values(wi, wi)
    except (RuntimeError, TypeError):
        return {}
    greys = {name: grey for name, grey in greys.items() if name in asked and grey > 0}
    # What is at the low end of its range has brighter hues only.
    dark = [name for name, colour in _coloured(greys).items() if loaded_or_none(given | {name: colour}) is None]
    return greys | {name: greys[name] / min(HUE) for name in dark}


def _tried(probe: BSDFProbe, given: dict[str, Any], greys: dict[str, float]) -> dict[str, dict[str, Any]]:
    """Return the BSDF in grey, by what is special of it in words. The variant must be one of rgb."""
    given = given | {name: _rgb(grey, (1, 1, 1)) for name, grey in greys.items()}
    tried = {"": given}
    for name in greys if probe.is_ours else ():
        bright = given | {name: _rgb(BRIGHT, (1, 1, 1))}
        if loaded_or_none(bright) is not None:  # else it is a reflectance
            tried[f" with {name} = {BRIGHT:g}"] = bright
    return tried


def _coloured(greys: dict[str, float]) -> dict[str, dict[str, Any]]:
    """Return colours of as many hues as channels, so that their ratios differ."""
    return {name: _rgb(grey, HUE[k % 3 :] + HUE[: k % 3]) for k, (name, grey) in enumerate(greys.items())}


def _load(given: dict[str, Any]) -> BSDFProbe:
    return BSDFProbe(load(given), every_wavelength=True)


def _rgb(grey: float, hue: tuple[float, ...]) -> dict[str, Any]:
    return {"type": "rgb", "value": tuple(grey * part for part in hue)}
