"""The plots of lobes: what is drawn is what closed forms say, legends name it, and the command writes it."""

import re
import sys
from functools import partial

import mitsuba as mi
import numpy as np
import pytest
from matplotlib import pyplot, rcParams
from matplotlib.colors import rgb_to_hsv, to_rgb
from support import LOFT, ROOT, call, context, direction
from test_cli import invoke

from mi_brdfs import plot
from mi_brdfs.bench.comparison import compare
from mi_brdfs.measured import read
from mi_brdfs.mitsuba.registry import own_models
from mi_brdfs.plot import command
from mi_brdfs.probe import curves as curves_of

pytestmark = pytest.mark.usefixtures("llvm_rgb")

MIRROR = {"type": "walter", "alpha": 0.01}
PHONG = {"type": "phong", "exponent": 2000, "diffuse_reflectance": 0, "specular_reflectance": 0.4}
SHEET = {"type": "wrap", "domain": "sphere", "reflectance": 0.6}
COLOURED = {"type": "lambert", "reflectance": {"type": "rgb", "value": [0.2, 0.5, 0.8]}}
AEROGLAZE = str(ROOT / "scenes" / "measured" / "aeroglaze_z307.bsdf")
LUMINANCE = 0.2126 * 0.2 + 0.7152 * 0.5 + 0.0722 * 0.8


def labelled(figure, panel=0):
    """The lines of a panel that its legend names."""
    return [line for line in figure.axes[panel].lines if line.get_label()[0] != "_"]


def curves(figure, panel=0):
    """The curves of a panel, by label: x and y."""
    return {line.get_label(): line.get_data() for line in labelled(figure, panel)}


def curve(figure, panel=0):
    (only,) = curves(figure, panel).values()
    return only


def legend(figure):
    return [text.get_text() for text in figure.legends[0].get_texts()]


def heading(figure):
    return figure.legends[0].get_title().get_text()


def near(got, expected, of_peak):
    """Equal to a part of the largest."""
    np.testing.assert_allclose(got, expected, rtol=0, atol=of_peak * np.max(expected))


# --- What is drawn --------------------------------------------------------------------------------------------------


def test_lamberts_polar_lobe_is_a_circle():
    """Of the diameter ρ/π, on the surface, for light from everywhere."""
    figure = plot.polar({"type": "lambert", "reflectance": 0.8}, angles=(0, 50, 85), scale="linear")
    assert len(curves(figure)) == 3
    for x, y in curves(figure).values():
        near(np.hypot(x, y - 0.4 / np.pi), np.full(len(x), 0.4 / np.pi), 1e-5)
        assert x.min() < -0.39 / np.pi and x.max() > 0.39 / np.pi and y.max() > 0.79 / np.pi


def test_the_log_radius_is_as_its_rings_say():
    """A ring 10^k lies where the curve is 10^k, and rings are as far apart as decades."""
    figure = plot.polar({"type": "lambert", "reflectance": 0.8}, angles=(30,), scale="log")
    x, y = curve(figure)
    theta, radius = np.degrees(np.arctan2(x, y)), np.hypot(x, y)
    rings = {int(found[1]): text.get_position()[0] for text in figure.axes[0].texts
             if (found := re.fullmatch(r"\$10\^\{(-?\d+)\}\$", text.get_text()))}  # fmt: skip
    assert len(rings) > 1
    for power, at in rings.items():
        expected = np.log10(0.8 / np.pi * np.cos(np.radians(theta))) - power + at
        seen = radius > 0
        np.testing.assert_allclose(radius[seen], expected[seen], atol=1e-4)


def test_the_signed_angle_is_positive_at_the_mirror_direction():
    theta, value = curve(plot.cartesian(PHONG, angles=(40,), scale="linear"))
    cos = np.maximum(np.cos(np.radians(theta - 40)), 0)
    near(value, 0.4 * 2002 / (2 * np.pi) * cos**2000 * np.cos(np.radians(theta)), 1e-3)
    assert theta[np.argmax(value)] == pytest.approx(40, abs=0.1)
    x, y = curve(plot.polar(PHONG, angles=(40,), scale="linear"))
    tip = np.argmax(np.hypot(x, y))
    assert np.degrees(np.arctan2(x[tip], y[tip])) == pytest.approx(40, abs=0.1)


