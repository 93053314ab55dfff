"""From measured BRDFs to parameters of models, :func:`fit`, and from pictures: :func:`images`."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from numbers import Integral
from pathlib import Path
from typing import Any

from ..measured import FileError
from ..mitsuba.registry import find_model
from ..parameters.messages import listed
from ..writing import write_text
from .engine import fit_configuration
from .lanes import rgb_variant
from .metrics import METRICS, Metric, find_metric
from .observations import CUT, PAIRS, FitError, Observations, Source, observe
from .pictures import ImageFit, images
from .result import Fit, Starts
from .starts import warm
from .unknowns import check_names, configurations

__all__ = [
    "METRICS",
    "FileError",
    "Fit",
    "FitError",
    "ImageFit",
    "Metric",
    "Observations",
    "Starts",
    "find_metric",
    "fit",
    "images",
    "observe",
    "report",
]

STARTS = 10
"""How many starts a fit has where nothing else is asked for."""


def fit(
    data: Source | Observations | Sequence[Source | Observations],
    model: str | Sequence[str],
    *,
    metric: str = "log",
    given: Mapping[str, Any] | None = None,
    tied: Mapping[str, str] | None = None,
    start: Mapping[str, Any] | Sequence[Mapping[str, Any]] = (),
    lobes: int = 1,
    starts: int = STARTS,
    seed: int = 0,
    cut: float = CUT,
    pairs: int = PAIRS,
    progress: Callable[[int, int], None] | None = None,
) -> list[Fit]:
    """Fit models to measured BRDFs, each model to all materials at once.

    Free are all numbers and colours that a model declares, within their ranges, a colour with a value for each channel
    of the data: also parameters without a default, as the diffuse lobe that a model may have; models without one, as
    the diffuse ones, get none. Anisotropic data have the values for both tangent directions and the rotation; numbers
    that are declared to make a model anisotropic stay at their defaults for isotropic data. A Fresnel term has the
    parameters of ``given["fresnel"]``: "schlick" (the default), "dielectric", "conductor" or "none". Words that later
    papers added to the models of facets (f82, f90, schlick_exponent, film_thickness, film_ior, haze, haze_spread,
    retroreflectivity) and the index outside stay as they are, unless they are given as "free". A fit of a thickness has
    256 starts or more, as each order of interference is a valley of its own.

    Half of the pairs of directions are fitted, and half held out. Fits minimise the error of a metric of
    ``mi_brdfs.fit.METRICS`` by Levenberg–Marquardt steps (:mod:`mi_brdfs.fit.solver`), from the settings that are
    nearest to the data among many, from random ones, and from the nearest published material; the best end counts.
    Negative and missing values have no weight: where noise about 0 makes them negative, what is left is too bright, by
    up to 0.8 of its standard deviation. It runs in the active variant if that is an rgb one with derivatives, and else
    in the fastest that works here.

    Args:
        data: a file, a :class:`mi_brdfs.measured.Measurement` or a tuple of arrays ``(wi, wo, f)``, of shapes (N, 3),
            (N, 3) and (N,) or (N, channels), with one channel or linear sRGB, f in 1/sr, as of an isotropic material;
            or what :func:`observe` made of one of these; or a list of them. Values of files weigh by the solid angles
            of their cells, and scattered ones alike.
        model: the name of a plugin of the pack or of a third-party package, or several.
        metric: "log", "l2", "ngan", "cube-root", "bieron-l2" or "bieron-log".
        given: parameters that are fixed, by name, None to leave one out, "free" to seek one that is not sought
            otherwise; words of choices, a tuple for a fit of each.
            They hold for the models that have them.
        tied: parameters that equal another one, as ``{"cy": "cx"}``.
        start: a plugin dict to start from, besides others, or several. What it leaves out starts where it suits the
            data. No fit is worse than one that gives all that is free.
        lobes: the number of lobes of models that have several of a kind.
        starts: the number of the other starts, of which no more than 256 are tried.
        seed: of the choice of pairs and of the random starts.
        cut: the largest angle of wi and wo to the normal, in degrees.
        pairs: the most pairs of directions of a material, fitted and held out.
        progress: called with how many of how many starts have ended.

    Returns:
        The fits, those of a material together, and of these first the one with the least error on what was held out.

    Raises:
        FitError: if nothing can be fitted, and why, in a sentence.
        FileError: if a file cannot be read.
        ValueError: if there is no such model or metric.
    """
    find_metric(metric)
    several = isinstance(data, Sequence) and not isinstance(data, (str, tuple))
    sources: list[Any] = list(data) if several else [data]  # type: ignore[arg-type]
    if not sources:
        raise FitError("There are no data to fit.")
    whole = all(isinstance(it, Integral) for it in (starts, lobes, pairs, seed))
    if not whole or starts < 0 or lobes < 1 or pairs < 2 or seed < 0 or not 0 < cut <= 90:
        raise FitError(
            "A fit needs whole numbers starts >= 0, lobes >= 1, pairs >= 2, seed >= 0 and a cut in (0, 90] degrees."
        )
    models = [find_model(name) for name in ([model] if isinstance(model, str) else model)]
    if not models:
        raise FitError("There is no model to fit; name one or more.")
    check_names(models, [*(given or {}), *(tied or {}), *(tied or {}).values()])
    given_starts = [start] if isinstance(start, Mapping) else list(start)
    if not starts and not given_starts:
        raise FitError("There is nothing to start from: starts is 0, and no start is given.")
    materials = [it if isinstance(it, Observations) else observe(it, cut, pairs, seed) for it in sources]
    with rgb_variant():
        todo = []
        for kind in dict.fromkeys((it.channels, it.anisotropic) for it in materials):
            alike = [k for k, it in enumerate(materials) if (it.channels, it.anisotropic) == kind]
            for each in models:
                found = configurations(each, given or {}, tied or {}, lobes, *kind)
                todo += [(it if kind[1] else it.isotropic(), alike) for it in found]
        for each_start in given_starts:
            alikes = [it for it, _ in todo if each_start.get("type", it.plugin) in it.model.plugins]
            if fixed := sorted({name for it in alikes for name in it.fixed} & each_start.keys()):
                named = listed(fixed, "and")
                raise FitError(f"No fit can start at {each_start}: isotropic data fix {named}; leave it out.")
            if all(warm(configuration, each_start) is None for configuration, _ in todo):
                raise FitError(f"No fit can start at {each_start}: it is of another plugin, or has other parameters.")
        ended, ranked = 0, []
        counts = [starts and max(starts, *(it.quantity.starts for it in each.unknowns)) for each, _ in todo]
        total = sum(len(alike) * (count + len(given_starts)) for (_, alike), count in zip(todo, counts, strict=True))

        def advance(count: int) -> None:
            nonlocal ended
            ended = min(ended + count, total)
            if progress:
                progress(ended, total)

        for (configuration, alike), count in zip(todo, counts, strict=True):
            own = [materials[k] for k in alike]
            fits = fit_configuration(configuration, own, metric, count, given_starts, seed, advance)
            ranked += list(zip(alike, fits, strict=True))
    return [it for _, it in sorted(ranked, key=lambda pair: (pair[0], pair[1].held_out))]


def report(fits: Sequence[Fit], path: str | Path, image: bool = False) -> list[Fit]:
    """Write a page about fits of files, as ``mi-brdfs fit -o report.html`` does: for each material the ranking of the
    models, pictures of the data and the fits by ``mi_brdfs.preview``, lobes in the plane of incidence, the residuals
    over θh and θd, and the parameters. It needs nothing but a browser.

    Args:
        fits: what :func:`fit` returned of files.
        path: of the page, which is replaced if it exists.
        image: rank the models by the FLIP errors of their pictures (:func:`mi_brdfs.fit.appearance.by_flip`).

    Returns:
        The fits in the order of the page, with ``flip`` if ``image``.

    Raises:
        ImportError: without the extra ``report``.
        FitError: if the data of a fit are no file, or there is no fit.
        ValueError: if the page would replace the data.
        OSError: if the page cannot be written.
    """
    from .appearance import look
    from .html import page_of, section_of

    sections, found = [], []
    if not fits:
        raise FitError("There is no fit to write a page about.")
    for file in dict.fromkeys(it.file for it in fits):
        if file and os.path.exists(path) and os.path.exists(file) and os.path.samefile(file, path):
            raise ValueError(f"{path}: the page would replace the data; give another name.")
        ranked, shown = look(sorted((it for it in fits if it.file == file), key=lambda it: it.held_out), image)
        sections.append(section_of(ranked, shown))
        found += ranked
    write_text(path, page_of(sections))
    return found
