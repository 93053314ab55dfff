"""Samplers, over all that is declared: at grazing, too, no sample weighs much more than the others."""

import mitsuba as mi
import numpy as np
import pytest
from support import context, direction, interaction, numbers
from test_fuzz import CASES, FuzzedPlugin, directions, magnitudes

from mi_brdfs.probe.arrays import luminance
from mi_brdfs.probe.variates import lattice, sampling_efficiency

pytestmark = pytest.mark.usefixtures("llvm_rgb", "no_lanes_left")

SETTINGS = 48
LARGEST_WEIGHT = 30
"""Of a sample, over the mean."""
LEAST_ETA = 0.15
"""η = E[w]²/E[w²] of any setting …"""
SELDOM_BELOW = 0.5
"""… and of all but ``SELDOM`` of them, where a part is not faint."""
SELDOM = 0.05
FAINT = 0.03
"""The share of all light of which a faint part reflects less, as multiple scattering on smooth facets."""


def drawn(options, rng):
    """Values of the quantities by name: colours and other fractions are uniform, the rest of any magnitude from a
    thousandth of one, or of where they usually end: a film is thicker than an atom."""
    values = {}
    for quantity in options.quantities:
        low, high = quantity.limits[0], min(quantity.limits[1], 1e3 if quantity.colour else 1e6)
        shape = (3, SETTINGS) if quantity.colour else SETTINGS
        usual = quantity.usual[1] if quantity.usual else 1
        if (low, high) == (0, 1) or low < 0:
            values[quantity.name] = rng.uniform(low, high, shape)
        else:
            values[quantity.name] = magnitudes(low or 1e-3 * usual, high, rng, shape)
    return {name: np.float32(value) for name, value in values.items()}


@pytest.mark.parametrize("model, options", CASES)
def test_weights(model, options):
    """Of every lobe alone and of their mixture, from 30° to 89°, most of them beyond 80°, at any azimuth."""
    rng = np.random.default_rng(1)
    points = lattice(8, 1)
    plugin = FuzzedPlugin(model, options, largest=1e6, lanes=SETTINGS * len(points))
    settings = drawn(options, rng)
    theta = np.radians(
        np.where(rng.random(SETTINGS) < 0.2, rng.uniform(30, 80, SETTINGS), rng.uniform(80, 89, SETTINGS))
    )
    wi = directions(np.cos(theta), np.sin(theta), rng)

    plugin.values = {name: np.repeat(value, len(points), axis=-1) for name, value in settings.items()}
    plugin.wi, plugin.u = np.repeat(wi, len(points), axis=0), np.tile(np.float32(points), (SETTINGS, 1))
    whole = 0
    for part, answers in plugin.answers().items():  # in the kernel of fuzzing
        weight = luminance(answers["the weight of sample"]).reshape(SETTINGS, len(points))
        mean = weight.mean(axis=1)
        black = mean <= 1e-30
        whole = mean if part is None else whole
        faint = mean < FAINT * whole
        mean = np.where(black, 1, mean)
        largest = weight.max(axis=1) / mean
        eta = np.where(black, 1, sampling_efficiency(weight))
        for wrong, figure in ((largest > LARGEST_WEIGHT, largest), (eta < LEAST_ETA, eta)):
            k = np.argmax(wrong)
            at = {name: value[..., k].tolist() for name, value in settings.items()}
            assert not wrong[k], f"{figure[k]:.3g} of part {part} at {np.degrees(theta[k]):.1f}°, wi {wi[k]}: {at}"
        assert ((eta < SELDOM_BELOW) & ~faint).mean() <= SELDOM, f"part {part}: {np.sort(eta)[:5]}"


def rgb(*value):
    return {"type": "rgb", "value": value}


def kit(distribution, shadowing, **given):
    return {"type": "microfacet", "distribution": distribution, "shadowing": shadowing, **given}