def ggx(theta, theta_i, alpha):
    """f cosθ_o in the plane of incidence of a perfect reflector with GGX facets and Smith's separate shadowing."""
    theta, theta_i = np.radians(theta), np.radians(theta_i)
    h = (theta - theta_i) / 2  # the angle of the half vector: wi is at -theta_i
    d = alpha**2 / (np.pi * (np.sin(h) ** 2 + alpha**2 * np.cos(h) ** 2) ** 2)
    g = [2 / (1 + np.sqrt(1 + (alpha * np.tan(t)) ** 2)) for t in (theta, theta_i)]
    return d * g[0] * g[1] / (4 * np.cos(theta_i))


@pytest.mark.parametrize("alpha, theta_i", [(1e-3, 0), (1e-3, 33.3), (1e-2, 80), (0.3, 80)])
def test_no_lobe_is_too_narrow(alpha, theta_i):
    figure = plot.cartesian({"type": "walter", "alpha": alpha}, angles=(theta_i,))
    everywhere = np.concatenate([np.linspace(-89, 89, 1000), theta_i + np.linspace(-5, 5, 100_001)])
    peak = ggx(everywhere[abs(everywhere) < 89], theta_i, alpha).max()
    for panel in (0, 1):
        theta, value = curve(figure, panel)
        assert value.max() == pytest.approx(peak, rel=0.01)
        asked = np.random.default_rng(1).uniform(-85, 85, 1000)
        asked = np.where(np.arange(1000) % 2, asked, theta_i + asked * alpha)
        asked = asked[abs(asked) < 85]
        expected = ggx(asked, theta_i, alpha)
        near(np.interp(asked, theta, value), expected, 0.01)
        error = abs(np.interp(asked, theta, value) / expected - 1)
        assert error[expected > 1e-6 * peak].max() < 0.05


@pytest.mark.parametrize("bsdf", ["toon", {"type": "ward", "alpha_u": 0.02, "alpha_v": 0.3}, "roughplastic"])
def test_any_bsdf_is_drawn_as_it_evaluates(bsdf):
    """Also turned about the normal."""
    theta, value = curve(plot.cartesian(bsdf, angles=(50,), azimuth=25, scale="linear"))
    asked = np.linspace(-88, 88, 777)
    wo = np.array([direction(-each, 25) for each in asked])
    loaded = mi.load_dict({"type": bsdf} if isinstance(bsdf, str) else bsdf)
    (expected,) = call(loaded.eval, context(), np.tile(direction(50, 25), (777, 1)), wo)
    near(np.interp(asked, theta, value), expected[:, 0], 0.01)


def test_below_the_surface_only_what_transmits():
    theta, value = curve(plot.cartesian(SHEET, angles=(40,), scale="linear"))
    assert theta[0] == -180 and theta[-1] == 180
    near(value, 0.6 * 3 / (4 * np.pi) * ((np.cos(np.radians(theta)) + 1) / 2) ** 2, 1e-3)
    _, y = curve(plot.polar(SHEET, angles=(40,), scale="linear"))
    assert y.min() < -0.003
    theta, _ = curve(plot.cartesian("lambert", angles=(40,)))
    assert theta[0] > -90 and theta[-1] < 90
    for bsdf, depth in (SHEET, 1), ("lambert", 0.12):
        bottom, top = plot.polar(bsdf, angles=(40,)).axes[0].get_ylim()
        assert -bottom / top == pytest.approx(depth)
    assert len(plot.hemisphere(SHEET, resolution=8).axes) == 2 * 3 + 1


@pytest.mark.slow
def test_a_refracted_lobe_lies_where_snell_says():
    """On the far side of the normal, at 180° - θ_t; and it is found there, though nothing hints at it elsewhere."""
    glass = {"type": "roughdielectric", "distribution": "beckmann", "alpha": 1e-4, "int_ior": 1.5}
    theta, value = curve(plot.cartesian(glass, angles=(50,), scale="linear"))
    refracted = np.degrees(np.arcsin(np.sin(np.radians(50)) / 1.5))
    assert theta[np.argmax(value)] == pytest.approx(180 - refracted, abs=0.1)
    assert (value[abs(theta - 180 + refracted) > 1] < 0.02 * value.max()).all()


