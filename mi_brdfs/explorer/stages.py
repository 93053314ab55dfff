"""Pictures of a subject that get better with each pass, on a stage of the preview or in the user's scene."""

from __future__ import annotations

import time
from collections import OrderedDict
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from .. import legacy
from ..names import linked
from ..parameters.messages import listed
from ..preview import STAGES, preview_scene
from ..preview.body import CENTRE, RADIUS
from ..rendering.output import tonemap
from ..rendering.passes import pass_source
from ..srgb import encoded_8bit
from .state import Bsdf, State

MOST = 256
"""Samples per pixel, after which a picture is finished."""
LONGEST = 0.08
"""The longest that a pass should take, in seconds: edits wait for its end."""
QUICK = 256
"""The most pixels of a side of the first pass, which shows an edit at once."""
KEPT = 4
"""Scenes that stay loaded."""
STEP = 128
"""Larger sides are multiples of it: scenes of a few sizes stay loaded."""
PEAK = 8.0
"""The radiance that is shown as white, the same in all pictures."""
ENVIRONMENT = "environment"
"""The stage whose light is the user's."""


@dataclass(frozen=True)
class Setting:
    """The scene of a picture, besides the BSDF."""

    stage: str
    shape: str
    size: int

    @classmethod
    def of(cls, state: State) -> Setting:
        """Return the setting of a state; the user's scene has its own light."""
        size = -(-state.size // STEP) * STEP if state.size > QUICK else state.size
        return cls("" if state.shape == "scene" else state.stage, state.shape, size)

    def quick(self) -> Setting:
        """Return it for the first pass after an edit, of few pixels."""
        return replace(self, size=min(self.size, QUICK))


@dataclass
class UserScene:
    """What the command line named: a scene, which of its BSDFs is replaced, and an environment map."""

    scene: Path | None = None
    material: str | None = None
    environment: Path | None = None


@dataclass
class Stage:
    """A loaded scene, in which the BSDF of some shapes is replaced for the time of a pass."""

    scene: mi.Scene
    shapes: list[mi.Shape]
    usual: list[mi.BSDF] = field(init=False)

    def __post_init__(self) -> None:
        self.usual = [shape.bsdf() for shape in self.shapes]

    @cached_property
    def passes(self) -> Any:
        return pass_source(self.scene.integrator())

    @contextmanager
    def showing(self, bsdf: mi.BSDF) -> Iterator[None]:
        """Give the shapes a BSDF."""
        for shape in self.shapes:
            shape.set_bsdf(bsdf)
        try:
            yield
        finally:
            for shape, usual in zip(self.shapes, self.usual, strict=True):
                shape.set_bsdf(usual)


def load(setting: Setting, user: UserScene) -> Stage:
    """Load the scene of a setting.

    Raises:
        ValueError: if the user's scene has no such material or shape.
    """
    if setting.shape == "scene":
        return _user_stage(setting, user)
    own = setting.stage == ENVIRONMENT
    scene = preview_scene(mi.load_dict({"type": "diffuse"}), "studio" if own else setting.stage)
    if own:
        scene["studio"] |= {"filename": linked(str(user.environment))}
        del scene["studio"]["bitmap"]
    scene["sensor"]["film"] |= {"width": setting.size, "height": setting.size, "rfilter": {"type": "box"}}
    if setting.shape == "sphere":
        bsdf = scene["body"].bsdf()
        to_world = mi.ScalarTransform4f().translate([0, 0, CENTRE]).scale(RADIUS)
        scene["body"] = {"type": "sphere", "to_world": to_world, "bsdf": bsdf}
    loaded = mi.load_dict(scene)
    return Stage(loaded, [shape for shape in loaded.shapes() if shape.id() == "body"])


def _user_stage(setting: Setting, user: UserScene) -> Stage:
    scene = legacy.load(Path(str(user.scene)), {})
    if not isinstance(scene, mi.Scene) or not scene.sensors() or not scene.integrator():
        raise ValueError(f"{user.scene} is not a scene with a sensor and an integrator.")
    shapes = [it for it in scene.shapes() if it.bsdf() is not None and not it.is_emitter()]
    materials, names = ([it.id() for it in objects] for objects in ([it.bsdf() for it in shapes], shapes))
    wanted = user.material or (materials[0] if shapes else None)
    chosen = [it for it in shapes if it.bsdf().id() == wanted] or [it for it in shapes if it.id() == wanted]
    if not chosen:
        told = [f"{kind} {listed(dict.fromkeys(filter(None, ids)), 'and')}"
                for kind, ids in (("materials", materials), ("shapes", names)) if any(ids)]  # fmt: skip
        raise ValueError(f"{user.scene} has no material or shape {wanted}; it has {', and '.join(told) or 'neither'}.")
    film = scene.sensors()[0].film()
    width, height = (int(it) for it in film.size())
    scale = setting.size / max(width, height)
    size = [max(1, round(width * scale)), max(1, round(height * scale))]
    params = mi.traverse(scene.sensors()[0])
    params["film.size"] = params["film.crop_size"] = size
    params["film.crop_offset"] = [0, 0]
    params.update()
    return Stage(scene, chosen)


@dataclass
class Progress:
    """A picture on its way."""

    stage: Stage
    sums: Any = 0
    spp: int = 0
    next_pass: int = 1
    denoised: int = 0
    """The samples per pixel when it was last denoised."""

    @property
    def finished(self) -> bool:
        return self.spp >= MOST

    def advance(self, bsdf: mi.BSDF) -> None:
        """Render a pass, of about as long as an edit may wait."""
        start, sensor = time.perf_counter(), self.stage.scene.sensors()[0]
        with self.stage.showing(bsdf):
            passed = self.stage.passes.sums(self.stage.scene, sensor, seed=self.spp, spp=self.next_pass)
            self.sums = self.sums + passed
            dr.eval(self.sums)
            dr.sync_thread()
        self.spp += self.next_pass
        seconds = time.perf_counter() - start
        if seconds < LONGEST / 2:
            self.next_pass = min(2 * self.next_pass, 16)
        elif seconds > LONGEST and self.next_pass > 1:
            self.next_pass //= 2

    def bitmap(self) -> mi.Bitmap:
        """Return the picture as it is, with linear values."""
        film = self.stage.scene.sensors()[0].film()
        self.stage.passes.put(film, self.sums, self.spp)
        return film.bitmap()

    def pixels(self) -> np.ndarray:
        """Return linear rgb, shape (height, width, 3)."""
        bitmap = self.bitmap().convert(mi.Bitmap.PixelFormat.RGB, mi.Struct.Type.Float32, False)
        return np.array(bitmap)


def rgba(linear: np.ndarray, exposure: float) -> bytes:
    """Return RGBA8, sRGB-encoded, in rows from the top. Bright values are compressed as :func:`tonemap` does, with the
    same peak for all pictures, so that they can be compared."""
    rgb = encoded_8bit(tonemap(linear * np.float32(2.0**exposure), PEAK))
    return np.concatenate([rgb, np.full_like(rgb[..., :1], 255)], axis=-1).tobytes()


def shown(
    progress: Progress, exposure: float, denoise: Callable[[np.ndarray], np.ndarray] | None
) -> tuple[bytes, dict[str, Any]]:
    """Return the payload of a picture's frame, denoised if there is a function for it, and what its header says of
    it."""
    linear = progress.pixels()
    height, width = linear.shape[:2]
    header = {"width": width, "height": height, "spp": progress.spp, "denoised": denoise is not None}
    return rgba(denoise(linear) if denoise else linear, exposure), header


class Stages:
    """The scenes that stay loaded for all sessions, what denoises their pictures, and which kernels there are."""

    def __init__(self, user: UserScene) -> None:
        self.user = user
        self.denoise = _denoiser()
        """A function of rgb, or None without the extra that brings it."""
        self._loaded: OrderedDict[Setting, Stage] = OrderedDict()
        self._known: set[Any] = set()

    @property
    def names(self) -> list[str]:
        """The words for the light."""
        return [*STAGES, *([ENVIRONMENT] if self.user.environment else [])]

    @property
    def shapes(self) -> list[str]:
        """The words for what is lit."""
        return ["body", "sphere", *(["scene"] if self.user.scene else [])]

    def stage(self, setting: Setting) -> Stage:
        """Return the scene of a setting.

        Raises:
            ValueError: if the user's scene has no such material or shape.
        """
        if setting not in self._loaded:
            self._loaded[setting] = load(setting, self.user)
            while len(self._loaded) > KEPT:
                self._loaded.popitem(last=False)
        self._loaded.move_to_end(setting)
        return self._loaded[setting]

    def forget(self) -> None:
        """Say of all kernels that they may have to be compiled."""
        self._known.clear()

    def is_new(self, bsdf: Bsdf, purpose: str | Setting) -> bool:
        """Return whether kernels for a BSDF of this structure may have to be compiled, for a view or a picture."""
        words = tuple(sorted((name, it if isinstance(it, (str, bool)) else None) for name, it in bsdf.items()))
        # Dr.Jit compiles a picture's kernel for the emitters and BSDFs of all scenes that are loaded.
        scenes = frozenset({*self._loaded, purpose}) if isinstance(purpose, Setting) else None
        known = (words, purpose, scenes) in self._known
        self._known.add((words, purpose, scenes))
        return not known


def _denoiser() -> Callable[[np.ndarray], np.ndarray] | None:
    try:
        import mitsuba_oidn
    except ImportError:
        return None
    return lambda rgb: mitsuba_oidn.denoise(np.ascontiguousarray(rgb), hdr=True)
