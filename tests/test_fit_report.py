"""The page of ``mi-brdfs fit``: complete, by itself, and with the numbers of the JSON; and the ranking by pictures."""

import base64
import json
import re
import shlex
import sys
from dataclasses import replace
from io import BytesIO

import mitsuba as mi
import numpy as np
import pytest
from PIL import Image
from support import LOFT, ROOT, Page
from test_cli import invoke

from mi_brdfs.fit import FitError, appearance, fit, observe, report
from mi_brdfs.fit.figures import Residuals, lobes
from mi_brdfs.fit.html import Card, Section, page_of, section_of
from mi_brdfs.fit.result import notes, values, whole
from mi_brdfs.measured import read
from mi_brdfs.mitsuba.registry import all_models
from mi_brdfs.probe.bsdf import BSDFProbe
from mi_brdfs.probe.sources import value_of

MEASURED = ROOT / "scenes" / "measured"
pytestmark = pytest.mark.usefixtures("llvm_rgb")

HOSTILE = "<b>&'\"{{1}}.bsdf"


def make_small(patch):
    """Render small pictures."""
    patch.setattr(appearance, "SIZE", 48)
    patch.setattr(appearance, "SAMPLES", 4)


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """``(stdout, rows of the JSON, page)`` of a file whose name would break a careless page."""
    folder = tmp_path_factory.mktemp("report")
    (folder / HOSTILE).write_bytes(LOFT.read_bytes())
    options = "--model", "lambert,ward", "-D", "variant=balanced,ward-duer", "-D", "alpha=0.4", "--starts", 2
    outputs = "--image", "--html", "r.html", "--json", "r.json"
    with mi.variant_context("llvm_ad_rgb"), pytest.MonkeyPatch.context() as patch:
        make_small(patch)
        done = invoke("fit", HOSTILE, *options, *outputs, cwd=folder)
    assert done.exit_code == 0, done.stderr
    rows = json.loads((folder / "r.json").read_text(encoding="utf-8"))
    return done.stdout, rows, (folder / "r.html").read_text(encoding="utf-8")


def test_the_page_needs_nothing_else(written):
    page = Page(re.sub(r"<script>.*?</script>", "", written[2], flags=re.DOTALL))
    links = [link for name in ("src", "href", "xlink:href") for link in page.attributes(name)]
    assert len(links) > 8 and all(link.startswith(("#", "data:image/")) for link in links)
    assert not re.search(r"@import|url\((?!#)|<link|<script src", written[2])
    assert "b" not in {tag for tag, _ in page.elements} and HOSTILE in page.text
    identifiers = page.attributes("id")
    assert len(set(identifiers)) == len(identifiers)
    assert page.text.count(f"Fits to {HOSTILE}") == 2
    assert {link[1:] for link in links if link.startswith("#")} <= set(identifiers)
    assert len(written[2]) < 700_000
    assert not re.search(r"<th[^>]*></th>", written[2])  # each column has a heading


def test_its_pictures_show_something(written):
    pictures = [link for link in Page(written[2]).attributes("src") if link.startswith("data:")]
    assert len(pictures) == 1 + 2 * 3  # the data, and each fit with its difference
    for link in pictures:
        shown = np.array(Image.open(BytesIO(base64.b64decode(link.partition("base64,")[2])))) / 255.0
        assert shown.shape == (48, 48, 3) and 0.1 < shown.mean() < 0.97 and shown.std() > 0.01
        assert (shown.max(axis=-1) == 1).mean() < 0.03 or link in pictures[2::2]  # differences are white
    drawings = Page(written[2]).pictures()
    assert sum(it.startswith("f over θo, θi = ") for it in drawings) == 4
    assert sum(it.startswith("Residuals of ") for it in drawings) == 3


def cells_of(kind, page):
    """The words of each row of a table."""
    table = page.partition(f'class="{kind}"')[2].partition("</table>")[0]
    return [re.sub(r"<[^>]*>", " ", row.partition(">")[2]).split() for row in table.split("<tr")[2:]]


