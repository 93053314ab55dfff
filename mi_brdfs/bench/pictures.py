"""Pictures of BSDFs in turn, with their render times, and the first of a process: tracing and compiling."""

from __future__ import annotations

import importlib
import json
import os
import subprocess
import sys
from collections.abc import Callable, Sequence
from math import asin, atan, degrees, radians, sin, sqrt, tan
from tempfile import TemporaryDirectory
from time import perf_counter
from typing import Any, NamedTuple

import drjit as dr
import mitsuba as mi
import numpy as np

from ..mitsuba import guests
from ..probe.arrays import Array, luminance
from ..probe.sources import BSDFSource
from .statistics import in_turn

SIZE = 128
"""The width and height of pictures."""
FIRST_SIZE = 16
"""That of the first of a process."""
SPP = 64
ROUNDS = 15
"""Pictures of each BSDF."""
DISTANCE = 4
"""The distance of the camera from the centre of a sphere of radius 1."""
LIMB = 85
"""The angle, in degrees, at which the sphere is seen in the corners of the picture. The sphere fills the picture, so
that all noise comes from the BSDF and none from the sphere's edge."""
PATH = {"type": "path", "max_depth": 6}

Scene = dict[str, Any]


class Pictures(NamedTuple):
    """Pictures of some BSDFs, one for each seed."""

    seconds: Array
    """The render times, of shape (BSDFs, seeds)."""
    luminance: Array
    """That of the pixels, of shape (BSDFs, seeds, pixels)."""


def sphere(bsdf: Any, size: int, integrator: Scene = PATH) -> Scene:
    """Return a sphere under a constant environment."""
    corner = asin(sin(radians(LIMB)) / DISTANCE)
    return {
        "type": "scene",
        "integrator": integrator,
        "sensor": {
            "type": "perspective",
            "fov": 2 * degrees(atan(tan(corner) / sqrt(2))),
            "to_world": mi.ScalarTransform4f().look_at([0, 0, DISTANCE], [0, 0, 0], [0, 1, 0]),
            "film": {"type": "hdrfilm", "width": size, "height": size, "rfilter": {"type": "box"}},
        },
        "sphere": {"type": "sphere", "bsdf": bsdf},
        "sky": {"type": "constant"},
    }


def render_in_turn(scenes: Sequence[Callable[[], Scene]]) -> Pictures:
    """Render each scene with each seed, one loaded at a time: a kernel contains the code of every live BSDF."""
    seconds = np.zeros((len(scenes), ROUNDS))
    pictures: list[list[Array]] = [[] for _ in scenes]
    for scene in scenes:
        render(scene(), 0)  # compiles
    for k, seed in in_turn(len(scenes), ROUNDS):
        seconds[k, seed], picture = render(scenes[k](), seed)
        pictures[k].append(luminance(picture.reshape(-1, picture.shape[-1])))
    return Pictures(seconds, np.array(pictures))


def render(scene: Scene, seed: int, spp: int = SPP) -> tuple[float, Array]:
    """Return ``(seconds, picture)`` of a scene, loaded before and discarded afterwards."""
    loaded = mi.load_dict(scene)
    dr.sync_thread()
    start = perf_counter()
    picture = mi.render(loaded, spp=spp, seed=seed)
    dr.eval(picture)
    dr.sync_thread()
    return perf_counter() - start, np.array(picture, np.float64)


# --- First pictures --------------------------------------------------------------------------------------------------


def bsdf_of(given: Any) -> Any:
    """Return the dict or the BSDF of a source, which another process gets as a list, and a dict as it is."""
    return given if isinstance(given, dict) else BSDFSource(*given).load()


def first_pictures(subjects: Sequence[list[Any]], rounds: int) -> Array:
    """Return the seconds to the first picture of each subject, some BSDFs each, in new processes without cached
    kernels; shape (subjects, rounds)."""
    seconds = np.zeros((len(subjects), rounds))
    for k, each in in_turn(len(subjects), rounds):
        seconds[k, each] = in_new_process(first_picture, subjects[k])
    return seconds


def first_picture(bsdfs: list[Any]) -> float:
    """Return the seconds from loading a scene with a sphere for each of some BSDFs to its small picture, traced and
    compiled, in a process that has rendered nothing."""
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
        start = perf_counter()
        seen, *others = map(bsdf_of, bsdfs)
        beside = {
            f"sphere_{k}": {"type": "sphere", "center": [3 * k, 0, 0], "bsdf": bsdf} for k, bsdf in enumerate(others, 1)
        }
        dr.eval(mi.render(mi.load_dict(sphere(seen, FIRST_SIZE) | beside), spp=1))
        dr.sync_thread()
        seconds = perf_counter() - start
        kernels = dr.kernel_history([dr.KernelType.JIT])
    if any(kernel["cache_disk"] for kernel in kernels):
        raise RuntimeError("kernels compiled by earlier runs were found")
    return seconds


def in_new_process(function: Callable, *arguments: Any) -> Any:
    """Return a function's result from a process that knows the same models (:func:`mi_brdfs.mitsuba.guests.source`),
    but no kernels of earlier runs: these are cached in the user's home folder, so the process gets an empty one.
    Arguments and result must be of JSON's types."""
    call = json.dumps([guests.sources(), mi.variant(), function.__module__, function.__name__, arguments])
    with TemporaryDirectory() as folder:
        # The path names packages in the home folder, which would not be found.
        env = os.environ | {"HOME": folder, "TMP": folder, "PYTHONPATH": os.pathsep.join(sys.path)}
        done = subprocess.run(
            [sys.executable, "-c", f"from {__name__} import answer; answer()", call],
            capture_output=True, text=True, env=env,
        )  # fmt: skip
    if done.returncode:
        raise RuntimeError(f"{function.__name__} failed in its process:\n{done.stderr.strip()}")
    return json.loads(done.stdout.splitlines()[-1])


def answer() -> None:
    """Carry out the call given as the argument of the new process."""
    sources, variant, module, name, arguments = json.loads(sys.argv[1])
    mi.set_variant(variant)
    for source in sources:
        guests.import_models(source)
    print(json.dumps(getattr(importlib.import_module(module), name)(*arguments)))
