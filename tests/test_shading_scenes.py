"""The scenes of ``shading``: pixel by pixel what the formulas say, and the same in every variant, for every seed."""

import mitsuba as mi
import numpy as np
import pytest
from plates import NAMES, SCENES, load, shaded
from support import is_scalar, unit

rgb = np.array


# --- Spheres, and their formulas ---------------------------------------------------------------------------------


def dot(a, b):
    return (a * b).sum(axis=-1)


def column(x):
    return np.asarray(x)[..., None]


TOWARDS = rgb([0.0, 0.0, 1.0])
"""The direction to the viewer, who is infinitely far away."""


class Ball:
    """The pixels of a picture that show a sphere, of the scenes' orthographic camera: their points and normals. Those
    that touch the outline are left out."""

    def __init__(self, centre, radius, width, height, half):
        x = half * (2 * (np.arange(width) + 0.5) / width - 1) - centre[0]
        y = half * height / width * (1 - 2 * (np.arange(height) + 0.5) / height) - centre[1]
        x, y = np.meshgrid(x / radius, y / radius)
        self.pixels = x * x + y * y < 0.995
        x, y = x[self.pixels], y[self.pixels]
        self.normal = np.stack([x, y, np.sqrt(1 - x * x - y * y)], axis=-1)
        self.centre, self.radius = rgb(centre), radius
        self.point = self.centre + radius * self.normal
        self.mirror = 2 * column(self.normal[:, 2]) * self.normal - TOWARDS

    def shadows(self, points, light):
        """Whether this sphere stands between points and a light, and whether that is a close shave."""
        way = light - points
        distance = np.linalg.norm(way, axis=-1)
        to = self.centre - points
        along = dot(to, way) / distance
        beside = np.sqrt(np.maximum(dot(to, to) - along**2, 0))
        between = (along > 0) & (along < distance)
        return between & (beside < self.radius), between & (abs(beside - self.radius) < 0.01 * self.radius)


def compare(image, ball, expected, but=False):
    np.testing.assert_allclose(image[ball.pixels][~np.broadcast_to(but, ball.pixels.sum())],
                               expected[~np.broadcast_to(but, len(expected))], atol=1e-4)  # fmt: skip
    assert np.ptp(expected) > 0.3  # there is something to see


@pytest.mark.usefixtures("llvm_rgb")
def test_formulas():
    """Diffuse formulas as the whole response to a light, and Phong's with its clamp before the power."""
    width, height, half = 96, 24, 4.6
    image = shaded(load("formulas", width, height), spp=1)
    l, light, colour = -unit([2, -1.5, -1.6]), rgb([1, 0.96, 0.9]), rgb([0.8, 0.5, 0.35])
    balls = [Ball((x, 0, 0), 1, width, height, half) for x in (-3.45, -1.15, 1.15, 3.45)]
    formulas = [
        lambda b: np.maximum(dot(b.normal, l), 0),
        lambda b: (0.5 * dot(b.normal, l) + 0.5) ** 2,
        lambda b: (np.maximum(dot(b.normal, l), 0) * b.normal[:, 2]) ** 1.5,
    ]
    for ball, k in zip(balls, formulas, strict=False):
        compare(image, ball, column(k(ball)) * colour * light)
    ball = balls[3]
    cos = dot(ball.normal, l)
    highlight = np.where(cos > 0, np.maximum(dot(ball.mirror, l), 0) ** 20, 0)
    compare(image, ball, (column(np.maximum(cos, 0)) * colour + 0.2 * column(highlight)) * light)


def step(cos, threshold, smooth):
    x = np.clip((cos - threshold + smooth) / (2 * smooth), 0, 1) if smooth else (cos > threshold).astype(float)
    return x * x * (3 - 2 * x)


@pytest.mark.usefixtures("llvm_rgb")
@pytest.mark.parametrize("tonemap", ["none", "reinhard"])
def test_bands(tonemap):
    """Bands, and the clamp at the end, or the HDR alternative to it."""
    width, height, half = 96, 32, 3.5
    image = shaded(load("bands", width, height, tonemap=tonemap), spp=1)
    ambient = rgb([0.06, 0.06, 0.09])
    lights = [
        (-unit([1.5, -1.5, -2]), rgb([0.95, 0.9, 0.8])),
        (-unit([-2, -0.5, -2]), rgb([0.5, 0.55, 0.7])),
    ]

    def finished(colour):
        return colour / (1 + colour) if tonemap == "reinhard" else np.clip(colour, 0, 1)

    ball = Ball((-2.3, 0, 0), 1, width, height, half)
    sum_of_lights = ambient + sum(column(np.maximum(dot(ball.normal, l), 0)) * light for l, light in lights)
    expected = rgb([0.95, 0.85, 0.4]) * sum_of_lights
    assert expected.max() > 1.05
    compare(image, ball, finished(expected))

    toons = [(0, [0.7, 0.3, 0.25], 0.5, 0.0, 0.0, 0.97, 0.0), (2.3, [0.3, 0.5, 0.75], 0.3, 0.15, 0.3, 0.9, 0.05)]
    for x, colour, threshold, smooth, dark, specular_threshold, specular_smooth in toons:
        ball = Ball((x, 0, 0), 1, width, height, half)
        expected, edge = rgb(colour) * ambient + 0 * ball.normal, np.zeros(len(ball.normal), bool)
        for l, light in lights:
            cos, cos_r = dot(ball.normal, l), dot(ball.mirror, l)
            band = dark + (1 - dark) * step(cos, threshold, smooth)
            lit = rgb(colour) * column(band) + 0.2 * column(step(cos_r, specular_threshold, specular_smooth))
            expected = expected + np.where(column(cos > 0), lit, 0) * light
            edge |= abs(cos) < 1e-5
            if not smooth:
                edge |= (abs(cos - threshold) < 1e-5) | (abs(cos_r - specular_threshold) < 1e-5)
        compare(image, ball, finished(expected), but=edge)


