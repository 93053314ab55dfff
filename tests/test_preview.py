"""The preview scene: it shows any material in every variant and on every stage, and the body is what it should be."""

import mitsuba as mi
import numpy as np
import pytest
from support import direction, small_picture

import mi_brdfs
from mi_brdfs.preview import STAGES
from mi_brdfs.preview.body import AZIMUTH, CENTRE, LENGTH, RADIUS, TILT
from mi_brdfs.preview.studio import environment

GOLD = {"type": "walter", "material": "Au", "alpha": 0.1}


@pytest.mark.usefixtures("llvm_rgb")
def test_preview_takes_a_loaded_bsdf_and_shows_it():
    bright, dark = (
        small_picture(mi.load_dict(mi_brdfs.preview_scene(mi.load_dict({"type": "lambert", "reflectance": value}))))
        for value in (0.9, 0.1)
    )
    assert bright[16, 16].mean() > 4 * dark[16, 16].mean()
    assert bright[0].mean() == pytest.approx(dark[0].mean(), rel=0.1)


@pytest.mark.parametrize("stage", STAGES)
def test_every_stage(stage, variant):
    scene = mi_brdfs.preview_scene({"type": "phong"}, stage)
    scene["sensor"]["film"] |= {"width": 24, "height": 24}
    image = np.array(mi.render(mi.load_dict(scene), spp=4))
    assert np.isfinite(image).all() and image.max() > 0.3


@pytest.mark.usefixtures("llvm_rgb")
def test_words_are_shown_and_what_is_no_bsdf_is_refused():
    name = "ngan/ward/blue-acrylic"
    by_word, by_dict = (small_picture(mi.load_dict(mi_brdfs.preview_scene(it))) for it in (name, mi_brdfs.preset(name)))
    np.testing.assert_allclose(by_word, by_dict, rtol=1e-4)
    with mi.variant_context("scalar_rgb"):
        other = mi.load_dict({"type": "ward"})
    for given, sentence in [
        *((it, "is no BSDF; give a dict") for it in ({}, None, 5, {"type": 5})),
        *((it, "is not a BSDF of llvm_ad_rgb") for it in (other, {"type": "sphere"})),
        ("wrad", 'no plugin "wrad"; did you mean "ward"'),
    ]:
        with pytest.raises(ValueError, match=sentence):
            mi_brdfs.preview_scene(given)
    with pytest.raises(ValueError, match="no stage 'stduio'; there are studio, lamp or point"):
        mi_brdfs.preview_scene({"type": "phong"}, "stduio")


@pytest.mark.usefixtures("llvm_rgb")
def test_gold_looks_like_gold_and_no_picture_is_blown_out():
    """Orange yellow, light and dark, in a picture that is nowhere much brighter than white paper."""
    image = small_picture(mi.load_dict(mi_brdfs.preview_scene(GOLD)), 64)
    ball = image[16:40, 20:44].reshape(-1, 3)
    red, green, blue = ball.mean(axis=0)
    assert 0.7 < green / red < 0.85 and blue / red < 0.4
    assert np.quantile(ball[:, 0], 0.95) > 6 * np.quantile(ball[:, 0], 0.05)
    white = small_picture(mi.load_dict(mi_brdfs.preview_scene({"type": "lambert", "reflectance": 1.0})), 64)
    assert 0.8 < np.quantile(white, 0.99) < 1.4


def test_the_studio_is_the_same_every_time():
    once = environment()
    environment.cache_clear()
    np.testing.assert_array_equal(environment(), once)
    assert once.shape == (256, 512, 3) and once.dtype == np.float32 and once.min() > 0.05 and once.max() < 5


@pytest.mark.usefixtures("llvm_rgb")
def test_the_body_is_a_ball_and_a_ribbon():
    """Normals agree with the triangles; u runs around the leaning axis, and from left to right."""
    params = mi.traverse(mi_brdfs.preview_scene({"type": "lambert"})["body"])
    positions, normals = (np.array(params[f"vertex_{name}"]).reshape(-1, 3) for name in ("positions", "normals"))
    faces, u = np.array(params["faces"]).reshape(-1, 3), np.array(params["vertex_texcoords"]).reshape(-1, 2)[:, 0]
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1, atol=1e-5)
    corners = positions[faces]
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    own, area = normals[faces].mean(axis=1), np.linalg.norm(across, axis=1)
    cosine = (across * own).sum(axis=1) / area.clip(1e-12) / np.linalg.norm(own, axis=1)
    assert cosine[area > 1e-6].min() > 0.999

    ball = np.isclose(np.linalg.norm(positions - [0, 0, CENTRE], axis=1), RADIUS, atol=1e-5)
    axis = direction(np.degrees(TILT), np.degrees(AZIMUTH))
    level = abs(normals @ axis) < 0.01
    before = np.cross(axis, normals[ball & level & (abs(u - 0.5) < 0.01)].mean(axis=0))
    later = normals[ball & level & (u > 0.5) & (u < 0.6)].mean(axis=0)
    assert before @ later > 0.2
    ribbon, x = positions[~ball], positions[~ball, 0]
    np.testing.assert_allclose(x, LENGTH * (u[~ball] - 0.5), atol=1e-5)
    assert ribbon[:, 2].min() > 0 and (normals[~ball, 1] < 0).all()  # above the floor, towards the camera
