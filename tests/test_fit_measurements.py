"""Fits of files and arrays: weights, metrics, starts, what is told, and what is refused."""

import json
import sys
from pathlib import Path
from xml.etree import ElementTree

import fit_cost
import mitsuba as mi
import numpy as np
import pytest
import reference as ref
from fits import MODELS, measured, pairs
from support import LOFT, interaction, numbers, shared

import mi_brdfs
from mi_brdfs.fit import METRICS, FileError, FitError, fit, observe
from mi_brdfs.fit.lanes import Lanes
from mi_brdfs.fit.observations import solid_angles
from mi_brdfs.fit.unknowns import configurations
from mi_brdfs.lobes import LambertLobe
from mi_brdfs.measured import Axis, Grid, Measurement, Samples
from mi_brdfs.measured.coordinates import HalfDifference, Spherical
from mi_brdfs.mitsuba.registry import find_model
from mi_brdfs.observer import to_srgb
from mi_brdfs.parameters import Reflectance, Rotation

pytestmark = pytest.mark.usefixtures("llvm_rgb")

WARD = MODELS["ward"].drawn(1)


@pytest.fixture(scope="module")
def ward():
    return measured("ward", WARD, 1000)


def test_weights_are_solid_angles():
    """4 cosθd sinθh sinθd ΔθhΔθdΔφd of half and difference angles, and sinθi sinθo ΔθiΔθoΔφ of polar ones."""
    u, theta, phi = (np.arange(count) + 0.5 for count in (40, 30, 20))
    axes = (Axis(u / 40, low=0, high=1), Axis(theta / 60 * np.pi, low=0, high=np.pi / 2), Axis(phi / 20 * np.pi, np.pi))
    indices = np.unravel_index(np.arange(40 * 30 * 20), (40, 30, 20))
    place = [axis.nodes[index] for axis, index in zip(axes, indices, strict=True)]
    found = solid_angles(Grid(HalfDifference(), axes, np.zeros((40, 30, 20, 1))), indices)
    theta_h = np.pi / 2 * place[0] ** 2
    expected = (
        4 * np.cos(place[1]) * np.sin(theta_h) * np.sin(place[1]) * np.pi * place[0] / 40 * np.pi / 60 * np.pi / 20
    )
    np.testing.assert_allclose(found, expected, rtol=2e-3)
    axes = (axes[1], axes[1], Axis(phi / 10 * np.pi, 2 * np.pi))
    indices = np.unravel_index(np.arange(30 * 30 * 20), (30, 30, 20))
    found = solid_angles(Grid(Spherical(mirrored=False), axes, np.zeros((30, 30, 20, 1))), indices)
    sines = [np.sin(axes[0].nodes[index]) for index in indices[:2]]
    np.testing.assert_allclose(found, sines[0] * sines[1] * (np.pi / 60) ** 2 * 2 * np.pi / 20, rtol=2e-3)


def test_a_choice_that_means_nothing_is_fitted_once():
    words = {"variant": ("microfacet", "dsbrdf"), "fresnel": ("schlick", "none")}
    found = configurations(find_model("nishino"), words, {}, 1, 1, False)
    assert [it.title for it in found] == ["nishino", "nishino fresnel=none", "nishino variant=dsbrdf"]


def test_metrics_are_what_they_say():
    """Of a Lambertian surface that is fitted as black but for a fixed albedo."""
    wi, wo = pairs(400, 5)
    f = np.random.default_rng(1).uniform(0.1, 0.5, 400)
    (it,) = fit((wi, wo, f), "orennayar", given={"sigma": 0.0}, starts=1)
    rho, material = it.bsdf["reflectance"], observe((wi, wo, f))
    i, o = material.wi.astype(float), material.wo.astype(float)
    x, y = material.f[:, 0] * i[:, 2], rho / np.pi * i[:, 2]
    flat, solid = 1 / np.maximum(np.hypot(o[:, 0], o[:, 1]), np.sin(np.radians(2))), np.ones(len(x))
    for name, difference, weight in (
        ("log", np.log(1 + x) - np.log(1 + y), flat),
        ("l2", x - y, flat),
        ("ngan", x - y, solid),
        ("cube-root", x ** (1 / 3) - y ** (1 / 3), solid),
        ("bieron-l2", x - y, o[:, 2]),
        ("bieron-log", np.log(1 + x) - np.log(1 + y), o[:, 2]),
    ):
        half = slice(0, material.fitted)
        error = np.sqrt((weight * difference**2)[half].sum() / weight[half].sum())
        assert it.errors[name]["fitted"] == pytest.approx(error, rel=1e-4)
    assert set(it.errors) == set(METRICS)


