"""The page of the checker: complete, harmless and by itself; and its pictures show the histograms as they are."""

import base64
import math
import re
from dataclasses import replace

import mitsuba as mi
import numpy as np
import pytest
from mutants import MUTANTS, Mutant, sampled
from support import Page, von_mises_fisher

from mi_brdfs.models.lambert import Lambert
from mi_brdfs.probe.directions import direction, on_side
from mi_brdfs.probe.partition import partitions
from mi_brdfs.validation import Finding, Report, check
from mi_brdfs.validation.html import page
from mi_brdfs.validation.incidents import Incident
from mi_brdfs.validation.pictures import HEMISPHERE, View, chart, rasters, views, weights
from mi_brdfs.validation.trial import COUNT, Trial

HOSTILE = """</h2><script>alert("1")</script> 'x' & <b"""


def lobe(width: float, turn: float = 0, theta: float = 60, side: int = 1) -> tuple[Trial, np.ndarray]:
    """The trial of a von Mises-Fisher lobe about the mirror direction of light from 60°, or turned from it, and the
    samples. Pilot and samples are the same: this is no test of a sampler."""
    wi = direction(60, 20)
    w, pdf = von_mises_fisher(on_side(direction(theta, 200 + turn), side), width, COUNT)
    (cells,) = partitions(lambda _, wo: pdf(wo), [w], [wi], COUNT)
    counts = cells.histogram(w)
    return Trial("whole", Incident("60°", wi), cells, counts, np.stack([counts, counts])), w


# --- The page -------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def reports() -> list[Report]:
    """One that fails and has a hostile name, one that transmits and one without histograms."""
    wrong = next(mutant for mutant in MUTANTS if mutant.name == "alphas swapped for a quarter of the azimuths")
    with mi.variant_context("llvm_ad_rgb"):
        wrap = {"type": "wrap", "domain": "sphere", "wrap": 0.8}
        only = ["pdf", "chi2", "albedo", "efficiency"]
        return [
            check(wrong.register(), name=HOSTILE, only=only, angles=(50,)),
            check(wrap, only=only, angles=(50,)),
            check({"type": "lambert"}, only=["flags"]),
            check({"type": "dielectric"}, only=["pdf", "flags"]),
        ]


@pytest.fixture(scope="module")
def text(reports) -> str:
    return page(reports)


@pytest.mark.slow
def test_the_page_is_complete(reports, text):
    """Verdicts, sentences, and for each part its pictures, described."""
    parsed = Page(text)
    assert "4 BSDFs checked, 1 failed, 1 not judged" in parsed.text
    assert "Nothing was judged. A delta function" in parsed.text
    assert parsed.text.count("FAIL") == 1 + len(reports[0].failures) > 1
    for report in reports:
        assert all(finding.message in parsed.text for finding in report.findings)
        assert all(f"{f.subject}: {f.message}" in parsed.text for f in report.failures)
    for report in reports[:2]:
        transmitting = "diffuse transmission" if report.name == "wrap" else "glossy reflection"
        for part in ("whole", "component 0 (diffuse reflection)", f"component 1 ({transmitting})"):
            drawn = f"{report.name}, {part}, light from 50°, "
            assert any(told.startswith(drawn) for told in parsed.pictures())
            assert f"{report.name}, {part}: albedo and efficiency over the angle of incidence" in parsed.pictures()
    assert parsed.text.count("corrected for three tests") == 2  # once for each report with pictures
    below = [told for told in parsed.pictures() if "below the surface" in told]
    through = "component 1 (diffuse transmission)"
    assert [told.split(", ")[:2] for told in below] == [["wrap", "whole"], ["wrap", through]]
    assert not any(told.startswith(("lambert", "dielectric")) for told in parsed.pictures())


def test_all_faults_are_told_once():
    """The sentence has the largest, and the table of all findings the others."""
    finding = Finding("weight", "whole", "fail", "one is 2 (and 1 more like it).", {"faults": ["one is 1", "one is 2"]})
    text = Page(page([Report("x", [finding])])).text
    assert text.count("one is 1") == 1 and text.count("one is 2") == text.count("one is 2 (and 1 more like it).") == 2


