"""Paths from the light show the same as paths from the camera."""

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest
from catalogue import REPRESENTATIVES, ROWS
from scipy.stats import ttest_ind

pytestmark = pytest.mark.slow

PIXELS = 16
"""Of a cell, from side to side."""
SEEDS, SAMPLES = 8, 24
COLUMNS = 12


def cell_block(rows):
    """A grid of cells, each with a slope of one of the BSDFs and a white screen. The slope is lit from straight above;
    the upright screen, only by what the slope reflects. Black walls part the cells."""
    T = mi.ScalarTransform4f
    black = mi.load_dict({"type": "twosided", "inner": {"type": "diffuse", "reflectance": 0.0}})
    white = mi.load_dict({"type": "diffuse", "reflectance": 1.0})
    breadth, depth = COLUMNS, -(-len(rows) // COLUMNS)
    middle, away = np.array([depth / 2, breadth / 2, 0.3]), 8 * breadth * np.array([-0.5, 0, np.sqrt(0.75)])
    scene = {
        "type": "scene",
        "sun": {"type": "directional", "direction": [0, 0, -1], "irradiance": 3.0},
        "sensor": {
            "type": "perspective",
            "to_world": T().look_at(list(middle + away), list(middle), [1, 0, 0]),
            "fov": np.degrees(2 * np.arctan(0.5 * 1.05 / 8)),
            "film": {
                "type": "hdrfilm",
                "width": PIXELS * breadth,
                "height": PIXELS * (depth + 1),
                "rfilter": {"type": "box"},
                "pixel_format": "luminance",
            },
        },
    }
    for k in range(breadth + 1):
        wall = T().translate([depth / 2, k, 0.3]).rotate([1, 0, 0], 90).scale([depth / 2, 0.3, 1])
        scene[f"wall_{k}"] = {"type": "rectangle", "to_world": wall, "bsdf": black}
    for k, row in enumerate(rows):
        cell = T().translate([k // breadth, k % breadth + 0.5, 0])
        slope = cell @ T().translate([0.4, 0, 0.25]).rotate([0, 1, 0], 40).scale([0.39, 0.5, 1])
        bsdf = row.bsdf
        if k % 2 and not row.transmits:  # seen from behind
            slope, bsdf = slope @ T().rotate([1, 0, 0], 180), {"type": "twosided", "inner": bsdf}
        screen = cell @ T().translate([1, 0, 0.3]).rotate([0, 1, 0], -90).scale([0.3, 0.5, 1])
        scene[f"slope_{k}"] = {"type": "rectangle", "to_world": slope, "bsdf": bsdf}
        scene[f"screen_{k}"] = {"type": "rectangle", "to_world": screen, "bsdf": white}
    return mi.load_dict(scene, optimize=False)


def shapes_in_pixels(scene):
    """The index of the one shape that each pixel shows, or -1."""
    width, height = scene.sensors()[0].film().size()
    seen = []
    for corner in ((0, 0), (0, 1), (1, 0), (1, 1)):
        x, y = (dr.arange(mi.Float, count) + offset for count, offset in zip((width, height), corner, strict=True))
        position = mi.Point2f(*dr.meshgrid(x / width, y / height))
        ray, _ = scene.sensors()[0].sample_ray(0, 0.5, position, 0.5)
        si = scene.ray_intersect(ray)
        seen.append(np.array(dr.select(si.is_valid(), dr.reinterpret_array(mi.UInt32, si.shape), 0)))
    index = {dr.reinterpret_array(mi.UInt32, mi.ShapePtr(shape))[0]: k for k, shape in enumerate(scene.shapes())}
    same = np.all([other == seen[0] for other in seen], axis=0)
    return np.array([index.get(it, -1) if one else -1 for it, one in zip(seen[0], same, strict=True)])


def radiances(scene, integrator, shown, seeds):
    """The mean radiance of each shape, in independent pictures of shape (seeds, shapes)."""
    integrator = mi.load_dict({"type": integrator, "max_depth": 4, "rr_depth": 100})
    pixels = shown >= 0
    count = np.bincount(shown[pixels], minlength=len(scene.shapes()))
    means = []
    for seed in seeds:
        image = np.array(mi.render(scene, integrator=integrator, spp=SAMPLES, seed=seed), np.float64).ravel()
        means.append(np.bincount(shown[pixels], image[pixels], len(count)) / np.maximum(count, 1))
    return np.array(means)


@pytest.mark.usefixtures("llvm_rgb")
@pytest.mark.parametrize("reciprocal", [True, False])
def test_light_tracing_is_path_tracing(reciprocal):
    """``ptracer`` follows light from its source, and asks for values and samples the other way round."""
    rows = [row for row in REPRESENTATIVES if row.reciprocal]
    if not reciprocal:  # these tell the two ways of light apart
        rows = [row for row in ROWS if not row.sharp and not row.reciprocal]
    scene = cell_block(rows)
    shown = shapes_in_pixels(scene)
    path = radiances(scene, "path", shown, range(SEEDS))
    light = radiances(scene, "ptracer", shown, range(SEEDS, 2 * SEEDS))
    regions = {shape.id(): k for k, shape in enumerate(scene.shapes())}
    wrong = []
    for number, row in enumerate(rows):
        known = False
        for part in ("slope", "screen"):
            one, other = (pictures[:, regions[f"{part}_{number}"]] for pictures in (path, light))
            error = np.hypot(one.std(ddof=1), other.std(ddof=1)) / np.sqrt(SEEDS) / one.mean()
            known |= error < 0.15  # where a lobe is narrow, paths from the light hardly find the camera
            if ttest_ind(one, other, equal_var=False).pvalue < 0.01 / (2 * len(rows)):
                wrong.append(f"{row}: {part}: {other.mean() / one.mean():.3f} ± {error:.3f}")
        assert known, f"{row}: too noisy to tell"
    assert not wrong, "\n".join(wrong)