@pytest.mark.slow
def test_each_metric_is_made_small():
    data = measured("walter", MODELS["walter"].drawn(3), 800, noise=0.1)
    fits = {name: fit(data, "ward", metric=name, starts=4)[0] for name in METRICS}
    for metric, best in fits.items():
        assert best.errors[metric]["fitted"] == min(it.errors[metric]["fitted"] for it in fits.values())


def test_colours_and_json(ward):
    wi, wo, _ = ward
    truth = [WARD | {"diffuse_reflectance": d} for d in (0.1, 0.2, 0.3)]
    f = np.stack([MODELS["ward"].reference(wi, wo, **each) / wo[:, 2] for each in truth], axis=-1)
    (it,) = fit((wi, wo, f), "ward", starts=2, given={"specular_reflectance": np.float32(WARD["specular_reflectance"])})
    assert it.bsdf["diffuse_reflectance"]["value"] == pytest.approx([0.1, 0.2, 0.3], rel=1e-3)
    row = json.loads(json.dumps(it.to_dict(), allow_nan=False))
    assert {"file", "model", "metric", "bsdf", "errors", "sigma", "starts"} <= row.keys()
    assert row["errors"]["log"].keys() == {"fitted", "held_out"}
    assert len(row["sigma"]["diffuse_reflectance"]) == 3 and row["starts"]["tried"] == 2
    assert ElementTree.fromstring(it.to_xml()).attrib == {"type": "ward"}
    pasted = mi.load_string(it.to_xml().replace("<bsdf ", '<bsdf version="3.0.0" ', 1))
    assert str(pasted) == str(mi.load_dict(row["bsdf"]))


def test_spectra_become_colours():
    """A reflectance of 0.4 below 600 nm and 0.1 above is cyan, in linear sRGB."""
    wi, wo = pairs(200, 2)
    wavelengths = np.arange(400.0, 701.0, 20)
    spectrum = np.where(wavelengths < 600, 0.4, 0.1)
    f = np.tile(spectrum / np.pi, (200, 1))
    f[:20, 5] = -0.1
    (it,) = fit(Measurement(Path("cyan"), "made", Samples(wi, wo, f, False), wavelengths), "lambert", starts=2)
    assert it.bsdf["reflectance"]["value"] == pytest.approx(spectrum @ to_srgb(wavelengths), rel=1e-4)
    assert it.bsdf["reflectance"]["value"][0] < 0.2 < it.bsdf["reflectance"]["value"][2]
    assert it.missing == 60 and it.negative == 0


def test_tinted_models_have_all_derivatives():
    """Burley's tints mix the channels of a colour."""
    wi, wo = pairs(600, 3)
    colour, tint = np.array([0.6, 0.3, 0.1]), 0.7
    f = ref.burley(wi, wo, colour, 0, 0, 0.5, tint, 0.4, 0, 0.8, 0.5, 0, 1) / wo[:, 2:]
    given = {"subsurface": 0.0, "metallic": 0.0, "clearcoat": None, "clearcoat_gloss": None}
    (it,) = fit((wi, wo, f), "burley", given=given, starts=2)
    assert it.bsdf["base_color"]["value"] == pytest.approx(colour, rel=1e-3)
    assert it.bsdf["spec_tint"] == pytest.approx(tint, rel=1e-2)


@pytest.mark.parametrize("given", [{}, {"alpha_u": 0.1}, {"alpha_u": "free", "alpha_v": 0.3}], ids=str)
def test_anisotropic_data_have_anisotropic_parameters(given):
    """Also if one of a pair is given."""
    wi, wo = pairs(3000, 4)
    f = ref.ward(*(ref.rotate(w, 0.1) for w in (wi, wo)), 0.2, 0.4, 0.1, 0.3, "balanced") / wo[:, 2]
    brushed = Measurement(Path("brushed"), "made", Samples(wi, wo, f[:, None], True), np.array([550.0]))
    (it,) = fit(brushed, "ward", starts=6, given=given)
    u, v, turn = (it.bsdf[name] for name in ("alpha_u", "alpha_v", "rotation"))
    if u > v:  # the same lobe, a quarter of a turn on
        u, v, turn = v, u, turn + 0.25
    assert (u, v) == (pytest.approx(0.1, rel=1e-3), pytest.approx(0.3, rel=1e-3))
    assert np.cos(4 * np.pi * (turn - 0.1)) == pytest.approx(1, abs=1e-5)