HEAVY = [  # of earlier samplers a sample weighed up to 300 times the mean
    (88.2, 150.9, None, kit("ggx", "smith", alpha_u=1.353, alpha_v=0.01734, int_ior=0.01245, ext_ior=0.01246)),
    (86.3, 102.2, None, kit("beckmann", "vcavity", alpha_u=0.00273, alpha_v=1.101, int_ior=69.47, ext_ior=69.54)),
    (87.0, 55.9, None, kit("epd", "ashikhmin-shirley", alpha=0.4619, gamma=0.1922, int_ior=3.6, ext_ior=3.785)),
    (85.1, 105.6, None, {"type": "cooktorrance", "distribution": "blinn", "normalization": "tog82", "alpha": 0.9286,
                         "int_ior": 1.333, "ext_ior": 1.3476, "diffuse_reflectance": 0.5,
                         "specular_reflectance": 0.8}),
    (85.6, 84.2, 1, {"type": "low", "variant": "smooth", "diffuse_reflectance": 0.7, "b": 2.197, "c": 0.2993,
                     "int_ior": 1.045}),
    (84.6, -169.5, None, kit("ggx", "smith-correlated", alpha=1.132, eta=rgb(2.26, 0.04876, 7.943),
                             k=rgb(0.08227, 0.07313, 0.0485))),
    (84.0, 17.7, None, kit("ggx", "schlick", alpha_u=0.1657, alpha_v=0.002473, eta=rgb(0.01801, 1.335, 0.01596),
                           k=rgb(0.003775, 0.01671, 0.002307))),
    (88.5, 147.0, None, kit("gtr", "ashikhmin-premoze", alpha=0.0885, gamma=2.194, eta=rgb(0.08868, 0.2391, 10.9),
                            k=rgb(0.00279, 0.002173, 0.005052))),
    (87.6, 177.5, None, kit("ggx", "ashikhmin-premoze", alpha=0.02423, eta=rgb(0.01313, 0.01666, 23.02),
                            k=rgb(0.1534, 0.001129, 0.5858))),
    (88.3, -151.9, None, kit("gtr", "ashikhmin-premoze", alpha=0.0001579, gamma=1.436)),
    (87.7, 14.2, None, kit("gtr", "schlick", alpha=0.001935, gamma=1.68, int_ior=0.6186, ext_ior=0.01252)),
    (83.8, -98.5, 0, {"type": "schlick", "variant": "interreflection", "roughness": 0.0002397, "isotropy": 0.0314,
                      "specular_reflectance": rgb(0.3161, 0.7048, 0.285), "diffuse_reflectance": 0.2}),
    (88.7, 61.8, None, kit("epd", "vcavity", alpha=0.0001282, gamma=0.1082)),
    (86.2, -156.8, 1, {"type": "brady", "normalization": "none", "f0": rgb(0.01938, 0.6215, 0.1537), "exponent": 2.021,
                       "beta": 1.974, "specular_reflectance": rgb(64.97, 0.04308, 0.001169)}),
    (88.9, 90.0, 1, {"type": "blinnphong", "normalization": "original", "exponent": 0.00319,
                     "diffuse_reflectance": 0.5}),
    (81.7, -93.9, None, kit("abc", "kurt", b=2237, c=0.2026, kurt_exponent=0.3265, int_ior=25.16, ext_ior=25.23)),
    (81.7, 115.5, None, kit("gtr", "schlick", alpha=0.00147, gamma=0.00194, int_ior=0.1848, ext_ior=0.1853)),
    (76.6, -123.0, None, kit("gtr", "kelemen", alpha=0.1823, gamma=0.00199, int_ior=0.02039, ext_ior=0.02054)),
    (37.4, -99.1, None, {"type": "walter", "shadowing": "correlated", "alpha_u": 0.00786, "alpha_v": 0.03512,
                         "int_ior": 1.333, "ext_ior": 1.514}),
    (88.1, -100.3, None, kit("hepd", "implicit", kappa=5.0194, gamma=67.07, int_ior=1.016, ext_ior=3.454)),
    (43.1, -27.5, None, kit("beckmann", "ashikhmin-premoze", alpha_u=1.6, alpha_v=0.0606, int_ior=46.17,
                            ext_ior=88.51)),
    (85.9, -92.2, None, kit("beckmann", "implicit", alpha_u=1.856, alpha_v=0.1317, int_ior=2.958, ext_ior=4.477)),
    (36.4, -100.8, None, kit("beckmann", "ashikhmin-shirley", alpha_u=1.912, alpha_v=0.00059, int_ior=3.588,
                             ext_ior=9.557)),
    (88.0, 0.0, None, kit("ggx", "smith", alpha=0.3, f0=0.0, multiscatter="walk")),
    (81.5, 0.0, None, kit("ggx", "smith", alpha=0.1, f0=0.9, f82=0.0, multiscatter="kulla-conty")),
]  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("theta, phi, part, given", HEAVY)
def test_heaviest_weights(theta, phi, part, given):
    u, x, y = lattice(10, 1).T
    si = interaction(np.tile(direction(theta, phi), (len(u), 1)))
    sampled = mi.load_dict(given).sample(context(part), si, mi.Float(u), mi.Point2f(x, y), True)
    weights = luminance(numbers(sampled[1]))
    assert 0 < weights.max() <= LARGEST_WEIGHT * weights.mean()
