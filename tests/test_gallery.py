"""The gallery: its sweeps, what it writes, and the pictures in the documentation."""

import errno
import os
import re
from pathlib import Path

import mitsuba as mi
import numpy as np
import pytest
from generate import models as docs
from PIL import Image
from support import is_scalar
from test_cli import invoke
from test_explore_page import browser as browser

import mi_brdfs
from mi_brdfs.gallery import Entry, Row, Shot, gallery, sheet, shot
from mi_brdfs.gallery.contents import Sweep, by_family, portrait, stage_of, sweeps_of, year
from mi_brdfs.lobes import LambertLobe
from mi_brdfs.mitsuba.registry import find_model, own_models
from mi_brdfs.model import FAMILIES, Model
from mi_brdfs.models.lambert import Lambert
from mi_brdfs.parameters import Choice, Number, Reflectance
from mi_brdfs.rendering.output import display_image
from mi_brdfs.rendering.passes import render

NAMES = [model.plugins[0] for model in own_models()]

# --- Sweeps and sheets ----------------------------------------------------------------------------------------------


@pytest.mark.usefixtures("llvm_rgb")
def test_every_model_has_a_portrait_and_sweeps():
    """Those in the table, or what its declarations make; and all of them load."""
    for model in own_models():
        sweeps = sweeps_of(model)
        parameters = [sweep.parameter for sweep in sweeps]
        assert parameters and len(set(parameters)) == len(parameters), model
        assert all(2 <= len(set(sweep.values)) == len(sweep.values) <= 5 for sweep in sweeps), model
        for bsdf in [portrait(model), *(bsdf for sweep in sweeps for bsdf in sweep.bsdfs(model.plugins[0]))]:
            mi.load_dict(bsdf)
    swept = {sweep.parameter: sweep.heading() for model in own_models() for sweep in sweeps_of(model)}
    assert swept["rotation"].startswith("rotation in turns of 360°, with alpha_u = 0.05")
    assert Sweep("rotation", (0.0, 0.0625), {}).captions() == ["0 (0°)", "0.0625 (22.5°)"]
    assert swept["film_thickness"].startswith("film_thickness in nm")


def test_braces_at_the_end_of_a_docstring_need_be_no_example():
    class Sawtooth(Model):
        """Sawtooth.

        {x} is the fractional part of x.
        """

    assert Sawtooth.example() == {"type": "sawtooth"}
    Sawtooth.__doc__ = "Sawtooth.\n\n{\n 'type': 'sawtooth', 'x': 2}"
    assert Sawtooth.example() == {"type": "sawtooth", "x": 2}


@pytest.mark.usefixtures("llvm_rgb", "as_before")
def test_sweeps_of_others_models_come_from_their_declarations():
    """With what else the example on the manual page gives, and without what excludes the parameter."""

    class Brushed(Model):
        """Brushed.

        {"type": "brushed", "alpha_u": 0.1, "alpha_v": 0.3, "tint": 0.9}
        """

        tint = Reflectance(0.5, "colour")
        alpha = Number(0.1, (0, 1), "roughness", anisotropic=True)
        exponent = Number(9, (0, 1e6), "exponent")
        width = Number(2, (0.001, 2), "width")
        mood = Choice(("dull", "bright"), "mood")

        def lobes(self, p):
            return (LambertLobe(p.tint),)

    mi_brdfs.register(Brushed)
    given = {"alpha_u": 0.1, "alpha_v": 0.3, "tint": 0.9}
    assert sweeps_of(Brushed) == [
        Sweep("alpha", (0, 0.25, 0.5, 0.75, 1), {"tint": 0.9}),
        Sweep("exponent", (1, 3, 9, 30, 80), given),
        Sweep("width", (0.2, 0.7, 2.0), given),
        Sweep("mood", ("dull", "bright"), given),
    ]
    for sweep in sweeps_of(Brushed):
        for bsdf in sweep.bsdfs("brushed"):
            mi.load_dict(bsdf)


def test_models_are_shown_by_family_and_year():
    """Families of others come after the pack's, and models without one last."""

    class Plain(Lambert):
        """Plain (1900)."""

        family = ""

    class Woven(Lambert):
        """Woven (1800)."""

        family = "cloth"

    ordered = by_family([Plain, Woven, *own_models()])
    assert ordered[-2:] == [Woven, Plain]
    assert all(model.family in FAMILIES for model in own_models())
    families = [model.family for model in ordered[:-2]]
    assert list(dict.fromkeys(families)) == list(FAMILIES)
    assert families == sorted(families, key=FAMILIES.index)
    for family in FAMILIES:
        years = [year(model) for model in ordered if model.family == family]
        assert years == sorted(years)


