"""Text formats with a row for each pair of directions, and what is written as text: values at known rows, units,
f cosθ, grids, and files read back."""

import itertools
import re
import warnings

import merl_tables
import numpy as np
import pytest
from support import shared, spherical, written

from mi_brdfs.measured import FileError, Grid, Samples, read, scattered
from mi_brdfs.measured.arrays import NUMPY, components
from mi_brdfs.measured.coordinates import HalfDifference, SpecularPolar, Spherical
from mi_brdfs.measured.formats import csv, zemax
from mi_brdfs.measured.report.summary import summarize
from mi_brdfs.measured.scattered import as_grid
from mi_brdfs.measured.source import Source


def measured(folder, text, name="x.csv"):
    return read(written(folder, name, text))


def highlight(wi, wo):
    """A reciprocal and isotropic highlight."""
    half = (wi + wo) / np.linalg.norm(wi + wo, axis=-1, keepdims=True)
    return 0.1 + np.exp(-20 * (1 - half[..., 2] ** 2))


def tabulated(folder, *angles, f=highlight):
    """A CSV of f where all angles cross: θi, θo and Δφ, or θi, φi, θo and φo."""
    names = "theta_i,theta_o,delta_phi" if len(angles) == 3 else "theta_i,phi_i,theta_o,phi_o"
    rows = np.array([*itertools.product(*angles)], dtype=float)
    i, p, o, q = rows.T if len(angles) == 4 else (rows[:, 0], 0, *rows.T[1:])
    table = np.column_stack([rows, f(spherical(i, p), spherical(o, q))])
    text = "\n".join(",".join(map(str, row)) for row in table.tolist())
    return measured(folder, f"# angles: degrees\n{names},f\n{text}")


def value_at(measurement, wi, wo):
    """The value of the sample, or the node, at a pair of directions."""
    data = measurement.data
    if isinstance(data, Grid):
        return data.evaluate(wi, wo, "nearest")
    row = np.flatnonzero(np.all(abs(data.wi - wi) < 1e-6, axis=1) & np.all(abs(data.wo - wo) < 1e-6, axis=1))
    return data.values[row].squeeze(0)


def test_a_header_in_a_comment(tmp_path):
    """As numpy.savetxt writes it."""
    rows = np.array([[0, 0, 0, 0.33], [0, 10, 0, 0.32], [10, 10, 180, 0.31]])
    np.savetxt(
        tmp_path / "x.csv", rows, delimiter=",", header="material: paint\ntheta_i_deg,theta_o_deg,delta_phi_deg,f"
    )
    measurement = read(tmp_path / "x.csv")
    assert measurement.material == "paint"
    assert value_at(measurement, spherical(10, 0), spherical(10, 180)) == pytest.approx(0.31)


def test_a_grid_has_nothing_below_the_horizon(tmp_path):
    """Its angles go on there."""
    data = as_grid(tabulated(tmp_path, range(0, 90, 20), range(0, 90, 20), range(0, 181, 20)).data)
    above, below = spherical(30, 10), spherical(140, [20, 200])
    assert (data.evaluate(above, below * [1, 1, -1]) > 0).all()
    for wi, wo in (above, below), (below, above), (below, below):
        for interpolation in "trilinear", "nearest":
            np.testing.assert_array_equal(data.evaluate(wi, wo, interpolation), 0)


# --- Cornell and ALTA -----------------------------------------------------------------------------------------------


def test_cornell(tmp_path):
    text = "# num wls\n2\n450 650\n0.3 0 0.2 3 0.1 0.2\n0.5 0.5 0.4 -1 0.3 0.4\n"
    measurement = measured(tmp_path, text, "x.brdf")
    assert measurement.format == "Cornell"
    np.testing.assert_array_equal(measurement.wavelengths, [450, 650])
    wi, wo = spherical(*np.degrees([0.5, 0.5])), spherical(*np.degrees([0.4, -1]))
    np.testing.assert_array_equal(value_at(measurement, wi, wo), [0.3, 0.4])
    assert measurement.data.anisotropic


