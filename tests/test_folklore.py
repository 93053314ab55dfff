"""Numbers of the chapter on the folklore: the formula that circulates, the published one, and the plugin's option."""

import re
from functools import cache, partial
from pathlib import Path

import mitsuba as mi
import numpy as np
import pytest
import reference as ref

import mi_brdfs

CHAPTER = (Path(__file__).parents[1] / "docs" / "folklore.md").read_text(encoding="utf-8")
ROWS = [[cell.strip() for cell in line.strip("|").split("|")] for line in CHAPTER.splitlines() if line.startswith("|")]


def assert_printed(model, text):
    """One row of the model says so in its column of differences, to the last digit."""
    cells = [row[3] for row in ROWS if row[0] == f"`{model}`"]
    assert sum(bool(re.search(rf"(?<![\d.-]){re.escape(text)}(?!\.?\d)", cell)) for cell in cells) == 1, text


@cache
def _gauss_legendre():
    """Nodes and weights on [0, 1]."""
    nodes, weights = np.polynomial.legendre.leggauss(200)
    return (nodes + 1) / 2, weights / 2


@cache
def _hemisphere():
    """Directions and weights: nodes in the cosine, and in the fourth root of the azimuth from the mirror direction."""
    x, weights = _gauss_legendre()
    z, phi = np.meshgrid(x, np.pi * x**4, indexing="ij")
    sin = np.sqrt(1 - z * z)
    wo = np.stack([-sin * np.cos(phi), sin * np.sin(phi), z], axis=-1).reshape(-1, 3)
    return wo, np.outer(weights, 8 * np.pi * x**3 * weights).ravel()


def albedo(response, theta=0.0):
    """Integral of f cosθ_o over the upper hemisphere; the models are symmetric in the azimuth."""
    wo, weights = _hemisphere()
    theta = np.radians(theta)
    wi = np.tile([np.sin(theta), 0, np.cos(theta)], (len(wo), 1))
    return weights @ response(wi, wo)


def moment(distribution):
    """Integral of D(cosθ_h) cosθ_h over the hemisphere."""
    x, weights = _gauss_legendre()
    return 2 * np.pi * weights @ (distribution(x) * x)


def half(wi, wo):
    """Cosines of the half vector with the normal and with either direction."""
    h = wi + wo
    length = np.linalg.norm(h, axis=1)
    return h[:, 2] / length, length / 2


def angles(wi, wo):
    """The larger and the smaller of the two polar angles, and the cosine of the azimuth between the directions."""
    theta = np.arccos([wi[:, 2], wo[:, 2]])
    return theta.max(0), theta.min(0), np.cos(np.arctan2(wi[:, 1], wi[:, 0]) - np.arctan2(wo[:, 1], wo[:, 0]))


SPECULAR = {"diffuse_reflectance": 0.0, "specular_reflectance": 1.0}


def test_options_exist():
    """Rows are complete, and each option that one names loads."""
    head, rule, *rows = ROWS
    assert {len(row) for row in ROWS} == {len(head)} == {5} and set("".join(rule)) == {"-"}
    assert len(rows) > 40 and all(cell for row in rows for cell in row[:4])
    options = [(row[0].strip("`"), re.findall(r"`(\w+)=([\w-]+)`", row[4])) for row in rows]
    assert sum(len(given) for _, given in options) > 12
    for model, given in options:
        assert model == "any" or model in mi_brdfs.list_models()
        if given:
            mi.load_dict({"type": model} | dict(given))


def test_pi_in_the_light():
    """Lambert's cosine and the half-Lambert, with or without the 1/π of a BRDF."""
    assert_printed("lambert", f"the albedo is {albedo(lambda wi, wo: wo[:, 2]):.2f}")
    assert albedo(partial(ref.lambert, reflectance=1)) == pytest.approx(1)

    def half_lambert(wi, wo):
        return ((1 + wo[:, 2]) / 2) ** 2 / np.pi

    def on_both_sides(response):
        return lambda wi, wo: response(wi, wo) + response(wi, wo * [1, 1, -1])

    front, both = albedo(half_lambert), albedo(on_both_sides(half_lambert))
    assert (front, both) == pytest.approx((7 / 6, 4 / 3))
    assert_printed("wrap", f"the albedo is {front:.2f} (7/6) on the hemisphere and {both:.2f} (4/3) on the sphere")
    option = partial(ref.wrap, reflectance=1, wrap=1, exponent=2, normalization="none")
    assert albedo(partial(option, domain="hemisphere")) == pytest.approx(front)
    assert albedo(on_both_sides(partial(option, domain="sphere"))) == pytest.approx(both)


