"""The scenes load everywhere and give a sane picture; what goes with the scenes is up to date."""

import xml.etree.ElementTree as ElementTree
from functools import partial

import make_textures
import mitsuba as mi
import numpy as np
import pytest
from generate import polarization, scenes, shading
from generate.made import ROOT
from generate.scenes import SCENES
from support import small_picture

QUICK = "cornell_box", "legacy_06"


@pytest.mark.parametrize(
    "path", [pytest.param(it, id=it.stem, marks=[] if it.stem in QUICK else pytest.mark.slow) for it in SCENES]
)
def test_scene_files(path, variant):
    small_picture(mi.load_file(str(path)))


def test_scene_files_have_defaults():
    for path in SCENES:
        defaults = {element.get("name") for element in ElementTree.parse(path).getroot().iter("default")}
        assert path.stem == "legacy_06" or {"spp", "width", "height", "max_depth"} <= defaults, path


FEW = [
    *((scenes.LARGE / f"{it.stem}.jpg", partial(scenes.picture, it, spp=4), 16, 0.01) for it in SCENES),
    *((shading.PICTURES / f"{it.stem}.jpg", partial(shading.picture, it, spp=32), 1, 0.02) for it in shading.SCENES),
    (polarization.PICTURE, partial(polarization.picture, polarization.SCENE, spp=16), 1, 0.02),
]
"""Pictures, how they are rendered with few samples, and how much they differ then, averaged over squares."""


@pytest.mark.slow
@pytest.mark.usefixtures("llvm_rgb")
@pytest.mark.parametrize("path, rendered, side, limit", [pytest.param(*it, id=it[0].stem) for it in FEW])
def test_picture_shows_the_scene(path, rendered, side, limit):
    """Rendered anew, it differs by its noise, up to 0.004 on the display's scale from 0 to 1 of squares of 16 pixels,
    and as JPEG has it."""
    stored, now = (np.array(it, np.float64) / 255 for it in (mi.Bitmap(str(path)), rendered()))
    assert stored.shape == now.shape
    difference = abs(squares(stored, side) - squares(now, side)).mean()
    assert difference < limit, f"stale: run python docs/generate {path.stem}"


@pytest.mark.slow
@pytest.mark.usefixtures("llvm_rgb")
def test_the_first_picture_is_what_its_command_renders(monkeypatch):
    """A quarter of the samples does, as they are denoised. Almost nothing in it is black or clipped."""
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    assert f"mi-brdfs render scenes/first_light.xml --spp {scenes.FIRST_LIGHT_SPP} --denoise\n" in readme
    monkeypatch.setattr(scenes, "FIRST_LIGHT_SPP", scenes.FIRST_LIGHT_SPP // 4)
    stored = np.array(mi.Bitmap(str(scenes.FIRST_LIGHT)), np.float64) / 255
    now = np.array(scenes.first_light(), np.float64) / 255
    assert stored.shape == now.shape and abs(squares(stored) - squares(now)).mean() < 0.005
    assert (stored.max(axis=-1) < 0.03).mean() < 0.01 and (stored.min(axis=-1) > 0.99).mean() < 0.01


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