def test_albedo():
    drawn = curves(plot.albedo(
        {"type": "lambert", "reflectance": 0.3}, SHEET, COLOURED, {"type": "conductor", "material": "none"},
        "dielectric", labels=["flat", "both sides", "coloured", "mirror", "glass"],
    ))  # fmt: skip
    expected = {"flat": 0.3, "both sides": 0.6, "coloured": LUMINANCE, "mirror": 1, "glass": 1}
    assert list(drawn) == list(expected)
    for name, (theta, value) in drawn.items():
        assert theta[0] == 0 and theta[-1] > 89
        np.testing.assert_allclose(value, expected[name], rtol=1e-3)


def test_albedos_without_bound_leave_the_others_their_scale():
    """And how far they go is said."""
    gaining, lossy = ({"type": "ward", "alpha": 0.3, "variant": variant} for variant in ("ward-duer", "ward"))
    figure = plot.albedo(gaining, lossy)
    most = max(value.max() for _, value in curves(figure).values())
    assert most > 5 and 1 < figure.axes[0].get_ylim()[1] < 1.5
    assert figure.axes[0].get_title("right") == f"up to {most:.2g}"
    assert plot.albedo(lossy).axes[0].get_title("right") == ""


def test_luminance_is_drawn_and_said():
    """Of spectra, the mean."""
    figure = plot.cartesian(COLOURED, angles=(0,), scale="linear")
    assert curve(figure)[1].max() == pytest.approx(LUMINANCE / np.pi, rel=1e-3)
    assert figure.axes[0].get_ylabel() == r"$f\,\cos\theta_o$ [1/sr], luminance"
    with mi.variant_context("llvm_ad_spectral"):
        figure = plot.cartesian({"type": "lambert", "reflectance": 0.5}, angles=(0,), scale="linear")
    assert curve(figure)[1].max() == pytest.approx(0.5 / np.pi, rel=1e-3)
    assert "mean of the spectrum" in figure.axes[0].get_ylabel()


# --- Maps -----------------------------------------------------------------------------------------------------------


def maps(figure):
    return [np.array(ax.images[0].get_array()) for ax in figure.axes if ax.images]


def disc(n):
    """The coordinates of the pixels, and the solid angle of each."""
    x, y = np.meshgrid((np.arange(n) + 0.5) * 2 / n - 1, (np.arange(n) + 0.5) * 2 / n - 1)
    r = np.hypot(x, y)
    return x, y, r, np.where(r < 1, np.sin(r * np.pi / 2) * np.pi / 2 / r * (2 / n) ** 2, 0)


def test_a_map_has_the_angle_as_its_radius():
    (picture,) = maps(plot.hemisphere({"type": "lambert", "reflectance": 0.8}, angles=(30,), resolution=100))
    _, _, r, _ = disc(100)
    seen = r < 0.97
    near(picture[seen], 0.8 / np.pi * np.cos(r * np.pi / 2)[seen], 2e-3)


@pytest.mark.parametrize("alpha", [1e-3, pytest.param(0.2, marks=pytest.mark.slow)])
def test_a_map_holds_the_whole_lobe(alpha):
    """Also one that is narrower than a pixel, and at any azimuth in the same place."""
    bsdf = {"type": "walter", "alpha": alpha}
    for azimuth in (0, 70):
        (picture,) = maps(plot.hemisphere(bsdf, angles=(40,), azimuth=azimuth, resolution=90))
        x, y, _, solid_angle = disc(90)
        brightest = np.unravel_index(np.argmax(picture), picture.shape)
        assert np.hypot(x[brightest] - 40 / 90, y[brightest]) < 0.04
        assert (picture * solid_angle).sum() == pytest.approx(np.interp(40, *curve(plot.albedo(bsdf))), rel=0.05)


def test_a_map_is_seen_from_above():
    """An anisotropic lobe, out of the plane of incidence, is where its axis is; and what is drawn is looked for where
    it is shown."""
    bsdf = {"type": "lafortune", "cx": -1, "cy": -0.2, "exponent": 400, "diffuse_reflectance": 0}
    (picture,) = maps(plot.hemisphere(bsdf, angles=(50,), azimuth=45, resolution=90))
    wo = direction(50, 45) * [-1, -0.2, 1]
    azimuth = np.degrees(np.arctan2(wo[1], wo[0])) - 45 + 180  # counter-clockwise from the right
    x, y, _, _ = disc(90)
    brightest = np.unravel_index(np.argmax(picture), picture.shape)
    assert np.degrees(np.arctan2(y[brightest], x[brightest])) == pytest.approx((azimuth + 180) % 360 - 180, abs=4)


