"""From pictures of a scene to the parameters of its materials: :func:`images`."""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from ..mitsuba.errors import one_line
from ..parameters import PerLobe, Quantity, Rotation
from ..parameters.messages import listed, meant
from ..probe.arrays import Array
from ..ranges import declared
from .noisy import descend, finish, refine_textures
from .observations import FitError
from .rendered import Rendered, Slot, View
from .unknowns import unknown_of

Picture = Any
"""A file, a bitmap, or an array of linear values, shape (height, width, channels)."""
SAMPLES = 1 << 18
"""Samples of a rendering of all pictures, unless there are to be more."""
COEFFICIENT = 1e9
"""Above it, a depth stands for none."""


@dataclass(frozen=True)
class ImageFit:
    """Parameters that were found from pictures."""

    values: dict[str, Any]
    """By their keys in ``mi.traverse(scene)``: a number, a list of a colour's channels, or the array of a bitmap, of
    shape (height, width, channels)."""
    sigma: dict[str, Any]
    """The standard deviations of numbers and channels, as far as noise of the pictures and of the last renderings goes,
    and for bitmaps that are right up to a common shift of their texels: where texels can make up for a number, it is
    known less well. On films of few pixels they are too small where the film's filter shares noise among pixels, as the
    Gaussian one does and a box does not. None at the end of a range, where the pictures tell nothing, and for
    bitmaps."""
    bsdfs: dict[str, dict[str, Any]]
    """Their materials, by path, as plugin dicts for ``mi.load_dict`` with the scene's own textures."""
    bounds: list[str]
    """Numbers that ended at an end of their range."""
    losses: list[float]
    """The mean squared relative difference before each step, and at last after them: without the noise of the
    renderings, but with that of the pictures."""
    converged: bool
    """Whether the steps of numbers and colours, and of bitmaps as a whole, got short or gained no more."""

    def update(self, scene: mi.Scene) -> None:
        """Give the values to another scene that has parameters with these keys."""
        params = mi.traverse(scene)
        for key, value in self.values.items():
            if key not in params:
                raise FitError(f"The scene has no parameter {key}.")
            kind = type(params[key])
            params[key] = kind(value) if np.ndim(value) != 1 else kind([float(number) for number in value])
        params.update()

    def to_dict(self) -> dict[str, Any]:
        """Return it as what JSON can hold: all but the plugin dicts."""
        return {
            "values": {k: v.tolist() if isinstance(v, np.ndarray) else v for k, v in self.values.items()},
            "sigma": self.sigma,
            "bounds": self.bounds,
            "losses": self.losses,
            "converged": self.converged,
        }


