"""The report as one page of HTML that needs nothing else."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..measured import Measurement, read
from ..measured.report.counts import in_one_plane
from ..mitsuba.registry import all_models
from ..pages import environment
from ..pages.figures import DIFFERENCE, data_uri, svg
from ..rendering.output import denoiser
from ..srgb import decoded, encoded
from .appearance import MOST, Appearance, lab
from .figures import CURVES, Residuals, lobes, probe_of
from .lanes import rgb_variant
from .metrics import METRICS
from .observations import observe
from .result import ALIKE, ANGLES, Fit, medians, notes, number, values

PAIRS = 16384
"""The most pairs of directions of a residual map."""
DECISIVE = 10
"""The difference in BIC from which the evidence is called very strong.

R. E. Kass, A. E. Raftery, Bayes factors, Journal of the American Statistical Association 90(430), 1995,
doi:10.1080/01621459.1995.10476572.
"""
POOR = 0.25
"""The part of the reflected light from which a fit that is off by it is called poor."""
NOTICED = 2.3
"""The difference of colours in CIELAB that is just noticed, side by side.

M. Mahy, L. Van Eycken, A. Oosterlinck, Evaluation of uniform color spaces developed after the adoption of CIELAB and
CIELUV, Color Research & Application 19(2), 1994, doi:10.1111/j.1520-6378.1994.tb00070.x.
"""
SCALES = 1, 2, 5, 10, 20, 50, 100
"""The ends of the scale of differences of lightness."""


@dataclass
class Card:
    """A fit, as it is shown. What is not shown is empty."""

    fit: Fit
    picture: str = ""
    difference: str = ""
    residuals: str = ""
    told: str = ""
    """How far it is from the data, in sentences."""


@dataclass
class Section:
    """A material. What is not shown is empty."""

    file: str
    cards: list[Card]
    material: str = ""
    """What a file calls it, and its format."""
    data: str = ""
    """The picture of the data."""
    planar: bool = False
    """Whether only the plane of incidence was measured."""
    lightness: int = 0
    """The end of the scale of differences."""
    stops: float = 0
    """By how many stops pictures are brightened."""
    quantity: str = ""
    """What residuals are of."""
    limit: float = 0
    """The end of their scale."""
    off: float = 0
    """How far the best fit is off, as a part of the reflected light."""
    lobes: Sequence[tuple[str, str]] = ()

    @property
    def best(self) -> Fit:
        return self.cards[0].fit

    @property
    def changed(self) -> str:
        """By how much pictures are brightened, in words."""
        word, by = "brightened" if self.stops > 0 else "darkened", abs(self.stops)
        return f"{word} by {by:g} stop{'s' * (by != 1)}" if by else ""

    @property
    def verdict(self) -> str:
        """Which model fits best, and by how much, in sentences."""
        fits = [card.fit for card in self.cards]
        all_tried = {model.plugins[0] for model in all_models()} <= {it.bsdf["type"] for it in fits}
        advice = ", and all models were tried: " if all_tried else ": try other models, or "
        best, poorly = fits[0], f", but fits poorly{advice}render the file itself" * (self.off > POOR)
        if len(fits) == 1:
            return f"Only {best.model} was fitted{poorly}."
        told = [f"{best.model} comes nearest to the data{poorly}."]
        ratio, name, against = fits[1].error / max(best.error, 1e-30), fits[1].model, fits[1].bic - best.bic
        kind = "held-out error" if best.flip is None else "FLIP error"
        larger = f"its {kind} is only {100 * (ratio - 1):.1f} % larger"
        if ratio > ALIKE:
            told.append(f"The {kind} of the next, {name}, is {ratio:.3g} times as large.")
        elif abs(against) < DECISIVE:
            told.append(f"{name} is as good: {larger}.")
        elif against > 0:
            told.append(f"{name} is close, {larger}, but its BIC is worse by {against:.0f}.")
        else:
            told.append(f"{name} is close: {larger}.")
        nearest, likeliest = min(fits, key=lambda it: it.held_out), min(fits, key=lambda it: it.bic)
        if nearest is not best:
            told.append(f"By the held-out error it would be {nearest.model}.")
        if likeliest is not best:
            told.append(f"By the BIC it would be {likeliest.model}, which is better by {best.bic - likeliest.bic:.0f}.")
        return " ".join(told)

    @property
    def mismatch(self) -> str:
        """How the scatter that the file states differs from that of its values, in a sentence, if it does."""
        ratios = [stated / max(values, 1e-30) for _, stated, values in self.best.scatter]
        if all(0.9 < ratio < 1.1 for ratio in ratios):
            return ""
        times = " to ".join(dict.fromkeys(f"{ratio:.2g}" for ratio in (min(ratios), max(ratios))))
        return f"The file states {times} times what its values integrate to."

    @property
    def converged(self) -> str:
        """How many optimisations of the best model found it, in a sentence."""
        agree, tried = self.best.starts.agree, self.best.starts.tried
        if tried == 1:
            return f"{self.best.model} was optimised from one start only."
        of = "All" if agree == tried else f"{agree} of"
        return f"{of} {tried} optimisations of {self.best.model} converged to the same error."


def section_of(fits: Sequence[Fit], shown: Appearance | None = None) -> Section:
    """Return the part of a report on a material, from its fits, the best first. With pictures of them, in the same
    order, it also gets drawings.

    Raises:
        FileError: if the data cannot be read any more.
    """
    section = Section(fits[0].file, [Card(it) for it in fits])
    if shown:
        _draw(section, shown)
    return section


def page_of(sections: Sequence[Section], unfinished: str = "") -> str:
    """Return a report; ``unfinished`` says what it lacks."""
    everything = [[card.fit for card in section.cards] for section in sections]
    return environment.get_template("fit.html").render(
        sections=sections,
        medians=medians(everything) if len(everything) > 1 else [],
        metrics=METRICS,
        flip=any(it.flip is not None for own in everything for it in own),
        unfinished=unfinished,
        alike=round(100 * (ALIKE - 1)),
        curves=CURVES,
        most=MOST,
        steepest=ANGLES[-1],
        notes=notes,
        noticed=NOTICED,
        values=values,
    )


def _draw(section: Section, shown: Appearance) -> None:
    """Draw a material, and its best fits."""
    cards, measurement = section.cards[:MOST], read(section.file, section.best.quantity)
    section.material, section.stops = _told(measurement), shown.stops
    pairs = observe(measurement, section.best.cut, PAIRS)
    section.planar = in_one_plane(measurement.data)
    data, *pictures = map(_smooth, (shown.data, *shown.fits[:MOST]))
    section.data = data_uri(data)
    differences = [lab(picture) - lab(data) for picture in pictures]
    lightness = np.quantile(abs(differences[0][..., 0]), 0.99)
    section.lightness = next((end for end in SCALES if end >= lightness), SCALES[-1])
    for card, picture, difference in zip(cards, pictures, differences, strict=False):
        card.picture = data_uri(picture)
        card.difference = data_uri(DIFFERENCE(0.5 + 0.5 * difference[..., 0] / section.lightness)[..., :3])
    with rgb_variant():
        probes = [probe_of(card.fit) for card in cards]
        residuals = [Residuals(pairs, card.fit, probe) for card, probe in zip(cards, probes, strict=True)]
        section.lobes = [(caption, svg(it)) for caption, it in lobes(measurement, probes[:CURVES], section.best.cut)]
    section.quantity, section.off = residuals[0].quantity, residuals[0].off
    section.limit = max(float(np.median([it.extent for it in residuals[:CURVES]])), 1e-12)
    for card, each, difference in zip(cards, residuals, differences, strict=True):
        card.residuals = svg(each.draw(section.limit))
        most = np.quantile(np.linalg.norm(difference, axis=-1), 0.99)
        seen = "a visible difference" if most > NOTICED else "hardly a visible difference"
        where = f"In the rendering{section.changed and f', {section.changed}'}"
        told = f"{each.told} {where}, ΔE is within {most:.2g} in 99 % of the pixels: {seen}."
        card.told = told.replace(" %", "\u00a0%").replace("≈ ", "≈\u00a0")


def _smooth(picture: np.ndarray) -> np.ndarray:
    """Return a picture in sRGB, denoised where the denoiser loads."""
    denoise = denoiser()
    return encoded(denoise(decoded(picture))) if denoise else picture


def _told(measurement: Measurement) -> str:
    channels = measurement.data.values.shape[-1]
    kind = "anisotropic" if measurement.data.anisotropic else "isotropic"
    words = [measurement.material, measurement.format, kind, f"{channels} channel{'s' * (channels > 1)}"]
    return ", ".join(word for word in words if word)


environment.filters |= {"number": number, "name": lambda file: Path(file).name}
