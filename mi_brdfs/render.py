"""Progressive rendering of a loaded scene, and its output as an EXR and a display image.

From Python::

    scene = mi.load_file("scene.xml")
    picture = render(scene, spp=256)
    picture.image                               # the developed tensor
    write(picture.bitmap, "scene.exr")
    write(display_image(picture.bitmap), "scene.png")
"""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace

import drjit as dr
import mitsuba as mi
import numpy as np

from .variants import is_scalar

SHOULDER = 0.8


@dataclass(frozen=True)
class Picture:
    """The result of ``render``."""

    image: mi.TensorXf
    """The developed image as ``film.develop()`` returns it, in the film's pixel format and with all AOVs."""
    bitmap: mi.Bitmap
    """The same image with channel names, ready to be written as an EXR."""
    spp: int
    """Samples per pixel finished."""
    total: int
    """Samples per pixel requested, rounded up as the sampler needs."""


def render(
    scene: mi.Scene,
    spp: int | None = None,
    seed: int = 0,
    sensor: int = 0,
    on_pass: Callable[[int, int], None] = lambda done, total: None,
) -> Picture:
    """Render ``scene`` in passes of about a second and combine them without bias.

    The passes sum the film's raw data, numerators and filter weights apart; one division at the end develops it. (A
    mean of developed passes would be biased: each is a ratio of two random sums.) An integrator that post-processes the
    mean of a pixel's samples, as ``shading`` does, has methods ``sums`` and ``put`` like those of :class:`FilmPasses`,
    so that its passes add up first.

    ``spp`` defaults to the scene's own number. ``on_pass(done, total)`` is called after each pass. The first Ctrl-C
    lets the running pass end (scalar variants may drop it) and returns the finished passes
    (``picture.spp < picture.total``). A second one, or one before any pass has finished, raises KeyboardInterrupt.

    The result depends on scene, variant, ``spp``, ``seed`` and, in LLVM variants, the number of threads, but never on
    timing: the size of a pass follows from the size of the image, and pass ``k`` uses a seed computed from ``seed``
    and ``k``. Two runs agree up to the order in which floats are added. Samplers that stratify do so within a pass.
    """
    camera = scene.sensors()[sensor]
    film, sampler, integrator = camera.film(), camera.sampler(), scene.integrator()
    source = integrator if hasattr(integrator, "sums") else FilmPasses(integrator)
    # Mitsuba's own handler cuts a pass of a scalar variant short.
    cut_short = is_scalar() and isinstance(source, FilmPasses)
    own_count = sampler.sample_count()
    try:
        particles = isinstance(integrator, mi.AdjointIntegrator)
        passes = _pass_sizes(sampler, spp or own_count, _samples_per_pass() // _pixel_count(film, particles))
        total, done, raw = sum(passes), 0, 0
        with ctrl_c() as interrupt:
            for index, count in enumerate(passes):
                passed = source.sums(scene, camera, seed=_pass_seed(seed, index), spp=count)
                if interrupt.pressed and cut_short:
                    break
                raw += passed
                dr.eval(raw)
                dr.sync_thread()
                done += count
                on_pass(done, total)
                if interrupt.pressed:
                    break
    finally:
        sampler.set_sample_count(own_count)
    if not done:
        raise KeyboardInterrupt
    source.put(film, raw, done)
    return Picture(film.develop(), film.bitmap(), done, total)


class FilmPasses:
    """The passes of Mitsuba's integrators: the film's raw data add up."""

    def __init__(self, integrator: mi.Integrator):
        self.integrator = integrator
        # A particle tracer's film holds a finished estimate per pass, with weight 0: average these.
        self.averaged = isinstance(integrator, mi.AdjointIntegrator)

    def sums(self, scene: mi.Scene, sensor: mi.Sensor, seed: int, spp: int) -> mi.TensorXf:
        """Return the film's content after a pass, to be added to that of other passes."""
        self.integrator.render(scene, sensor, seed=seed, spp=spp, evaluate=False)
        return sensor.film().develop(raw=True) * (spp if self.averaged else 1)

    def put(self, film: mi.Film, sums: mi.TensorXf, count: int) -> None:
        """Fill a film with the sums over ``count`` samples per pixel."""
        film.clear()
        film.put_block(mi.ImageBlock(sums / count if self.averaged else sums, film.crop_offset(), border=False))


def tonemap(image: np.ndarray) -> np.ndarray:
    """Map linear RGB of any range to [0, 1], still linear, without flat highlights or hue shifts.

    With ``m`` the largest of a pixel's channels and ``p`` the 99.9th percentile of ``m``, a pixel is multiplied by
    ``f(m) / m``. Up to 0.8, and everywhere if ``p <= 1``, ``f(m) = m``: a well exposed picture stays as it is. Above,

        f(m) = 0.8 + 0.2 t (1 + t/T²) / (1 + t),    t = (m - 0.8) / 0.2,    T = (p - 0.8) / 0.2,

    which continues with slope 1 and reaches 1 at ``m = p``. Brighter pixels are scaled to 1; negative values and NaNs
    become 0.
    """
    image = np.nan_to_num(np.maximum(image, 0), nan=0.0, posinf=np.finfo(np.float32).max)
    m = image.max(axis=-1, keepdims=True)
    T = max((np.percentile(m, 99.9) - SHOULDER) / (1 - SHOULDER), 1.0)
    t = np.maximum(m - SHOULDER, 0) / (1 - SHOULDER)
    f = np.where(m > SHOULDER, SHOULDER + (1 - SHOULDER) * t * (1 / (1 + t) + t / (1 + t) / T / T), m)
    return image * np.minimum(f, 1) / np.where(m > 0, m, 1)


def display_image(bitmap: mi.Bitmap) -> mi.Bitmap | None:
    """Return the tone-mapped 8-bit sRGB image of a developed film, without alpha and AOVs; None if it has no
    colours."""
    names = "".join(field.name for field in bitmap.struct_())
    formats = (mi.Bitmap.PixelFormat.RGB, mi.Bitmap.PixelFormat.XYZ, mi.Bitmap.PixelFormat.Y)
    colours = next((it for it in formats if names.startswith(it.name)), None)
    if colours is None:
        return None
    pixels = np.array(bitmap).reshape(*reversed(bitmap.size()), -1)[..., : len(colours.name)]
    linear = mi.Bitmap(np.ascontiguousarray(pixels), colours).convert(mi.Bitmap.PixelFormat.RGB)
    mapped = mi.Bitmap(tonemap(np.array(linear)).astype(np.float32), mi.Bitmap.PixelFormat.RGB)
    return mapped.convert(component_format=mi.Struct.Type.UInt8, srgb_gamma=True)


def write(bitmap: mi.Bitmap, path: str | os.PathLike) -> None:
    """Write ``bitmap`` in the format of the file name, all or nothing: ``path`` never holds half an image."""
    path = Path(path)
    partial = path.with_name(f".{path.stem}-{os.getpid()}{path.suffix}")
    try:
        bitmap.write(str(partial))
        os.replace(partial, path)
    finally:
        partial.unlink(missing_ok=True)


def _samples_per_pass() -> int:
    """Return about a second's worth on an ordinary scene: fixed numbers, so that results do not depend on timing."""
    if is_scalar():
        return 1 << 14
    if mi.variant().startswith("llvm"):
        return (1 << 20) * dr.thread_count()
    return 1 << 24


def _pixel_count(film: mi.Film, particles: bool) -> int:
    if particles:  # one particle per pixel of the uncropped film
        return int(np.prod(film.size()))
    border = 2 * film.rfilter().border_size() if film.sample_border() else 0
    return int(np.prod(np.array(film.crop_size()) + border))


def _pass_sizes(sampler: mi.Sampler, spp: int, limit: int) -> list[int]:
    """Return the samples per pixel of each pass: powers of two up to ``limit`` and a rest, rounded as the sampler
    does."""

    def rounded(count: int) -> int:
        sampler.set_sample_count(count)
        return sampler.sample_count()

    full = rounded(min(spp, 1 << max(limit, 1).bit_length() - 1))
    sizes = [full] * (spp // full)
    rest = spp - sum(sizes)
    return [*sizes, rounded(rest)] if rest else sizes


def _pass_seed(seed: int, index: int) -> int:
    """Return consecutive seeds within a render, as scalar variants distinguish only a few thousand seeds of a large
    film.

    The golden ratio keeps the sequences of different ``seed`` far apart.
    """
    return (seed * 0x9E3779B1 + index) % (1 << 32)


@contextmanager
def ctrl_c() -> Iterator[SimpleNamespace]:
    """Note the first Ctrl-C instead of raising; only the main thread can do so, others leave it to their caller."""
    interrupt = SimpleNamespace(pressed=False)

    def note(signum: int, frame: object) -> None:
        if interrupt.pressed:
            raise KeyboardInterrupt
        interrupt.pressed = True

    if threading.current_thread() is not threading.main_thread():
        yield interrupt
        return
    previous = signal.signal(signal.SIGINT, note)
    try:
        yield interrupt
    finally:
        signal.signal(signal.SIGINT, previous)
