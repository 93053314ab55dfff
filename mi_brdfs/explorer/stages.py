"""Pictures of a subject that get better with each pass, on a stage of the preview or in the user's scene."""

from __future__ import annotations

import time
from collections import OrderedDict
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import chain, count
from pathlib import Path
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from ..loading import checked_mesh
from ..mitsuba.errors import one_line
from ..names import linked
from ..preview import STAGES, preview_scene
from ..preview.body import RADIUS
from ..probe.bsdf import contained, shapes_of
from ..probe.sources import BSDFSource
from ..rendering.output import denoiser, tonemap
from ..rendering.passes import pass_source
from ..rendering.scene_file import SceneFile, on_both_sides
from ..srgb import encoded_8bit
from .state import INCIDENCE, SHAPES, Bsdf, State

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
IRRADIANCE = 3.0
"""Of the light from ωi, on what faces it."""
MARK, TWOSIDED = "mi_brdfs shown", "TwoSidedBRDF"
LIGHTS, MESHES = (".exr", ".hdr"), (".ply", ".obj")
"""The endings of uploads that are environments, and of files that are meshes."""


@dataclass(frozen=True)
class Pose:
    """What moves within a scene, in degrees."""

    turn: float = 0.0
    yaw: float = 0.0
    pitch: float = 0.0
    incidence: tuple[float, float] = (0.0, 0.0)
    """From where the light comes that follows ωi: θ and φ."""