def test_labels_cover_no_picture_and_are_not_cut():
    red = Image.new("RGB", (20, 20), (255, 0, 0))
    rows = [
        Row({0: "a heading that is much wider than the picture below it"}, [red], ["1"]),
        Row({1: "of the second"}, [red, red], ["smith-correlated", "2\nsecond"]),
    ]
    image = np.array(sheet(rows))
    assert (image == (255, 0, 0)).all(axis=-1).sum() == 3 * 20 * 20
    ink = (image > 128).all(axis=-1)
    assert ink.sum() > 200
    assert not any(edge.any() for edge in (ink[:4], ink[-4:], ink[:, :4], ink[:, -4:]))
    bare = np.array(sheet([Row({}, [red, red], ["specular-maroon-phenolic", "specular-orange-phenolic"])]))
    blank = np.flatnonzero(~(bare[30:] > 128).any(axis=(0, 2)))
    widest = max(map(len, np.split(blank, np.flatnonzero(np.diff(blank) > 1) + 1)[1:-1]))
    assert widest >= 12  # several times the space between letters


def test_profiles_are_below_their_pictures_on_one_scale():
    red = Image.new("RGB", (90, 90), (255, 0, 0))
    flat, step = np.full(90, 0.5), np.repeat([0.0, 1.0], 45)
    image = np.array(sheet([Row({}, [red, red], ["", ""], [flat, step])]).convert("L"), float)
    panels = [image[98:128, start : start + 90] for start in (8, 106)]
    heights = [np.argmax(panel, axis=0) for panel in panels]
    assert abs(heights[0] - 15).max() < 3  # half of the largest
    assert heights[1][:40].min() > 26 and heights[1][50:].max() < 4
    assert (panels[1][13:17, 5:40].max(axis=0) > 50).all()  # the first one


# --- What is rendered and written -----------------------------------------------------------------------------------


