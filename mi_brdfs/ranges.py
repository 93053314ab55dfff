"""The ranges of traversed parameters, for optimisation."""

from __future__ import annotations

from collections.abc import Iterator, MutableMapping
from typing import Any

import drjit as dr
import mitsuba as mi

from .parameters import Range

VALUES = ("value", "values", "data")
"""The names of the values of Mitsuba's textures in ``mi.traverse``."""


def ranges(bsdf: mi.BSDF) -> dict[str, Range]:
    """Return the range ``(low, high)`` of each parameter of a BSDF of this package, by key in ``mi.traverse(bsdf)``.

    A value outside is evaluated as the nearer limit; ``high`` may be infinite. Spectral variants leave out parameters
    given as rgb: Mitsuba stores the coefficients of a spectrum there, which have no range.

    Raises:
        ValueError: if the BSDF is not from this package, or none of the active variant.
    """
    if not isinstance(bsdf, mi.BSDF):
        raise ValueError(f"{type(bsdf).__name__} is not a BSDF of {mi.variant()}; give a loaded BSDF.")
    if not _is_ours(bsdf):
        raise ValueError(f"{bsdf.class_name()} declares no ranges: it is not a BSDF of mi_brdfs.")
    return dict(limits_of(mi.traverse(bsdf)))


def project(params: mi.SceneParameters, optimizer: MutableMapping[str, Any] | None = None) -> None:
    """Clamp the parameters of all BSDFs of this package in a scene to their ranges; a NaN stays one, to be seen, and
    attributes of meshes are theirs.

    In an optimisation, call it after each step with the optimizer, whose variables alone are clamped then, in both::

        optimizer.step()
        params.update(optimizer)
        mi_brdfs.project(params, optimizer)

    Args:
        params: what ``mi.traverse`` returned for a scene, a shape or a BSDF.
        optimizer: an optimizer such as ``mi.ad.Adam``, with variables named like the parameters.

    Raises:
        ValueError: if these are no such parameters, or those of another variant than the active one.
    """
    if not isinstance(params, mi.SceneParameters):
        raise ValueError(f"{type(params).__name__} holds no parameters; give what mitsuba.traverse returns for it.")
    if any(hasattr(node, "model") and hasattr(node, "eval_pdf") and not _is_ours(node) for node in params.hierarchy):
        raise ValueError(f"These parameters are not of {mi.variant()}; activate the variant that they were loaded in.")
    source = params if optimizer is None else optimizer
    inside: dict[str, Any] = {}
    for key, limits in limits_of(params):
        if key in source:
            inside[key] = _projected(inside.get(key, source[key]), limits)
    if optimizer is not None:
        for key, value in inside.items():
            optimizer[key] = value
        inside = {key: optimizer[key] for key in inside}  # they keep copies, and want the gradients of those
    params.update(inside)


def limits_of(params: mi.SceneParameters) -> Iterator[tuple[str, Range]]:
    """Yield ``(key, range)`` of the traversed parameters of our BSDFs, and of their arrays."""
    found = [(key, bsdf, name) for key, bsdf, _, name in declared(params)]
    for key in params.keys():
        if _is_ours(node := params.properties[key][2]):  # whose textures are nodes of their own
            found.append((key, node, key.rpartition(".")[2]))
    for key, bsdf, name in found:
        if name in bsdf.model.ranges:
            yield key, bsdf.model.ranges[name]


def declared(params: mi.SceneParameters) -> Iterator[tuple[str, Any, str, str]]:
    """Yield ``(key, bsdf, path, name)`` of the traversed values of parameters of our BSDFs: ``path`` is that of the
    BSDF, empty if it was traversed by itself and its id if the scene holds the texture, and ``name`` the property's. A
    texture that several share comes once for each."""
    owners: dict[Any, list[tuple[Any, str]]] = {}
    for bsdf in filter(_is_ours, params.hierarchy):
        for name, texture in bsdf.textures.items():
            owners.setdefault(texture, []).append((bsdf, name))
    for key in params.keys():
        node = params.properties[key][2]
        *path, word = key.split(".")
        if word not in VALUES or _holds_coefficients(node, params[key]):
            continue
        # A key is the path from the root: it has as many words below a node as there are nodes.
        levels = 0
        while node is not None and node not in owners:
            node, levels = params.hierarchy[node][0], levels + 1
        for bsdf, name in owners.get(node, []):
            within = params.hierarchy[node][0] is bsdf
            yield key, bsdf, ".".join(path[: -levels - 1]) if within else bsdf.id(), name


def _is_ours(node: Any) -> bool:
    return isinstance(node, mi.BSDF) and hasattr(node, "model")


def _holds_coefficients(node: Any, value: Any) -> bool:
    """Return whether a texture holds the coefficients of spectra instead of rgb colours."""
    kind = node.class_name()
    upsampled = kind == "SRGBReflectanceSpectrum" or (kind.startswith("BitmapTexture") and value.shape[-1] == 3)
    return mi.is_spectral and upsampled


def _projected(value: Any, limits: Range) -> Any:
    low, high = limits
    inside = dr.minimum(dr.maximum(dr.detach(value), low), high)
    if dr.grad_enabled(value):
        dr.enable_grad(inside)
    return inside
