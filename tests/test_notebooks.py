"""The notebooks run, and do what they say."""

import ast
import json
import re
from functools import partial
from unittest.mock import patch

import matplotlib
import mitsuba as mi
import numpy as np
import pytest
from generate.notebooks import FOLDER, NOTEBOOKS, code_cells
from generate.notebooks import read as read_notebook
from support import call, context, hemisphere

import mi_brdfs
from mi_brdfs.fit import noisy, pictures
from mi_brdfs.plot import maps

matplotlib.use("Agg")

import matplotlib.pyplot as plt

SAMPLES = 16
"""Samples per pixel of renderings that take theirs from the scene."""
MOST = 1 << 22
"""The most samples of a rendering."""
LARGE, FEW = 160**2, 4
"""Pictures of more pixels, and those of solutions, have fewer samples per pixel: they are looked at, and not fitted or
compared."""
FITTED, LOOKS = 1 << 16, 2
"""Samples of a rendering within a fit to pictures, whose noise, and sigma, are twice as large, and how often its result
is looked at."""


def run_notebook(path, monkeypatch):
    """Execute the code cells of a notebook in order, in ``llvm_ad_rgb`` and in its folder; the namespace that they
    leave."""
    names = {}
    monkeypatch.chdir(path.parent)
    monkeypatch.delenv("MI_BRDFS_DATA", raising=False)  # as the committed outputs were made
    monkeypatch.setattr(pictures, "SAMPLES", FITTED)
    monkeypatch.setattr(noisy, "LOOKS", LOOKS)
    with mi.variant_context("llvm_ad_rgb"):
        for cell in code_cells(read_notebook(path)):
            is_solution = "solution" in cell["metadata"].get("tags", ())
            with patch("mitsuba.render", partial(grainy, is_solution=is_solution)):
                exec(compile("".join(cell["source"]), f"{path.name}: {cell['id']}", "exec"), names)
    plt.close("all")
    return names


def grainy(scene, *args, is_solution, render=mi.render, spp=SAMPLES, sensor=0, **options):
    """``mi.render`` with fewer samples."""
    film = (scene.sensors()[sensor] if isinstance(sensor, int) else sensor).film()
    pixels = int(np.prod(film.size()))
    most = FEW if is_solution or pixels > LARGE else MOST // pixels
    return render(scene, *args, spp=min(spp, most), sensor=sensor, **options)


# --- What they say --------------------------------------------------------------------------------------------------


def first_light(names):
    recovered = {key.split(".")[2]: value.numpy().ravel() for key, value in names["recovered"].items()}
    assert names["losses"][-1] < 0.5 * names["losses"][0]  # what remains is the noise of 16 samples
    assert recovered["specular_reflectance"] == pytest.approx([0.8, 0.5, 0.35], abs=0.08)
    assert recovered["alpha_u"] == pytest.approx(0.08, abs=0.02)
    assert recovered["alpha_v"] == pytest.approx(0.3, abs=0.04)
    assert recovered["diffuse_reflectance"] == pytest.approx(0.05, abs=0.02)


def is_my_sampler_right(names):
    reports = names["reports"]
    assert names["walter"].passed and names["roughconductor"].passed and names["facets"].passed
    assert failed_checks(reports["no_jacobian"]) == failed_checks(reports["loses_samples"]) == {"pdf", "chi2"}
    assert failed_checks(reports["wrong_weight"]) == {"weight"}

    albedo = {report.name: albedos(report) for report in [*reports.values(), names["walter"]]}
    assert albedo["facets"] == pytest.approx(albedo["walter"], rel=0.01)
    kept = {name: {angle: albedo[name][angle] / albedo["facets"][angle] for angle in (0, 70)} for name in reports}
    assert kept["no_jacobian"][0] == pytest.approx(0.25, abs=0.03)
    for name in ("loses_samples", "wrong_weight"):
        assert 0.94 < kept[name][0] < 0.965 and 0.84 < kept[name][70] < 0.885

    middle, rim = np.s_[40:56, 40:56], np.s_[40:56, 84:88]
    balls = {name: np.array(picture) for name, picture in names["balls"].items()}
    dimmer = {n: [1 - ball[part].mean() / balls["facets"][part].mean() for part in (middle, rim)]
              for n, ball in balls.items()}  # fmt: skip
    assert dimmer["wrong_weight"] == pytest.approx([0.035, 0.035], abs=0.02)
    assert dimmer["loses_samples"] == pytest.approx([0.01, 0.1], abs=0.02)

    assert (names["eta"]["walter"] > names["eta"]["roughconductor"]).all()
    assert (names["eta"]["roughconductor"][6:] > names["eta"]["facets"][6:] + 0.03).all()
    drawn = names["facets"].of("pdf")[0].data["80°"]
    assert drawn["drawn"] == pytest.approx(drawn["integral"], abs=0.003) and drawn["drawn"] < 0.7


