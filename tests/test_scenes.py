"""The scenes and the preview load everywhere and give a sane picture."""

import mitsuba as mi
import numpy as np
import pytest
from support import is_scalar

import mi_brdfs


def picture(scene, size=32, spp=16):
    """A small rendering of a scene, free of NaN, infinite and negative pixels, and neither black nor blown out."""
    params = mi.traverse(scene)
    params[next(key for key in params.keys() if key.endswith("film.size"))] = [size, size]
    params.update()
    image = np.array(mi.render(scene, spp=1 if is_scalar() else spp))
    assert np.isfinite(image).all() and (image >= 0).all()
    assert 0.02 < np.median(image) < 0.9
    assert (image > 2).mean() < 0.1
    return image


@pytest.mark.parametrize("name", ["first_light", "legacy_06"])
def test_scene_files(name, variant, pytestconfig):
    picture(mi.load_file(str(pytestconfig.rootpath / "scenes" / f"{name}.xml")))


@pytest.mark.usefixtures("llvm_rgb")
def test_first_light_shows_every_model_of_its_time(pytestconfig):
    text = (pytestconfig.rootpath / "scenes" / "first_light.xml").read_text()
    assert all(f'<bsdf type="{name}">' in text for name in ("lambert", "phong", "ward", "walter"))


@pytest.mark.usefixtures("llvm_rgb")
def test_legacy_scene_keeps_its_parameters(pytestconfig):
    """The camelCase names of Mitsuba 0.6 reach the plugins, as they would under Mitsuba 3's names."""
    params = mi.traverse(mi.load_file(str(pytestconfig.rootpath / "scenes" / "legacy_06.xml")))
    values = {
        parameter: params[key][0]
        for parameter in ("alpha_u", "alpha_v", "exponent")
        for key in params.keys()
        if key.endswith(f"{parameter}.value")
    }
    assert values == pytest.approx({"alpha_u": 0.07, "alpha_v": 0.25, "exponent": 80})


@pytest.mark.parametrize("name", mi_brdfs.list_models())
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
    np.testing.assert_allclose(bright[0], dark[0], rtol=0.3)