@dataclass(frozen=True)
class Setting:
    """The scene of a picture, besides the BSDF."""

    stage: str
    shape: str
    size: int
    pose: Pose = Pose()

    @classmethod
    def of(cls, state: State) -> Setting:
        """Return the setting of a state; the user's scene has its own light."""
        size = -(-state.size // STEP) * STEP if state.size > QUICK else state.size
        stage = "" if state.shape == "scene" else state.stage
        incidence = (state.theta, state.phi) if stage == INCIDENCE else (0.0, 0.0)
        return cls(stage, state.shape, size, Pose(state.turn, state.yaw, state.pitch, incidence))

    def quick(self) -> Setting:
        """Return it for the first pass after an edit, of few pixels."""
        return replace(self, size=min(self.size, QUICK))

    def scene(self) -> Setting:
        """Return it for all poses."""
        return replace(self, pose=Pose())


@dataclass
class UserScene:
    """What the command line named, and what was dropped in: a scene, which of its BSDFs is replaced, and environment
    maps and meshes by name."""

    scene: Path | None = None
    material: str | None = None
    has_sky: bool = False
    """Whether the scene has an environment to be turned; known once it is loaded."""
    lights: dict[str, Path] = field(default_factory=dict)
    meshes: dict[str, Path] = field(default_factory=dict)

    def add(self, path: Path, name: str) -> tuple[str, str]:
        """Take a mesh, or else an environment map, and return what it is, ``shape`` or ``stage``, and the word for it:
        its name, with a number if that is taken."""
        kind, files = ("shape", self.meshes) if path.suffix.lower() in MESHES else ("stage", self.lights)
        taken = {*self.lights, *self.meshes, *STAGES, *SHAPES, INCIDENCE}
        word = next(it for it in chain([name], (f"{name} {k}" for k in count(2))) if it not in taken)
        files[word] = path
        return kind, word


@dataclass
class Stage:
    """A loaded scene, in which the BSDF of some shapes is replaced for the time of a pass."""

    scene: mi.Scene
    shapes: list[mi.Shape]
    light: mi.Emitter | None = None
    """The light that follows ωi."""
    usual: list[mi.BSDF] = field(init=False)
    pose: Pose | None = field(default=None, init=False)

    def __post_init__(self) -> None:
        self.usual = [shape.bsdf() for shape in self.shapes]
        skies = [it for it in self.scene.emitters() if it.class_name() == "EnvironmentMapEmitter"]
        self.skies = [(it, _matrix(it)) for it in map(mi.traverse, skies)]
        sensor = mi.traverse(self.scene.sensors()[0])
        self._sensor = (sensor, _matrix(sensor)) if "to_world" in sensor else None

    @cached_property
    def passes(self) -> Any:
        return pass_source(self.scene.integrator())

    @contextmanager
    def showing(self, bsdf: mi.BSDF, pose: Pose) -> Iterator[None]:
        """Give the shapes a BSDF, and camera and light their places."""
        if pose != self.pose:
            self._take(pose)
        for shape, usual in zip(self.shapes, self.usual, strict=True):
            shape.set_bsdf(on_both_sides(bsdf) if usual.class_name() == TWOSIDED else bsdf)
        try:
            yield
        finally:
            for shape, usual in zip(self.shapes, self.usual, strict=True):
                shape.set_bsdf(usual)

    def _take(self, pose: Pose) -> None:
        """Put camera and light into their places. The camera goes around where it looks at, at the distance of the
        shapes; up is the axis of the world that is nearest to its own."""
        up = np.array([0.0, 0.0, 1.0])
        if self._sensor:
            sensor, usual = self._sensor
            right, own_up, ahead, place = usual[:3].T
            axis = abs(own_up).argmax()
            up = np.eye(3)[axis] * np.sign(own_up[axis])
            centre = np.mean([it.bbox().center() for it in self.shapes], axis=0)
            pivot = place + ahead * ((centre - place) @ ahead)
            around = mi.ScalarTransform4f().translate(pivot).rotate(up, pose.yaw).rotate(right, pose.pitch)
            _put(sensor, around.translate(-pivot), usual)
        for sky, usual in self.skies:
            _put(sky, mi.ScalarTransform4f().rotate(up, pose.turn), usual)
        if self.light is not None:
            theta, phi = pose.incidence
            # The usual camera looks along y, and that of lobes against it.
            turned = mi.ScalarTransform4f().rotate([0, 0, 1], phi + 180).rotate([0, 1, 0], theta + 180)
            _put(mi.traverse(self.light), turned, np.eye(4))
        self.pose = pose


def _matrix(params: Any) -> np.ndarray:
    return np.array(params["to_world"].matrix, np.float64).reshape(4, 4)


def _put(params: Any, moved: mi.ScalarTransform4f, usual: np.ndarray) -> None:
    params["to_world"] = mi.Transform4f(mi.Matrix4f((np.array(moved.matrix) @ usual).tolist()))
    params.update()


def load(setting: Setting, user: UserScene) -> Stage:
    """Load the scene of a setting.

    Raises:
        ValueError: if the user's scene has no such material or shape, or a mesh has no size.
        RuntimeError: what Mitsuba says of a file that it cannot read.
    """
    if setting.shape == "scene":
        return _user_stage(setting, user)
    environment = user.lights.get(setting.stage)
    lights = "point" if setting.stage == INCIDENCE else "studio" if environment else setting.stage
    scene = preview_scene(mi.load_dict({"type": "diffuse"}), lights)
    if environment:
        scene["studio"]["bitmap"] = _environment(setting.stage, environment)
    if setting.stage == INCIDENCE:
        del scene["sky"]
        scene["light"] = {"type": "directional", "irradiance": IRRADIANCE}
    scene["sensor"]["film"] |= {"width": setting.size, "height": setting.size, "rfilter": {"type": "box"}}
    if setting.shape != "body":
        mesh = user.meshes.get(setting.shape)
        shape = {"type": mesh.suffix[1:].lower(), "filename": linked(str(mesh))} if mesh else {"type": "sphere"}
        to_world = _placed(setting.shape, checked_mesh(shape))
        scene["body"] = {**shape, "to_world": to_world, "bsdf": scene["body"].bsdf()}
    loaded = mi.load_dict(scene)
    bodies = [shape for shape in loaded.shapes() if shape.id() == "body"]
    return Stage(loaded, bodies, loaded.emitters()[0] if setting.stage == INCIDENCE else None)


def _environment(name: str, path: Path) -> mi.Bitmap:
    """Return the pixels of an environment map. Raise a ValueError where Mitsuba would end the process or the picture be
    without light."""
    try:
        bitmap = mi.Bitmap(linked(str(path)))
        pixels = np.array(bitmap)
    except MemoryError:
        raise ValueError(f"{name}: there is no memory for so many pixels; make it smaller.") from None
    except RuntimeError as error:
        raise ValueError(f"{name}: it is no picture that Mitsuba can read: {one_line(error)}") from None
    if not (pixels.size and np.isfinite(pixels).all() and pixels.max() > 0):
        raise ValueError(f"{name}: it has no light, or pixels that are not finite; write those as numbers.")
    return bitmap


def _placed(name: str, shape: mi.Shape) -> mi.ScalarTransform4f:
    """Return what puts a shape, whose y is up, on the floor, as large as the ball. Without size, raise a ValueError."""
    box, reach = shape.bbox(), 1.0
    if isinstance(shape, mi.Mesh):
        vertices = np.array(shape.vertex_positions_buffer()).reshape(-1, 3) - np.array(box.center())
        reach = float(np.linalg.norm(vertices, axis=1).max(initial=0))
    if not (np.isfinite(reach) and reach > 0):
        raise ValueError(f"{name} has no triangles.")
    scale = RADIUS / reach
    height = scale * float(box.extents().y) / 2
    to_world = mi.ScalarTransform4f().translate([0, 0, height]).rotate([1, 0, 0], 90).scale(scale)
    return to_world.translate(-np.array(box.center()))


def _within(bsdf: mi.BSDF) -> list[mi.BSDF]:
    """Return the BSDFs in ``twosided``, or a BSDF with those in it."""
    return contained(bsdf) if bsdf.class_name() == TWOSIDED else [bsdf, *contained(bsdf)]


def _user_stage(setting: Setting, user: UserScene) -> Stage:
    # Mark where ``render --replace`` would put the material.
    mark = {user.material: BSDFSource(MARK, MARK, f'<bsdf type="lambert" id="{MARK}"/>')} if user.material else {}
    # A box filter is what the denoiser expects.
    scene = SceneFile(str(user.scene), box_filter=True, keeps_ids=True, replaced=mark).load()
    if not isinstance(scene, mi.Scene) or not scene.sensors() or not scene.integrator():
        raise ValueError(f"{user.scene} is not a scene with a sensor and an integrator.")
    shapes = [it for it in shapes_of(scene) if it.bsdf().class_name() != "Null"]
    if mark:
        inside = {it: [bsdf.id() for bsdf in _within(it.bsdf())] for it in shapes}
        chosen = [it for it, ids in inside.items() if MARK in ids]
        if any(set(inside[it]) != {MARK} for it in chosen):
            raise ValueError(f"{user.scene}: {user.material} is also part of other materials; name one of these.")
    else:
        shapes = [it for it in shapes if not it.is_emitter()]
        chosen = [it for it in shapes if it.bsdf() is shapes[0].bsdf()]
    if not chosen:
        raise ValueError(f"{user.scene} has no material to be replaced.")
    film = scene.sensors()[0].film()
    width, height = (int(it) for it in film.size())
    scale = setting.size / max(width, height)
    size = [max(1, round(width * scale)), max(1, round(height * scale))]
    params = mi.traverse(scene.sensors()[0])
    params["film.size"] = params["film.crop_size"] = size
    params["film.crop_offset"] = [0, 0]
    params.update()
    stage = Stage(scene, chosen)
    user.has_sky = bool(stage.skies)
    return stage


@dataclass
class Progress:
    """A picture on its way."""

    stage: Stage
    pose: Pose = Pose()
    sums: Any = 0
    spp: int = 0
    next_pass: int = 1
    denoised: int = 0
    """The samples per pixel when it was last denoised,"""
    clean: np.ndarray | None = None
    """and what it was then."""

    @property
    def finished(self) -> bool:
        return self.spp >= MOST

    def advance(self, bsdf: mi.BSDF) -> None:
        """Render a pass, of about as long as an edit may wait."""
        start, sensor = time.perf_counter(), self.stage.scene.sensors()[0]
        with self.stage.showing(bsdf, self.pose):
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

    def denoise(self, function: Callable[[np.ndarray], np.ndarray]) -> None:
        """Show the picture denoised from here on, as it is now."""
        self.clean, self.denoised = function(self.pixels()), self.spp

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


def shown(progress: Progress, exposure: float) -> tuple[bytes, dict[str, Any]]:
    """Return the payload of a picture's frame, as it was when it was last denoised if it was, and its header."""
    linear = progress.pixels() if progress.clean is None else progress.clean
    height, width = linear.shape[:2]
    spp = progress.denoised or progress.spp
    return rgba(linear, exposure), {"width": width, "height": height, "spp": spp, "denoised": bool(progress.denoised)}


class Stages:
    """The scenes that stay loaded for all sessions, what denoises their pictures, and which kernels there are."""

    def __init__(self, user: UserScene) -> None:
        self.user = user
        self.denoise = denoiser()
        """A function of rgb, or None without the extra that brings it."""
        self._loaded: OrderedDict[Setting, Stage] = OrderedDict()
        self._known: set[Any] = set()

    @property
    def names(self) -> list[str]:
        """The words for the light."""
        return [*STAGES, INCIDENCE, *self.user.lights]

    @property
    def turned(self) -> list[str]:
        """The words for light that can be turned, and for the user's scene if that of it can."""
        return ["studio", *self.user.lights, *(["scene"] if self.user.has_sky else [])]

    @property
    def shapes(self) -> list[str]:
        """The words for what is lit."""
        return ["body", "sphere", *self.user.meshes, *(["scene"] if self.user.scene else [])]

    def stage(self, setting: Setting) -> Stage:
        """Return the scene of a setting, in whatever pose; raise as :func:`load` does."""
        setting = setting.scene()
        if setting not in self._loaded:
            self._loaded[setting] = load(setting, self.user)
            while len(self._loaded) > KEPT:
                self._loaded.popitem(last=False)
        self._loaded.move_to_end(setting)
        return self._loaded[setting]

    def add(self, path: Path, name: str) -> dict[str, str]:
        """Take a mesh or an environment map that can be loaded, and return which member of a state it is a word for;
        raise as :func:`load` does."""
        kind, word = self.user.add(path, name)
        try:
            self.stage(Setting("studio", word, QUICK) if kind == "shape" else Setting(word, "body", QUICK))
        except Exception as error:
            del (self.user.meshes if kind == "shape" else self.user.lights)[word]
            # Frames would keep a mesh alive with which no kernel can be compiled.
            raise error.with_traceback(None) from None
        return {kind: word}

    @property
    def material(self) -> str:
        """The id of the user's material that is replaced."""
        return self.stage(Setting("", "scene", QUICK)).usual[0].id()

    def progress(self, setting: Setting) -> Progress:
        """Return a picture that begins."""
        return Progress(self.stage(setting), setting.pose)

    def forget(self) -> None:
        """Say of all kernels that they may have to be compiled."""
        self._known.clear()

    def is_new(self, bsdf: Bsdf, purpose: str | Setting) -> bool:
        """Return whether kernels for a BSDF of this structure may have to be compiled, for a view or a picture."""
        words = tuple(sorted((name, it if isinstance(it, (str, bool)) else None) for name, it in bsdf.items()))
        purpose = purpose.scene() if isinstance(purpose, Setting) else purpose
        # Dr.Jit compiles a picture's kernel for the emitters and BSDFs of all scenes that are loaded.
        scenes = frozenset({*self._loaded, purpose}) if isinstance(purpose, Setting) else None
        known = (words, purpose, scenes) in self._known
        self._known.add((words, purpose, scenes))
        return not known