@pytest.mark.usefixtures("as_before")
def test_a_nap_is_turned_by_more_than_a_quarter():
    """Half a turn changes a cloth with a nap."""

    class Napped(LambertLobe):
        glossy = anisotropic = True

        def eval_pdf(self, wi, wo):
            value, pdf = super().eval_pdf(wi, wo)
            return value * (1 + wi.x / 2) * (1 + wo.x / 2), pdf

    nap = {"reflectance": Reflectance(0.3, "albedo"), "rotation": Rotation()}
    members = {"__doc__": "Cloth with a nap.", "lobes": lambda self, p: (Napped(p.reflectance),), **nap}
    mi_brdfs.register(type("Nap", (mi_brdfs.Model,), members))
    wi, wo = pairs(1000, 5)
    f = 0.4 / np.pi * np.prod([1 + ref.rotate(w, 0.6)[:, :1] / 2 for w in (wi, wo)], axis=0)
    (it,) = fit(Measurement(Path("nap"), "made", Samples(wi, wo, f, True), np.array([550.0])), "nap", starts=4)
    assert it.bsdf["reflectance"] == pytest.approx(0.4, rel=1e-4)
    assert it.bsdf["rotation"] == pytest.approx(-0.4, abs=1e-4)


@pytest.mark.slow
def test_tied_and_several_lobes():
    wi, wo = pairs(600, 6)
    lobe = {"specular_reflectance": 0.3, "cx": -1.0, "cy": -1.0, "cz": 1.0, "exponent": 40.0}
    back = {"specular_reflectance": 0.2, "cx": 1.0, "cy": 1.0, "cz": 1.0, "exponent": 10.0}
    f = ref.lafortune(wi, wo, 0.2, [lobe, back], "energy") / wo[:, 2]
    fixed = {f"{name}_{k + 1}": it[name] for k, it in enumerate((lobe, back)) for name in ("cx", "cy", "cz")}
    (it,) = fit((wi, wo, f), "lafortune", given=fixed, lobes=2, starts=3)
    assert it.bsdf["exponent_1"] == pytest.approx(40, rel=1e-3) and it.bsdf["exponent_2"] == pytest.approx(10, rel=1e-3)
    (tied,) = fit((wi, wo, f), "lafortune", given=fixed, tied={"exponent_2": "exponent_1"}, lobes=2, starts=2)
    assert tied.bsdf["exponent_2"] == tied.bsdf["exponent_1"]


def test_what_a_start_leaves_out_starts_where_it_suits_the_data(ward):
    (it,) = fit(ward, "ward", start={"type": "ward"}, starts=0)
    assert it.starts.tried == 1 and it.bsdf["alpha"] == pytest.approx(WARD["alpha"], rel=0.05)


@pytest.mark.slow
@pytest.mark.parametrize(
    "start",
    [
        {"type": "ward", "variant": "ward", "diffuse_reflectance": 0.01, "specular_reflectance": 0.05, "alpha": 0.3},
        mi_brdfs.preset(mi_brdfs.presets("ward")[0]),
    ],
    ids=["given", "published"],
)
def test_no_worse_than_a_warm_start(start):
    (it,) = fit(LOFT, "ward", given={"variant": "ward"}, start=start, starts=0)
    assert it.starts.tried == it.starts.warm == 2  # and the nearest published material
    grey = {name: np.mean(value["value"]) if isinstance(value, dict) else value for name, value in start.items()}
    material = observe(LOFT)
    value = numbers(mi.load_dict(grey).eval(mi.BSDFContext(), interaction(material.wi), mi.Vector3f(material.wo.T)))
    cos = material.wi[:, 2].astype(float)
    residual = np.log(1 + material.f[:, 0] * cos) - np.log(1 + value[:, 0] * cos / material.wo[:, 2])
    weight = material.solid_angle / np.maximum(np.hypot(material.wo[:, 0], material.wo[:, 1]), np.sin(np.radians(2)))
    half = slice(0, material.fitted)
    at_start = np.sqrt((weight * residual**2)[half].sum() / weight[half].sum())
    assert it.errors["log"]["fitted"] <= at_start


def test_more_starts_than_candidates_are_all_candidates():
    (it,) = fit(measured("lambert", {"reflectance": 0.4}, 50), "lambert", starts=3000)
    assert 400 > it.starts.tried > 100


def test_negatives_and_gaps_have_no_weight(ward):
    wi, wo, f = ward
    dirty = f.copy()
    dirty[::7], dirty[1::7], dirty[2::7] = np.nan, -50.0, np.inf
    (it,) = fit((wi, wo, dirty), "ward", starts=2)
    assert it.bsdf["alpha"] == pytest.approx(WARD["alpha"], rel=1e-3)
    assert it.negative == len(f[1::7]) and it.missing == len(f[::7]) + len(f[2::7])
    assert any(sentence.startswith("Without weight: ") for sentence in it.remarks())