def recover_a_material(names):
    excess = {model: error / names["noise"] for model, error in names["errors"].items()}
    assert excess["walter"] < 1.1
    assert min(excess[model] for model in ("phong", "ward", "burley")) > 2
    found = {
        model: {key.split(".")[2]: value for key, value in fit.values.items()}
        for model, (_, fit) in names["fits"].items()
    }
    for name, hidden in names["hidden"].items():
        assert found["walter"][name] == pytest.approx(hidden, abs=0.02), name
        sigma = np.array(names["fits"]["walter"][1].sigma[f"ball.bsdf.{name}.value"])
        assert (abs(np.array(found["walter"][name]) - hidden) < 4 * sigma).all(), name
    for model in ("phong", "ward"):
        assert found[model]["diffuse_reflectance"][0] > 0.15
    difference = {model: np.array(fit[0] - names["target"]) for model, fit in names["fits"].items()}
    assert difference["phong"][28:36, 57:60].mean() < -0.1  # the reflection of the light from behind
    assert difference["ward"][18:26, 18:26].mean() < -0.02  # the middle of the highlight
    red, _, blue = difference["burley"][8:16, 8:40].mean(axis=(0, 1))  # the ball where light falls on it
    assert red > 0.005 and blue < -0.005
    red, _, blue = difference["burley"][18:26, 18:26].mean(axis=(0, 1))
    assert red < -0.1 and blue > 0.1


def write_your_own_brdf(names):
    report = names["report"]
    assert report.passed
    assert {finding.check for finding in report.findings if finding.verdict == "skip"} <= {"spectral", "null", "deltas"}
    assert min(efficiencies(report)) > 0.98
    assert names["cosine"].passed
    assert efficiencies(names["cosine"])[-1] == pytest.approx(0.84, abs=0.01)
    assert failed_checks(names["slip"]) == {"chi2"}
    assert albedos(names["slip"])[89.9] > 3 * 0.148
    assert names["refusal"].endswith("lommelseeliger: scattering = 1.5 is not allowed; it must be a number, rgb or "
                                     "spectrum within [0, 1] or a texture.")  # fmt: skip

    # w/2 ∫ ν/(μ+ν) dν by the midpoint rule.
    nu = (np.arange(100_000) + 0.5) / 100_000
    for theta, albedo in albedos(report).items():
        assert albedo == pytest.approx(0.15 * np.mean(nu / (np.cos(np.radians(theta)) + nu)), rel=2e-3)

    moons = {key: np.array(picture)[..., 0] for key, picture in names["moons"].items()}
    full = moons["lommelseeliger", 0]
    assert full[64, 12:116] == pytest.approx(0.5, rel=1e-3)
    assert moons["lambert", 0][64, 12] < 0.6 * moons["lambert", 0][64, 64]
    assert moons["lommelseeliger", 70][64].argmax() > 115


def failed_checks(report):
    return {finding.check for finding in report.failures}


def albedos(report):
    found = report.of("albedo")[0].data
    return {theta: found[f"{theta:g}°"]["albedo"] for theta in (0, 30, 60, 70, 80, 89.9)}


def efficiencies(report):
    return list(report.of("efficiency")[0].data.values())


def from_a_goniometer_to_a_picture(names):
    stated = [it.stated for it in names["summary"].scatter]
    assert names["sums"] == pytest.approx(stated, rel=1e-3)
    ratio = [it.integrated / it.stated for it in names["summary"].scatter]
    assert ratio[0] == pytest.approx(4 / 3, abs=0.03) and ratio[3] == pytest.approx(3 / 4, abs=0.03)
    hold, zero = (np.array(names["gaps"][name])[..., 0] for name in ("hold", "zero"))
    assert (zero < hold + 0.05).mean() > 0.99
    towards_camera = np.s_[109:125, 120:136]  # on the ball
    assert zero[towards_camera].mean() < 0.001 < 0.09 < hold[towards_camera].mean()
    peak, middle = (names["f"][k].max() / names["f"][0].max() for k in (3, 2))
    assert 45 < peak < 60 and names["at_70"] > 10 * names["at_50"] and middle < 10
    assert (names["at_30"] + names["at_70"]) / 2 == pytest.approx(7 * names["at_50"], rel=0.05)
    assert np.sqrt(names["at_30"] * names["at_70"]) > 2 * names["at_50"]