def blocks(image) -> np.ndarray:
    """The means of 8 x 8 pixels, from 0 to 1 on the scale of the display."""
    values = np.array(image, np.float64) / 255
    height, width = (size - size % 8 for size in values.shape[:2])
    return values[:height, :width].reshape(height // 8, 8, width // 8, 8, 3).mean(axis=(1, 3))


@pytest.mark.usefixtures("llvm_rgb")
def test_a_picture_shows_the_preview_scene():
    """Denoising, and the sampler that is quieter, leave it as it is."""
    scene = mi_brdfs.preview_scene({"type": "ward"})
    scene["sensor"]["film"] |= {"width": 48, "height": 48}
    expected = display_image(render(mi.load_dict(scene), 256).bitmap)
    made = shot({"type": "ward"}, size=48, spp=64).picture
    assert made.size == (48, 48)
    np.testing.assert_allclose(blocks(made), blocks(expected), atol=0.03)


def test_pictures_in_every_variant(variant):
    picture, profile = shot({"type": "ward"}, size=16, spp=4 if is_scalar() else 16)
    made = np.array(picture)
    assert made.shape == (16, 16, 3) and 40 < made.mean() < 160
    assert profile.shape == (16,) and 0 < profile.min() < profile.max() < 3


@pytest.mark.usefixtures("llvm_rgb")
def test_a_profile_tells_limb_and_terminator():
    """Lambert's falls from the light to the terminator, where it ends; beyond is the ball's own shadow."""
    profile = shot({"type": "lambert", "reflectance": 0.6}, "point", 96, 16).profile
    left, right = 13, 82  # the ball's limbs
    assert np.argmax(profile[left:right]) < 15
    assert (np.diff(profile[left + 15 : right - 20]) < 0).all() and profile[right - 5] < 0.05 * profile.max()


@pytest.fixture
def grey(monkeypatch):
    """Grey squares in place of pictures."""

    def square(bsdf, stage, size, spp):
        return Shot(Image.new("RGB", (size, size)), np.ones(size))

    monkeypatch.setattr("mi_brdfs.gallery.shot", square)


@pytest.mark.usefixtures("grey", "llvm_rgb")
def test_what_is_finished_is_kept(tmp_path, monkeypatch):
    """Ctrl-C comes with the eighth picture."""

    def press_ctrl_c(type, done, total):
        reported.append((type, done, total))
        if done == 8:
            raise KeyboardInterrupt

    def pressed(types, folder, spp, size, advance, presets):
        return gallery(types, folder, spp, size, lambda *it: (advance(*it), press_ctrl_c(*it)), presets)

    reported = []
    monkeypatch.setattr("mi_brdfs.gallery.gallery", pressed)
    done = invoke("gallery", "lambert", "eon", "wrap", "--size", 16, "-o", "made/here", cwd=tmp_path)
    assert (done.exit_code, done.stdout) == (130, f"{Path('made', 'here', 'index.html')}\n"), done.output
    assert done.stderr == "lambert is finished; 6 of 23 pictures.\nInterrupted; it has 8 of 23 pictures.\n"
    assert reported == [*(("lambert", k, 23) for k in range(1, 7)), ("wrap", 7, 23), ("wrap", 8, 23)]
    files = {path.name: path for path in (tmp_path / "made" / "here").iterdir()}
    assert set(files) == {"index.html", "overview.png", "lambert.png", "wrap.png"}
    text = files["index.html"].read_text()
    assert 'alt="wrap: wrap, with reflectance = (0.6, 0.35, 0.2): 0"' in text and 'id="eon"' not in text


@pytest.mark.usefixtures("grey")
def test_a_wall_of_presets(tmp_path, monkeypatch):
    """Under the names of their sets, half as large; as far as it goes."""
    names = [*mi_brdfs.presets("ward")[:10], "ngan/ward-duer/chrome", "ngan/ward-duer/nickel"]
    monkeypatch.setattr("mi_brdfs.gallery.presets", lambda type: names)

    def press_ctrl_c(type, done, total):
        assert total == 6 + len(names)
        if done == total - 1:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        gallery(["lambert"], tmp_path, 1, 64, press_ctrl_c, with_presets=True)
    text = (tmp_path / "index.html").read_text()
    assert f'src="lambert_presets.jpg" alt="{", ".join(names[:-1])}"' in text
    entry = Entry(find_model("lambert"), with_presets=True)
    entry.shots = [Shot(Image.new("RGB", (32, 32)), np.ones(32))] * (6 + len(names) - 1)
    rows = entry.wall()
    assert [row.headings for row in rows] == [{0: "ngan/ward"}, {}, {0: "ngan/ward-duer"}]
    assert [caption for row in rows for caption in row.captions] == [name.rpartition("/")[2] for name in names[:-1]]
    width, height = mi.Bitmap(str(tmp_path / "lambert_presets.jpg")).size()
    assert width > 8 * 32 and height > 3 * 32
    assert mi.Bitmap(str(tmp_path / "lambert.png")).size()[0] == width


@pytest.mark.usefixtures("llvm_rgb", "grey")
def test_the_command_writes_a_page_and_its_pictures(folder):
    done = invoke("gallery", "eon", "lambert", "--size", 16, "--spp", 1, "-o", "pictures")
    assert (done.exit_code, done.stdout) == (0, f"{Path('pictures', 'index.html')}\n"), done.stderr
    told = r"lambert is finished; 6 of 12 pictures\.\n12 pictures in \d+ s, \w+_rgb\.\n"
    assert re.fullmatch(told, done.stderr)
    folder = folder / "pictures"
    assert sorted(path.name for path in folder.iterdir()) == ["eon.png", "index.html", "lambert.png", "overview.png"]

    text = (folder / "index.html").read_text(encoding="utf-8")
    assert 'alt="eon: roughness, with reflectance = (0.6, 0.35, 0.2): 0, 0.25, 0.5, 0.75, 1"' in text
    links = set(re.findall(r'(?:src|href)="([^"]+)"', text))
    assert links == {"overview.png", "eon.png", "lambert.png", "#eon", "#lambert"}
    assert all(f'id="{link[1:]}"' in text for link in links if link.startswith("#"))
    for name in "eon", "lambert":
        width, height = mi.Bitmap(str(folder / f"{name}.png")).size()
        assert width > 5 * 16 and height > 2 * 16
    assert "<nav>" in text and 'class="sheet" href="overview.png"' in text
    invoke("gallery", "eon", "--size", 16, "--spp", 1, "-o", "one")
    text = Path("one", "index.html").read_text(encoding="utf-8")
    assert "<nav" not in text and "overview.png" not in text


@pytest.mark.slow
@pytest.mark.usefixtures("llvm_rgb", "grey")
def test_on_a_phone_labels_are_legible_and_sheets_scroll(folder, browser, monkeypatch):
    monkeypatch.setattr("mi_brdfs.gallery.presets", lambda type: mi_brdfs.presets("ward")[:10])
    gallery(["lambert"], with_presets=True)
    tab = browser.new_page(viewport={"width": 390, "height": 3000})  # all is seen, so that it is loaded
    tab.goto((folder / "gallery" / "index.html").as_uri())
    tab.wait_for_function("[...document.images].every(it => it.naturalWidth)")
    scales = tab.eval_on_selector_all(
        ".sheet img", "all => all.map(it => (it.clientWidth - parseFloat(getComputedStyle(it).paddingRight))"
        " / it.naturalWidth)"
    )  # fmt: skip
    assert np.all(np.array(scales) * (256 // 11, 128 // 11) > (11, 8.5))  # pixels, of the letters
    assert tab.evaluate("document.documentElement.scrollWidth") == 390
    assert all(tab.eval_on_selector_all(".sheet", "all => all.map(it => it.scrollWidth > it.clientWidth)"))
    tab.close()


def test_a_folder_that_cannot_be_written_to_is_told_of_before_rendering(folder, monkeypatch):
    def refused(dir):
        raise OSError(errno.EROFS, os.strerror(errno.EROFS))

    monkeypatch.setattr("mi_brdfs.gallery.TemporaryFile", refused)
    monkeypatch.setattr("mi_brdfs.gallery.shot", lambda *_: pytest.fail("it renders"))
    done = invoke("gallery", "ward", "-o", "made")
    assert done.exit_code == 1
    assert done.stderr == "mi-brdfs: cannot write to the folder made: Read-only file system\n"


def test_a_picture_without_pixels_or_samples_is_refused():
    with pytest.raises(ValueError, match="needs spp >= 1 and size >= 16, not 16 and 0"):
        gallery("ward", size=0)  # one name is no list of letters


# --- The pictures in the documentation ------------------------------------------------------------------------------

STALE = "looks different; if that is meant, run python docs/generate"


def difference(name: str, **changes) -> float:
    """How far a material is from a thumbnail: the mean square of the difference, over what the noise makes of it as
    two renderings with other seeds and a quarter of the samples tell. About 1 if the thumbnail shows the material."""
    committed = blocks(Image.open(docs.THUMBNAILS / f"{name}.png"))
    model = find_model(name)
    bsdf, stage = portrait(model) | changes, stage_of(model)
    first, second = (blocks(shot(bsdf, stage, docs.SIZE, docs.SAMPLES // 4, seed).picture) for seed in (1, 2))
    variance = np.square(first - second).mean() / 2
    return np.square((first + second) / 2 - committed).mean() / (0.75 * variance)


@pytest.mark.usefixtures("llvm_rgb")
def test_a_thumbnail_shows_its_model():
    """And would not show it if its diffuse lobe were darker. Of the other models, the strips tell."""
    assert difference("ward") < 4, f"ward {STALE} ward"
    assert difference("ward", diffuse_reflectance=0.03) > 8


@pytest.mark.slow
@pytest.mark.usefixtures("llvm_rgb")
@pytest.mark.parametrize("model", own_models(), ids=lambda model: model.plugins[0])
def test_strips_show_the_main_sweeps(model, monkeypatch):
    """From the first picture to the last. Noise is .003 to .007; of a specular lobe a fifth too dark, Phong's strip is
    off by .011."""
    name, size = model.plugins[0], docs.STRIP_SIZE
    committed, (first, *_, last) = Image.open(docs.STRIPS / f"{name}.jpg"), docs.main_sweep(model).bsdfs(name)
    blank = Shot(Image.new("RGB", (size, size), (255, 0, 255)), np.ones(size))
    monkeypatch.setattr(docs, "shot", lambda *_: blank)
    layout = docs.strip(model)
    at = (np.array(layout) == (255, 0, 255)).all(axis=-1)
    top, columns = at.any(axis=1).argmax(), np.flatnonzero(at.any(axis=0))
    assert layout.size == committed.size
    for bsdf, left in (first, columns[0]), (last, columns[-1] + 1 - size):
        now = blocks(shot(bsdf, stage_of(model), size, 4).picture)
        off = now - blocks(committed.crop((left, top, left + size, top + size)))
        assert np.sqrt(np.square(off).mean()) < 0.01, f"{STALE} {name}"


def test_pictures_are_small_and_one_of_each_model():
    assert len({path.read_bytes() for path in docs.THUMBNAILS.glob("*.png")}) == len(NAMES)
    for folder, suffix in (docs.THUMBNAILS, ".png"), (docs.LARGE, ".jpg"), (docs.STRIPS, ".jpg"):
        sizes = {path.stem: path.stat().st_size for path in folder.iterdir() if path.suffix == suffix}
        assert set(sizes) == set(NAMES) and max(sizes.values()) < 80_000
    assert docs.GALLERY.stat().st_size < 300_000