# --- One's own way --------------------------------------------------------------------------------------------------


def test_each_curve_over_its_maximum():
    given = [{"type": "phong", "exponent": n} for n in (10, 10000)]
    with pytest.warns(UserWarning, match=r"the maxima differ by a factor of \d{3}; --normalize compares shapes"):
        plot.cartesian(*given, angles=(30,), scale="linear")
    for kind, reach in ((plot.cartesian, lambda x, y: y), (plot.polar, np.hypot)):
        figure = kind(*given, angles=(30,), scale="linear", normalize=True)
        assert [reach(*xy).max() for xy in curves(figure).values()] == pytest.approx([1, 1])
        label = figure.axes[0].get_ylabel() or figure.axes[0].get_xlabel()
        assert "/ maximum" in label and "1/sr" not in label


@pytest.mark.slow
def test_red_green_and_blue():
    """In a row for each angle, a style for each BSDF, and without the word luminance; one curve for what is grey."""
    figure = plot.cartesian(COLOURED, "lambert", angles=(0, 60), scale="linear", rgb=True)
    drawn = curves(figure)
    assert list(drawn)[:3] == [f"reflectance=0.2, 0.5, 0.8, {name}" for name in ("red", "green", "blue")]
    assert list(drawn)[3:] == ["reflectance=0.5"] and legend(figure)[:4] == list(drawn)
    peaks = [value.max() for _, value in drawn.values()]
    assert peaks == pytest.approx(np.array([0.2, 0.5, 0.8, 0.5]) / np.pi, rel=1e-3)
    lines = labelled(figure)
    assert len({line.get_color() for line in lines}) == 4 and len({line.get_linestyle() for line in lines}) == 2
    assert len(figure.axes) == 2 and "luminance" not in figure.axes[0].get_ylabel()
    assert [value[0] for _, value in curves(plot.albedo(COLOURED, rgb=True)).values()] == pytest.approx([0.2, 0.5, 0.8])
    assert "Black: red, green and blue are equal." in heading(figure)
    with mi.variant_context("llvm_ad_spectral"), pytest.raises(ValueError, match="rgb curves need an rgb variant"):
        plot.polar("lambert", rgb=True)


def test_what_is_grey_is_drawn_as_luminance_and_that_is_said():
    def looks(figure):
        return [(line.get_label(), line.get_color(), line.get_marker()) for ax in figure.axes for line in ax.lines]

    for draw, *bsdfs in (plot.cartesian, "lambert"), (plot.polar, "lambert", "ward"), (plot.albedo, "lambert", "ward"):
        figure = draw(*bsdfs, rgb=True)
        assert looks(figure) == looks(draw(*bsdfs))
        assert "Red, green and blue are equal." in heading(figure)


@pytest.mark.slow
def test_marks_are_beside_the_lobes():
    """Those of the mirror direction, which peaks are close to; on a map they are at the directions themselves."""
    for theta in 0, 80:
        ax = plot.polar(MIRROR, angles=(theta,), scale="linear").axes[0]
        (mark,) = [line for line in ax.lines if line.get_marker() not in ("None", "")]
        x, y = mark.get_data()
        lobe = np.hypot(*curve(ax.figure))
        assert np.hypot(x, y)[0] > 1.05 * lobe.max()
        assert np.degrees(np.arctan2(x, y))[0] == pytest.approx(theta)
        ax = plot.cartesian(MIRROR, angles=(theta,), scale="linear").axes[0]
        (mark,) = [line for line in ax.lines if line.get_marker() not in ("None", "")]
        assert mark.get_xdata()[0] == theta and mark.get_ydata()[0] > 1  # of the axes' height
    for theta, ax in zip((10, 40, 70), plot.hemisphere(MIRROR, resolution=8).axes, strict=False):
        assert [line.get_xdata()[0] * 90 for line in ax.lines] == pytest.approx([-theta, theta])
        assert [line.get_ydata()[0] for line in ax.lines] == [0, 0]