def test_minnaert_is_not_reciprocal_with_one_cosine_too_many():
    w = np.array([[np.sqrt(1 - z * z), 0, z] for z in (0.9, 0.3)])
    light, viewer = w, w[::-1]

    def folklore(wi, wo, k):
        return (wi[:, 2] * wo[:, 2]) ** k / np.pi

    def f(response):
        return response(viewer, light) / light[:, 2]

    there, back = f(partial(folklore, k=2))
    published = f(partial(ref.minnaert, reflectance=1, exponent=2, normalization="published"))
    assert published[0] == pytest.approx(published[1])
    bright = albedo(partial(folklore, k=0.5))
    assert_printed(
        "minnaert",
        f"f from NL = 0.9 to NV = 0.3 is {there:.3f}, and {back:.3f} the other way round, instead of "
        f"{published[0]:.3f} both ways; for k = 0.5 the albedo at 0° is {bright:.2f}",
    )
    option = partial(ref.minnaert, reflectance=1, normalization="none")
    np.testing.assert_allclose(f(partial(option, exponent=2)), [there, back])
    assert albedo(partial(option, exponent=0.5)) == pytest.approx(bright)


def test_orennayar_with_a_parenthesis_misplaced():
    a, b = 1 - 0.09 / (2 * (0.09 + 0.33)), 0.45 * 0.09 / (0.09 + 0.09)

    def folklore(wi, wo):
        alpha, beta, cos_phi = angles(wi, wo)
        return wo[:, 2] * (a + b * np.sin(alpha)) * np.tan(beta) * np.maximum(0, cos_phi) / np.pi

    published = partial(ref.orennayar, reflectance=1, sigma=0.3, model="qualitative")
    (dark, bright), (dark60, bright60) = ([albedo(f, theta) for f in (folklore, published)] for theta in (0, 60))
    assert_printed(
        "orennayar",
        f"the albedo is {dark:.2f} instead of {bright:.2f} at 0°, and {dark60:.2f} instead of {bright60:.2f} at 60°",
    )


def test_orennayar_with_the_sign_of_the_roughness_lost():
    def folklore(wi, wo):
        s = np.sum(wi * wo, axis=1) - wi[:, 2] * wo[:, 2]
        t = np.where(s > 0, np.maximum(wi[:, 2], wo[:, 2]), 1)
        a = 1 + 0.09 * (1 / (0.09 + 0.13) + 0.5 / (0.09 + 0.33))
        return wo[:, 2] * (a + 0.45 * 0.09 / (0.09 + 0.09) * s / t) / np.pi

    full, qualitative = (
        albedo(partial(ref.orennayar, reflectance=1, sigma=0.3, model=model)) for model in ("full", "qualitative")
    )
    assert_printed(
        "orennayar",
        f"the albedo at 0° is {albedo(folklore):.2f} instead of {full:.2f} (full) or {qualitative:.2f} (qualitative)",
    )


def test_orennayar_without_the_clamp_is_negative():
    wi, wo = (np.array([[sign * np.sin(np.radians(88)), 0, np.cos(np.radians(88))]]) for sign in (1, -1))
    wrong, right = ([c * m / (m + d) for m in (0.09, 0.36)] for c, d in ((0.44, 0.99), (0.45, 0.09)))
    assert_printed(
        "orennayar",
        f"B is {wrong[0]:.3f} instead of {right[0]:.3f} for σ = 0.3, and "
        f"{wrong[1]:.3f} instead of {right[1]:.3f} for σ = 0.6",
    )
    alpha, beta, cos_phi = angles(wi, wo)
    a = 1 - 0.36 / (2 * (0.36 + 0.33))
    unclamped, worse = ((a + b * cos_phi * np.sin(alpha) * np.tan(beta)).item() / np.pi for b in (right[1], wrong[1]))
    published = (ref.orennayar(wi, wo, 1, 0.6, "qualitative") / wo[:, 2]).item()
    assert_printed(
        "orennayar",
        f"f is {unclamped:.2f} instead of {published:.2f} for σ = 0.6, and {worse:.2f} with the B of 0.44 and 0.99",
    )


