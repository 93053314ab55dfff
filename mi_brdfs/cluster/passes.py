"""Network rendering: the passes of a picture, computed by workers."""

from __future__ import annotations

import uuid
from collections.abc import Generator, Iterable
from typing import Any

import mitsuba as mi
import numpy as np

from ..rendering.passes import Passes, PassesError, crop, one_thread, pass_source
from ..rendering.scene_file import SceneFile
from ..variants import is_scalar
from . import ClusterError, Failed, run

_loaded: tuple[str, Any] | None = None
"""The scene of the run that this worker takes part in, by the run's id."""


def passes_on(
    file: SceneFile, *, window: list[int] | None = None, workers: int | None = None, scheduler: str | None = None
) -> Passes:
    """Return the argument ``passes`` of :func:`.rendering.passes.render` with which workers render a scene file.

    Workers of a scheduler get the files; those of this machine read them where they are. Each loads the scene once.
    ``window`` is that of :func:`.rendering.passes.crop`; see :func:`mi_brdfs.cluster.run` for the other arguments.
    """

    def passes(scene: mi.Scene, sensor: int, jobs: Iterable[tuple[int, int]]) -> Generator[Any, None, None]:
        film, integrator = scene.sensors()[sensor].film(), scene.integrator()
        film.prepare(integrator.aov_names())  # the film of a scene that is not rendered has no channels yet
        shared = (uuid.uuid4().hex, file.copied() if scheduler else file, sensor, window)
        tasks = ((str(index), (index == 0, *job)) for index, job in enumerate(jobs))
        early, following = {}, 0
        try:
            for key, result in run(pass_sums, tasks, workers=workers, scheduler=scheduler, shared=shared):
                if isinstance(result, Failed):
                    raise RuntimeError(result.error)
                early[int(key)] = result
                while following in early:  # floats are added in the order of the passes
                    yield _as_drjit(early.pop(following))
                    following += 1
        except ClusterError as error:
            raise PassesError(str(error)) from error

    return passes


def pass_sums(
    run: str, file: SceneFile, sensor: int, window: list[int] | None, first: bool, seed: int, spp: int
) -> np.ndarray:
    """Return the sums of a pass, in a worker, as one thread computes them after the passes before it.

    A scene completes textures and tables at their first use. This splits the kernels of that pass, and other kernels
    round differently: so the first pass of a picture is computed with a new scene, and no other is.
    """
    global _loaded
    is_new = first or _loaded is None or _loaded[0] != run
    if is_new:
        _loaded = None  # two scenes may be too much
        _loaded = run, file.load()
        if window:
            crop(_loaded[1].sensors()[sensor], *window)
    assert _loaded
    scene = _loaded[1]
    source, camera = pass_source(scene.integrator()), scene.sensors()[sensor]
    with one_thread():
        if is_new and not first:
            np.array(source.sums(scene, camera, seed=seed, spp=spp))
        return np.array(source.sums(scene, camera, seed=seed, spp=spp))


def _as_drjit(sums: np.ndarray) -> Any:
    """Return sums in the type that they had, as these are added: a film's content, or colours of pixels."""
    return mi.TensorXf(sums) if sums.ndim == 3 else sums if is_scalar() else mi.Vector4f(sums)