@pytest.mark.parametrize(
    "parts, towards", [(("cornell", "krylon_blue.brdf"), [-1, -1, 1]), (("retro", "retro-3M-jaune.dat"), [1, 1, 1])]
)
def test_highlights_are_where_they_must_be(parts, towards):
    """With light from 30°, of paint at its mirror direction, and of a retro-reflector at the light itself."""
    samples = read(shared(*parts)).data
    wi = samples.wi[np.argmin(abs(samples.wi[:, 2] - np.cos(np.pi / 6)))]
    of = np.flatnonzero(np.all(abs(samples.wi - wi) < 1e-6, axis=1))
    brightest = samples.wo[of[np.nanargmax(samples.values[of].mean(axis=1))]]
    assert not samples.anisotropic and brightest @ (wi * towards) > np.cos(np.radians(5))


def alta(parametrisation, rows, outputs=1, quantity="INV_STERADIAN"):
    lines = [" ".join(f"{number:.12g}" for number in row) for row in rows]
    header = f"#DIM {len(rows[0]) - outputs} {outputs}\n#PARAM_IN {parametrisation}\n#PARAM_OUT {quantity}\n"
    return header + "\n".join(lines) + "\n"


L, V = spherical(50, 20), spherical(30, 100)


def about_light():
    """The angle of V from L, and its azimuth about L from the side of the normal on."""
    towards = np.array([0, 0, 1]) - L[2] * L
    towards /= np.linalg.norm(towards)
    return np.arccos(L @ V), np.arctan2(V @ np.cross(towards, L), V @ towards)


def places():
    theta_l, phi_l, theta_v, phi_v = np.radians([50, 20, 30, 100])
    (theta_h,), (theta_d,), (phi_d,) = merl_tables.angles(V[None], L[None])  # of the view, as ALTA has it
    phi_h = np.arctan2(L[1] + V[1], L[0] + V[0])
    delta, (angle, azimuth) = phi_v - phi_l, about_light()
    yield "SPHERICAL_TL_PL_TV_PV", (theta_l, phi_l, theta_v, phi_v)
    yield "ISOTROPIC_TV_TL_DPHI", (theta_v, theta_l, -delta)
    yield "ISOTROPIC_TL_TV_PROJ_DPHI", (theta_l, theta_v * np.cos(delta), theta_v * np.sin(delta))
    yield "RETRO_TL_TVL_PROJ_DPHI", (theta_l, angle * np.cos(azimuth), angle * np.sin(azimuth))
    yield "RUSIN_TH_TD_PD", (theta_h, theta_d, phi_d)
    yield "RUSIN_TH_PH_TD_PD", (theta_h, phi_h, theta_d, phi_d)
    yield "CARTESIAN", (*V, *L)


@pytest.mark.parametrize("name, place", list(places()))
def test_alta_parametrisations(tmp_path, name, place):
    rows = [(*place, 0.5), (*([0.3] * len(place)), 0.25)]
    measurement = measured(tmp_path, alta(name, rows), "x.dat")
    assert measurement.format == "ALTA"
    data = measurement.data
    assert isinstance(data, Samples)
    wi, wo = data.wi[data.values[:, 0] == 0.5][0], data.wo[data.values[:, 0] == 0.5][0]
    assert data.anisotropic == (len(place) > 3)
    if data.anisotropic:
        np.testing.assert_allclose([wi, wo], [L, V], atol=1e-9)
    # Up to a turn, which leaves the polar angles and the angle from azimuth to azimuth.
    np.testing.assert_allclose([wi[2], wo[2], wi @ wo], [L[2], V[2], L @ V], atol=1e-9)
    assert np.cross(wi, wo)[2] == pytest.approx(np.cross(L, V)[2], abs=1e-9)


def test_alta_values(tmp_path):
    rows = [(0.3, 0.2, 0.1, 0.5), (0.3, np.pi / 2, 0, 0.5)]
    f_cos = measured(tmp_path, alta("ISOTROPIC_TL_TV_PROJ_DPHI", rows, quantity="INV_STERADIAN_COSINE_FACTOR"), "x.dat")
    assert f_cos.quantity == "f cos"
    np.testing.assert_allclose(f_cos.data.values[:, 0], [0.5 / np.cos(np.hypot(0.2, 0.1)), np.nan], rtol=1e-9)
    assert np.isnan(f_cos.wavelengths).tolist() == [True]
    rgb = measured(tmp_path, alta("ISOTROPIC_TV_TL_DPHI", [(0.1, 0.2, 0.3, 1, 2, 3)], 3, "RGB_COLOR"), "y.dat")
    assert rgb.wavelengths is None
    with_deltas = alta("ISOTROPIC_TV_TL_DPHI", [(0.1, 0.2, 0.3, 1, 0.1)]).replace("#DIM 4 1", "#DIM 3 1\n#VS 1")
    np.testing.assert_array_equal(measured(tmp_path, with_deltas, "z.dat").data.values.ravel(), [1])


