"""The published materials: their numbers, their formulas, and how they are named."""

import re

import mitsuba as mi
import numpy as np
import pytest
import reference
from generate import presets as generator
from support import ROOT, call, direction, hemisphere, lattice, rows, shared
from test_cli import invoke

import mi_brdfs
from mi_brdfs import srgb
from mi_brdfs.parameters.published import provenance
from mi_brdfs.testing import assert_bsdf

SETS = sorted({name.rpartition("/")[0] for name in mi_brdfs.presets()})


def of_set(name):
    return [it for it in mi_brdfs.presets() if it.startswith(f"{name}/")]


def numbers_of(name):
    """A preset's own numbers, without the words."""
    values = {k: v for k, v in mi_brdfs.preset(name).items() if not isinstance(v, str)}
    return {k: np.array(v["value"] if isinstance(v, dict) else v) for k, v in values.items()}


# --- What the papers print ------------------------------------------------------------------------------------------

SCALE = np.array([1, 1.15, 1.66])
PRINTED = {
    name: [np.fromstring(numbers, sep=" ") for numbers in others]
    for name, *others in (row.split(" | ") for row in rows("presets.txt"))
}
"""Of a material in each set: the albedo of the diffuse lobe, the colour of the other one, its width, …"""


@pytest.mark.parametrize("name", PRINTED)
def test_numbers_are_those_of_the_paper(name):
    """In Ngan's colours but for the scale of MERL's channels; the kit's exponent n has the factor n+2 for n+1."""
    diffuse, specular, others = PRINTED[name]
    scale = SCALE if name.startswith("ngan") else 1
    values = numbers_of(name)
    scale_of_lobe = scale * (others[0] + 1) / (others[0] + 2) if "ashikhmin" in name else scale
    np.testing.assert_allclose(values.pop("diffuse_reflectance"), np.multiply(diffuse, scale), rtol=1e-6)
    lobe = values.pop("a") if "a" in values else values.pop("specular_reflectance")
    np.testing.assert_allclose(lobe, np.multiply(specular, scale_of_lobe), rtol=1e-6)
    np.testing.assert_allclose(sorted(map(float, values.values())), sorted(others), rtol=1e-6)


def test_data_file_is_generated():
    assert generator.text_of(shared("fits")) == generator.FILE.read_text(encoding="utf-8")


def test_conventions_of_ngan_agree():
    """The exponents of Blinn and Phong belong to the half vector: about the mirror direction they would be a quarter of
    those of Ashikhmin and Shirley. What narrow lobes of Cook and Torrance reflect towards the mirror direction is what
    those of Ashikhmin and Shirley do: with 1/π for 1/4, 1.27 times that."""
    materials = [it.rpartition("/")[2] for it in of_set("ngan/ward")]
    exponents, reflected = [], []
    for material in materials:
        phong, cook, ashikhmin = (
            numbers_of(f"ngan/{model}/{material}") for model in ("blinn-phong", "cook-torrance", "ashikhmin-shirley")
        )
        exponents.append(phong["exponent"] / ashikhmin["exponent"])
        if cook["alpha"] < 0.1:
            colours = (it["specular_reflectance"][1] * it["f0"] for it in (cook, ashikhmin))
            reflected.append(np.divide(*colours))
    assert 0.7 < np.median(exponents) < 2
    assert len(reflected) > 40 and abs(np.median(reflected) - 1) < 0.05


# --- Values ---------------------------------------------------------------------------------------------------------


def published(name, i, o):
    """What a set's paper says of the specular lobe, without its colour, times cosθ_o."""
    it, group = numbers_of(name), name.rpartition("/")[0]

    def fresnel(cos):
        return (
            reference.fresnel_schlick(cos, it["f0"]) if "f0" in it else reference.fresnel_dielectric(cos, it["int_ior"])
        )

    if group.startswith("ngan/ward"):
        return reference.ward(i, o, 0, 1, it["alpha"], it["alpha"], group.removeprefix("ngan/"))
    if group == "ngan/blinn-phong":
        return reference.blinn(*reference._half(i, o), it["exponent"]) * o[:, 2]
    if "cook-torrance" in group:
        normalization = "modern" if group.startswith("ngan") else "tog82"
        return reference.cooktorrance(i, o, 0, 1, it["alpha"], "beckmann", normalization, fresnel)
    if "ashikhmin-shirley" in group:
        n = it["exponent"]
        to_paper = (n + 2) / (n + 1)  # the colour is the kit's
        return to_paper * reference.ashikhminshirley(i, o, 0, 1, n, n) * fresnel(reference._cos_d(i, o))
    assert group in ("low/microfacet", "low/smooth")
    return reference.low(i, o, 0, 1, it["b"], it["c"], it["int_ior"], group.removeprefix("low/"))


def width(name):
    """About the slope at which a lobe ends."""
    it = numbers_of(name)
    return float(it.get("alpha") or (2 / it.get("exponent", it.get("b"))) ** 0.5)


