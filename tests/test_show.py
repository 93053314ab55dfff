"""``mi-brdfs show``, and what ``render`` and ``show`` do with a picture besides."""

import os
import re
import time

import mitsuba as mi
import numpy as np
import pytest
from support import ROOT
from test_cli import invoke as run

from mi_brdfs.rendering.output import denoise

pytestmark = pytest.mark.usefixtures("llvm_rgb")

SCENE = (ROOT / "tests" / "rows" / "scenes" / "balls.xml").read_text()


@pytest.fixture
def folder(tmp_path, monkeypatch):
    (tmp_path / "scene.xml").write_text(SCENE)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def image(file):
    return np.array(mi.Bitmap(str(file)))


@pytest.mark.parametrize(
    "words, name",
    [
        (["ward", "--param", "alpha=.3", "-D", "specular_reflectance=#ff0000", "-Ddiffuse_reflectance=0"], "ward"),
        (["scene.xml:moon", "--stage", "point"], "scene_moon"),
        (["phong:exponent=.5"], "phong_exponent_0_5"),
        (['<!-- <bsdf type="old"/> --><bsdf type="lambert"/>', "--stage", "lamp"], "bsdf"),
    ],
)
def test_it_shows_a_material(folder, words, name):
    done = run("show", *words, "--size", 32, "--spp", 4)
    assert done.exit_code == 0, done.stderr
    assert done.stdout.split() == [f"{name}.exr", f"{name}.png"]
    picture = image(folder / f"{name}.exr")
    assert picture.shape == (32, 32, 3)
    r, g, b = picture[10:18, 12:20].mean(axis=(0, 1))
    assert r > 0.02 and ((r > 50 * g and r > 50 * b) if name == "ward" else abs(r - g) < 0.3 * r)


def test_pixels_that_are_not_finite_are_counted(folder):
    done = run("show", "diffuse:reflectance=nan", "--size", 16, "--spp", 2, "-o", "nan.exr")
    count = np.sum(~np.isfinite(image(folder / "nan.exr")).all(axis=-1))
    assert count and f"{count} pixels have values that are not finite" in done.stderr


PICTURED = """<scene version="3.0.0"><sensor type="perspective"/><integrator type="direct"/>
<shape type="sphere"><bsdf type="diffuse" id="ball"><texture type="bitmap" name="reflectance">
<string name="filename" value="NAME"/></texture></bsdf></shape></scene>"""


@pytest.mark.parametrize("command", ["render", "show"])
def test_a_picture_takes_the_place_of_no_file_of_its_scene(folder, command):
    """By default it has the name of the scene, as the scene's own textures may have."""
    before = mi.Bitmap(np.ones((2, 2, 3), np.float32))
    before.write(str(folder / "photo.exr"))
    (folder / "photo.xml").write_text(PICTURED.replace("NAME", "photo.exr"))
    done = run(command, "photo.xml", "--spp", 1)
    assert done.exit_code == 2 and "photo.exr: the command reads this file; write to another one" in done.stderr
    assert image(folder / "photo.exr").shape == (2, 2, 3) and not (folder / "photo.png").exists()


def test_a_seed_that_would_be_another_is_refused():
    """Passes distinguish 2^32 of them."""
    done = run("show", "ward", "--seed", 1 << 32)
    assert done.exit_code == 2 and "'--seed'" in done.stderr


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="there are no pipes here")
@pytest.mark.parametrize(
    "text", [PICTURED.replace("NAME", "pipe"), '<scene version="3.0.0"><include filename="pipe"/></scene>']
)
def test_a_pipe_is_not_waited_for(folder, text):
    os.mkfifo(folder / "pipe")
    (folder / "waits.xml").write_text(text)
    assert "pipe: it is a pipe or a device; name a file" in run("render", "waits.xml").stderr