@pytest.mark.parametrize(
    "coordinates",
    [HalfDifference(reciprocal=False, anisotropic=True), Spherical(False, True), SpecularPolar(False, True)],
    ids=lambda it: type(it).__name__,
)
@pytest.mark.parametrize("tiny", [0, 1e-9, 1e-6])
def test_azimuths_count_where_a_pole_has_none(coordinates, tiny):
    """Of the other direction, where one is at the normal, and of both, where the half vector is."""
    normal, view = np.array([0, tiny, 1]), spherical(40, 70)
    mirrored = view * [-1, -1, 1] + [0, tiny, 0]
    for wi, wo in ((normal, view), (view, normal), (view, mirrored / np.linalg.norm(mirrored))):
        there = coordinates.locate(components(wi), components(wo), NUMPY)
        found = [np.array([w.x, w.y, w.z]) for w in coordinates.directions(*map(np.float64, there))]
        np.testing.assert_allclose(found, [wi, wo], atol=2e-7)


def test_alta_grids_of_half_vectors_reach_below_the_horizon(tmp_path):
    angles = [*itertools.product(*(np.radians(range(0, most, 15)) for most in (91, 91, 181)))]
    below = sum(np.cos(h) * np.cos(d) - np.sin(h) * np.sin(d) * abs(np.cos(phi)) < -1e-6 for h, d, phi in angles)
    with pytest.warns(UserWarning, match=f"rows of directions below the horizon are left out: {below}"):
        samples = measured(tmp_path, alta("RUSIN_TH_TD_PD", [(*row, 0.5) for row in angles]), "x.dat").data
    assert min(samples.wi[:, 2].min(), samples.wo[:, 2].min()) > -1e-5
    with pytest.raises(FileError, match="no row has both directions above the horizon"):
        measured(tmp_path, alta("RUSIN_TH_TD_PD", [(1.5, 1.5, 0, 0.5)]), "x.dat")


def test_alta_vectors_have_any_length_but_none(tmp_path):
    rows = [(*(3 * V), *(1e-200 * L), 0.5), (*L, *V, 0.1)]
    samples = measured(tmp_path, alta("CARTESIAN", rows), "x.dat").data
    np.testing.assert_allclose([samples.wi[0], samples.wo[0]], [L, V], atol=1e-9)
    with pytest.raises(FileError, match=r"in line 5, .* a direction is the zero vector"):
        measured(tmp_path, alta("CARTESIAN", [*rows[:1], (0, 0, 0, *L, 0.5)]), "x.dat")


UNSTATED = {
    "alta": alta("ISOTROPIC_TV_TL_DPHI", [(0.5, 0.2, 0.3, 1.0), (0.7, 0.1, 0.2, 1.0)]).replace("#PARAM_OUT", "#PARAM"),
    "alta, rgb": alta("ISOTROPIC_TV_TL_DPHI", [(0.5, 0.2, 0.3, 1, 1, 1), (0.7, 0.1, 0.2, 1, 1, 1)], 3, "RGB_COLOR"),
    "csv": "theta_o_rad theta_i_rad phi_o_rad r g b\n0.5 0.2 0.3 1 1 1\n0.7 0.1 0.2 1 1 1\n",
}


@pytest.mark.parametrize("name", [*UNSTATED, "utia"])
def test_what_a_file_does_not_state_can_be_said(tmp_path, name):
    path = tmp_path / ("x.bin" if name == "utia" else "x.dat")
    if name == "utia":
        path.write_bytes(np.full(3 * (2 * 16) ** 2, 1.0).tobytes())
    else:
        path.write_text(UNSTATED[name])
    f, f_cos = read(path, "f"), read(path, "f cos")
    assert (f.quantity, f_cos.quantity) == ("f", "f cos")
    _, wo, values = f_cos.data.pairs()
    assert np.ptp(wo[:, 2]) > 0.1
    np.testing.assert_allclose(values, np.ones_like(values) / wo[:, 2:], rtol=1e-6)
    np.testing.assert_array_equal(f.data.values, 1)
    if name == "alta":
        with pytest.raises(FileError, match='does not say what it holds: give the quantity, "f" or "f cos", or add a'):
            read(path)
    else:
        assert read(path).quantity == "f"