def test_labels_of_ticks_stay_apart():
    """Also from those of the other axis and of the panels beside; each line of the grid has one."""
    narrow = plot.cartesian(SHEET, "lambert", "wrap", "eon", side_by_side=True, scale="log")
    for figure in plot.cartesian("ward"), plot.cartesian(SHEET), narrow, plot.measured(AEROGLAZE):
        figure.draw_without_rendering()
        angles = [label.get_text() for label in figure.axes[1].get_xticklabels()]
        assert len(angles) == 7 and all(angles[1:-1])
        axes = [axis for ax in figure.axes for axis in (ax.xaxis, ax.yaxis) if axis.get_ticklabels()]
        seen = [label for axis in axes for at, label in zip(axis.get_ticklocs(), axis.get_ticklabels(), strict=True)
                if axis.get_view_interval()[0] <= at <= axis.get_view_interval()[1] and label.get_text()]  # fmt: skip
        # Bounds are higher than digits.
        boxes = [label.get_window_extent().padded(2, -3) for label in seen]
        assert len(boxes) > 10 and all(first.count_overlaps(boxes) == 1 for first in boxes)


# --- Several BSDFs --------------------------------------------------------------------------------------------------


def test_a_sweep_is_named_by_what_differs():
    sweep = [{"type": "ward", "alpha": alpha, "variant": "ward-duer"} for alpha in (0.1, 0.25)]
    figure = plot.polar(*sweep, "roughconductor", angles=(45,))
    assert legend(figure)[:3] == ["ward alpha=0.1", "ward alpha=0.25", "roughconductor"]
    title = "ward with variant=ward-duer\nroughconductor with default parameters"
    assert heading(figure) == title
    assert list(curves(figure)) == legend(figure)[:3]
    looks = {(line.get_color(), line.get_linestyle()) for line in labelled(figure)}
    assert len(looks) == 3
    first, second, _ = (np.hypot(*xy).max() for xy in curves(figure).values())
    assert first > 3 * second
    several = [{"type": kind, "exponent": n, "specular_reflectance": 0.1}
               for kind, n in (("phong", 9), ("phong", 20), ("blinnphong", 9))]  # fmt: skip
    figure = plot.albedo(*several)
    assert legend(figure) == ["phong exponent=9", "phong exponent=20", "blinnphong exponent=9", ""]
    assert heading(figure) == "all with specular_reflectance=0.1"


def test_a_sweep_of_a_number_has_colours_in_its_order():
    def brightness(*bsdfs):
        figure = plot.cartesian(*bsdfs, angles=(30,), scale="log")
        lines = labelled(figure)
        return [sum(to_rgb(line.get_color())) for line in lines], {line.get_linestyle() for line in lines}

    sweep = [{"type": "phong", "exponent": n} for n in (2, 4, 8, 16)]
    levels, styles = brightness(*sweep)
    assert levels == sorted(levels) and len(set(levels)) == 4 and styles == {"-"}
    assert len(brightness(sweep[0], sweep[2], sweep[1])[1]) > 1
    others = [{"type": "ward", "alpha": a} for a in (0.1, 0.2)]
    levels, styles = brightness(*sweep, *others, "lambert")
    assert levels[:4] == sorted(levels[:4]) and levels[4] < levels[5] and len(set(levels)) == 7 and len(styles) == 2


def test_several_sweeps_have_a_hue_and_a_column_of_the_legend_each():
    """Also if they are given one value after the other."""
    swept = [{"type": kind, "alpha": alpha} for kind in ("ward", "walter") for alpha in (0.1, 0.2, 0.3)]
    for bsdfs in swept, [swept[k] for k in (0, 3, 1, 4, 2, 5)]:
        figure = plot.albedo(*bsdfs)
        hues = {}
        for line in figure.axes[0].lines[:6]:
            hue, saturation, _ = rgb_to_hsv(to_rgb(line.get_color()))
            assert saturation > 0.2
            hues.setdefault(line.get_label().split()[0], []).append(hue)
        assert all(max(own) - min(own) < 0.02 for own in hues.values()) and len(hues) == 2
    assert legend(plot.albedo(*swept, rgb=True)) == [f"{it['type']} alpha={it['alpha']}" for it in swept]
    figure = plot.cartesian(*swept, "phong", angles=(10,))
    assert legend(figure)[3:6] == [f"walter alpha={alpha}" for alpha in (0.1, 0.2, 0.3)]
    assert legend(figure)[6:] == ["phong", "mirror direction", ""] and figure.legends[0]._ncols == 3


