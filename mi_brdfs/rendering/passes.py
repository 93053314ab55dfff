"""Progressive rendering of a loaded scene."""

from __future__ import annotations

import itertools
import signal
import threading
import time
import warnings
from collections.abc import Callable, Generator, Iterable, Iterator
from contextlib import closing, contextmanager, nullcontext
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from ..variants import is_scalar
from . import MOST_PIXELS

Passes = Callable[["mi.Scene", int, Iterable[tuple[int, int]]], Generator[Any, None, None]]


class PassesError(RuntimeError):
    """Why what computes passes elsewhere cannot begin or go on."""


@dataclass(frozen=True)
class Picture:
    """The result of ``render``."""

    image: mi.TensorXf
    """The developed image as ``film.develop()`` returns it, in the film's pixel format and with all AOVs."""
    bitmap: mi.Bitmap
    """The same image with channel names, ready to be written as an EXR."""
    spp: int
    """Samples per pixel finished."""
    total: int | None
    """Samples per pixel requested, rounded up as the sampler needs; None if only the time was."""
    interrupted: bool = False
    """Whether Ctrl-C ended it, or the end of a cluster."""


def render(
    scene: mi.Scene,
    spp: int | None = None,
    seed: int = 0,
    sensor: int = 0,
    on_pass: Callable[[int, int | None], None] = lambda done, total: None,
    seconds: float | None = None,
    passes: Passes | None = None,
) -> Picture:
    """Render ``scene`` in passes of about a second and combine them without bias.

    The passes sum the film's raw data, numerators and filter weights apart; one division at the end develops it. (A
    mean of developed passes would be biased: each is a ratio of two random sums.) An integrator that post-processes the
    mean of a pixel's samples, as ``shading`` does, has methods ``sums`` and ``put`` like those of :class:`FilmPasses`,
    so that its passes add up first.

    ``spp`` defaults to the scene's own number. With ``seconds``, the pass in which they end is the last; then there is
    no limit to the samples unless ``spp`` is given. ``on_pass(done, total)`` is called after each pass. The first
    Ctrl-C lets the running pass end (scalar variants may drop it) and returns the finished passes
    (``picture.interrupted``). A second one, or one before any pass has finished, raises KeyboardInterrupt.

    The result depends on scene, variant, ``spp``, ``seed`` and, in LLVM variants, the number of threads, and on timing
    only as to the number of passes, with ``seconds``: the size of a pass follows from the size of the image, and pass
    ``k`` uses a seed computed from ``seed`` and ``k``. Two runs agree up to the order in which floats are added; with
    one thread (:func:`one_thread`) also in that, and in every bit, in LLVM and scalar variants. Samplers that stratify
    do so within a pass.

    ``passes`` computes the passes elsewhere, as of :func:`mi_brdfs.cluster.passes.passes_on`: called with the scene,
    the sensor's index, and the seed and samples per pixel of each pass, it yields their sums in this order. The result
    is that of one thread, bit for bit, on processors of the same instruction set. If a
    :class:`PassesError` ends it, the finished passes are returned, with a warning.
    """
    camera = scene.sensors()[sensor]
    film, sampler, integrator = camera.film(), camera.sampler(), scene.integrator()
    source = pass_source(integrator)
    # Mitsuba's own handler cuts a pass of a scalar variant short.
    cut_short = is_scalar() and isinstance(source, FilmPasses) and not passes
    own_count = sampler.sample_count()
    if max(film.crop_size()) > MOST_PIXELS:
        across, down = film.crop_size()
        problem = f"the film has {across} x {down} pixels, more than {MOST_PIXELS} across or down"
        raise ValueError(f"{problem}; give it fewer, or render parts of it (--crop)")

    def here(scene: mi.Scene, sensor: int, jobs: Iterable[tuple[int, int]]) -> Generator[Any, None, None]:
        return (source.sums(scene, camera, seed=seed, spp=count) for seed, count in jobs)

    try:
        particles = isinstance(integrator, mi.AdjointIntegrator)
        threads = 1 if passes else dr.thread_count()
        limit = _samples_per_pass(threads) // _pixel_count(film, particles)
        counts: Iterable[int]
        if seconds is not None and spp is None:
            counts, total = itertools.repeat(_rounded(sampler, _power_of_2(limit))), None
        else:
            counts, total = _pass_sizes(sampler, spp or own_count, limit)
        done, raw, start = 0, 0, time.perf_counter()
        ahead, behind = itertools.tee(counts)
        jobs = ((_pass_seed(seed, index), count) for index, count in enumerate(ahead))
        with ctrl_c() as interrupt, closing((passes or here)(scene, sensor, jobs)) as sums:
            try:
                for passed, count in zip(sums, behind, strict=False):
                    if interrupt.pressed and cut_short:
                        break
                    raw += passed
                    dr.eval(raw)
                    dr.sync_thread()
                    done += count
                    on_pass(done, total)
                    if interrupt.pressed or (seconds is not None and time.perf_counter() - start >= seconds):
                        break
            except PassesError as error:
                if not done:
                    raise
                warnings.warn(str(error), stacklevel=2)
                interrupt.pressed = True
    finally:
        sampler.set_sample_count(own_count)
    if not done:
        raise KeyboardInterrupt
    with one_thread() if passes else nullcontext():  # reconstruction filters add floats, too
        source.put(film, raw, done)
        bitmap = film.bitmap()
    return Picture(film.develop(), bitmap, done, total, interrupt.pressed and done != total)