def which_model_fits(names):
    held_out = {model: it.held_out for model, it in names["own"].items()}
    assert min(held_out, key=held_out.get) == "walter"
    assert 1.3 * held_out["walter"] < held_out["cooktorrance"] < 0.6 * held_out["ward"] < held_out["lambert"]
    metrics = names["by_metric"]
    for found in metrics.values():
        assert min(found, key=lambda model: found[model].held_out) == "walter"
    alpha = {metric: found["ward"].bsdf["alpha"] for metric, found in metrics.items()}
    assert 1.2 * alpha["ngan"] < alpha["log"] < alpha["cube-root"]
    spread = {cut: ranked[-1].held_out / ranked[0].held_out for cut, ranked in names["cuts"].items()}
    assert spread[40] < 1.15 < spread[60] < spread[80]
    assert len({ranked[0].model for ranked in names["cuts"].values()}) == 3
    splits = np.reshape(names["splits"], (4, 4))
    assert len({ranked[0].model for ranked in splits}) > 1
    assert all(min(ranked, key=lambda it: it.bic).model == "low" for ranked in splits)
    assert names["fixed"].bic - names["free"].bic == pytest.approx(-np.log(359), abs=0.5)
    assert names["fixed"].sigma["alpha"] < 0.5 * names["free"].sigma["alpha"]
    assert names["it"].undetermined == [] and -1.6 < names["it"].bsdf["cx"] < -1.2


def coming_from_mitsuba_06(names):
    assert names["difference"] < 1e-4  # of the same scene with the names of Mitsuba 3


def where_does_the_light_go(names):
    """What is stated in the pages of the ways, within the noise of walks of 200,000 rays."""
    worst = names["worst"]
    assert worst["none"] > 0.5 and worst["walk"] < 0.008
    assert 0.02 < worst["kulla-conty"] < 0.04 and 0.03 < worst["turquin"] < 0.055
    for way, low, high in (("none", 0.14, 0.17), ("walk", 0.495, 0.505)):
        middle = np.array(names["balls"][way][2])[44:52, 44:52].mean()
        assert low < middle < high  # of a light of 0.5


def anatomy_of_a_microfacet_brdf(names):
    """The white furnace: Blinn's D without the 4, whose integral at normal incidence is 4 (n + 2^(-n/2))/(n+4)."""
    picture = names["picture"]
    assert picture[72:88, 72:88].mean() == pytest.approx(4 * (20 + 2**-10) / 24, rel=0.01)
    np.testing.assert_allclose(picture[[0, 0, -1, -1], [0, -1, 0, -1]], 1, rtol=1e-5)


# --- Tests ----------------------------------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.usefixtures("as_before")
@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_notebook(path, monkeypatch):
    names = run_notebook(path, monkeypatch)
    if says := globals().get(path.stem):
        says(names)


