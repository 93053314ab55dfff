"""A package of somebody else, ``tests/guest``, that brings a model with a kind of parameter, a distribution and a
sampler by an entry point: nothing in the project knows of it."""

import importlib.metadata

import mitsuba as mi
import numpy as np
import pytest
from support import call, hemisphere
from test_cli import invoke

import mi_brdfs
from mi_brdfs.explorer.controls import controls_of
from mi_brdfs.fit import fit
from mi_brdfs.gallery.contents import Sweep, sweeps_of
from mi_brdfs.mitsuba.registry import find_model

pytestmark = pytest.mark.skipif(
    not importlib.metadata.entry_points(group="mi_brdfs.models", name="guest"),
    reason="the guest is not installed: pip install ./tests/guest",
)

KIT = {"type": "microfacet", "distribution": "student-t", "alpha_u": 0.2, "alpha_v": 0.5, "gamma": 2.2,
       "shadowing": "vcavity"}  # fmt: skip


def lommel_seeliger(wi, wo):
    return 0.6 / (4 * np.pi * (wi[:, 2] + wo[:, 2])) * wo[:, 2]


def student_t(wi, wo):
    h = wi + wo
    h /= np.linalg.norm(h, axis=1, keepdims=True)
    cos_d = (wi * h).sum(axis=1)
    t = ((h[:, 0] / 0.2) ** 2 + (h[:, 1] / 0.5) ** 2) / h[:, 2] ** 2
    ndf = (1 + t / 1.2) ** -2.2 / (np.pi * 0.2 * 0.5 * h[:, 2] ** 4)
    shadowing = np.minimum(1, 2 * h[:, 2] * np.minimum(wi[:, 2], wo[:, 2]) / cos_d)
    return ndf * shadowing / (4 * wi[:, 2])


@pytest.mark.parametrize(
    "bsdf, reference", [({"type": "regolith", "w": 0.6}, lommel_seeliger), (KIT, student_t)], ids=["model", "D"]
)
def test_formulas(llvm_rgb, bsdf, reference):
    wi, wo = hemisphere(10_000, 1), hemisphere(10_000, 2)
    got = call(mi.load_dict(bsdf).eval, mi.BSDFContext(), wi, wo)[0][:, 0]
    expected = reference(wi.astype(np.float64), wo.astype(np.float64))
    np.testing.assert_allclose(got, expected, rtol=1e-4, atol=1e-6 * expected.max())


def command(folder, *words):
    done = invoke(*words, cwd=folder)
    assert done.exit_code == 0, done.output
    return done.stdout


def test_it_is_listed_and_has_a_page(tmp_path, llvm_rgb):
    assert {"regolith", "dust"} <= set(mi_brdfs.list_models())
    assert "The law of Lommel and Seeliger" in command(tmp_path, "list")
    assert "single-scattering albedo w" in command(tmp_path, "info", "dust")
    page = command(tmp_path, "info", "microfacet")
    assert "student-t" in page and "with beckmann, ggx and student-t" not in page


@pytest.mark.slow
@pytest.mark.parametrize("word", ["dust", "vcavity", "bare"])
def test_it_passes_all_checks(tmp_path, word, llvm_rgb):
    (tmp_path / "kit.xml").write_text(
        '<bsdf type="microfacet" version="3.0.0"><string name="distribution" value="student-t"/>'
        f'<string name="shadowing" value="{word}"/><float name="alpha" value="0.5"/></bsdf>'
    )
    assert "fail" not in command(tmp_path, "check", word if word == "dust" else "kit.xml")


def test_its_sampler_is_that_of_the_lobe(llvm_rgb):
    """The density is the cosine's, whatever D is."""
    bsdf = mi.load_dict({"type": "microfacet", "distribution": "student-t", "shadowing": "bare"})
    wi, wo = hemisphere(1000, 1), hemisphere(1000, 2)
    np.testing.assert_allclose(call(bsdf.pdf, mi.BSDFContext(), wi, wo)[0][:, 0], wo[:, 2] / np.pi, rtol=1e-6)


def test_its_kind_of_parameter_is_known_everywhere(llvm_rgb):
    """Fits seek it, the explorer has a slider for it, the gallery sweeps it."""
    model = find_model("dust")
    wi, wo = hemisphere(2000, 1), hemisphere(2000, 2)
    f = 0.6 * lommel_seeliger(wi.astype(np.float64), wo.astype(np.float64)) / wo[:, 2]
    fitted = fit((wi, wo, f[:, None]), "dust", given={"w": 0.6}, starts=2)[0]
    assert abs(fitted.bsdf["craters"] - 40) < 0.1
    (control,) = [it for it in controls_of(model, {"type": "dust"}) if it["name"] == "craters"]
    assert (control["kind"], control["low"], control["high"]) == ("number", 0, 100)
    assert Sweep("craters", (0.0, 25.0, 50.0, 75.0), {}) in sweeps_of(model)


@pytest.mark.slow
def test_its_energy_is_measured(tmp_path, llvm_rgb):
    """As the integral has it: w/2 (1 - μ ln(1 + 1/μ)) at 89.9°, for w = 0.3 and 1."""
    cosine = np.cos(np.radians(89.9))
    largest = 0.5 * (1 - cosine * np.log(1 + 1 / cosine))
    assert [np.ceil(1000 * w * largest) for w in (0.3, 1)] == [149, 495]
    assert "energy = Energy(0.149, [({}, 0.495)])" in command(tmp_path, "energy", "dust")


@pytest.mark.slow
def test_it_is_plotted_and_pictured(tmp_path, llvm_rgb):
    command(tmp_path, "plot", "dust", "-o", "dust.png")
    command(tmp_path, "gallery", "dust", "-o", "pictures", "--size", "32", "--spp", "4")
    assert (tmp_path / "dust.png").exists() and (tmp_path / "pictures" / "regolith.png").exists()