def test_its_numbers_are_those_of_the_rows(written):
    stdout, rows, page = written
    shown = cells_of("ranking", page)
    assert len(shown) == len(rows) == 3
    assert [row["flip"] for row in rows] == sorted(row["flip"] for row in rows)
    for cells, row in zip(shown, rows, strict=True):
        numbers = row["flip"], row["errors"]["log"]["held_out"], row["errors"]["log"]["fitted"]
        at = len(row["model"].split()) + cells.index(row["model"].split()[0])
        assert cells[at : at + 3] == [f"{number:.4g}" for number in numbers]
        assert cells[at + 4] == f"{row['albedo']:.3g}"
        assert f"{row['flip']:.4g}" in stdout
    assert len(rows[0]["scatter"]) == 4 and "the file states" not in page  # the table says so
    ratios = [at["stated"] / at["values"] for at in rows[0]["scatter"]]
    assert max(ratios) > 1.1 and f"The file states {min(ratios):.2g} to {max(ratios):.2g} times what" in page
    for k, at in enumerate(rows[0]["scatter"]):
        numbers = at["stated"], at["values"], *(row["scatter"][k]["fit"] for row in rows)
        assert cells_of("scatter", page)[k] == [f"{at['theta_i']:g}°", *(f"{number:.3g}" for number in numbers)]


def test_parameters_are_fixed_and_choices_enumerated(written):
    rows = {row["model"]: row for row in written[1]}
    assert set(rows) == {"lambert", "ward", "ward variant=ward-duer"}
    for name in set(rows) - {"lambert"}:
        assert rows[name]["bsdf"]["alpha"] == 0.4 and "alpha" not in rows[name]["sigma"]
    assert "alpha" not in rows["lambert"]["bsdf"]


FIT = "fit", LOFT, "--model", "ward"


@pytest.mark.parametrize(
    ("package", "extra", "command"),
    [
        ("jinja2", "report", (*FIT, "-ofit.html")),
        ("flip_evaluator", "report", (*FIT, "--image")),
        ("matplotlib", "report", ("check", "ward", "--html", "check.html")),
        *((package, "gallery", ("gallery", "ward")) for package in ("PIL", "mitsuba_oidn", "jinja2")),
    ],
)
def test_a_missing_package_is_told_before_anything_is_done(package, extra, command, tmp_path, monkeypatch):
    for name in [package, *sys.modules]:
        if name.partition(".")[0] == package:
            monkeypatch.setitem(sys.modules, name, None)
        elif re.match(r"mi_brdfs\.(pages|gallery|fit\.html|validation\.html)", name):
            monkeypatch.delitem(sys.modules, name)
    done = invoke(*command, cwd=tmp_path)
    assert done.exit_code == 1 and done.stdout == ""
    assert done.stderr.startswith("mi-brdfs: ") and done.stderr.count("\n") == 1
    assert f"pip install 'mi_brdfs[{extra}]'" in done.stderr


@pytest.fixture
def small(monkeypatch):
    make_small(monkeypatch)


@pytest.fixture(scope="module")
def fits():
    """Of two materials, two each."""
    return fit([str(LOFT), str(MEASURED / "aeroglaze_z307.bsdf")], ["lambert", "ward"], starts=1)


LIKELIER = "By the BIC it would be second, which is better by 12."


@pytest.mark.parametrize(
    ("error", "bic", "told"),
    [
        (1.03, 9, "second is as good: its held-out error is only 3.0 % larger."),
        (1.03, 12, "second is close, its held-out error is only 3.0 % larger, but its BIC is worse by 12."),
        (1.03, -12, f"second is close: its held-out error is only 3.0 % larger. {LIKELIER}"),
        (2, -12, f"The held-out error of the next, second, is 2 times as large. {LIKELIER}"),
    ],
)
def test_the_verdict_heeds_the_evidence(fits, error, bic, told):
    """None is as good that has very strong evidence against it. Nothing is said twice."""
    first = replace(fits[0], model="first", bic=0, bounds=[], correlations={}, errors={"log": {"held_out": 1.0}})
    second = replace(fits[1], model="second", bic=bic, errors={"log": {"held_out": error}})
    section = Section("f", [Card(first), Card(second)])
    assert section.verdict == f"first comes nearest to the data. {told}"
    assert section.converged == "first was optimised from one start only."
    poor = replace(section, off=0.4)
    assert (
        poor.verdict
        == f"first comes nearest to the data, but fits poorly: try other models, or render the file itself. {told}"
    )
    rest = [Card(replace(second, bsdf={"type": model.plugins[0]})) for model in all_models()]
    all_tried, but_one = (replace(poor, cards=[*poor.cards, *own]).verdict for own in (rest, rest[1:]))
    assert all_tried == poor.verdict.replace(": try other models, or", ", and all models were tried:")
    assert but_one == poor.verdict