def test_a_model_is_written_on_public_names():
    """Those that docs/extending.md names."""
    notebook = read_notebook(FOLDER / "write_your_own_brdf.ipynb")
    code = "\n".join("".join(cell["source"]) for cell in code_cells(notebook))
    taken = set(re.findall(r"from (mi_brdfs[.\w]*) import", code)) | set(re.findall(r"\b(mi_brdfs\.\w+)", code))
    public = {f"mi_brdfs.{name}" for name in mi_brdfs.__all__} | {"mi_brdfs", "mi_brdfs.plot", "mi_brdfs.validation"}
    assert "mi_brdfs.register" in taken and taken <= public
    page = (FOLDER.parent / "docs" / "extending.md").read_text(encoding="utf-8")
    assert all(f"`{name}`" in page for name in taken & {"mi_brdfs.plot", "mi_brdfs.validation", "mi_brdfs.lobes"})


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_committed_form(path):
    """Sources are reviewable as text, and plain Python; all cells were run in order, without errors, and what they show
    is small and says nothing of the machine. Solutions of exercises begin with their numbers, and follow one another
    before the links at the end."""
    text, notebook = path.read_text(encoding="utf-8"), read_notebook(path)
    assert text == json.dumps(notebook, indent=1, ensure_ascii=False) + "\n"
    assert len({cell["id"] for cell in notebook["cells"]}) == len(notebook["cells"])
    cells = code_cells(notebook)
    assert [cell["execution_count"] for cell in cells] == [*range(1, len(cells) + 1)]
    for cell in cells:
        compile("".join(cell["source"]), cell["id"], "exec")
        for output in cell["outputs"]:
            assert output["output_type"] in ("stream", "display_data", "execute_result")
            assert output.get("name") != "stderr"
            assert set(output.get("data", {})) <= {"text/plain", "image/png", "image/jpeg"}
    assert len(text) < 1_000_000 and not re.search(r"/(home|root|tmp|Users)/|student-t|regolith", text)

    texts = ["".join(cell["source"]) for cell in notebook["cells"]]
    assert [text.splitlines(keepends=True) for text in texts] == [cell["source"] for cell in notebook["cells"]]
    (exercises,) = [text for text in texts if text.startswith("## Exercises\n")]
    tagged = ["solution" in cell["metadata"].get("tags", ()) for cell in notebook["cells"]]
    solutions = [text for text, is_one in zip(texts, tagged, strict=True) if is_one]
    numbers = [re.match(r"\*\*Solution (\d)\.\*\* ", text) for text in solutions]
    assert [found[1] for found in numbers if found] == re.findall(r"^(\d)\. ", exercises, re.MULTILINE) != []
    assert numbers[0] and not any(tagged[tagged.index(True) + len(solutions) :])


def test_texts_name_the_marks_that_are_drawn():
    """Of directions on a hemisphere."""
    drawn = {{"o": "circle", "+": "cross"}[mark["marker"]] for mark in (maps.WI, maps.MIRROR)}
    named = set()
    for path in NOTEBOOKS:
        text = "".join("".join(cell["source"]) for cell in read_notebook(path)["cells"])
        for sentence in re.findall(r"`plot\.hemisphere` maps.*?\.\s", text, re.DOTALL):
            named |= set(re.findall(r"circle|cross|triangle|square|dot|arrow", sentence))
    assert named == drawn


def test_every_notebook_has_its_place():
    """In the list that says in which order to read them."""
    listed = re.findall(r"^\d+\. \[.*?\]\((\w+)\.ipynb\)", (FOLDER / "README.md").read_text(encoding="utf-8"), re.M)
    assert sorted(listed) == [path.stem for path in NOTEBOOKS]


# --- The notebook on Mitsuba 0.6 ------------------------------------------------------------------------------------


def what_is_what():
    """The rows of its table: plugin, name in 0.6, name here, default."""
    cells = read_notebook(FOLDER / "coming_from_mitsuba_06.ipynb")["cells"]
    text = "\n".join("".join(cell["source"]) for cell in cells)
    rows = re.findall(r"^\| `(\w+)` \| `(\w+)` \| `(\w+)` \| (\S+) \|", text, re.MULTILINE)
    return [(plugin, old, new, parsed(default)) for plugin, old, new, default in rows]


def parsed(word):
    try:
        return ast.literal_eval(word.capitalize())
    except ValueError:
        return word


def values(bsdf):
    return call(bsdf.eval, context(), hemisphere(64, seed=1), hemisphere(64, seed=2))[0]


@pytest.mark.usefixtures("llvm_rgb")
def test_parameters_of_06():
    """The old name does what the new one does, which is something, and the default is as the table says."""
    assert len(what_is_what()) == 12
    for plugin, old, new, default in what_is_what():
        if isinstance(default, bool):
            tag, other = "boolean", not default
        elif isinstance(default, str):
            tag, other = "string", "ward-duer"
        else:
            tag, other = "float", 1.5 * default
        bsdf = f'<bsdf type="{plugin}"><{tag} name="{old}" value="{str(other).lower()}"/></bsdf>'
        scene = mi.load_string(f'<scene version="0.6.0"><shape type="sphere">{bsdf}</shape></scene>')
        named, alone, stated = (
            values(mi.load_dict({"type": plugin, **it})) for it in ({new: other}, {}, {new: default})
        )
        np.testing.assert_array_equal(values(scene.shapes()[0].bsdf()), named, err_msg=old)
        np.testing.assert_array_equal(alone, stated, err_msg=old)
        assert not np.allclose(named, alone, rtol=1e-3), old