@pytest.mark.parametrize("held, asked", [("f", "f cos"), ("f cos", "f")])
def test_what_a_file_states_counts(tmp_path, held, asked):
    path = tmp_path / "x.csv"
    path.write_text(f"# quantity: {held}\n" + UNSTATED["csv"])
    assert read(path, held).quantity == read(path).quantity == held
    with pytest.raises(FileError, match=f"x.csv holds {held}, as it or its format states, and not {asked}; leave"):
        read(path, asked)
    with pytest.raises(ValueError, match="the quantity 'cosine' is none of stated, f, f cos"):
        read(path, "cosine")


# --- CSV ------------------------------------------------------------------------------------------------------------

ROWS = list(itertools.product((0, 20, 40), (0, 20, 40), range(0, 181, 20)))


def f_of(theta_i, theta_o, delta):
    """Something that is symmetric, and does not depend on an azimuth at the normal."""
    return 1 + theta_i / 100 + theta_o / 1000 + theta_i * theta_o * delta / 1e8


def table(header="theta_i_deg,theta_o_deg,phi_o_deg,f", scale=1.0, mark=",", factor=lambda i, o, d: 1.0):
    rows = [[i * scale, o * scale, d * scale, f_of(i, o, d) * factor(i, o, d)] for i, o, d in ROWS]
    return header + "\n" + "\n".join(mark.join(f"{x:.12g}" for x in row) for row in rows) + "\n"


@pytest.mark.parametrize(
    "text",
    [
        table(),
        table("theta_i_rad,theta_o_rad,phi_o_rad,f", np.pi / 180),
        table("# angles: radians\ntheta_i,theta_o,phi_o,f", np.pi / 180),
        table("# units: Degree\ntheta_i,theta_o,phi_o,f"),
        table("# Angles = degrees\nTheta_in,Theta_r,delta_phi,brdf [1/sr]"),
        table("theta_l (deg)\ttheta_v (deg)\tphi_v (deg)\tf", mark="\t"),
        table("theta_l (deg)\ttheta_v (deg)\tphi_v (deg)\tf", mark="\t").replace(".", ","),
        table("theta_i_deg;theta_o_deg;phi_o_deg;f", mark=";").replace(".", ","),
        table("theta_i_deg,theta_o_deg,phi_o_deg,f_cos", factor=lambda i, o, d: np.cos(np.radians(o))),
        table("# quantity: f cos\n" + table().splitlines()[0], factor=lambda i, o, d: np.cos(np.radians(o))),
    ],
    ids=range(10),
)
def test_csv_spellings(tmp_path, text):
    measurement = measured(tmp_path, text)
    assert isinstance(measurement.data, Grid)
    for i, o, d in ROWS:
        np.testing.assert_allclose(value_at(measurement, spherical(i, 0), spherical(o, d)), f_of(i, o, d), rtol=1e-9)


def test_csv_values(tmp_path):
    row = "\n30,10,40,100,0.1,0.2,0.3\n"
    angles = "theta_i_deg,phi_i_deg,theta_o_deg,phi_o_deg"
    wi, wo = spherical(30, 0), spherical(40, 90)  # turned: a single φi is that of an isotropic material
    rgb = measured(tmp_path, angles + ",b,g,r" + row)
    assert rgb.wavelengths is None
    np.testing.assert_allclose(value_at(rgb, wi, wo), [0.3, 0.2, 0.1])
    spectral = measured(tmp_path, angles + ",650nm,450 nm,f_550" + row)
    np.testing.assert_array_equal(spectral.wavelengths, [450, 550, 650])
    np.testing.assert_allclose(value_at(spectral, wi, wo), [0.2, 0.3, 0.1])
    grey = measured(tmp_path, "# wavelength: 633 nm\n# material: Black Paint\n" + table())
    assert (grey.wavelengths.tolist(), grey.material) == ([633], "Black Paint")
    assert np.isnan(measured(tmp_path, table()).wavelengths).all()
    with pytest.raises(FileError, match=r"the wavelength '0\.65 um' is no number of nm, such as 650"):
        measured(tmp_path, "# wavelength: 0.65 um\n" + table())