def test_ties_are_told(fits):
    """Beside each model that is about as good, by the error that ranks; not beside the best."""
    best, *others = (
        replace(fits[0], bounds=[], in_highlight=9, errors={"log": {"held_out": it}}) for it in (1, 1.04, 1.06)
    )
    assert [notes(it, best) for it in (best, *others)] == ["", "about as good", ""]
    best, *others = (replace(it, flip=flip) for it, flip in zip((best, *others), (1, 1.06, 1.04), strict=True))
    assert [notes(it, best) for it in (best, *others)] == ["", "", "about as good"]


@pytest.mark.parametrize(("f0", "option"), [
    (0.04, "f0=0.04"), ({"type": "rgb", "value": [0.5, 0.25, 1.0]}, "'f0=0.5;0.25;1'"),
])  # fmt: skip
def test_what_is_hard_to_tell_apart_can_be_fixed(fits, f0, option):
    """By an option that reads back as the value that the fit has."""
    bsdf, names = {"type": "walter", "f0": f0, "alpha": 0.3}, ("alpha", "f0.r")
    fit = replace(fits[0], bsdf=bsdf, correlations={a: dict.fromkeys(names, 0.99) for a in names})
    (told,) = (it for it in fit.remarks(shown=True) if it.startswith("Hard to tell apart: alpha and f0: "))
    assert told.endswith(f"fix one that is known, as in -D {option}.")
    assert value_of(shlex.split(option)[0].removeprefix("f0=")) == f0


@pytest.mark.parametrize(("channels", "label"), [(1, "$f$ [1/sr]"), (3, "$f$ [1/sr], luminance")])
def test_axes_tell_what_of_colours_is_drawn(channels, label):
    data = read(LOFT)
    coloured = replace(data, data=replace(data.data, values=np.repeat(data.data.values, channels, axis=-1)))
    assert {figure.axes[0].get_ylabel() for _, figure in lobes(coloured, [], 80)} == {label}


def test_how_far_a_fit_is_from_the_data_is_told(fits):
    """By the light that it lacks, here half of it and at grazing angles more, and where that is worst."""
    pairs = observe(read(LOFT))
    wi, wo = pairs.wi, pairs.wo
    grazing = (wi[:, 2] < 0.5) & (wo[:, 2] < 0.5)
    f = np.where(grazing, 4, 2)[:, None] / np.pi * np.ones(pairs.channels)
    white = {"type": "lambert", "reflectance": {"type": "rgb", "value": [1, 1, 1]}}
    probe = BSDFProbe(mi.load_dict(white))
    light = pairs.solid_angle * wo[:, 2] * wi[:, 2] * np.where(grazing, 4, 2)
    lacks = 100 * (0.5 + 0.25 * light[grazing].sum() / light.sum())
    told = Residuals(replace(pairs, f=f, usable=f > 0), replace(fits[0], metric="log"), probe).told
    assert told.startswith(f"The fit is off by {lacks:.2g} % of the reflected light, most at θi ≈")
    assert int(re.search(r"≈ (\d+)°", told)[1]) >= 60 and "4 times too dark" in told


def test_fits_without_a_picture_are_folded(fits):
    """They have no empty cards beside those with pictures, and links lead to all."""
    many = [replace(fits[0], model=f"model {k}") for k in range(11)]
    shown = Page(page_of([section_of(many)]))
    kinds = [tag for tag, attributes in shown.elements if re.fullmatch(r"material-1-\d+", attributes.get("id") or "")]
    assert kinds == ["article"] * 9 + ["details"] * 2 and "11. model 10" in shown.text