def images(
    scene: mi.Scene,
    pictures: Picture | Sequence[Picture],
    parameters: str | Sequence[str] | None = None,
    *,
    sensors: int | Sequence[int] | None = None,
    iterations: int = 20,
    spp: int | None = None,
    seed: int = 0,
    progress: Callable[[int, int], None] | None = None,
) -> ImageFit:
    """Fit parameters of materials to pictures of a scene whose shapes, lights and sensors are known.

    The scene's own values are the start, a little inwards if they are at an end of a range, and those found are in the
    scene in the end; it is as before if the fit fails or is interrupted. Numbers, colours and bitmaps are sought within
    the ranges that the models declare, on the scales that suit these: roughnesses and exponents on a logarithmic one,
    shares and reflectances on a logit one; mesh attributes stay as they are. A colour that is given as a number stays
    grey, and a parameter that a model leaves out by default is fitted if it is given, also as 0.

    What is minimised is the mean over pixels of ((I − P) / (P̄ + m/10))², for a rendering I and a picture P with the
    local mean P̄ over 5 x 5 pixels and the mean m of all: highlights count no more than what is around. Numbers and
    colours are found by Levenberg–Marquardt steps, whose derivatives are images: radiative backpropagation (``prb``) in
    forward mode. The products of residuals, and of derivatives, are those of renderings with different random numbers,
    so that noise does not bias them. Bitmaps follow first as a whole, and then texel by texel with Adam. A narrow
    highlight that overlaps none in the picture gains nothing by a small turn: start with a wide lobe, or near its
    rotation.

    Args:
        scene: a loaded scene without media, in a variant with derivatives, such as ``llvm_ad_rgb``. It is rendered by
            its integrator if that is a ``prb``, or ``shading`` that does not clamp, and else by ``prb`` of the same
            depth.
        pictures: a picture, or a list of them: files, bitmaps, or arrays of linear values and shape (height, width,
            channels) as ``mi.render`` returns them, of the size of the film. Pixels that are NaN do not count, and
            neither does alpha. Files of integers are taken as sRGB, and their pixels with a clipped channel do not
            count.
        parameters: keys of ``mi.traverse(scene)``, or the beginnings of some up to a dot, as ``"ball.bsdf"`` for all
            parameters of a BSDF, or ``"ball.bsdf.alpha"``. By default, all of the BSDFs of this package.
        sensors: for each picture, the index of the sensor that took it; by default the first ones, in order.
        iterations: the most steps. They end when they gain no more.
        spp: the samples of a pixel in each rendering; by default as many as make 2^18 for all pictures.
        seed: of the renderings' random numbers.
        progress: called with how many of how many steps are done.

    Returns:
        The values by traverse key, their uncertainty, and the materials as plugin dicts.

    Raises:
        FitError: if nothing can be fitted, and why, in a sentence.
    """
    if not isinstance(scene, mi.Scene):
        raise FitError(
            f"A fit needs a loaded scene, not {type(scene).__name__}: mi.load_file or mi.load_dict return it."
        )
    if not dr.is_diff_v(mi.Float) or mi.is_spectral or mi.is_polarized:  # of which prb has no forward derivatives
        raise FitError(f"A fit to pictures needs an rgb variant with derivatives, as llvm_ad_rgb, not {mi.variant()}.")
    if iterations < 1 or (spp is not None and spp < 1):
        raise FitError("A fit needs iterations >= 1 and spp >= 1.")
    if not scene.emitters():
        raise FitError("The scene has no light.")
    params = mi.traverse(scene)
    for key, value in params:
        if dr.grad_enabled(value):  # as an optimiser leaves it
            params[key] = dr.detach(value)
    params.update()
    slots, point = _slots(params, parameters)
    integrator = _integrator(scene)
    views = _views(scene, integrator, pictures, sensors)
    pixels = sum(view.picture.shape[0] * view.picture.shape[1] for view in views)
    rendered = Rendered(scene, integrator, views, slots, spp or max(SAMPLES // pixels, 2), seed)
    before = {slot.key: type(rendered.params[slot.key])(rendered.params[slot.key]) for slot in slots}
    counts = [(view.sensor.sampler(), view.sensor.sampler().sample_count()) for view in views]
    losses, done = list[float](), 0
    textures = any(slot.is_texture for slot in slots)
    total = iterations * (3 if textures else 1) + 1

    def on_step(loss: float | None = None) -> None:
        nonlocal done
        done += 1
        if loss is not None:
            losses.append(loss)
        if progress:
            progress(done, total)

    try:
        point, converged = descend(rendered, point, iterations, on_step)
        if textures:
            point = refine_textures(rendered, point, iterations, on_step)
            point, converged = descend(rendered, point, iterations, on_step)
        point, sigma, loss = finish(rendered, point)
        rendered.put(point)
    except BaseException:
        for key, value in before.items():
            rendered.params[key] = value
        rendered.params.update()
        raise
    finally:
        for sampler, count in counts:
            sampler.set_sample_count(count)
    done = total - 1
    on_step(loss)
    return _found(rendered, point, sigma, losses, converged)


def _found(rendered: Rendered, point: Array, sigma: Array, losses: Sequence[float], converged: bool) -> ImageFit:
    """Return the result at a point, which the scene has."""
    values, sigmas, bounds = dict[str, Any](), dict[str, Any](), list[str]()
    for slot, place in zip(rendered.slots, rendered.places, strict=True):
        own = slot.values(point[place])
        if slot.is_texture:
            values[slot.key], sigmas[slot.key] = own.astype(np.float32), None
            continue
        numbers = [slot.unknown.shown(float(f"{number:.7g}")) for number in own]
        deviations = [
            float(f"{s * slope:.3g}") if np.isfinite(s) else None
            for s, slope in zip(sigma[place], slot.slopes(point[place]), strict=True)
        ]
        single = slot.channels == 1
        values[slot.key] = numbers[0] if single else numbers
        sigmas[slot.key] = deviations[0] if single else deviations
        bounds += [slot.key if single else f"{slot.key}.{channel}" for number, channel in zip(own, "rgb", strict=False)
                   if slot.unknown.at_end(float(number))]  # fmt: skip
    bsdfs = {path: plugin_dict(bsdf) for key, bsdf, path, _ in declared(rendered.params) if key in values}
    return ImageFit(values, sigmas, bsdfs, bounds, list(losses), converged)


def plugin_dict(bsdf: Any) -> dict[str, Any]:
    """Return the dict of a loaded BSDF of a model, with its textures unless they are a number or a colour."""
    model = bsdf.model
    words = dict(model.parameters.chosen)
    for parameter in model.parameters.values():
        if isinstance(parameter, PerLobe):
            words |= {name: word for lobe in parameter.lobes for name, word in lobe.chosen.items()}
    return {"type": model.plugins[0], **words, **{name: _literal(it) for name, it in model.textures.items()}}


def _literal(texture: mi.Texture) -> Any:
    """Return a texture as a plugin dict has it: a number, an rgb colour, or itself."""
    params = mi.traverse(texture)
    value = params.get("value")
    if isinstance(value, mi.Float) and np.size(value) == 1:
        return float(np.ravel(value)[0])
    if isinstance(value, mi.Color3f) and mi.is_rgb:
        return {"type": "rgb", "value": [float(channel[0]) for channel in value]}
    return texture


def _slots(params: mi.SceneParameters, wanted: str | Sequence[str] | None) -> tuple[list[Slot], Array]:
    """Return the parameters that are sought, and the point where they are now."""
    ours = {key: (bsdf.model, name) for key, bsdf, _, name in declared(params)
            if name in bsdf.model.ranges or isinstance(bsdf.model.parameters.get(name), Rotation)}  # fmt: skip
    if not ours:
        raise FitError("The scene has no BSDF of mi_brdfs whose parameters can be fitted.")
    words = list(ours) if wanted is None else [wanted] if isinstance(wanted, str) else list(wanted)
    chosen: dict[str, None] = {}
    for word in words:
        matching = [key for key in ours if key == word or key.startswith(f"{word}.")]
        if not matching:
            if any(key == word or key.startswith(f"{word}.") for key in params.keys()):
                raise FitError(
                    f"{word} is no number, colour or bitmap of a BSDF of mi_brdfs; there are {listed(ours, 'and')}."
                )
            near = meant(word, ours)
            hint = f"did you mean {near}?" if near else f"there are {listed(ours, 'and')}."
            raise FitError(f"The scene has no parameter {word}; {hint}")
        chosen |= dict.fromkeys(matching)
    if not chosen:
        raise FitError("There are no parameters to fit: the list is empty.")
    slots, starts = [], []
    for key in chosen:
        slot, start = _slot(key, *ours[key], params[key])
        slots.append(slot)
        starts.append(start)
    return slots, np.concatenate(starts)


def _slot(key: str, model: Any, name: str, value: Any) -> tuple[Slot, Array]:
    if not isinstance(value, (mi.TensorXf, mi.Float, mi.Color3f)):
        raise FitError(f"{key} has no derivatives: load the bitmap with the parameter format = variant.")
    numbers = np.array(value, np.float64)
    if numbers.ndim < 3:
        numbers = numbers.ravel()
    limits = model.ranges.get(name, (0, 1))
    is_colour, is_rotation = numbers.shape[-1] == 3, name not in model.ranges
    unknown = unknown_of(Quantity(name, limits, None, colour=is_colour, turns=is_rotation))
    on_scale = unknown.start(numbers)
    if numbers.ndim == 3:
        return Slot(key, unknown, type(value), on_scale), np.zeros(numbers.shape[-1])
    return Slot(key, unknown, type(value), np.zeros(len(numbers))), on_scale


def _integrator(scene: mi.Scene) -> mi.Integrator:
    """Return a scene's own integrator if it propagates derivatives forward, or else ``prb`` of the same depth."""
    if any(shape.is_medium_transition() for shape in scene.shapes()):
        raise FitError("Scenes with media cannot be fitted: Mitsuba has no forward derivatives of them.")
    own = scene.integrator()
    local = getattr(own, "physics", None)  # of shading, which reflects once: it has derivatives of any kind
    if local and local.environment_reflection:
        raise FitError(
            "Pictures with environment_reflection cannot be fitted: Dr.Jit has no forward derivatives of them."
        )
    if local and local.clamp:
        raise FitError(
            "What shading clamps cannot be fitted: give it clamp = false, and a picture that is not clamped."
        )
    if local or (isinstance(own, mi.ad.integrators.common.RBIntegrator) and "Vol" not in type(own).__name__):
        return own
    given = {name: int(number) for name, number in re.findall(r"(max_depth|rr_depth) = (-?\d+)", str(own))}
    if own.class_name() == "DirectIntegrator":
        given["max_depth"] = 2
    if given.get("max_depth", 0) > COEFFICIENT:
        given["max_depth"] = -1
    return mi.load_dict({"type": "prb", "hide_emitters": bool(getattr(own, "hide_emitters", False)), **given})


def _views(
    scene: mi.Scene,
    integrator: mi.Integrator,
    pictures: Picture | Sequence[Picture],
    sensors: int | Sequence[int] | None,
) -> list[View]:
    """Return the pictures with their sensors."""
    given = pictures if isinstance(pictures, (list, tuple)) else [pictures]
    count = len(scene.sensors())
    indices = range(len(given)) if sensors is None else [*map(int, np.atleast_1d(sensors))]
    if not given:
        raise FitError("There is no picture to fit to.")
    if len(indices) != len(given) or not {*indices} <= {*range(count)}:
        raise FitError(
            f"Each picture has its sensor: these are {[*indices]} of {len(given)} pictures, and the scene has {count}, "
            "counted from 0."
        )
    views = []
    for index, picture in zip(indices, given, strict=True):
        sensor = scene.sensors()[index]
        own = sensor.sampler().sample_count()
        height, width, channels = integrator.render(scene, sensor, seed=0, spp=1).shape
        sensor.sampler().set_sample_count(own)
        pixels = _pixels(picture, sensor.film().bitmap().pixel_format())
        colours = channels - mi.has_flag(sensor.film().flags(), mi.FilmFlags.Alpha)
        if pixels.shape not in {(height, width, channels), (height, width, colours)}:
            shape = (height, width, channels)
            raise FitError(f"A picture has the shape {pixels.shape}, and the film of its sensor has {shape}.")
        pixels = pixels[..., :colours]
        if not ((pixels > 0) & (pixels < np.inf)).any():
            raise FitError("A picture is black, or has no positive numbers.")
        views.append(View(sensor, pixels))
    return views


def _pixels(picture: Picture, film: mi.Bitmap.PixelFormat) -> Array:
    """Return a picture as an array of linear values, shape (height, width, channels), in the colours of a film unless
    it is an array."""
    if isinstance(picture, (str, os.PathLike)):
        if not Path(picture).is_file():
            raise FitError(f"There is no file {picture}.")
        try:
            picture = mi.Bitmap(str(picture))
        except RuntimeError as error:
            raise FitError(f"Mitsuba cannot read {picture}: {one_line(error)}") from None
    if isinstance(picture, mi.Bitmap):
        formats = mi.Bitmap.PixelFormat
        if (count := picture.channel_count()) > 4:
            raise FitError(f"A picture has {count} channels: give the colours among what mi.Bitmap.split returns.")
        colour = formats.Y if picture.pixel_format() in (formats.Y, formats.YA) else formats.RGB
        clips, shape = np.array(picture).dtype.kind == "u", (picture.height(), picture.width(), -1)
        linear = np.array(picture.convert(colour, mi.Struct.Type.Float32, srgb_gamma=False)).reshape(shape)
        if clips:
            # What is white may be brighter. The value below is 3e-5 less even of 16 bits.
            linear[(linear > 1 - 1e-6).any(axis=2)] = np.nan
        in_xyz = colour == formats.RGB and film in (formats.XYZ, formats.XYZA)
        picture = np.array(mi.Bitmap(linear).convert(formats.XYZ)) if in_xyz else linear
    pixels = np.array(picture)
    if pixels.dtype.kind in "iub":
        raise FitError("A picture of integers has no linear values: give its file, or mi.Bitmap(it), which is sRGB.")
    pixels = pixels.astype(np.float64)
    return pixels if pixels.ndim != 2 else pixels[..., None]