def test_rows_that_are_no_grid_are_samples(tmp_path):
    for text in (table().rsplit("\n", 2)[0], table().replace("\n40,40,80", "\n40,41,80")):
        measurement = measured(tmp_path, text)
        assert isinstance(measurement.data, Samples)
        np.testing.assert_allclose(value_at(measurement, spherical(40, 0), spherical(20, 80)), f_of(40, 20, 80))


def test_rows_that_contradict_others_are_told(tmp_path):
    """Two runs in one file; noise, and what is next to nothing, is no contradiction."""
    noisy, other = (table("", factor=lambda *_, it=it: it).lstrip() for it in (1.1, 5.0))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        measured(tmp_path, table() + noisy)
        measured(tmp_path, table() + other + "50,50,10,1000\n")
    with pytest.warns(UserWarning, match="more than twice or less than half their values, are averaged: 90"):
        measured(tmp_path, table() + other, "y.csv")


def test_rows_of_anisotropic_materials(tmp_path):
    """A turn may be closed by 360°; a single row may stand for all azimuths at the pole, in isotropic tables."""
    angles = itertools.product((10, 40), range(0, 361, 90), (20, 50), range(0, 361, 60))
    rows = [f"{i},{p},{o},{p + d},{i + o / 100 + (p % 360) / 1e5 + (d % 360) / 1e7}" for i, p, o, d in angles]
    data = measured(tmp_path, "theta_i_deg,phi_i_deg,theta_o_deg,phi_o_deg,f\n" + "\n".join(rows)).data
    assert data.anisotropic
    assert [len(axis.nodes) for axis in data.axes] == [2, 2, 6, 4]
    assert [axis.period for axis in data.axes[2:]] == [2 * np.pi, 2 * np.pi]
    found = data.evaluate(spherical(40, 270), spherical(20, 270 + 300), "nearest")
    np.testing.assert_allclose(found, 40 + 0.2 + 270e-5 + 300e-7, rtol=1e-9)
    once = "\n".join(line for line in table().splitlines() if not re.search(r"^\d+,0,[1-9]", line))
    assert isinstance(measured(tmp_path, once).data, Grid)


def test_a_row_without_a_value_takes_none_from_others(tmp_path):
    """Neither from those that stand for the same direction at a pole, nor from one of the same angles."""
    angles = [*itertools.product(range(0, 61, 10), range(0, 61, 10), range(0, 181, 20))]
    values = {(i, o, d): f"{highlight(spherical(i, 0), spherical(o, d))}" for i, o, d in angles}

    def data(*lacking, again=""):
        rows = [f"{i},{o},{d},{'' if (i, o, d) in lacking else f}" for (i, o, d), f in values.items()]
        text = "theta_i_deg,theta_o_deg,delta_phi_deg,f\n" + "\n".join(rows) + again
        return measured(tmp_path, text).data.values

    np.testing.assert_allclose(data((0, 20, 0), (20, 0, 60), again="\n30,30,20,"), data(), rtol=1e-12)
    assert np.isnan(data((30, 30, 20))).sum() == 1


def test_an_anisotropic_grid_of_alta_has_azimuths_at_the_normal(tmp_path):
    angles = itertools.product(range(0, 61, 20), range(0, 360, 90), range(0, 61, 20), range(0, 360, 90))
    rows = [(*np.radians(row), streaks(spherical(*row[:2]), spherical(*row[2:]))[0]) for row in angles]
    data = measured(tmp_path, alta("SPHERICAL_TL_PL_TV_PV", rows), "x.alta").data
    assert isinstance(data, Grid) and data.values.shape == (4, 4, 4, 4, 1)


def test_both_directions_may_be_on_either_side_of_the_normal(tmp_path):
    data = tabulated(tmp_path, range(-60, 61, 10), range(-60, 61, 5), [0]).data
    assert not data.anisotropic
    wi, wo = spherical(30, 70), spherical(30, 250)
    np.testing.assert_allclose(as_grid(data).evaluate(wi, wo), highlight(wi, wo), rtol=0.05)