def test_how_sure_each_parameter_is(fits):
    """A value at the end of its range, or one that the data do not tell, is no measured one."""
    fit = replace(fits[0], bsdf={"f0": 0.0, "ior": 1.5, "ks": {"type": "rgb", "value": [1.0, 0.5, 0.25]}},
                  sigma={"f0": None, "ior": None, "ks": [None, 0.01, 0.02]}, bounds=["f0", "ks.r"],
                  undetermined=["ior"])  # fmt: skip
    assert values(fit) == [
        ("f0", 0, "at its limit"), ("ior", 1.5, "undetermined"),
        ("ks.r", 1, "at its limit"), (".g", 0.5, "± 0.01"), (".b", 0.25, "± 0.02"),
    ]  # fmt: skip


def test_colours_are_named_once():
    """With the channels that a remark is about, unless it is about all."""
    assert whole(["kd.r", "ks.r", "ks.g", "ks.b", "alpha"]) == "kd (r), ks, alpha"


@pytest.mark.slow
@pytest.mark.usefixtures("small")
def test_pictures_choose_where_the_metric_misleads(fits, tmp_path):
    """A white material to which a metric gave the least error is not what the black paint looks like; the data
    themselves, with the same seed, have no error; and FLIP is what its authors' program says of the same pictures, up
    to their rounding to 8 bits."""
    from flip_evaluator import evaluate

    good = fits[0]
    white = {"type": "lambert", "reflectance": {"type": "rgb", "value": [0.8, 0.8, 0.8]}}
    misled = replace(fits[1], bsdf=white, errors={"log": {"fitted": 0.0, "held_out": 0.0}})
    data = replace(fits[0], model="data", bsdf={"type": "tabulated", "filename": str(LOFT)})
    shown = appearance.render([misled, good, data])
    ranked, sorted_pictures = appearance.by_flip([misled, good, data], shown)
    assert [it.model for it in ranked] == ["data", good.model, misled.model]
    assert ranked[0].flip < 1e-4 and ranked[2].flip > 2 * ranked[1].flip
    assert np.array_equal(sorted_pictures.fits[1], shown.fits[1])
    for name, picture in (("data", shown.data), ("fit", shown.fits[1])):
        Image.fromarray(np.round(255 * picture).astype(np.uint8)).save(tmp_path / f"{name}.png")
    _, flip, _ = evaluate(str(tmp_path / "data.png"), str(tmp_path / "fit.png"), "LDR")
    assert ranked[1].flip == pytest.approx(flip, rel=0.02)


@pytest.mark.slow
@pytest.mark.usefixtures("small")
def test_report_from_python(fits, tmp_path):
    """Of several materials it has a list and medians; what is no file is refused."""
    ranked = report(fits, tmp_path / "r.html")
    assert ranked == fits and all(it.flip is None for it in ranked)
    text = (tmp_path / "r.html").read_text(encoding="utf-8")
    page = Page(text)
    assert "Medians over all materials" in page.text and "FLIP" not in page.text
    assert page.attributes("href").count("#material-2") == 1 and text.count('class="ranking"') == 2
    middle = np.mean([it.held_out for it in fits if it.model == "ward"])
    assert f"{middle:.4g}" in text.partition('class="medians"')[2].partition("</table>")[0]
    with pytest.raises(FitError, match="there is none of arrays"):
        report([replace(fits[0], file="arrays")], tmp_path / "no.html")
    assert not (tmp_path / "no.html").exists()
    (tmp_path / "data.bsdf").write_text("data")
    with pytest.raises(ValueError, match="would replace the data"):
        report([replace(fits[0], file=str(tmp_path / "data.bsdf"))], tmp_path / "data.bsdf")


def test_differences_of_colours():
    """CIELAB of the primaries of sRGB under D65, as tables have them."""
    expected = {(1, 1, 1): (100, 0, 0), (1, 0, 0): (53.24, 80.09, 67.20), (0, 1, 0): (87.73, -86.18, 83.18),
                (0, 0, 1): (32.30, 79.19, -107.86), (0, 0, 0): (0, 0, 0)}  # fmt: skip
    np.testing.assert_allclose(appearance.lab(np.array([*expected], float)), [*expected.values()], atol=0.05)