@pytest.mark.slow
def test_tells_of_ends_albedos_and_narrow_lobes():
    wi, wo = pairs(1500, 8)
    bright = ref.lambert(wi, wo, 1.3) / wo[:, 2]
    (it,) = fit((wi, wo, bright), "lambert", starts=2)
    assert it.bounds == ["reflectance"] and it.sigma["reflectance"] is None
    (it,) = fit((wi, wo, bright), "low", given={"normalization": "paper"}, starts=4)
    assert it.albedo > 1 and any("albedo" in sentence for sentence in it.remarks())
    assert it.albedo == pytest.approx(1.3, rel=0.05)
    narrow = (0.1 * np.ones(1500)) / np.pi
    narrow[3] = 1e3
    mirror = wi * np.array([-1, -1, 1], np.float32)
    towards = wo.copy()
    towards[3] = mirror[3]
    (it,) = fit((wi, towards, narrow), "ward", given={"alpha": 0.001, "specular_reflectance": 0.5}, starts=1)
    assert not it.resolved and any("narrower" in sentence for sentence in it.remarks())


def test_no_more_values_than_unknowns_determine_nothing():
    """Any noise is fitted."""
    wi, wo, _ = measured("lambert", {"reflectance": 0.4}, 4)
    (it,) = fit((wi, wo, np.array([0.1, 0.4, 0.2, 0.3])), "phong", given={"exponent": 10.0}, starts=1)
    assert it.pairs == 2 and set(it.sigma.values()) == {None}
    assert it.undetermined == ["diffuse_reflectance", "specular_reflectance"]


@pytest.mark.slow
def test_tells_what_the_data_do_not_determine():
    """Lafortune's factors scale each other; of Burley's sheen's tint nothing is seen where there is no sheen."""
    (it,) = fit(measured("lafortune", MODELS["lafortune"].drawn(1), 800), "lafortune", starts=2)
    assert it.undetermined == ["cx", "cz"] and it.sigma["cx"] is it.sigma["cz"] is None and it.sigma["exponent"] > 0
    assert "cx" not in it.correlations and it.correlations["exponent"]["exponent"] == pytest.approx(1)
    given = {"metallic": 0.0, "sheen": 0.0, "specular": 0.5, "clearcoat": None, "clearcoat_gloss": None}
    (it,) = fit(measured("lambert", {"reflectance": 0.4}, 300), "burley", given=given, starts=2)
    assert "sheen_tint" in it.undetermined
    del given["sheen"]
    for seed in (0, 4):  # which end near to no sheen, and at it
        wi, wo, f = measured("lambert", {"reflectance": 0.4}, 300, seed, noise=0.02)
        (it,) = fit((wi, wo, f[:, None] * np.array([1, 0.7, 0.3])), "burley", given=given, starts=2)
        assert it.bsdf["sheen"] < 1e-4 and it.sigma["sheen_tint"] is None and "sheen_tint" in it.undetermined
    json.dumps(it.to_dict(), allow_nan=False)


@pytest.mark.slow
def test_predicts_how_much_is_scattered():
    """The albedo of a fit is the integral over what was measured, where nearly all of it was. What LOFT states is
    another one, and this is told."""
    (it,) = fit(LOFT, "walter", starts=4)
    assert [theta for theta, _, _ in it.scatter] == [10, 30, 50, 70]
    for theta, stated, values in it.scatter[:2]:
        assert it.albedos(theta)[0] == pytest.approx(values, rel=0.1)
        told = [sentence for sentence in it.remarks() if sentence.startswith(f"At {theta:g}° ")]
        assert len(told) == 1 and f"states {stated:.3g}" in told[0]


def test_materials_do_not_depend_on_others():
    """And the same seed gives the same fit."""
    noisy = measured("ward", WARD, 500, noise=0.05)
    alone, together = fit(noisy, "ward", starts=3)[0], fit([LOFT, noisy], "ward", starts=3)[1]
    assert alone == together


@pytest.mark.parametrize("where", ["between kernels", "within one"])
def test_what_is_broken_off_does_no_harm_while_its_traceback_lives(where, ward, monkeypatch):
    """The plugin that was fitted is part of the picture's kernel."""
    mi.set_variant("llvm_ad_rgb")

    def stop(*_):
        raise KeyboardInterrupt

    if where == "within one":
        monkeypatch.setattr(Lanes, "_tangent", stop)
    with pytest.raises(KeyboardInterrupt) as kept:
        fit(ward, "burley", starts=2, progress=stop)
    scene = mi.load_dict(mi_brdfs.preview_scene({"type": "lambert"}))
    assert 0.05 < mi.render(scene, spp=1).numpy().mean() < 1
    del kept


