"""What ``shading`` says of bad input, and its manual page."""

import re

import mitsuba as mi
import pytest
from plates import SUN, WHITE, lamp, plate, refused

import mi_brdfs


@pytest.mark.usefixtures("llvm_rgb")
@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"ambient": -0.1}, r"shading: ambient = -0.1 is not allowed; it must be a number, rgb or spectrum within \[0"),
        ({"ambient": {"type": "rgb", "value": [0.1, -1, 0]}}, r"shading: ambient = .* is not allowed"),
        ({"tonemap": "filmic"}, r'shading: tonemap = "filmic" is unknown; it must be one of "none" or "reinhard"'),
        ({"area_lights": "center"}, r'must be one of "sample" or "centre"'),
        ({"shadows": "yes"}, r'shading: shadows = "yes" is a string; it must be true or false'),
        ({"max_depth": 3}, "shading: unknown parameter max_depth; known are "),
    ],
)
def test_bad_parameters(given, message):
    with pytest.raises(RuntimeError, match=message):
        mi.load_dict({"type": "shading", **given})


@pytest.mark.usefixtures("llvm_rgb")
@pytest.mark.parametrize("ambient", [None, 0.0, {"type": "rgb", "value": [0, 0, 0]}])
def test_no_light_and_no_ambient(ambient):
    given = {} if ambient is None else {"ambient": ambient}
    with refused("shading: the scene has no light; add an emitter to it, or give ambient"):
        mi.render(plate(WHITE, **given))


@pytest.mark.usefixtures("llvm_rgb")
def test_bad_scenes():
    with refused("environment_reflection needs an environment"):
        mi.render(plate(WHITE, SUN, environment_reflection=True))
    with refused('area_lights = "centre" knows Rectangle, Disk and Sphere, but a light is a Cylinder'):
        mi.render(plate(WHITE, lamp("cylinder"), area_lights="centre"))


def test_films_without_colours_are_refused():
    with mi.variant_context("llvm_ad_spectral"):
        band = {"type": "regular", "wavelength_min": 400, "wavelength_max": 700, "values": "0, 1, 0"}
        film = {"type": "specfilm", "width": 2, "height": 2, "band": band}
        sensor = mi.load_dict({"type": "orthographic", "film": film})
        with pytest.raises(ValueError, match="shading: SpecFilm has no colours to finish; use an hdrfilm"):
            mi.load_dict({"type": "shading"}).render(plate(WHITE, SUN), sensor)


def test_manual_page():
    page = mi_brdfs.info("shading")
    assert "pi_folded" in page
    xml = re.search(r"<integrator .*?</integrator>", page, re.S).group().replace(">", ' version="3.0.0">', 1)
    given = re.search(r'^\{"type".*?\}$', page, re.S | re.M).group()
    for variant in ("scalar_rgb", "scalar_spectral"):
        with mi.variant_context(variant):
            assert str(mi.load_string(xml)) == str(mi.load_dict(eval(given)))
    assert "shading" not in mi_brdfs.list_models()
