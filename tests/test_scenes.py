"""The scenes and the preview load everywhere and give a sane picture; what goes with the scenes is up to date."""

import xml.etree.ElementTree as ElementTree

import make_textures
import mitsuba as mi
import numpy as np
import pytest
from generate import scenes
from generate.made import ROOT
from generate.scenes import SCENES
from support import is_scalar

import mi_brdfs
from mi_brdfs.mitsuba.registry import own_models


def picture(scene, size=32, spp=16):
    """A small rendering of a scene, free of NaN, infinite and negative pixels, and neither black nor blown out.

    Few samples may put a spectral pixel outside the sRGB gamut, where a channel is negative; its luminance never is.
    """
    params = mi.traverse(scene)
    params[next(key for key in params.keys() if key.endswith("film.size"))] = [size, size]
    params.update()
    image = np.array(mi.render(scene, spp=1 if is_scalar() else spp))
    assert np.isfinite(image).all()
    assert ((image @ [0.2126, 0.7152, 0.0722] if mi.is_spectral else image) >= 0).all()
    assert 0.02 < np.median(image) < 0.9
    assert (image > 2).mean() < 0.1
    return image


@pytest.mark.parametrize("path", SCENES, ids=lambda path: path.stem)
def test_scene_files(path, variant):
    picture(mi.load_file(str(path)))


@pytest.mark.parametrize("path", SCENES, ids=lambda path: path.stem)
def test_scene_files_have_defaults(path):
    defaults = {element.get("name") for element in ElementTree.parse(path).getroot().iter("default")}
    assert path.stem == "legacy_06" or {"spp", "width", "height", "max_depth"} <= defaults


@pytest.mark.slow
@pytest.mark.usefixtures("llvm_rgb")
@pytest.mark.parametrize("path", SCENES, ids=lambda path: path.stem)
def test_picture_shows_the_scene(path):
    """Rendered anew with few samples and averaged over squares, the picture differs by its noise, up to 0.004 on the
    display's scale from 0 to 1."""
    stored = np.array(mi.Bitmap(str(scenes.PICTURES / f"{path.stem}.jpg")), np.float64) / 255
    now = np.array(scenes.picture(path, spp=16), np.float64) / 255
    assert stored.shape == now.shape
    assert abs(squares(stored) - squares(now)).mean() < 0.01, f"stale: run python docs/generate {path.stem}"


def squares(image, side=8):
    """The means of an image over squares of pixels."""
    height, width, channels = image.shape
    image = image[: height // side * side, : width // side * side]
    return image.reshape(height // side, side, width // side, side, channels).mean(axis=(1, 3))


def test_textures_are_what_the_script_makes():
    made = make_textures.textures()
    assert set(made) == {path.name for path in make_textures.FOLDER.glob("*.png")}
    for name, image in made.items():
        stored = np.array(mi.Bitmap(str(make_textures.FOLDER / name))).squeeze()
        assert stored.dtype == image.dtype, name
        # Functions such as atan2 may differ in their last bit among machines.
        np.testing.assert_allclose(stored.astype(int), image.astype(int), atol=1, err_msg=name)


def test_catalogue_shows_every_model():
    scene = ElementTree.parse(ROOT / "scenes" / "catalogue.xml").getroot()
    shown = [bsdf.get("type") for bsdf in scene.findall("shape/bsdf")]
    assert sorted(shown) == sorted(model.plugins[0] for model in own_models())


def test_first_light_shows_every_model_of_its_time():
    text = (ROOT / "scenes" / "first_light.xml").read_text()
    assert all(f'<bsdf type="{name}">' in text for name in ("lambert", "phong", "ward", "walter"))


@pytest.mark.usefixtures("llvm_rgb")
def test_legacy_scene_keeps_its_parameters():
    """The camelCase names of Mitsuba 0.6 reach the plugins, as they would under Mitsuba 3's names."""
    params = mi.traverse(mi.load_file(str(ROOT / "scenes" / "legacy_06.xml")))
    values = {
        parameter: params[key][0]
        for parameter in ("alpha_u", "alpha_v", "exponent")
        for key in params.keys()
        if key.endswith(f"{parameter}.value")
    }
    assert values == pytest.approx({"alpha_u": 0.07, "alpha_v": 0.25, "exponent": 80})


@pytest.mark.parametrize("name", [name for model in own_models() for name in model.plugins])
def test_preview(name, variant):
    scene = mi.load_dict(mi_brdfs.preview_scene({"type": name}))
    if not is_scalar():
        picture(scene)


@pytest.mark.usefixtures("llvm_rgb")
def test_preview_takes_a_loaded_bsdf_and_shows_it():
    bright, dark = (
        picture(mi.load_dict(mi_brdfs.preview_scene(mi.load_dict({"type": "lambert", "reflectance": value}))))
        for value in (0.9, 0.1)
    )
    assert bright[16, 16].mean() > 4 * dark[16, 16].mean()
    assert bright[0].mean() == pytest.approx(dark[0].mean(), rel=0.1)