def test_phong_with_even_powers_of_negative_cosines():
    def folklore(wi, wo, n):
        cos = np.sum(wi * [-1, -1, 1] * wo, axis=1)
        return (n + 2) / (2 * np.pi) * np.maximum(0, cos**n) * wo[:, 2]

    published = partial(ref.phong, **SPECULAR, normalization="energy")
    (ghost, clean), (ghost10, clean10) = (
        [albedo(partial(folklore, n=n), theta), albedo(partial(published, exponent=n), theta)]
        for n, theta in ((2, 89), (10, 85))
    )
    assert_printed(
        "phong",
        f"the normalised lobe has an albedo of {ghost:.2f} instead of {clean:.2f} (n = 2, 89°), "
        f"and {ghost10:.2f} instead of {clean10:.2f} (n = 10, 85°)",
    )


def test_phong_and_blinnphong_without_their_constants():
    def phong(wi, wo, n):
        return np.maximum(0, np.sum(wi * [-1, -1, 1] * wo, axis=1)) ** n * wo[:, 2]

    def blinnphong(wi, wo, n):
        return half(wi, wo)[0] ** n * wo[:, 2]

    for name, folklore in (("phong", phong), ("blinnphong", blinnphong)):
        one, hundred = (albedo(partial(folklore, n=n)) for n in (1, 100))
        assert_printed(name, f"the albedo at 0° is {one:.2f} for n = 1 and {hundred:.3f} for n = 100")
        for n, expected in ((1, one), (100, hundred)):
            option = partial(getattr(ref, name), **SPECULAR, exponent=n)
            assert albedo(partial(option, normalization="energy")) == pytest.approx(1)
            assert albedo(partial(option, normalization="none")) == pytest.approx(expected)
    ten, hundred = (albedo(partial(blinnphong, n=n)) * (n + 2) / (2 * np.pi) for n in (10, 100))
    assert_printed("blinnphong", f"the albedo at 0° is {ten:.2f} for n = 10 and {hundred:.2f} for n = 100")
    ndf = partial(ref.blinnphong, **SPECULAR, exponent=100, normalization="ndf")
    assert albedo(ndf) == pytest.approx(hundred)


def test_microfacets_over_pi():
    """4/π of Cook and Torrance and of Walter et al., and the 4 of the journal version."""

    def beckmann(wi, wo):
        cos, cos_d = half(wi, wo)
        d = np.exp((1 - 1 / cos**2) / 0.01) / (np.pi * 0.01 * cos**4)
        return d * np.minimum(1, 2 * cos * np.minimum(wi[:, 2], wo[:, 2]) / cos_d) / wi[:, 2]

    def ggx(wi, wo):
        d = 0.01 / (np.pi * (1 - 0.99 * half(wi, wo)[0] ** 2) ** 2)
        g1 = [2 * w[:, 2] / (w[:, 2] + np.sqrt(0.01 + 0.99 * w[:, 2] ** 2)) for w in (wi, wo)]
        return d * g1[0] * g1[1] / wi[:, 2]

    option = partial(ref.cooktorrance, **SPECULAR, alpha=0.1, distribution="beckmann")
    modern = albedo(partial(option, normalization="modern"))
    bright = albedo(lambda wi, wo: beckmann(wi, wo) / np.pi)
    assert bright / modern == pytest.approx(4 / np.pi)
    assert_printed("cooktorrance", f"4/π times too bright: the albedo at 0° is {bright:.2f} (m = 0.1)")

    journal = albedo(beckmann)  # 1/π once, of D or of the fraction
    assert journal / modern == pytest.approx(4)
    assert_printed("cooktorrance", f"4 times too bright: the albedo at 0° is {journal:.2f} (m = 0.1)")
    assert albedo(partial(option, normalization="tog82")) == pytest.approx(journal)

    separable = {"alpha_u": 0.1, "alpha_v": 0.1, "shadowing": "separable", "fresnel": np.ones_like}
    published = albedo(partial(ref.walter, **SPECULAR, **separable))
    bright = albedo(lambda wi, wo: ggx(wi, wo) / np.pi)
    assert bright / published == pytest.approx(4 / np.pi)
    assert_printed("walter", f"the albedo at 0° is {bright:.2f} instead of {published:.2f} (α = 0.1)")