def test_a_default_is_said_where_another_value_is():
    figure = plot.albedo(
        "walter", {"type": "walter", "multiscatter": "walk"}, {"type": "ward", "alpha_u": 0.2}, "lambert"
    )
    assert legend(figure) == ["walter multiscatter=none", "walter multiscatter=walk", "ward alpha_u=0.2", "lambert"]
    figure = plot.albedo("ward", {"type": "ward", "alpha": 0.2}, {"type": "ward", "alpha_v": 0.2})
    assert legend(figure) == ["alpha=0.1", "alpha=0.2", "alpha_v=0.2"]
    assert heading(figure) == "ward"
    assert legend(plot.albedo("ward", "ward")) == ["ward", "ward"]


def test_defaults_in_which_models_differ_are_said():
    """Unless they are given."""

    def told(*bsdfs):
        return heading(plot.albedo(*bsdfs)).split("\n")

    ward, walter = "ward by default: diffuse_reflectance=0.5", "walter by default: diffuse_reflectance=none"
    both = [f"{ward} specular_reflectance=0.2", f"{walter} specular_reflectance=1"]
    assert told("ward", "walter") == ["default parameters", *both]
    given = [{"type": kind, "specular_reflectance": 0.4} for kind in ("ward", "walter")]
    assert told(*given) == ["all with specular_reflectance=0.4", ward, walter]
    assert told("ward", "phong") == ["default parameters"]
    assert told({"type": "ward", "preset": "ngan/ward/chrome"}, "walter") == ["walter with default parameters"]


@pytest.mark.slow
def test_each_angle_is_a_row_of_several_and_a_curve_of_one():
    figure = plot.cartesian("lambert", "phong", angles=(10, 60))
    assert len(figure.axes) == 4 and list(curves(figure, 2)) == ["lambert", "phong"]
    assert ["10°" in ax.get_title("left") for ax in figure.axes] == [True, False, False, False]
    figure = plot.polar("lambert", "phong", angles=(10, 60))
    texts = [[text.get_text() for text in ax.texts] for ax in figure.axes]
    assert [own.count("30°") for own in texts] == [2, 2, 2, 2]
    assert ["$10^{-1}$" in own for own in texts] == [False, False, False, True]  # one scale
    assert "0" in texts[0] and "0" in texts[2]  # scales of their own
    figure = plot.cartesian({"type": "phong", "exponent": 7}, angles=(10, 60))
    assert len(figure.axes) == 2 and figure.get_suptitle() == "phong exponent=7"
    assert ["10°" in label for label in curves(figure)] == [True, False]


def test_side_by_side_each_bsdf_has_a_panel_on_one_scale():
    """With a colour for each angle, and a row for each scale; the last of five panels leaves no empty axes."""
    narrow, wide = ({"type": "phong", "exponent": n, "diffuse_reflectance": 0} for n in (2000, 20))
    figure = plot.cartesian(wide, narrow, angles=(10, 40), side_by_side=True)
    assert [ax.get_title() for ax in figure.axes] == ["exponent=20", "exponent=2000", "", ""]
    assert heading(figure).startswith("phong with diffuse_reflectance=0\n")
    linear, other, log, _ = figure.axes
    assert linear.get_ylim() == other.get_ylim() and [linear.get_yscale(), log.get_yscale()] == ["linear", "log"]
    tops = [max(value.max() for _, value in curves(figure, panel).values()) for panel in (0, 1)]
    assert other.get_ylim()[1] == pytest.approx(1.05 * tops[1]) and tops[1] > 20 * tops[0]
    assert [["10°" in name for name in curves(figure, panel)] for panel in range(4)] == 4 * [[True, False]]
    alike = plot.polar(*5 * [PHONG], angles=(10,), scale="log", labels=list("abcde"), side_by_side=True)
    assert [ax.get_title() for ax in alike.axes] == list("abcde")