def test_half_a_turn_tells_the_other_half(tmp_path, monkeypatch):
    """Of the light's azimuths, by reciprocity; there is no jump where they end."""
    monkeypatch.setattr(scattered, "MOST_NODES", 30_000)
    thetas, angles = range(0, 61, 20), range(0, 360, 20)
    with pytest.warns(UserWarning, match="Light from φi = 0° to 180° was measured; from elsewhere"):
        data = as_grid(tabulated(tmp_path, thetas, angles[:10], thetas, angles, f=streaks).data)
    assert data.anisotropic
    for phi in (-1e-3, 1e-3, 90, 270):
        wi, wo = spherical(40, phi), spherical(40, phi + 180)
        np.testing.assert_allclose(data.evaluate(wi, wo), streaks(wi, wo), rtol=0.25)
        wi, wo = spherical(40, phi), spherical(20, phi + 90)
        np.testing.assert_allclose(data.evaluate(wi, wo), streaks(wi, wo), rtol=0.25)


@pytest.mark.parametrize(
    "azimuths",
    [lambda i, d: (180, 180 + d), lambda i, d: (180 if i else 0, 180 + d), lambda i, d: (-d, 0),
     lambda i, d: (d // 180 * 180, d // 180 * 180 + d), lambda i, d: (i * d % 7 / 100, d + i * d % 7 / 100)],
    ids=["light at 180°", "light at 180°, but 0 at the normal", "light goes round", "light on both sides", "as read"],
)  # fmt: skip
def test_isotropic_materials_are_recognized(tmp_path, azimuths):
    """Whichever azimuth a file keeps; at the normal one means nothing."""
    rows = []
    for i, o, d in itertools.product((0, 20, 40), (0, 20, 40), range(0, 360, 20)):
        phi_i, phi_o = azimuths(i, d)
        rows.append(f"{i},{phi_i},{o},{phi_o},{highlight(spherical(i, 0), spherical(o, d))}")
    data = measured(tmp_path, "theta_i_deg,phi_i_deg,theta_o_deg,phi_o_deg,f\n" + "\n".join(rows)).data
    assert isinstance(data, Grid) and not data.anisotropic
    wi, wo = spherical(20, 50), spherical(40, 210)
    np.testing.assert_allclose(data.evaluate(wi, wo), highlight(wi, wo), rtol=1e-3)


def test_a_single_angle_of_incidence_is_that_of_both_directions(tmp_path):
    """Where the light comes from one of the views, as it would for reciprocal materials, and not as from the light."""
    data = tabulated(tmp_path, [45], range(0, 81, 5), range(0, 181, 10)).data
    wi, wo = np.stack([spherical(o, 0) for o in (10, 30, 60)]), spherical(45, 180)
    np.testing.assert_allclose(as_grid(data).evaluate(wi, wo)[:, 0], highlight(wi, wo), rtol=0.1)


def test_what_lies_beside_a_single_angle_counts(tmp_path):
    measurement = tabulated(tmp_path, [45], range(-85, 86, 5), [180], f=lambda wi, wo: 0.25 + 0 * wo[:, 0])
    assert summarize(measurement).largest_albedo.value == pytest.approx(0.25 * np.pi, rel=0.01)
    zero = as_grid(measurement.data, "zero")
    assert zero.evaluate(spherical(45, 0), spherical(20, 100), extrapolate="zero") == pytest.approx(0.25)


@pytest.mark.parametrize("step", [180, 90, 60])
def test_highlights_are_not_smeared_around_the_normal(tmp_path, step):
    """Between azimuths that are far apart, as those of the plane of incidence, half vectors say where they are; a table
    of azimuths would be several times too bright there."""
    measurement = tabulated(tmp_path, range(0, 81, 10), range(0, 81, 5), range(0, 181, step))
    wi, wo = spherical(60, 0), np.stack([spherical(o, d) for o, d in itertools.product((40, 60), range(100, 181, 10))])
    found = as_grid(measurement.data).evaluate(wi, wo)[:, 0]
    np.testing.assert_allclose(found, highlight(wi, wo), atol=0.1)
    assert ("plane of incidence only" in str(summarize(measurement).rows())) == (step == 180)


# --- Writers --------------------------------------------------------------------------------------------------------


def colours(wi, wo):
    """A reciprocal and isotropic BRDF with a highlight."""
    half = (wi + wo) / np.linalg.norm(wi + wo, axis=-1, keepdims=True)
    lobe = np.exp(-10 * (1 - half[..., 2:] ** 2))
    return np.concatenate([0.1 + lobe, 0.2 + 0.1 * lobe, 0.3 - 0.2 * lobe], axis=-1)


def streaks(wi, wo):
    """Another one, narrow in x and wide in y."""
    half = (wi + wo) / np.linalg.norm(wi + wo, axis=-1, keepdims=True)
    return 0.1 + np.exp(-10 * half[..., :1] ** 2 - half[..., 1:2] ** 2)


SOURCES = {
    "rgb": Source(colours, material="A test"),
    "one wavelength": Source(lambda wi, wo: colours(wi, wo)[..., :1], np.array([650.0])),
    "anisotropic": Source(streaks, np.array([550.0]), anisotropic=True),
    "grey": Source(lambda wi, wo: np.repeat(colours(wi, wo)[..., :1], 3, axis=-1)),
    "spectral": Source(colours, np.array([450.0, 550.0, 650.0])),
}


SLOW = "anisotropic", "grey"
CASES = [*itertools.product([csv], SOURCES), *((zemax, name) for name in SOURCES if name != "spectral")]


@pytest.mark.parametrize(
    "format, name", [pytest.param(*case, marks=[pytest.mark.slow] * (case[1] in SLOW)) for case in CASES]
)
def test_files_are_read_back(tmp_path, monkeypatch, format, name):
    source, path = SOURCES[name], tmp_path / ("x.csv" if format is csv else "x.bsdf")
    if source.anisotropic:  # what matters, in a tenth of the time
        monkeypatch.setattr(zemax, "hemisphere", lambda *angles: (np.array([[0, 0, 1.0]]), np.ones(1)))
    format.write(path, source)
    measurement = read(path)
    grid = measurement.data
    assert (measurement.format, grid.anisotropic) == (format.NAME, source.anisotropic)
    wi, wo, f = grid.pairs(np.random.default_rng(1).integers(0, grid.values[..., 0].size, 5000))
    seen = np.isfinite(f[:, 0])
    assert seen.mean() > 0.3
    expected = source.evaluate(wi[seen], wo[seen])
    if format is zemax and name == "grey":
        expected = expected[:, :1]
    np.testing.assert_allclose(f[seen], expected, rtol=3e-6, atol=1e-6)
    if name in ("one wavelength", "spectral"):
        np.testing.assert_array_equal(measurement.wavelengths, source.wavelengths)
    assert not source.material or measurement.material == source.material


def test_written_tis_is_the_albedo(tmp_path):
    lambertian = Source(lambda wi, wo: np.full((len(wi), 1), 0.3 / np.pi), np.array([550.0]))
    zemax.write(tmp_path / "x.bsdf", lambertian)
    stated = read(tmp_path / "x.bsdf").stated_albedos
    assert len(stated) == 18
    np.testing.assert_allclose(list(stated.values()), 0.3, rtol=1e-3)


def test_spectra_without_the_visible_are_announced(tmp_path):
    """A sheet measured in the infrared is rendered as its nearest wavelength: this is said."""
    rows = "\n".join(f"30,{o},180,0.2,0.1" for o in range(0, 61, 20))
    with pytest.warns(UserWarning, match="wavelengths of 900 to 1700 nm leave out 100% of what the eye sees"):
        measured(tmp_path, "theta_i_deg,theta_o_deg,phi_o_deg,900,1700\n" + rows)
    measured(tmp_path, "theta_i_deg,theta_o_deg,phi_o_deg,450,650\n" + rows)


def test_radians_that_are_called_degrees_are_announced(tmp_path):
    rows = "\n".join(f"{theta_i},{theta_o},0,.3" for theta_i in (0.0, 0.5, 1.0) for theta_o in (0.0, 0.7, 1.5))
    with pytest.warns(UserWarning, match="θ is at most 1.57°; if these are radians, call the columns _rad"):
        measured(tmp_path, "theta_i_deg,theta_o_deg,delta_phi_deg,f\n" + rows)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        measured(tmp_path, "theta_i_rad,theta_o_rad,delta_phi_rad,f\n" + rows)