@pytest.mark.slow
def test_the_page_needs_nothing_else(text):
    parsed = Page(text)
    ids = parsed.attributes("id")
    assert len(set(ids)) == len(ids)
    pictures = [target for target in parsed.attributes("href") if target.startswith("data:")]
    assert len(pictures) == 3 * sum("the samples drawn" in told for told in parsed.pictures())
    assert {target[1:] for target in parsed.attributes("href") if target not in pictures} <= set(ids)
    assert set(re.findall(r"url\((.*?)\)", text)) <= {f"#{name}" for name in ids}
    assert not {tag for tag, _ in parsed.elements} & {"script", "link", "img", "iframe", "object", "base", "form"}
    assert not {"src", "onload", "srcset"} & {name for _, given in parsed.elements for name in given}
    assert not re.search(r"https?:|file:|@import", re.sub(r"base64,[\w+/=]+", "", text))


def test_hostile_words_are_harmless():
    """Wherever they come from."""
    finding = Finding(HOSTILE, HOSTILE, "fail", HOSTILE, {"faults": [HOSTILE, f"2 {HOSTILE}"]})
    trial, _ = lobe(1)
    trials = [replace(trial, part=HOSTILE, incident=Incident(HOSTILE, trial.incident.wi))]
    data = {"0°": {"albedo": 0.5, "noise": 0}}
    parsed = Page(page([Report(HOSTILE, [finding, Finding("albedo", HOSTILE, "info", "", data)], trials)], [HOSTILE]))
    assert "script" not in {tag for tag, _ in parsed.elements} and "b" not in {tag for tag, _ in parsed.elements}
    assert parsed.text.count(HOSTILE) >= 9
    assert sum(told.startswith(f"{HOSTILE}, {HOSTILE}") for told in parsed.pictures()) == 3


def images(text: str) -> list[np.ndarray]:
    """The colours of all pictures, red to opacity."""
    files = [target for target in Page(text).attributes("href") if target.startswith("data:")]
    found = []
    for file in files:
        data = base64.b64decode(file.removeprefix("data:image/png;base64,"), validate=True)
        assert data[:8] == b"\x89PNG\r\n\x1a\n" and len(data) < 32_000
        stream = mi.MemoryStream()
        stream.write(data)
        stream.seek(0)
        found.append(np.array(mi.Bitmap(stream)))
    return found


@pytest.mark.slow
def test_pictures_are_sound(reports, text):
    """And small, and the hemisphere stands out from what is around it."""
    pictures = images(text)
    for picture in pictures:
        assert picture.shape == (190, 190, 4) and len(np.unique(picture.reshape(-1, 4), axis=0)) > 10
    of_wrap = sum(told.startswith("wrap") and "the samples drawn" in told for told in Page(text).pictures())
    for drawn, density, difference in zip(*[iter(pictures[-3 * of_wrap :])] * 3, strict=True):
        assert drawn[0, 0, 3] == density[0, 0, 3] == difference[0, 0, 3] == 0
        assert density[95, 95, 3] == difference[95, 95, 3] == 255
        shown = difference[difference[..., 3] > 0]
        assert (np.median(shown[:, :3], axis=0) > 200).all()  # about zero is white


def test_charts_show_albedo_and_efficiency():
    """What cannot be drawn is left out, and what exceeds the chart leaves it, with its value."""
    albedos = {"0°": 0.5, "45°": math.nan, "90°": 0.25, "0° behind": 1.0, "90° behind": 1e30}
    albedo = {name: {"albedo": value, "noise": 0} for name, value in albedos.items()} | {"faults": ["a", "b"]}
    findings = [Finding("albedo", "whole", "fail", "a.", albedo), Finding("efficiency", "whole", "info", "", {"0°": 1})]
    parsed = Page(page([Report("x", findings)]))
    (drawn,) = parsed.pictures()
    assert drawn == "x, whole: albedo and efficiency over the angle of incidence"
    curves: dict = {}
    for tag, given in parsed.elements:
        found = re.search(r"var\(--series-(\d)\); stroke-width: ([\d.]+)", given.get("style", ""))
        if tag == "path" and found:
            points = [tuple(map(float, point)) for point in re.findall(r"[ML] (\S+) (\S+)", given["d"])]
            curves[found.groups()] = points
    assert "↑ 1e+30 at 90°" in parsed.text
    albedo["90° behind"] = {"albedo": 3.9, "noise": 0}
    assert not chart({"albedo": albedo}).axes[0].get_title("right")
    # Albedos are up to 4; what is above is cut off by the chart, and not drawn at its edge.
    (left, half), (right, quarter) = curves["1", "1.6"]
    ((_, one),) = {curves["2", "1.6"][0]}
    (zero, from_behind), (_, beyond) = curves["1", "0.8"]
    assert zero == left < right and from_behind == one
    scale = (half - one) / 0.5
    assert quarter - half == pytest.approx(0.25 * scale, abs=1e-3) and (one - beyond) / scale > 3