def test_gaps_of_measured_files_are_gaps():
    """Beyond its cone about the mirror direction, unless asked what renders there; and its curves have no dashes."""
    angles = {"angles": (60,), "scale": "log"}
    figure = plot.cartesian("ward", str(LOFT), **angles)
    theta, value = curves(figure)[read(LOFT).title]
    seen = np.isfinite(value)
    assert theta[seen].min() == pytest.approx(60 - 90, abs=0.1) and (np.diff(np.flatnonzero(seen)) == 1).all()
    assert [line.get_linestyle() for line in labelled(figure)] == ["-", "-"]
    held = curve(plot.cartesian(f"{LOFT}:extrapolate=hold", **angles))
    assert np.isfinite(held[1]).all() and np.interp(-60, *held) > 0
    (picture,) = maps(plot.hemisphere(str(LOFT), angles=(60,), resolution=40))
    assert np.isnan(picture[20, 2]) and picture[20, 33] > 0  # 79° on the side of wi, and near the mirror direction


def test_zeros_of_a_measured_file_are_gaps():
    """This one has zeros beyond 80°: its curves end there and do not fall."""
    theta, value = curve(plot.cartesian(AEROGLAZE, angles=(10,), scale="log"))
    theta, value = theta[np.isfinite(value)], value[np.isfinite(value)]
    assert [theta[0], theta[-1]] == pytest.approx([-80, 80], abs=1)
    assert (abs(np.diff(np.log(value))) < 0.2).all()  # by 0.07 at most for each degree that it is measured
    theta, value = curve(plot.albedo(AEROGLAZE))
    assert theta[np.isfinite(value)][[0, -1]].tolist() == [10, 70]


def test_negative_values_are_left_out(monkeypatch):
    """Which measured files have: they have no radius."""
    given = curves_of.Curve(np.array([-60.0, 0, 45]), np.array([-0.1, 0.2, 0.1]))
    monkeypatch.setattr(curves_of, "in_plane_of_incidence", lambda *_: given)
    figure = plot.polar("lambert", angles=(0,), scale="linear")
    assert [*np.hypot(*curve(figure))] == pytest.approx([0, 0.2, 0.1])
    assert heading(figure) == "Negative values are left out."


def test_what_was_measured_in_the_plane_of_incidence_alone_is_a_line_of_a_map():
    (picture,) = maps(plot.hemisphere(AEROGLAZE, angles=(40,), resolution=40))
    assert np.isfinite(picture[19:21, 10]).all() and np.isnan(picture[[18, 21], 10]).all()  # at -43°


def test_the_name_of_a_loaded_bsdf_and_of_those_of_a_file(tmp_path):
    loaded = mi.load_dict({"type": "ward", "id": "brushed"})
    (tmp_path / "two.xml").write_text(
        '<scene version="3.0.0"><shape type="sphere"><bsdf type="lambert" id="wall"/></shape>'
        '<shape type="sphere"><bsdf type="toon" id="fun"/></shape></scene>'
    )
    figure = plot.albedo(loaded, str(tmp_path / "two.xml"), '<bsdf type="lambert" id="text"/>', COLOURED)
    assert legend(figure) == ["brushed", "two.xml:fun", "two.xml:wall", "text", "lambert reflectance=0.2, 0.5, 0.8"]
    assert legend(plot.albedo(loaded, labels=["mine"])) == ["mine"]


def test_a_users_dollars_are_no_formulas_and_what_is_left_out_is_said():
    figure = plot.polar({"type": "lambert"}, {"type": "wrap"}, labels=["$x", "$y"], title=r"$\frac{")
    figure.canvas.draw()
    assert legend(figure)[:2] == [r"\$x", r"\$y"] and figure.get_suptitle() == r"\$\frac{"
    assert plot.polar("plastic").get_suptitle() == "plastic without its delta lobe"


# --- Any model, any kind --------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_every_model_in_every_kind():
    names = [model.plugins[0] for model in own_models()]
    for figure in plot.polar(*names, angles=(50,), scale="log"), plot.albedo(*names):
        for panel in range(len(figure.axes)):
            assert list(drawn := curves(figure, panel)) == names
            assert all(np.isfinite(x).all() and np.isfinite(y).all() and y.max() > 0 for x, y in drawn.values())
    pictures = maps(plot.hemisphere(*names, angles=(50,), resolution=12))
    assert len(pictures) == len(names) and all(np.isfinite(it).all() and it.max() > 0 for it in pictures)


@pytest.mark.slow
@pytest.mark.filterwarnings("error")
def test_what_is_black_is_drawn_and_figures_are_nobody_elses():
    """pyplot knows none of them, its settings stay, and a notebook can show them."""
    before = dict(rcParams)
    for kind in command.KINDS.values():
        assert kind({"type": "lambert", "reflectance": 0})._repr_png_()[0].startswith(b"\x89PNG")
    assert pyplot.get_fignums() == [] and dict(rcParams) == before


