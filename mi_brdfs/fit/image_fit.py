"""What was found from pictures."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import mitsuba as mi
import numpy as np

from ..parameters import PerLobe
from ..probe.arrays import Array
from ..ranges import declared
from .observations import FitError
from .rendered import Rendered


@dataclass(frozen=True)
class ImageFit:
    """Parameters that were found from pictures."""

    values: dict[str, Any]
    """By their keys in ``mi.traverse(scene)``: a number, a list of a colour's channels, or the array of a bitmap, of
    shape (height, width, channels)."""
    sigma: dict[str, Any]
    """The standard deviations of numbers and channels, as far as noise of the pictures and of the last renderings goes;
    None at the end of a range, where the pictures tell nothing, and for bitmaps."""
    bsdfs: dict[str, dict[str, Any]]
    """The materials they belong to, as plugin dicts for ``mi.load_dict``, by their paths. Textures are those of the
    scene."""
    bounds: list[str]
    """Numbers that ended at an end of their range."""
    losses: list[float]
    """The mean squared relative difference before each step, and at last after them: without the noise of the
    renderings, but with that of the pictures."""
    converged: bool
    """Whether the steps got short, or gained no more, before they were used up."""

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


def found(rendered: Rendered, point: Array, sigma: Array, losses: Sequence[float], converged: bool) -> ImageFit:
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
    return ImageFit(values, sigmas, _bsdfs(rendered.params, list(values)), bounds, list(losses), converged)


def _bsdfs(params: mi.SceneParameters, keys: Sequence[str]) -> dict[str, dict[str, Any]]:
    """Return the plugin dicts of the BSDFs that keys belong to."""
    owners = {path: bsdf for key, bsdf, path, _ in declared(params) if key in keys}
    return {path: _plugin_dict(bsdf) for path, bsdf in owners.items()}


def _plugin_dict(bsdf: Any) -> dict[str, Any]:
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