def test_an_approximated_shadowing_term():
    def of(shadowing):
        facets = {"distribution": "beckmann", "shadowing": shadowing, "alpha_u": 0.3, "alpha_v": 0.3}
        return albedo(partial(ref.microfacet, **SPECULAR, **facets), 80)

    told = f"for α = 0.3 the albedo at 80° is {of('smith-rational'):.3f} instead of {of('smith'):.3f}"
    assert_printed("microfacet", told)


def test_distributions_that_are_none():
    """GGX with NH not squared, and Blinn's with its constant inside the power."""

    def ggx(cos, r):
        return r**4 / (np.pi * (cos * (r**4 - 1) + 1) ** 2)

    def blinn(cos, r):
        return (cos / (np.pi * r**4)) ** (2 / r**2 - 2)

    def published(cos, r):
        return ref.ggx(cos, np.sqrt(1 - cos**2) / cos, 0.0, r**2, r**2)

    integrals = [moment(partial(ggx, r=r)) for r in (0.2, 0.5, 0.8)]
    assert moment(partial(published, r=0.2)) == pytest.approx(1)
    assert_printed(
        "metallicroughness",
        "∫ D NH dω is {:.2f} for r = 0.2, {:.2f} for r = 0.5 and {:.2f} for r = 0.8, instead of 1".format(*integrals),
    )
    large, huge = moment(partial(blinn, r=0.5)), moment(partial(blinn, r=0.3))
    assert moment(lambda cos: ref.blinn(cos, 0.0, 0.0, 2 / 0.5**4 - 2)) == pytest.approx(1)
    assert_printed(
        "cooktorrance",
        f"∫ D NH dω is {large / 1e4:.1f}·10⁴ for r = 0.5 and {huge / 1e31:.1f}·10³¹ for r = 0.3, instead of 1",
    )


def test_ward_with_the_wider_gaussian():
    """Equation 5b over 5a where tanθ_h = 2α, for light and viewer on the half vector."""
    ratios = []
    for alpha in (0.1, 0.3, 0.5):
        cos = 1 / np.hypot(1, 2 * alpha)
        w = np.array([[np.sqrt(1 - cos**2), 0, cos]])
        ratio = np.exp(4 - 2 * (1 - cos**2) / alpha**2 / (1 + cos))
        option = partial(ref.ward, w, w, **SPECULAR, alpha_u=alpha, alpha_v=alpha)
        assert (option(variant="approximate") / option(variant="ward")).item() == pytest.approx(ratio)
        ratios.append(ratio)
    assert_printed(
        "ward",
        "{:.2f} times too large for α = 0.1, {:.2f} times for α = 0.3, and {:.2f} times for α = 0.5".format(*ratios),
    )


def test_shadowing_for_lamps_under_a_sky():
    """A smooth metal at grazing, with the k of analytic lights."""

    def folklore(wi, wo):
        k, alpha2 = 1.1**2 / 8, 0.1**4
        g = [w[:, 2] / (w[:, 2] * (1 - k) + k) for w in (wi, wo)]
        return alpha2 / (np.pi * (1 + (alpha2 - 1) * half(wi, wo)[0] ** 2) ** 2) * g[0] * g[1] / (4 * wi[:, 2])

    metal = {"base_color": 1.0, "metallic": 1.0, "roughness": 0.1}
    dark = albedo(folklore, 89)
    direct, ibl, smith = (
        albedo(partial(ref.metallicroughness, **metal, shadowing=name), 89) for name in ("direct", "ibl", "smith")
    )
    assert direct == pytest.approx(dark)
    assert_printed(
        "metallicroughness",
        f"the albedo at 89° is {dark:.2f} instead of {ibl:.2f}, or {smith:.2f} with Smith's term",
    )


def test_brady_is_no_distribution():
    def folklore(wi, wo):
        cos, cos_d = half(wi, wo)
        return np.exp(-((1 / cos**2 - 1) / 0.3**4)) / (4 * cos_d) * wo[:, 2]

    dim = albedo(folklore)
    lobe = {"f0": 1.0, "exponent": 2.0, "beta": 0.3, "normalization": "none"}
    assert albedo(partial(ref.brady, **SPECULAR, **lobe)) == pytest.approx(dim)
    assert_printed("brady", f"the albedo at 0° is {dim:.3f}")