def pass_source(integrator: mi.Integrator) -> Any:
    """Return what has the methods ``sums`` and ``put`` for an integrator's passes."""
    return integrator if hasattr(integrator, "sums") else FilmPasses(integrator)


@contextmanager
def one_thread() -> Iterator[None]:
    """Compute with one thread of Dr.Jit. Several add to a pixel in the order in which they get there, and float sums
    depend on it; the sums of one are the same each time.

    Do not load scenes in it: Mitsuba decodes bitmaps in another thread, and would wait for it forever.
    """
    before = dr.thread_count()
    dr.set_thread_count(1)
    try:
        yield
    finally:
        dr.set_thread_count(before)


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


def crop(sensor: mi.Sensor, x: int, y: int, width: int, height: int) -> None:
    """Let a sensor take only the part of its picture that is ``width`` x ``height`` pixels from (x, y) on, counted from
    the left and the top.

    Raises:
        ValueError: if that is not within the picture.
    """
    across, down = sensor.film().size()
    if min(x, y) < 0 or min(width, height) < 1 or x + width > across or y + height > down:
        raise ValueError(f"it is not within the picture, which has {across} x {down} pixels")
    parameters = mi.traverse(sensor)
    parameters["film.crop_offset"], parameters["film.crop_size"] = [x, y], [width, height]
    parameters.update()


def _samples_per_pass(threads: int) -> int:
    """Return about a second's worth on an ordinary scene: fixed numbers, so that results do not depend on timing."""
    if is_scalar():
        return 1 << 14
    if mi.variant().startswith("llvm"):
        return (1 << 20) * threads
    return 1 << 24


def _pixel_count(film: mi.Film, particles: bool) -> int:
    if particles:  # one particle per pixel of the uncropped film
        return int(np.prod(film.size()))
    border = 2 * film.rfilter().border_size() if film.sample_border() else 0
    return int(np.prod(np.array(film.crop_size()) + border))


def _pass_sizes(sampler: mi.Sampler, spp: int, limit: int) -> tuple[Iterable[int], int]:
    """Return the samples of each pass, powers of two up to ``limit`` and a rest, as rounded, and their sum."""
    full = _rounded(sampler, min(spp, _power_of_2(limit)))
    count, rest = divmod(spp, full)
    last = [_rounded(sampler, rest)] if rest else []
    return itertools.chain(itertools.repeat(full, count), last), count * full + sum(last)


def _power_of_2(limit: int) -> int:
    """Return the largest power of two that is no larger."""
    return 1 << max(limit, 1).bit_length() - 1


def _rounded(sampler: mi.Sampler, count: int) -> int:
    sampler.set_sample_count(count)
    return sampler.sample_count()


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