def pairs(name):
    """Directions about the mirror direction, as far as the lobe is wide, and all over: (wi, wo), float32."""
    tangents = min(width(name), 1) * np.array([0, 0.3, 1, 2, 3.5])
    phis, thetas = np.radians([10, 130, 250]), np.radians([0, 20, 45, 70, 85])
    theta, tan, phi = (grid.ravel() for grid in np.meshgrid(thetas, tangents, phis))
    wi = np.stack([np.sin(theta), 0 * theta, np.cos(theta)], axis=1)
    h = np.stack([tan * np.cos(phi), tan * np.sin(phi), np.ones_like(tan)], axis=1)
    h /= np.linalg.norm(h, axis=1, keepdims=True)
    wo = 2 * (wi * h).sum(1)[:, None] * h - wi
    wi, wo = (np.concatenate([a, hemisphere(30, seed)]).astype(np.float32) for a, seed in ((wi, 1), (wo, 2)))
    above = wo[:, 2] > 0.02
    return wi[above], wo[above]


@pytest.mark.usefixtures("llvm_rgb")
@pytest.mark.parametrize(
    "group", ["ngan/cook-torrance", *(pytest.param(it, marks=pytest.mark.slow) for it in SETS if "n/cook" not in it)]
)
def test_each_evaluates_to_its_formula(group):
    """Within 1e-4 of every channel where f is above 1e-6 of its peak."""
    ctx = mi.BSDFContext()
    for name in of_set(group):
        wi, wo = pairs(name)
        values = mi_brdfs.preset(name)
        (value,) = call(mi.load_dict(values).eval, ctx, wi, wo)
        i, o = wi.astype(np.float64), wo.astype(np.float64)
        colour = np.array(values["a" if "a" in values else "specular_reflectance"]["value"])
        diffuse = np.array(values["diffuse_reflectance"]["value"]) / np.pi * o[:, 2:]
        expected = diffuse + published(name, i, o)[:, None] * colour
        checked = expected > 1e-6 * expected.max()
        assert checked.mean() > 0.4
        np.testing.assert_allclose(value[checked], expected[checked], rtol=1e-4, err_msg=name)


@pytest.mark.slow
@pytest.mark.usefixtures("llvm_rgb")
def test_albedo():
    """Below one up to 89.9°, or as much as the page of the plugin states, for the materials that say so."""
    points, ctx = lattice(5, 1), mi.BSDFContext()
    angles = [0, 45, 70, 80, 85, 89, 89.9]
    wi = np.repeat([direction(theta, 17) for theta in angles], len(points), axis=0)
    uniform = np.tile(points, (len(angles), 1))
    gains = {}
    for name in mi_brdfs.presets():
        bsdf = mi.load_dict(mi_brdfs.preset(name))
        weight = call(bsdf.sample, ctx, wi, uniform[:, :1], uniform[:, 1:])[2]
        albedo = weight.reshape(len(angles), len(points), -1).mean(axis=1)
        assert albedo.max() < max(bsdf.model.stated_albedo(), 1), name
        assert albedo[:5].max() < 0.9, name
        if albedo.max() > 1:
            gains.setdefault(name.rpartition("/")[0], {})[name] = albedo.max()
    (paint,) = gains.pop("low/cook-torrance-e1")
    assert paint.endswith("white-paint") and "white-paint" in provenance(paint).defects[-1]
    (duer,) = gains.values()
    words = provenance(next(iter(duer))).defects[-1]
    assert f"the albedo of {len(duer)} materials" in words and f"up to {max(duer.values()):.1f}" in words


NARROWEST = {mi_brdfs.preset(name)["type"]: name for name in sorted(mi_brdfs.presets(), key=width, reverse=True)}


@pytest.mark.slow
@pytest.mark.usefixtures("llvm_rgb")
@pytest.mark.parametrize("name", NARROWEST.values())
def test_check_of_the_narrowest_of_each_model(name):
    assert_bsdf(mi_brdfs.preset(name), only=["finite", "support", "eval_pdf", "weight", "albedo"])


# --- Names ----------------------------------------------------------------------------------------------------------


def test_names():
    """As many as README says, of a model, and the user's own."""
    assert f"lists {len(mi_brdfs.presets())} materials" in (ROOT / "README.md").read_text(encoding="utf-8")
    ward = mi_brdfs.presets("ward")
    assert set(ward) < set(mi_brdfs.presets()) and {mi_brdfs.preset(name)["type"] for name in ward} == {"ward"}
    name = "ngan/ward/blue-acrylic"
    before = mi_brdfs.preset(name)
    mi_brdfs.preset(name)["diffuse_reflectance"]["value"][0] = 9
    assert mi_brdfs.preset(name) == before


