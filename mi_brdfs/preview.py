"""A scene that shows a material."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import mitsuba as mi
import numpy as np

# The outline of the preview shape, from its foot to its top: control points (radius, height) of a smooth curve.
OUTLINE = [
    (0.00, 0.00), (0.55, 0.00), (0.75, 0.04), (0.74, 0.16), (0.42, 0.26), (0.36, 0.40), (0.70, 0.62), (0.98, 1.00),
    (0.96, 1.45), (0.66, 1.80), (0.38, 1.92), (0.30, 2.04), (0.34, 2.14), (0.20, 2.26), (0.00, 2.28),
]  # fmt: skip

# The surroundings, from the rim to the middle of the floor: a round cove, open above.
COVE = [(9, 7), (9, 4), (8.6, 1.4), (7, 0.2), (5, 0), (2, 0), (0, 0)]


def preview_scene(bsdf: dict | mi.BSDF) -> dict:
    """Return the dict of a scene that shows a material: ``mi.render(mi.load_dict(preview_scene({"type": "ward"})))``.

    A turned body, whose curves show highlight, grazing reflection and anisotropy (dp_du runs around its axis), stands
    in a round cove under a soft key light from the left, a rim light from behind on the right and a dim sky. The
    picture has 512 x 512 pixels and 128 samples.

    Args:
        bsdf: the material, a plugin dict or a loaded BSDF.

    Returns:
        A dict for ``mi.load_dict``, to be changed at will before loading; it belongs to the active variant.
    """
    T = mi.ScalarTransform4f
    return {
        "type": "scene",
        "integrator": {"type": "path", "max_depth": 6},
        "sensor": {
            "type": "perspective",
            "fov": 24.5,
            "to_world": T().look_at(origin=[0, -6.2, 2.9], target=[0, 0, 1.08], up=[0, 0, 1]),
            "film": {"type": "hdrfilm", "width": 512, "height": 512},
            "sampler": {"type": "independent", "sample_count": 128},
        },
        "body": _revolve(_smooth(OUTLINE, 160), 192, bsdf),
        "cove": _revolve(_smooth(COVE, 64), 64, {"type": "diffuse", "reflectance": 0.22}),
        "key": {
            "type": "rectangle",
            "to_world": T().look_at(origin=[-4.8, -2.2, 4.4], target=[0, 0, 1], up=[0, 0, 1]).scale([1.4, 1.4, 1]),
            "emitter": {"type": "area", "radiance": 13.0},
        },
        "rim": {
            "type": "rectangle",
            "to_world": T().look_at(origin=[4.2, 2.8, 2.4], target=[0, 0, 1.2], up=[0, 0, 1]).scale([0.6, 1.8, 1]),
            "emitter": {"type": "area", "radiance": 13.0},
        },
        "sky": {"type": "constant", "radiance": 0.25},
    }


def _smooth(points: Sequence[Any], count: int) -> np.ndarray:
    """Return ``count`` points on the Catmull-Rom curve through ``points``, shape (count, 2)."""
    p = np.array([points[0], *points, points[-1]])
    t = np.linspace(0, len(points) - 1, count)
    k = np.minimum(t.astype(int), len(points) - 2)
    t = (t - k)[:, None]
    p0, p1, p2, p3 = (p[k + offset] for offset in range(4))
    a, b, c = p2 - p0, 2 * p0 - 5 * p1 + 4 * p2 - p3, 3 * (p1 - p2) + p3 - p0
    curve = p1 + 0.5 * (a * t + b * t**2 + c * t**3)
    curve[:, 0] = np.maximum(curve[:, 0], 0)
    return curve


def _revolve(outline: np.ndarray, segments: int, bsdf: dict | mi.BSDF) -> mi.Mesh:
    """Return the surface that an outline of (radius, height) sweeps around the z axis, with u around and v along it."""
    rings = len(outline)
    radius, height = outline.T
    d_radius, d_height = np.gradient(outline, axis=0).T
    phi = np.linspace(0, 2 * np.pi, segments + 1)
    cos, sin, one = np.cos(phi), np.sin(phi), np.ones_like(phi)

    positions = np.stack([np.outer(radius, cos), np.outer(radius, sin), np.outer(height, one)], axis=-1)
    normals = np.stack([np.outer(d_height, cos), np.outer(d_height, sin), np.outer(-d_radius, one)], axis=-1)
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    uv = np.stack(np.meshgrid(phi / (2 * np.pi), np.linspace(0, 1, rings)), axis=-1)

    corner = np.arange(rings - 1)[:, None] * (segments + 1) + np.arange(segments)
    right, up = corner + 1, corner + segments + 1
    faces = np.stack([corner, right, up + 1, corner, up + 1, up], axis=-1).reshape(-1, 3)

    props = mi.Properties()
    props["bsdf"] = mi.load_dict(bsdf) if isinstance(bsdf, dict) else bsdf
    vertices = positions.size // 3
    mesh = mi.Mesh("revolved", vertices, len(faces), props, has_vertex_normals=True, has_vertex_texcoords=True)
    params = mi.traverse(mesh)
    params["vertex_positions"] = positions.astype(np.float32).ravel()
    params["vertex_normals"] = normals.astype(np.float32).ravel()
    params["vertex_texcoords"] = uv.astype(np.float32).ravel()
    params["faces"] = faces.astype(np.uint32).ravel()
    params.update()
    return mesh
