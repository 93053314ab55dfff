"""How fits look beside their data: pictures of the preview scene, and their FLIP errors."""

from __future__ import annotations

import os
import warnings
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import mitsuba as mi
import numpy as np

from ..model import EnergyWarning
from ..names import tabulated
from ..preview import preview_scene
from ..probe.arrays import Array
from ..srgb import decoded, encoded
from .lanes import rgb_variant
from .observations import FitError
from .result import Fit

SIZE, SAMPLES, DEPTH, SEED = 256, 36, 3, 1
"""Of pictures: their width and height, the samples of a pixel, the length of paths, and the seed, which is the same for
data and fits: their noise is then alike, and almost none of it is in their difference."""
MOST = 9
"""The most fits to a material that a report shows, and does not only list."""

TO_XYZ = np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]])
"""From linear sRGB, by IEC 61966-2-1."""


class Appearance(NamedTuple):
    """A material and fits to it, in the same scene: pictures of shape (SIZE, SIZE, 3) in sRGB, from 0 to 1."""

    data: Array
    fits: list[Array]
    stops: float
    """By how many stops all are brighter than rendered."""


def render(fits: Sequence[Fit], advance: Callable[[], None] = lambda: None) -> Appearance:
    """Render the data of fits to one material by ``tabulated``, and each fit, calling ``advance`` after each picture.
    Raise a FitError if the data are arrays."""
    file = fits[0].file
    if not os.path.exists(file):
        raise FitError(f"Pictures need the file that was fitted; there is none of {file}.")
    with rgb_variant(), warnings.catch_warnings():
        warnings.simplefilter("ignore", EnergyWarning)  # the albedo tells
        pictures = []
        data = tabulated(os.path.abspath(file)) | {"quantity": fits[0].quantity}
        for bsdf in (data, *(it.bsdf for it in fits)):
            pictures.append(_picture(bsdf))
            advance()
        stops = _stops(pictures[0])
        measured, *others = (encoded(2.0**stops * picture).astype(np.float32) for picture in pictures)
    return Appearance(measured, others, stops)


def look(fits: Sequence[Fit], image: bool, advance: Callable[[], None] = lambda: None) -> tuple[list[Fit], Appearance]:
    """Return fits to one material and pictures of the best ones, or with ``image`` of all, in the order of FLIP."""
    shown = render(fits if image else fits[:MOST], advance)
    return by_flip(fits, shown) if image else (list(fits), shown)


def by_flip(fits: Sequence[Fit], shown: Appearance) -> tuple[list[Fit], Appearance]:
    """Return fits with their FLIP errors, the least first, and their pictures in the same order.

    It is the mean over the picture of LDR-FLIP (P. Andersson et al., FLIP: A difference evaluator for alternating
    images, HPG 2020, doi:10.1145/3406183) at 67 pixels per degree, its authors' default. Pictures are compared as the
    report shows them: linear values, brightened alike, clipped at 1, in sRGB, without any other tone mapping. What a
    display clips has no error.

    Another seed changes an error by less than .001, and the order of fits whose errors differ by more not at all.
    """
    evaluate = evaluator()
    errors = [float(evaluate(shown.data, it, "LDR", True, False, True, {"ppd": 67.0})[1]) for it in shown.fits]
    order = np.argsort(errors, kind="stable")
    return [replace(fits[k], flip=errors[k]) for k in order], shown._replace(fits=[shown.fits[k] for k in order])


def evaluator() -> Callable[..., Any]:
    """Return the function that computes FLIP, or raise an ImportError that says what brings it."""
    try:
        from flip_evaluator import evaluate
    except ImportError:
        raise ImportError("FLIP needs the package flip-evaluator: pip install 'mi_brdfs[report]'") from None
    return evaluate


def lab(picture: Array) -> Array:
    """Return CIELAB of a picture in sRGB: L*, from 0 to 100, a* and b*."""
    xyz = decoded(picture) @ TO_XYZ.T / TO_XYZ.sum(axis=1)
    x, y, z = np.moveaxis(np.where(xyz > (6 / 29) ** 3, np.cbrt(xyz), (29 / 6) ** 2 / 3 * xyz + 4 / 29), -1, 0)
    return np.stack([116 * y - 16, 500 * (x - y), 200 * (y - z)], axis=-1)


def _picture(bsdf: dict) -> Array:
    """Return a picture of a material, linear."""
    scene = preview_scene(bsdf)
    scene["integrator"]["max_depth"] = DEPTH
    scene["sensor"]["film"] |= {"width": SIZE, "height": SIZE, "rfilter": {"type": "box"}}  # for the denoiser
    scene["sensor"]["sampler"] = {"type": "multijitter", "sample_count": SAMPLES}
    loaded = mi.load_dict(scene)  # alive until the picture is
    return np.array(mi.render(loaded, seed=SEED))[..., :3]


def _stops(picture: Array) -> float:
    """Return by how many stops, in halves, a picture can be brightened, or must be darkened, to be hardly clipped."""
    return float(np.floor(-2 * np.log2(np.quantile(picture.max(axis=-1), 0.995))) / 2)