@pytest.mark.parametrize(
    "wrong, sentence",
    [
        ("ngan/ward/blu-acrylic", "There is no preset 'ngan/ward/blu-acrylic'; did you mean 'ngan/ward/blue-acrylic'?"),
        ("ngan/wardd/chrome", "did you mean 'ngan/ward/chrome'?"),
        ("ngan/ward/qqq", "There is no preset 'ngan/ward/qqq'; mi-brdfs presets and mi_brdfs.presets() list them."),
        ("ngan/lafortune/chrome", "rounding moves and scales the lobes"),
        ("low/ashikhmin-shirley-e1/white-paint", "the scale of its specular lobe is 1.29, above 1."),
        (("ward", "ngan/ward/chrme"), 'preset = "ngan/ward/chrme" is unknown; did you mean "ngan/ward/chrome"? It '),
        (("low", "chrome"), 'is unknown; did you mean "low/microfacet/chrome"? It must be'),
        (("ward", "low/smooth/chrome"), '"low/smooth/chrome" is a material of the plugin low; it must be a '),
        (("ward", 3.5), "ward: preset = 3.5 is a number; it must be a name."),
        (("ward", ""), 'preset = "" is unknown; it must be a material that `mi-brdfs presets --model ward` lists.'),
    ],
)
def test_wrong_names(llvm_rgb, wrong, sentence):
    """In Python, and as a parameter of a plugin."""
    with pytest.raises((ValueError, RuntimeError), match=re.escape(sentence)):
        mi_brdfs.preset(wrong) if isinstance(wrong, str) else mi.load_dict({"type": wrong[0], "preset": wrong[1]})


# --- As a parameter -------------------------------------------------------------------------------------------------


def described(given, name):
    """A plugin dict with a preset, loaded, without the line that names it."""
    return str(mi.load_dict(given)).replace(f"  preset = {name},\n", "")


def test_parameter(variant):
    """A plugin with a preset is the one with its values, in every variant; ``traverse`` has them all."""
    for name in [of_set(group)[7] for group in SETS]:
        values = mi_brdfs.preset(name)
        given = {"type": values["type"], "preset": name}
        assert described(given, name) == str(mi.load_dict(values))
        keys = [[*mi.traverse(mi.load_dict(bsdf)).keys()] for bsdf in (given, values)]
        assert keys[0] == keys[1] != []


ON_TOP = [
    ("ngan/ward/chrome", {"alpha_u": 0.3, "alpha_v": 0.2}, ["alpha"]),
    ("ngan/ward/chrome", {"diffuse_reflectance": {"type": "checkerboard"}}, []),
    ("ngan/ward/chrome", {"variant": "balanced"}, []),
    ("low/cook-torrance-e2/chrome", {"material": "Au"}, ["int_ior", "ext_ior"]),
    ("low/cook-torrance-e2/chrome", {"int_ior": 2.5}, []),
    ("ngan/cook-torrance/chrome", {"int_ior": 1.5}, ["f0"]),
    ("ngan/ashikhmin-shirley/chrome", {"distribution": "ggx", "shadowing": "smith"}, ["exponent"]),
    ("ngan/ashikhmin-shirley/chrome", {"distribution": "blinn"}, []),
    ("ngan/ashikhmin-shirley/chrome", {"exponent": 5}, []),
    ("low/microfacet/chrome", {"variant": "smooth"}, ["normalization"]),
    ("low/microfacet/chrome", {"normalization": "unit", "a": 0.5}, []),
]


def test_others_on_top(llvm_rgb):
    for name, given, replaced in ON_TOP:
        values = {key: value for key, value in mi_brdfs.preset(name).items() if key not in replaced} | given
        assert described({"type": values["type"], "preset": name, **given}, name) == str(mi.load_dict(values))


# --- On the command line --------------------------------------------------------------------------------------------


def test_the_command_lists_and_shows():
    first = "ngan/ward/blue-acrylic"
    listed = invoke("presets", "--model", "ward", "--like", "Acrylic").stdout.splitlines()
    (row,) = (line.split() for line in listed if first in line)
    assert row == [first, "ward", "#1f365b", "α", "0.0162"] and len(listed) == 9
    text = invoke("presets", "ngan/ward-duer/chrome").stdout
    assert eval(text[: text.index("}\n\n") + 1]) == mi_brdfs.preset("ngan/ward-duer/chrome")
    xml = text[text.index("<bsdf") : text.index("</bsdf>")] + "</bsdf>"
    with mi.variant_context("llvm_ad_rgb"):
        assert "ngan/ward-duer/chrome" in str(mi.load_string(xml.replace("<bsdf", '<bsdf version="3.0.0"', 1)))
    origin = provenance("ngan/ward-duer/chrome")
    said = " ".join(text.split())
    assert all(words in said for words in [origin.source, origin.doi, origin.convention, *origin.defects])


@pytest.mark.parametrize("linear, encoded, byte", [(0, 0, 0), (0.001, 0.01292, 3), (0.18, 0.461356, 118), (1, 1, 255)])
def test_srgb(linear, encoded, byte):
    """The curve of IEC 61966-2-1, in both its parts; what no display shows is clipped."""
    assert srgb.encoded(linear) == pytest.approx(encoded, abs=1e-6)
    assert srgb.decoded(encoded) == pytest.approx(linear, abs=1e-6)
    assert srgb.encoded_8bit([linear, np.nan, -1, 2]).tolist() == [byte, 0, 0, 255]