# --- The pictures ---------------------------------------------------------------------------------------------------


def solid_angles(x, y):
    """Of the pixels of a window."""
    theta = np.radians(np.hypot(x, y))
    return np.radians(x[0, 1] - x[0, 0]) ** 2 * np.sin(theta) / theta


def grid(view: View):
    steps = (np.arange(190) - 94.5) / 95 * view.half
    return np.meshgrid(view.x + steps, view.y + steps)


WIDE = [pytest.param(*row, marks=pytest.mark.slow) for row in ((0.03, 4, 1), (0.3, 20, -1), (1, 0, 1))]


@pytest.mark.parametrize("width, turn, side", [(1e-3, 0.1, -1), *WIDE])
def test_pictures_show_the_samples(width, turn, side):
    """Each window, from the samples: the part of them in it, and their mean direction, to a tenth of their spread.
    It holds 99 % of those on its side and shows narrow lobes large; the density is what it is."""
    trial, w = lobe(width, turn, side=side)
    azimuth = np.radians(20) - np.arctan2(w[:, 1], w[:, 0])  # from that of the light, clockwise
    theta = np.degrees(np.arctan2(np.hypot(w[:, 0], w[:, 1]), abs(w[:, 2])))
    px, py = -theta * np.cos(azimuth), -theta * np.sin(azimuth)
    seen = list(views(trial))
    assert {view.side for view in seen} == set(np.sign(w[:, 2])) and (width > 0.1 or len(seen) == 1)
    for view in seen:
        here = w[:, 2] * view.side > 0
        inside = here & (abs(px - view.x) < view.half) & (abs(py - view.y) < view.half)
        assert inside.sum() > 0.99 * here.sum()
        assert view == (view.side, 0, 0, HEMISPHERE) if width == 1 else view.half < 10 * np.degrees(width)
        x, y = grid(view)
        (drawn, density, deviation), _ = rasters(trial, view)
        assert (np.isnan(drawn) == (np.hypot(x, y) >= 90)).all()
        weights = np.nan_to_num(drawn) * solid_angles(x, y)
        assert weights.sum() == pytest.approx(inside.mean(), rel=0.02)
        for pixel, sample in ((x, px), (y, py)):
            spread = sample[inside].std()
            assert np.average(pixel, weights=weights) == pytest.approx(sample[inside].mean(), abs=0.1 * spread)
        assert (np.nan_to_num(density) * solid_angles(x, y)).sum() == pytest.approx(inside.mean(), rel=0.02)
        assert np.nanmean(deviation**2) < 2


@pytest.mark.slow
def test_pictures_show_where_samples_are_wrong():
    """Samples turned about the normal: too many on one side of the lobe, too few on the other."""
    trial, w = lobe(0.05)
    cos, sin = np.cos(0.1), np.sin(0.1)
    turned = w @ [[cos, sin, 0], [-sin, cos, 0], [0, 0, 1]]
    wrong = replace(trial, counts=trial.partition.histogram(turned))
    (view,) = views(wrong)
    deviation = rasters(wrong, view)[0][2]
    x, y = grid(view)
    lit = abs(x - 60) < 3
    assert np.median(deviation[lit & (y < -5) & (y > -10)]) > 5
    assert np.median(deviation[lit & (y > 2) & (y < 7)]) < -5