@pytest.mark.slow
def test_runs_without_a_variant_for_it(ward):
    with mi.variant_context("scalar_rgb"):
        (it,) = fit(ward, "ward", starts=1)
        assert it.albedo < 1 and mi.variant() == "scalar_rgb"


@pytest.mark.parametrize(
    ("data", "model", "options", "sentence"),
    [
        *((it, "ward", {}, "arrays: there are no two pairs of directions above the horizon, and within the cut at 80°")
          for it in ("below", "grazing", "negative", "dark", "one")),
        ("good", "lambert", {"given": {"reflectance": 0.5}}, "lambert has nothing to fit: all its parameters are"),
        ("good", "ward", {"given": {"alfa": 0.5}}, "ward: there is no parameter alfa; did you mean alpha?"),
        ("good", "ward", {"given": {"variant": "wards"}}, "ward: variant = 'wards' is unknown; it is balanced, ward, "
                                                          "ward-duer or approximate."),
        ("good", "ward", {"given": {"alpha": 7.0}}, "ward: alpha = 7 is not allowed; it must be a number in"),
        ("good", "ward", {"tied": {"alpha": "beta"}}, "ward: there is no parameter beta"),
        ("good", "ward", {"tied": {"alpha": "alpha"}}, "ward: alpha is tied, and another one to it; tie them to one"),
        ("good", "burley", {"start": {"anisotropic": 0.5}}, "isotropic data fix anisotropic; leave it out."),
        ("good", "ward", {"start": {"exponent": 3}}, "No fit can start at {'exponent': 3}: it is of another plugin"),
        ("good", "ward", {"metric": "logs"}, "There is no metric 'logs'; did you mean 'log'? There are log, l2"),
        ("good", "kurt", {"lobes": 9}, "There can be 8 lobes at most, not 9."),
        ("good", "ward", {"given": {"alpha": (0.1, 0.2)}}, "could not assign an object of type 'tuple' to key 'alpha'"),
        ("good", "ward", {"starts": 0}, "There is nothing to start from"),
        ("good", "ward", {"seed": -1}, "starts >= 0, lobes >= 1, pairs >= 2, seed >= 0 and a cut in (0, 90]"),
        ("good", "ward", {"starts": 1.5}, "A fit needs whole numbers starts >= 0"),
        ("shapes", "ward", {}, "Arrays (wi, wo, f) have the shapes (N, 3), (N, 3) and (N,), or (N, 3) of"),
        ("short", "ward", {}, "Arrays (wi, wo, f): directions must have the length 1, not 0.5."),
        ("nothing", "ward", {}, "There are no data to fit."),
        ("good", [], {}, "There is no model to fit"),
        ("file", "ward", {}, "none.bsdf: No such file or directory."),
    ],
)  # fmt: skip
def test_wrong_input_gets_a_sentence(data, model, options, sentence, ward, tmp_path):
    wi, wo, f = (array[:50] for array in ward)
    sources = {
        "good": (wi, wo, f), "below": (-wi, wo, f), "negative": (wi, wo, -f), "dark": (wi, wo, 1e-6 * f / f.max()),
        "shapes": (wi, wo[:4], f), "nothing": [],
        "short": (wi / 2, wo, f), "one": (wi[:1], wo[:1], f[:1]),
        "grazing": (wi, np.tile(np.float32([0.995, 0, 0.0999]), (50, 1)), f), "file": tmp_path / "none.bsdf",
    }  # fmt: skip
    with pytest.raises((FitError, FileError, ValueError)) as caught:
        fit(sources[data], model, **options)
    text = str(caught.value)
    assert sentence in text and "\n" not in text


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="memory is measured on Linux")
def test_repeated_fits_hold_no_more_memory():
    resident = [held for held, _ in fit_cost.memory(["lambert", "low"], repeats=12)]
    assert max(resident[6:]) - min(resident[6:]) < 4


@pytest.mark.slow
def test_real_materials_held_out():
    """Models fitted to half of the directions suit the other half as well, in the median."""
    files = sorted(shared("rgl").glob("*.bsdf"))
    ratios = [it.held_out / it.errors["log"]["fitted"] for it in fit(files, ["ward", "walter", "low"], starts=4)]
    assert np.median(ratios) < 1.05