@pytest.mark.usefixtures("llvm_rgb")
def test_phong():
    """The Phong illumination model, with max(0, ·) and both terms within the sum over the lights."""
    width, height, half = 72, 48, 2.1
    image = shaded(load("phong", width, height), spp=1)
    balls = [Ball((0.3, 0, 0), 1.2, width, height, half), Ball((-1.4, 0.75, 1.4), 0.35, width, height, half)]
    colours = [rgb([0.7, 0.25, 0.2]), rgb([0.25, 0.5, 0.3])]
    lights = [(rgb([-4.0, 3, 4]), rgb([30, 28, 24])), (rgb([4.0, -1, 3]), rgb([5, 7, 12]))]
    in_shadow = 0
    for ball, kd, other in zip(balls, colours, reversed(balls), strict=True):
        expected, doubt = kd * rgb([0.12, 0.12, 0.16]) + 0 * ball.normal, np.zeros(len(ball.normal), bool)
        for position, intensity in lights:
            way = position - ball.point
            l, light = unit(way), intensity / column(dot(way, way))
            cos = dot(ball.normal, l)
            hidden, close = other.shadows(ball.point, position)
            specular = np.maximum(dot(ball.mirror, l), 0) ** 40
            term = kd * column(cos) + 0.4 * column(specular)
            expected = expected + np.where(column((cos > 0) & ~hidden), term * light, 0)
            doubt |= close | (abs(cos) < 1e-3)
            in_shadow += (hidden & (cos > 0.1)).sum()
        compare(image, ball, np.clip(expected, 0, 1), but=doubt)
    assert in_shadow > 10


@pytest.mark.usefixtures("llvm_rgb")
def test_mirrored_sky():
    """The mirrored environment, weighted by the Fresnel reflectance, beside what the lobes make of a light."""
    width, height, half = 96, 32, 3.5
    image = shaded(load("mirrored_sky", width, height), spp=1)
    sky = np.array(mi.Bitmap(str(SCENES / "sky.exr")), np.float64)[:, 0]
    l, light = -unit([1.5, -1.5, -2]), rgb([0.6, 0.58, 0.5])
    h = unit(l + TOWARDS)

    def fresnel(f0, cos):
        return f0 + (1 - f0) * column(1 - cos) ** 5

    def environment(d):
        theta = np.arccos(np.clip(d[:, 1], -1, 1)) / np.pi * (len(sky) - 1)
        return np.stack([np.interp(theta, np.arange(len(sky)), channel) for channel in sky.T], axis=-1)

    def metal(b, nl, nv, nh):
        alpha = 0.5**2
        d = alpha**2 / (np.pi * (1 + (alpha**2 - 1) * nh**2) ** 2)
        k = 1.5**2 / 8
        g = 1 / ((nl * (1 - k) + k) * (nv * (1 - k) + k))
        return fresnel(rgb([0.9, 0.65, 0.35]), h @ TOWARDS) * column(np.pi * d * g / 4 * nl)

    def dielectric(b, nl, nv, nh):
        alpha = 0.2
        d = np.exp((1 - 1 / nh**2) / alpha**2) / (np.pi * alpha**2 * nh**4)
        g = np.minimum(1, np.minimum(2 * nh * nv, 2 * nh * nl) / (h @ TOWARDS))
        return fresnel(rgb([0.05] * 3), h @ TOWARDS) * column(np.pi * d * g / (4 * nv))

    def blinn(b, nl, nv, nh):
        return rgb([0.5, 0.6, 0.5]) * column(nh**60)

    colours = [rgb([0.9, 0.65, 0.35]), rgb([0.05] * 3)]
    mirrors = [lambda nv, f0=f0: fresnel(f0, nv) for f0 in colours] + [lambda nv: rgb([0.5, 0.6, 0.5])]
    for x, specular, mirror in zip((-2.3, 0, 2.3), (metal, dielectric, blinn), mirrors, strict=True):
        ball = Ball((x, 0, 0), 1, width, height, half)
        nl, nv, nh = dot(ball.normal, l), ball.normal[:, 2], dot(ball.normal, h)
        lit = np.where(column(nl > 0), specular(ball, np.maximum(nl, 1e-9), nv, np.maximum(nh, 1e-3)), 0) * light
        compare(image, ball, np.clip(lit + mirror(nv) * environment(ball.mirror), 0, 1), but=nv < 0.1)


# --- All scenes -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", NAMES)
def test_scenes_in_every_variant(name, variant):
    image = shaded(load(name, 24, 8), spp=1 if is_scalar() else 16)
    assert 0.02 < image.mean() < 0.9
    assert image.min() >= 0
    assert image.max() <= 1


@pytest.mark.usefixtures("llvm_rgb")
@pytest.mark.parametrize("name", NAMES)
def test_same_picture_for_any_seed_and_samples(name):
    first = shaded(load(name, 48, 24), spp=1)
    for seed, spp in ((1, 1), (2, 3)):
        np.testing.assert_allclose(shaded(load(name, 48, 24), seed=seed, spp=spp), first, atol=1e-6)