def test_pictures_show_where_weights_are_wrong():
    """Of a sampler that forgets the cosine: one over it too large, wherever there are samples. Only the page of a
    report in which ``weight`` fails has them."""
    forgotten = sampled(weight=lambda bs, weight, si, u: weight / bs.wo.z)
    with mi.variant_context("llvm_ad_rgb"):
        report = check(Mutant("cosine forgotten", ("weight",), Lambert, forgotten).register(), only="weight", angles=30)
    trial = report.trials[0]
    (view,) = views(trial)
    (weight, quotient, difference), _ = rasters(trial, view, weights)
    x, y = grid(view)
    cosine = np.cos(np.radians(np.hypot(x, y)))
    seen = (cosine > 0.3) & np.isfinite(difference)
    assert seen.mean() > 0.4
    assert abs((1 + difference[seen]) * cosine[seen] - 1).mean() < 0.04
    assert weight[seen] == pytest.approx((1 + difference[seen]) * quotient[seen])
    told = "the weights, eval/pdf, and the difference"
    assert told in page([report]) and told not in page([replace(report, findings=[])])


@pytest.mark.slow
def test_dots_are_not_missed():
    """A lobe far smaller than a pixel is one in a picture of the hemisphere, of the density that the pixel has."""
    trial, _ = lobe(1e-3)
    view = View(1, 0, 0, HEMISPHERE)
    (drawn, density, _), _ = rasters(trial, view)
    for picture in (drawn, density):
        x, y = grid(view)
        assert 0.3 < (np.nan_to_num(picture) * solid_angles(x, y)).sum() < 3
        bright = picture > 0.1 * np.nanmax(picture)
        assert abs(x[bright] - 60).max() < 3 and abs(y[bright]).max() < 3


@pytest.mark.slow
def test_faint_deviations_are_in_the_window():
    """A thousandth of the samples goes where the density has nothing, far from a narrow lobe or on the other side."""
    trial, w = lobe(0.01)
    stray = np.where(np.arange(len(w))[:, None] % 1000, w, direction(20, 110))
    wrong = replace(trial, counts=trial.partition.histogram(stray))
    (right_view,), (view,) = views(trial), views(wrong)
    x, y = 0, 20  # the light comes from an azimuth of 20°
    assert right_view.half < 5 and (right_view.x - x) ** 2 + (right_view.y - y) ** 2 > 30**2
    assert abs(view.x - x) < view.half and abs(view.y - y) < view.half
    stray = np.where(np.arange(len(w))[:, None] % 1000, w, direction(180))
    wrong = replace(trial, counts=trial.partition.histogram(stray))
    assert [view.side for view in views(wrong)] == [1, -1]
    nothing = replace(trial, partition=replace(trial.partition, integrals=0 * trial.expected), counts=0 * trial.counts)
    assert not list(views(nothing)) and "almost nothing is drawn" in page([Report("x", [], [nothing])])


@pytest.mark.slow
@pytest.mark.parametrize("below", [-0.1, math.inf])
def test_impossible_densities_are_marked(below):
    """And do not spoil the colours of others."""

    def pdf(wo):
        return np.where(wo[:, 2] > 0, abs(wo[:, 2]) / np.pi, below)

    trial, w = lobe(1)
    with np.errstate(all="ignore"):
        (cells,) = partitions(lambda _, wo: pdf(wo), [w[w[:, 2] > 0]], [trial.incident.wi], COUNT)
        impossible = replace(trial, partition=cells, counts=cells.histogram(w[w[:, 2] > 0]))
        p = impossible.test.p_value
    with np.errstate(all="raise", under="ignore"):
        text = page([Report("x", [], [impossible])])
    chance = f"= {p:.2g}" if p else "&lt; 1e-300"
    assert f'<span class="fail">p {chance}</span>' in text and text.count("red where &lt; 0 or infinite") == 1
    assert ["below" in told for told in Page(text).pictures()] == [False, True]
    scales = [float(scale) for scale in re.findall(r">([^<>]+) per sr<", text)]
    assert len(scales) == 4 and max(scales) < 10
    above, below = images(text)[:3], images(text)[3:]
    red = [(picture == [230, 0, 60, 255]).all(axis=-1) for picture in (*above, *below)]
    assert [picture.any() for picture in red] == [False, False, False, False, True, False]
    shown = [picture[..., 3] > 0 for picture in (*above, *below)]
    assert (red[4] == shown[1]).all() and not shown[3].any() and (shown[5] == shown[2]).all()