def test_a_part_of_the_picture(folder):
    """With as many samples, it is that of the whole, within its noise."""
    words = "render", "scene.xml", "--variant", "llvm_ad_rgb", "--spp", 1024
    run(*words, "-o", "whole.exr")
    done = run(*words, "-o", "part.exr", "--crop", "20,8,16,12")
    assert done.exit_code == 0, done.stderr
    whole, part = image(folder / "whole.exr")[8:20, 20:36], image(folder / "part.exr")
    assert part.shape == (12, 16, 3)
    # 4 % is five times the standard deviation of a pixel of 1024 samples whose own deviation is a quarter of its mean.
    np.testing.assert_allclose(part, whole, rtol=0.04)
    assert whole.std() > 0.1 * whole.mean()


def test_one_of_several_sensors(folder):
    by_id = run("render", "scene.xml", "--sensor", "away", "--spp", 4, "-o", "id.exr")
    by_number = run("render", "scene.xml", "--sensor", "1", "--spp", 4, "-o", "number.exr")
    assert by_id.exit_code == by_number.exit_code == 0, by_id.stderr
    for name in "id", "number":
        np.testing.assert_allclose(image(folder / f"{name}.exr"), np.ones((20, 20, 3)), rtol=1e-5)  # the sky alone


def test_time_ends_it(folder):
    """Samples are taken until then, without a limit; one given still holds."""
    start = time.perf_counter()
    done = run("render", "scene.xml", "--variant", "llvm_ad_rgb", "--time", 1)
    assert done.exit_code == 0 and 1 < time.perf_counter() - start < 60
    spp = int(re.match(r"(\d+) samples per pixel in [\d.]+ s", done.stderr)[1])
    assert spp > 1024
    done = run("render", "scene.xml", "--variant", "llvm_ad_rgb", "--time", 60, "--spp", 8)
    assert done.stderr.startswith("8 samples per pixel")


def test_denoising(folder):
    """Neighbours within a ball differ less, and the picture is as bright; the film's filter, which would spread the
    noise, is replaced."""
    pytest.importorskip("mitsuba_oidn")
    words = "render", "scene.xml", "--variant", "llvm_ad_rgb"
    run(*words, "--spp", 8, "-o", "few.exr")
    done = run(*words, "--spp", 8, "--denoise", "-o", "clean.exr")
    assert done.exit_code == 0, done.stderr
    few, clean = (image(folder / f"{name}.exr")[12:20, 18:26] for name in ("few", "clean"))
    assert np.diff(clean, axis=1).std() < 0.5 * np.diff(few, axis=1).std()
    np.testing.assert_allclose(clean.mean(), few.mean(), rtol=0.03)
    assert run(*words, "--sensor", "away", "--denoise", "--spp", 4).exit_code == 0
    assert run("show", "lambert", "--size", 32, "--denoise").stderr.startswith("32 samples per pixel")


def test_denoised_edges_have_no_lines():
    """Of pictures whose sides are no multiples of what the denoiser works in."""
    pytest.importorskip("mitsuba_oidn")
    noise = np.random.default_rng(1).normal(1, 0.02, (45, 90, 3)).astype(np.float32)
    clean = denoise(mi.Bitmap(noise)).mean(axis=2)
    assert clean.shape == (45, 90)
    np.testing.assert_array_equal(denoise(np.asfortranarray(noise)), denoise(noise))
    with pytest.raises(ValueError, match=r"shape \(height, width, 3 or 1\), not \(45, 90\)"):
        denoise(noise[..., 0])
    with pytest.raises(ValueError, match=r"not \(0, 90, 3\)"):
        denoise(noise[:0])
    with pytest.raises(ValueError, match="linear colours as floats, not uint8"):
        denoise(np.uint8(255 * noise))
    np.testing.assert_allclose([clean[-1].mean(), clean[:, -1].mean()], 1, atol=0.005)
    noise[20, 30], noise[25, 60, 0] = np.inf, np.nan
    found = denoise(noise)
    np.testing.assert_array_equal(np.isfinite(found), np.isfinite(noise))  # to be told of, as without
    assert np.nanmedian(found) == pytest.approx(1, abs=0.005)