# --- Errors ---------------------------------------------------------------------------------------------------------

ERRORS = [
    (lambda: plot.polar(), "no BSDF to plot"),
    (lambda: plot.polar({"type": "sphere"}), "sphere is not a BSDF of llvm_ad_rgb"),
    (lambda: plot.albedo(3), "int is not a BSDF"),
    (lambda: plot.cartesian({"alpha": 0.2}), "'alpha': 0.2.* is no BSDF; give a dict such as"),
    (lambda: compare({"alpha": 0.2}), "'alpha': 0.2.* is no BSDF; give a dict such as"),
    (lambda: plot.hemisphere("ward", angles=()), "no angle"),
    (lambda: plot.polar("ward", size=(0, 0)), "give a width and a height in inches"),
    (lambda: plot.albedo("ward", size=6), "size 6: give a width and a height"),
    (lambda: plot.polar("ward", "phong", labels="ab"), "there are 2 BSDFs, but 1 labels"),
    (lambda: plot.albedo("ward", azimuth=np.inf), "azimuth inf: give degrees"),
    (lambda: plot.cartesian("ward", azimuth=np.nan), "azimuth nan: give degrees"),
    (lambda: plot.hemisphere("ward", azimuth=np.nan), "azimuth nan: give degrees"),
    (lambda: plot.hemisphere("ward", resolution=20.5), "resolution 20.5: give from 2 to 4096 pixels"),
    (lambda: plot.polar("ward", scale="logarithmic"), "no scale 'logarithmic'; there are linear, log, both"),
]


def test_errors():
    for wrong, text in ERRORS:
        with pytest.raises((ValueError, RuntimeError), match=text):
            wrong()
    with mi.variant_context("llvm_ad_mono_polarized"), pytest.raises(ValueError, match="vectorized and unpolarized"):
        plot.polar("lambert")


# --- The command ----------------------------------------------------------------------------------------------------


run = partial(invoke, "plot")


def test_the_command_passes_on_what_it_is_told(folder, monkeypatch):
    def kind(*bsdfs, angles=(), azimuth=0, scale="both", normalize=False, rgb=False, side_by_side=False):
        told.append((bsdfs, list(angles), azimuth, scale, normalize, rgb, side_by_side))
        return plot.albedo("lambert")

    told = []
    monkeypatch.setitem(command.KINDS, "polar", kind)
    words = "ward lambert --angles 10,60.5 --azimuth 30 --scale log --rgb --side-by-side -oa.svg"
    done = run(*words.split())
    assert done.exit_code == 0 and done.stdout == "a.svg\n"
    assert told == [(("ward", "lambert"), [10, 60.5], 30, "log", False, True, True)]
    assert "<svg" in (folder / "a.svg").read_text()


def test_each_kind_has_its_file(folder):
    done = run("ward", "--param", "alpha=0.1,0.4", "--param", "variant=ward-duer", "--scale", "log")
    assert (done.exit_code, done.stdout, done.stderr) == (0, "ward-polar.png\n", "")
    assert min(mi.Bitmap(str(folder / "ward-polar.png")).size()) > 800
    assert run("ward", "--kind", "albedo", "--size", "3x2", "--title", "A", "-o", "s.png").stdout == "s.png\n"
    assert list(mi.Bitmap(str(folder / "s.png")).size()) == [600, 400]
    (folder / "s.png").unlink()
    assert run("lambert", "toon", "--kind", "albedo").stdout == "lambert-toon-albedo.png\n"
    assert run('<bsdf type="lambert"/>', "--kind", "cartesian", "-o", "b.pdf").stdout == "b.pdf\n"
    assert {file.name for file in folder.iterdir()} == {"ward-polar.png", "lambert-toon-albedo.png", "b.pdf"}
    assert pyplot.get_fignums() == []


def test_a_missing_library_is_named(monkeypatch, folder):
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    monkeypatch.delitem(sys.modules, "mi_brdfs.plot")
    done = run("ward")
    assert done.exit_code == 1 and done.stdout == ""
    assert re.fullmatch(r"mi-brdfs: .*Matplotlib: pip install 'mi_brdfs\[plot\]'\n", done.stderr)
