"""The explorer without a browser: what a page sends, and what it gets."""

import base64
import gc
import gzip
import json
import os
import re
import shutil
import subprocess
from contextlib import suppress

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest
from explorer_page import edited
from support import LOFT as FILE
from support import ROOT

from mi_brdfs.explorer.export import CLIENT, page
from mi_brdfs.explorer.materials import BUILT_IN, Materials, kinds
from mi_brdfs.explorer.session import Session
from mi_brdfs.explorer.stages import Pose, Progress, Setting, Stages, UserScene, rgba
from mi_brdfs.explorer.state import StateError, checked, parse
from mi_brdfs.explorer.tours import parse as parse_tour
from mi_brdfs.explorer.tours import tours
from mi_brdfs.mitsuba.registry import find_model
from mi_brdfs.probe.sources import BSDFSource, find_sources
from mi_brdfs.rendering.scene_file import SceneFile, with_material

STAGES = ["studio", "lamp", "point"]
LOFT = str(FILE)


class Client:
    """A page in this thread: its states are worked off at once."""

    def __init__(self, user=None, sources=()):
        self.scenes, self.frames, self.unread = Stages(user or UserScene()), [], []
        self.scenes.denoise = None
        materials = Materials({it.word: it for it in sources})
        self.session = Session(materials, self.scenes, self.frames.append, self.unread.__len__)
        self.serial = 0

    def send(self, bsdf, *others, **members):
        self.serial += 1
        state = {"subjects": [{"bsdf": it} for it in (bsdf, *others)], **members}
        self.session.show(parse(state, self.scenes.names, self.scenes.shapes), self.serial)

    def work(self, steps=400):
        """What came, by type or view: header, payload."""
        self.frames.clear()
        self.session._edited = 0  # there is no other edit to wait for
        for _ in range(steps):
            if not self.session.step():
                break
        return [opened(frame) for frame in self.frames]

    def show(self, bsdf, *others, refine=False, **members):
        self.send(bsdf, *others, **members)
        self.unread[:] = [] if refine else [None] * 99
        found = self.work()
        assert not [it for it in found if it["type"] == "error"], found
        return found


def opened(frame):
    if isinstance(frame, str):
        return json.loads(frame)
    end = 4 + int.from_bytes(frame[:4], "little")
    assert end % 4 == 0
    return {**json.loads(frame[4:end]), "payload": frame[end:]}


def of(found, name, subject=0):
    return [it for it in found if it.get("view", it["type"]) == name and it.get("subject", subject) == subject]


@pytest.fixture
def client(llvm_rgb):
    return Client()


# --- States -----------------------------------------------------------------------------------------------------------


WARD = {"bsdf": {"type": "ward"}}
NO_STATES = [
    ([], "The state of a page is an object"),
    *(({"subjects": it}, "one to 6 materials") for it in (None, [], [WARD] * 7)),
    ({"subjects": [3]}, "A material is an object"),
    ({"subjects": [{"bsdf": {"alpha": 1}}]}, "needs a bsdf with a type"),
    ({"subjects": [{"bsdf": {"type": "tabulated", "filename": "/etc/passwd"}}]}, "filename cannot be a parameter"),
    ({"subjects": [{"bsdf": {"type": "ward", "x" * 99: 1}}]}, "cannot be a parameter"),
    *(({"subjects": [{"bsdf": {"type": "ward", "alpha": it}}]}, "alpha must be a number")
      for it in ({"type": "bitmap"}, float("nan"), 1e39, 10**400)),
    ({"subjects": [WARD], "theta": "steep"}, "theta is a number"),
    ({"subjects": [WARD], "stage": "moon"}, "stage = 'moon' is unknown"),
    ({"subjects": [WARD], "axis": ["phi"]}, "axis is unknown; it is theta_o"),
    ({"subjects": [WARD], "views": ["xray"]}, "views are picture"),
    ({"subjects": [WARD], "stage": {}}, "stage is unknown"),
]  # fmt: skip


def test_a_state_that_is_none_is_refused_in_a_sentence():
    """But numbers beyond their range are brought into it."""
    for state, sentence in NO_STATES:
        with pytest.raises(StateError, match=re.escape(sentence)):
            parse(state, STAGES)
    state = parse({"subjects": [WARD], "theta": 200, "size": 1e9}, STAGES)
    assert (state.theta, state.size) == (89, 1024)


def test_no_type_or_word_of_a_page_reads_a_file(llvm_rgb):
    for bsdf in (
        {"type": "tabulated", "file": "/etc/passwd"},
        {"type": "given", "file": LOFT},
        {"type": "measured"},
        {"type": "../ward"},
        {"type": "twosided"},
    ):
        with pytest.raises(StateError):
            Materials().expanded(checked(bsdf))
    with (
        pytest.raises(StateError, match="is unknown"),
        Materials().loaded(checked({"type": "walter", "material": "../../../etc/passwd"})),
    ):
        pass


# --- Subjects ---------------------------------------------------------------------------------------------------------


def test_every_plugin_opens_with_its_controls(client):
    """Of the kinds that the page can make."""
    for name in [it["name"] for it in kinds()]:
        (told,) = of(client.show({"type": name}, views=[]), "subject")
        assert told["error"] is None and told["controls"] and told["xml"].startswith("<bsdf"), name
        assert {it["kind"] for it in told["controls"]} <= {"number", "colour", "choice", "flag", "text"}


@pytest.mark.slow
def test_built_ins_are_drawn(client):
    for name in BUILT_IN:
        found = client.show({"type": name}, views=["polar", "sampler"])
        assert of(found, "polar") and of(found, "sampler"), name


def test_controls_have_the_declared_ranges(client):
    controls = {
        it["name"]: it for it in of(client.show({"type": "ward", "alpha": 0.3}, views=[]), "subject")[0]["controls"]
    }
    assert controls["alpha"]["value"] == 0.3 and controls["alpha"]["scale"] == "log"
    assert controls["alpha_u"]["value"] is None and controls["alpha_u"]["excludes"] == ["alpha"]
    assert controls["alpha_u"]["also"] == {"alpha_v": 0.3}
    assert "duer" in " ".join(controls["variant"]["words"])
    assert controls["diffuse_reflectance"]["kind"] == "colour" and controls["diffuse_reflectance"]["high"] == 1


@pytest.mark.parametrize(
    ("bsdf", "changes"),
    [
        ({"type": "ward", "alpha": 0.2}, {"alpha": 0.4, "variant": "ward-duer", "diffuse_reflectance": [0.5, 0.1, 0]}),
        pytest.param({"type": "roughdiffuse", "alpha": 0.8}, {"use_fast_approx": True}, marks=pytest.mark.slow),
        pytest.param({"type": "roughplastic"}, {"eta": 2.0}, marks=pytest.mark.slow),
    ],
)
def test_each_kind_of_control_changes_picture_and_curves(client, bsdf, changes):
    before, serial = client.show(bsdf, views=["picture", "polar"], size=64), 1
    for name, value in changes.items():
        bsdf, serial = bsdf | {name: value}, serial + 1
        found = client.show(bsdf, views=["picture", "polar"], size=64)
        assert of(before, "picture")[0]["payload"] != of(found, "picture")[0]["payload"], name
        assert of(before, "polar")[0]["curves"][0]["y"] != of(found, "polar")[0]["curves"][0]["y"], name
        assert of(found, "polar")[0]["serial"] == serial
        before = found


def test_an_error_is_the_plugins_sentence_and_the_others_live_on(client):
    found = client.show({"type": "ward", "alpha": -1}, {"type": "lambert"}, views=["polar"])
    assert "ward: alpha = -1 is not allowed" in of(found, "subject")[0]["error"]
    assert not of(found, "polar") and of(found, "polar", 1)
    assert of(client.show({"type": "ward", "alpha": 0.1}, {"type": "lambert"}, views=["polar"]), "polar")
    (told,) = of(client.show({"type": "ward", "variant": [1, 1, 1]}, views=[]), "subject")
    assert told["error"].startswith("ward: variant ")


def test_lobes_are_added_and_removed(client):
    """A new one is like the last, and the others stay."""
    for name, value in ("kurt", {"alpha": 0.3}), ("lafortune", {"exponent": 9.0}):
        materials, bsdf = Materials(), {"type": name, **value}
        for count in (1, 2, 3, 2, 1):
            bsdf = materials.expanded({**bsdf, "lobes": str(count)})
            assert "lobes" not in bsdf
            with materials.loaded(bsdf) as loaded:
                assert loaded.component_count() == count + 1  # and the diffuse one
        assert value.items() <= bsdf.items()
    given = {"type": "lafortune", "cz_1": 0.5, "cz_2": 0.9, "exponent_2": 20.0, "lobes": "3"}
    assert materials.expanded(given) == {
        "type": "lafortune", "cx_1": -1, "cx_2": -1, "cx_3": -1, "cy_1": -1, "cy_2": -1, "cy_3": -1,
        "cz_1": 0.5, "cz_2": 0.9, "cz_3": 0.9,
        "exponent_1": 30, "exponent_2": 20, "exponent_3": 20,
        "specular_reflectance_1": 0.2, "specular_reflectance_2": 0.2, "specular_reflectance_3": 0.2,
    }  # fmt: skip


def test_a_preset_is_its_plugin_with_its_values(client):
    (told,) = of(client.show({"type": "preset", "name": "ngan/ward/blue-acrylic"}, views=[]), "subject")
    assert told["bsdf"]["type"] == "ward" and told["bsdf"]["alpha"] > 0
    beside = {"type": "preset", "name": "ngan/ward/blue-acrylic", "alpha": 0.7, "lobes": "1"}
    assert Materials().expanded(beside) == {**told["bsdf"], "alpha": 0.7}


def test_the_copied_xml_and_dict_give_the_same_picture(client):
    bsdf = {"type": "ward", "alpha_u": 0.1, "alpha_v": 0.3, "specular_reflectance": [0.9, 0.5, 0.2]}
    bsdf["variant"] = "ward-duer"
    found = client.show(bsdf, views=["picture", "polar"], size=64)
    told, picture = of(found, "subject")[0], of(found, "picture")[0]
    stage = client.session._pictures[0][1].stage
    for again in (mi.load_string(told["xml"].replace(">", ' version="3.0.0">', 1)), mi.load_dict(eval(told["dict"]))):
        progress = Progress(stage)
        progress.advance(again)
        assert rgba(progress.pixels(), 0) == picture["payload"]
    assert told["command"].startswith("mi-brdfs show ward -D alpha_u=0.1")


# --- Work -------------------------------------------------------------------------------------------------------------


def test_only_the_last_of_many_edits_is_drawn(client):
    client.show({"type": "ward", "alpha": 0.5}, views=["polar"])
    for k in range(100):
        client.send({"type": "ward", "alpha": 0.1 + 0.001 * k}, views=["polar"])
    found = client.work()
    assert [it["serial"] for it in of(found, "polar")] == [101]


def test_what_did_not_change_is_not_drawn_again(client):
    client.show({"type": "ward"}, {"type": "lambert"}, views=["polar", "albedo"])
    assert not of(client.show({"type": "ward"}, {"type": "lambert"}, views=["polar", "albedo"], wipe=0.7), "polar")
    found = client.show({"type": "ward"}, {"type": "lambert"}, views=["polar", "albedo"], theta=60)
    assert of(found, "polar") and of(found, "polar", 1) and not of(found, "albedo")


@pytest.fixture
def same_bsdfs():
    """BSDFs of other tests that nobody holds go before a test, and not during it: kernels are for all that live."""
    gc.collect()
    gc.disable()
    yield
    gc.enable()


@pytest.mark.usefixtures("same_bsdfs")
def test_no_kernel_is_compiled_where_a_value_changes(client):
    views = ["picture", "lobe", "polar", "albedo", "slice", "sampler"]
    found = client.show({"type": "kurt"}, views=views, size=64, theta=30)
    told = of(found, "subject")[0]
    controls, bsdf = told["controls"], told["bsdf"] or {"type": "kurt"}
    client.show(bsdf, views=views, size=64, theta=50)  # lobes have other numbers of lines: sizes differ, kernels do not
    rng = np.random.default_rng(4)
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
        dr.kernel_history_clear()
        for _ in range(2):
            for control in controls:  # all of them are moved
                bsdf = edited(bsdf, [control], rng)
            found = client.show(bsdf, views=views, size=64, theta=40)
            assert of(found, "subject")[0]["error"] is None and of(found, "sampler")
        history = dr.kernel_history([dr.KernelType.JIT])
    assert history and all(it["cache_hit"] for it in history)


def test_the_page_is_told_of_what_has_to_be_compiled(client):
    def told(alpha, stage):
        return bool(of(client.show({"type": "ward", "alpha": alpha}, views=["picture"], size=64, stage=stage), "busy"))

    assert [told(0.1, "studio"), told(0.2, "studio"), told(0.3, "lamp")] == [True, False, True]
    assert [told(0.4, "studio"), told(0.5, "studio")] == [True, False]  # Dr.Jit compiles for the emitters of both


def test_pictures_are_refined_until_they_are_finished(client, monkeypatch):
    monkeypatch.setattr("mi_brdfs.explorer.stages.MOST", 12)
    found = of(client.show({"type": "lambert"}, views=["picture"], size=64, refine=True), "picture")
    spp = [it["spp"] for it in found]
    assert spp == sorted(spp) and spp[-1] >= 12 and found[-1]["final"] and not found[0]["final"]
    pixels = np.frombuffer(found[-1]["payload"], np.uint8).reshape(64, 64, 4)
    assert (pixels[..., 3] == 255).all() and 85 < pixels[..., :3].mean() < 115


def test_another_size_keeps_the_picture_until_it_is_as_good(client, monkeypatch):
    monkeypatch.setattr("mi_brdfs.explorer.stages.MOST", 3)
    before = of(client.show(WARD["bsdf"], views=["picture"], refine=True, size=64), "picture")[-1]
    found = of(client.show(WARD["bsdf"], views=["picture"], refine=True, size=96), "picture")
    assert found and {it["width"] for it in found} == {96}
    assert all(it["spp"] >= before["spp"] or it["final"] for it in found)
    (other,) = of(client.show(WARD["bsdf"], views=["picture"], size=64, exposure=1), "picture")
    assert other["spp"] == 1  # in another exposure none is there


def test_a_saved_picture_is_what_is_shown(client, monkeypatch, tmp_path):
    """And needs no room on the disk."""
    monkeypatch.setattr("tempfile.tempdir", "/dev/full")
    shown = of(client.show({"type": "ward"}, views=["picture"], size=64), "picture")[0]
    client.session.ask({"type": "save", "what": "exr", "subject": 0})
    (file,) = of(client.work(), "file", None)
    assert file["name"] == "ward.exr"
    (tmp_path / file["name"]).write_bytes(file["payload"])
    bitmap = mi.Bitmap(str(tmp_path / file["name"])).convert(mi.Bitmap.PixelFormat.RGB, mi.Struct.Type.Float32, False)
    assert rgba(np.array(bitmap), 0) == shown["payload"]
    brighter = of(client.show({"type": "ward"}, views=["picture"], size=64, exposure=1), "picture")[0]
    assert brighter["spp"] == shown["spp"]  # not rendered anew
    assert np.frombuffer(brighter["payload"], np.uint8).mean() > np.frombuffer(shown["payload"], np.uint8).mean() + 10


def test_a_picture_that_was_denoised_stays_so_in_another_exposure(client, monkeypatch):
    monkeypatch.setattr("mi_brdfs.explorer.stages.MOST", 3)
    client.scenes.denoise = lambda pixels: np.full_like(pixels, 0.25)
    last = of(client.show(WARD["bsdf"], views=["picture"], size=64, refine=True), "picture")[-1]
    (brighter,) = of(client.show(WARD["bsdf"], views=["picture"], size=64, exposure=1), "picture")
    assert last["denoised"] and brighter["denoised"] and brighter["spp"] == last["spp"]
    assert brighter["payload"] == rgba(np.full((64, 64, 3), 0.25, np.float32), 1)


def test_views_hold_the_plugins_values(client):
    """A diffuse BRDF is ρ/π everywhere, its lobe ρ cosθ/π, its albedo ρ, and its sampler perfect."""
    views = ["lobe", "polar", "albedo", "slice", "hemisphere", "sampler"]
    found = client.show({"type": "lambert", "reflectance": 0.5}, views=views)
    lobe, cut, albedo, cells, disc, sampler = (of(found, name)[0] for name in views)
    (part,) = lobe["parts"]
    values = np.frombuffer(lobe["payload"], np.float32).reshape(len(part["theta"]), len(part["phi"]))
    expected = 0.5 / np.pi * np.cos(np.radians(part["theta"]))
    np.testing.assert_allclose(values, expected[:, None] + 0 * values, atol=1e-5)
    curve = cut["curves"][0]
    np.testing.assert_allclose(curve["y"], 0.5 / np.pi * np.cos(np.radians(curve["x"])), atol=1e-5)
    np.testing.assert_allclose(albedo["curves"][0]["y"], 0.5, rtol=1e-4)
    f = np.frombuffer(cells["payload"], np.float32)
    np.testing.assert_allclose(f[np.isfinite(f)], 0.5 / np.pi, rtol=1e-4)
    assert np.isfinite(f).mean() > 0.99  # all but grazing directions
    (part,) = disc["parts"]
    disc_values = np.frombuffer(disc["payload"], np.float32).reshape(part["height"], -1)
    assert disc_values[part["height"] // 2, part["width"] // 2] == pytest.approx(0.5 / np.pi, rel=1e-3)
    assert sampler["efficiency"] == pytest.approx(1, abs=1e-5) and len(sampler["dots"]) > 100
    edges, counts = sampler["histogram"]["edges"], sampler["histogram"]["count"]
    assert np.average(edges[1:], weights=counts) == pytest.approx(1, abs=0.1)  # of weights over their mean
    found = client.show({"type": "lambert", "reflectance": 0.5}, views=["lobe", "polar", "hemisphere"], cosine=False)
    for payload in (of(found, it)[0]["payload"] for it in ("lobe", "hemisphere")):
        np.testing.assert_allclose(np.frombuffer(payload, np.float32), 0.5 / np.pi, rtol=1e-3)
    np.testing.assert_allclose(of(found, "polar")[0]["curves"][0]["y"], 0.5 / np.pi, rtol=1e-3)


def test_a_view_has_both_sides_of_a_surface_that_transmits(client):
    """The upper one first, and as many values as their sizes say."""
    found = client.show({"type": "roughdielectric"}, views=["lobe", "hemisphere"])
    for view in (of(found, name)[0] for name in ("lobe", "hemisphere")):
        above, below = view["parts"]
        values = np.frombuffer(view["payload"], np.float32)
        assert len(values) == above["size"] + below["size"]
        assert 0 < np.nanmax(values[: above["size"]]) < np.nanmax(values[above["size"] :])  # most light is transmitted


def test_curves_go_along_other_angles(client):
    """Of a diffuse BRDF as cosθo = cosθh cosθd says, and all through the value in the mirror direction."""

    def curve(bsdf, **members):
        (found,) = of(client.show(bsdf, views=["cartesian"], theta=30, phi=20, **members), "cartesian")[0]["curves"]
        return np.array(found["x"]), np.array(found["y"])

    for axis, held, low, high in (("theta_h", 30, 0, 89.99), ("theta_d", 0, 0, 89.99), ("phi", 30, 0, 360)):
        x, y = curve({"type": "lambert", "reflectance": 0.5}, axis=axis)
        assert (x[0], x[-1]) == (low, pytest.approx(high))
        cosine = np.cos(np.radians(held)) * (np.cos(np.radians(x)) if axis != "phi" else 1)
        np.testing.assert_allclose(y, 0.5 / np.pi * cosine, atol=1e-5)  # five digits are sent
    ward = {"type": "ward", "alpha_u": 0.02, "alpha_v": 0.3}
    mirror = np.interp(30, *curve(ward))
    for axis, at in (("theta_h", 0), ("theta_d", 30), ("phi", 180)):
        assert np.interp(at, *curve(ward, axis=axis)) == pytest.approx(mirror, rel=0.02)


def test_channels_and_components(client):
    bsdf = {"type": "ward", "diffuse_reflectance": [0.8, 0.4, 0.1], "specular_reflectance": 0.1}
    rgb = of(client.show(bsdf, views=["albedo"], channel="rgb"), "albedo")[0]["curves"]
    assert [it["channel"] for it in rgb] == ["red", "green", "blue"]
    assert rgb[0]["y"][0] - rgb[2]["y"][0] == pytest.approx(0.7, abs=2e-3)  # by 2048 samples, some on the other lobe
    whole = of(client.show(bsdf, views=["polar"]), "polar")[0]["curves"][0]["y"]
    parts = [of(client.show(bsdf, views=["polar"], component=k), "polar")[0]["curves"][0] for k in (0, 1)]
    assert max(max(it["y"]) for it in parts) < max(whole)
    diffuse, glossy, both = (
        np.array(of(client.show(bsdf, views=["albedo"], component=k), "albedo")[0]["curves"][0]["y"])
        for k in (0, 1, None)
    )
    assert np.ptp(diffuse) < 1e-3 and np.ptp(glossy) > 0.01
    np.testing.assert_allclose(diffuse + glossy, both, atol=0.01)  # by 2048 samples


@pytest.mark.parametrize("noticed", [True, False], ids=["noticed", "between steps"])
def test_a_material_that_comes_back_is_told_and_drawn_again(client, noticed):
    """The page has forgotten it."""
    walter, ward = {"type": "walter", "alpha": 0.2}, {"type": "ward", "alpha": 0.3}
    client.show(walter, ward, views=["polar"])
    for between in ([walter], [walter, walter]):
        client.send(*between, views=["polar"])
        if noticed:
            client.work()
        found = client.show(walter, ward, views=["polar"])
        assert of(found, "subject", 1)[0]["controls"] and of(found, "polar", 1)[0]["curves"]


def test_chi_square_on_request(client):
    client.show({"type": "walter", "alpha": 0.2}, views=[])
    for subject in (0, 1):
        client.session.ask({"type": "chi2", "subject": subject})
    found = client.work()
    (answer,) = of(found, "chi2")
    assert answer["passed"] and "p-value" in answer["text"], answer
    assert [it["error"] for it in of(found, "chi2", 1)] == ["There is no material 1."]


# --- Files ------------------------------------------------------------------------------------------------------------


@pytest.fixture
def with_file(llvm_rgb):
    return Client(sources=list(find_sources(LOFT)))


NAMES = [
    b"paint (1).bsdf", b'it\'s "gold" & 100%25;.bsdf', b"<b>.bsdf", b"-$5 \\$(x)`.bsdf", b"line\n\t\x1b[1m--.bsdf",
    "漆é.bsdf".encode(), b"x.xml.bsdf", b"\xff'\xe4.bsdf",
]  # fmt: skip


def test_views_say_nothing_where_nothing_was_measured(with_file):
    """As figures do, unless a parameter says how values go on."""
    subject = {"type": "tabulated", "file": LOFT}
    for given, is_whole in ((subject, False), (subject | {"extrapolate": "hold"}, True)):
        (curve,) = of(with_file.show(given, views=["polar"]), "polar")[0]["curves"]
        known = dict(zip(curve["x"], (it is not None for it in curve["y"]), strict=True))
        assert known[0] and known[min(known)] is is_whole


def test_what_is_copied_names_a_file_of_any_name(llvm_rgb, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    words, commands = [], []
    for name in NAMES:
        shutil.copy(LOFT, name)
        (source,) = find_sources(os.fsdecode(name))
        subject = checked({"type": "tabulated", "file": source.word, "interpolation": "nearest"})
        told = Materials({source.word: source}).written(subject)
        commands.append(f"printf '%s\\0' {told['command']}")
        words += [b"mi-brdfs", b"show", os.fsencode(tmp_path / source.word), b"-D", b"interpolation=nearest"]
        if b"\xff" in name:
            assert "only names in UTF-8" in told["xml"] and "only names in UTF-8" in told["dict"]
        else:
            assert isinstance(mi.load_string(told["xml"].replace(">", ' version="3.0.0">', 1)), mi.BSDF), name
            assert eval(told["dict"])["filename"] == str(tmp_path / source.word)
    printed = subprocess.run(["bash", "-c", "\n".join(commands)], capture_output=True).stdout
    assert printed.split(b"\0")[:-1] == words


def test_what_is_copied_of_a_material_of_a_file_has_its_edits(llvm_rgb, tmp_path):
    """Or says that it has not, of one that is made of others or has textures."""
    metal = '<bsdf type="walter"><float name="alpha" value="0.2"/><rgb name="f0" value="0.9, 0.6, 0.2"/></bsdf>'
    for inner, alpha in ((metal, "alpha"), (f'<bsdf type="twosided">{metal}</bsdf>', "brdf_0.alpha")):
        path = tmp_path / "metal.xml"
        path.write_text(inner.replace("<bsdf", '<bsdf version="3.0.0"', 1))
        (source,) = find_sources(str(path))
        subject, materials = {"type": "given", "file": source.word}, Materials({source.word: source})
        as_it_is, edited = materials.written(checked(subject)), materials.written(checked(subject | {alpha: 0.77}))
        assert as_it_is["command"] == f"mi-brdfs show {path}" and as_it_is["dict"] == f"# {path}"
        if "." in alpha:
            assert edited["command"].endswith("metal.xml  # but with brdf_0.alpha = 0.77")
            assert all(edited[it].count("metal.xml, but with brdf_0.alpha = 0.77") == 1 for it in ("xml", "dict"))
            continue
        copied = eval(edited["dict"])
        assert copied["alpha"] == pytest.approx(0.77) and copied["f0"]["value"] == pytest.approx([0.9, 0.6, 0.2])
        assert "mi-brdfs show walter" in edited["command"] and "-D alpha=0.77" in edited["command"]
        loaded = mi.load_string(edited["xml"].replace(">", ' version="3.0.0">', 1))
        assert mi.traverse(loaded)["alpha.value"][0] == pytest.approx(0.77)


def test_fits_wait_for_edits_go_on_and_are_cancelled(with_file, monkeypatch):
    models = ["lambert", "ward"]
    monkeypatch.setattr("mi_brdfs.explorer.session.find_models", lambda names: [find_model(it) for it in models])
    subject = {"type": "tabulated", "file": LOFT}
    with_file.show(subject, views=[])
    with_file.session.ask({"type": "fit", "subject": 0, "model": "all", "metric": "log"})
    send = with_file.session.send

    def edit(frame):
        with_file.session.send = send
        with_file.send(subject, views=["polar"])
        with_file.session._edited = -1.0  # another time, but long ago: fits wait for a pause

    with_file.session.send = edit
    assert not of(with_file.work(1), "fit")
    found = with_file.work()
    fits = [it for it in of(found, "fit") if "bsdf" in it]
    assert [it["model"] for it in fits] == [it["bsdf"]["type"] for it in fits] == models
    assert all(0 < it["error"] < 1 for it in fits)
    done = [it["done"] for it in of(found, "fit")]
    assert len(done) > 2 and done == sorted(done) and done[-1] == len(models)
    kinds = [it.get("view", it["type"]) for it in found]
    assert kinds.index("polar") < kinds.index("fit") and of(found, "fitted")[0]["error"] is None
    with_file.session.ask({"type": "fit", "subject": 0, "model": "lambert", "metric": "log"})
    with_file.session.send = lambda frame: with_file.session.ask({"type": "cancel"}) or with_file.frames.append(frame)
    assert not [it for it in with_file.work() if "bsdf" in it]
    with_file.session.send = send
    for request in ({"type": "fit", "subject": 0, "model": "lambert", "metric": "log"}, {"type": "cancel"}):
        with_file.session.ask(request)
    assert not of(with_file.work(), "fit")


def staged(scene, material=None):
    """A scene of a user, in which a material is replaced."""
    return Stages(UserScene(scene, material)).stage(Setting("", "scene", 8))


def shades_show(scene, material=None):
    """Pictures of a scene show what its material is replaced by."""
    client, shown = Client(UserScene(scene, material)), {"views": ["picture"], "shape": "scene", "size": 32}
    dark, bright = (of(client.show({"type": "lambert", "reflectance": it}, **shown), "picture") for it in (0.1, 0.9))
    return dark[0]["payload"] != bright[0]["payload"]


def test_the_users_scene_has_its_material_replaced(llvm_rgb):
    scene = ROOT / "scenes" / "cornell_box.xml"
    assert shades_show(scene)
    stage = staged(scene, "ward")  # the id of a shape
    assert [it.id() for it in stage.shapes] == ["ward"]
    assert stage.scene.sensors()[0].film().rfilter().is_box_filter()  # as the denoiser expects


TWINS = """<scene version="3.0.0"><integrator type="path"/><sensor type="perspective"/>
<bsdf id="one" type="diffuse"/><bsdf id="other" type="diffuse"/>
<shape id="left" type="cube"><ref id="one"/></shape><shape id="right" type="cube"><ref id="one"/></shape>
<shape id="above" type="cube"><ref id="other"/></shape></scene>"""
GREY, BLACK = (BSDFSource(it, it, it) for it in ("lambert", "ward"))


@pytest.fixture
def twins(llvm_rgb, tmp_path):
    path = tmp_path / "twins.xml"
    path.write_text(TWINS)
    return path


@pytest.mark.parametrize(
    ("id", "shapes"), [("one", ["left", "right"]), ("other", ["above"]), ("left", ["left"]), ("right", ["right"])]
)
def test_materials_that_are_alike_are_not_one(twins, id, shapes):
    """Mitsuba makes one of those, and of meshes that share one, and forgets the names of the rest."""
    assert [it.id() for it in staged(twins, id).shapes] == shapes
    scene = SceneFile(str(twins), replaced={id: GREY}).load()
    assert [it.id() for it in scene.shapes() if it.bsdf().class_name() != "SmoothDiffuse"] == shapes


GROUP = """<scene version="3.0.0"><integrator type="path"/><sensor type="perspective"><transform name="to_world">
<lookat origin="0, 0, 6" target="0, 0, 0" up="0, 1, 0"/></transform></sensor><emitter type="constant"/>
<shape type="shapegroup" id="group"><shape type="cube" id="part"><bsdf type="mute" id="paint"/></shape></shape>
<shape type="instance"><ref id="group"/></shape></scene>"""


def test_materials_that_instances_show(llvm_rgb, tmp_path):
    class Mute(mi.BSDF):
        """It has no name in words, and reflects nothing."""

        def __init__(self, props):
            mi.BSDF.__init__(self, props)
            self.m_components, self.m_flags = [mi.BSDFFlags.DiffuseReflection], mi.BSDFFlags.DiffuseReflection

        def eval(self, context, si, wo, active=True):
            return mi.Spectrum(0)

    mi.register_bsdf("mute", Mute)
    path = tmp_path / "group.xml"
    path.write_text(GROUP)
    (found,) = find_sources(str(path))
    assert found.name == "group.xml:paint"
    path.write_text(GROUP.replace("mute", "diffuse"))
    assert shades_show(path, "paint")


def test_each_material_of_a_scene_is_its_own(twins):
    unused = '<bsdf id="unused" type="twosided"><bsdf id="inside" type="diffuse"/></bsdf><shape'
    twins.write_text(TWINS.replace("<shape", unused, 1))
    assert [it.name for it in find_sources(str(twins))] == ["twins.xml:one", "twins.xml:other"]
    for id in ("unused", "inside"):
        with pytest.raises(ValueError, match=f"nothing in the scene has the BSDF {id}"):
            SceneFile(str(twins), replaced={id: GREY}).load()


TWISTED = """<scene version="3.0.0"><integrator type="direct"/><emitter type="constant"/>
<sensor type="perspective"><transform name="to_world"><lookat origin="0, 0, -4" target="0, 0, 0" up="0, 1, 0"/>
</transform><film type="hdrfilm"><integer name="width" value="8"/><integer name="height" value="8"/></film></sensor>
<default name="grey" value="0.5"/>
<bsdf type="twosided" id="outer">
<bsdf type="diffuse" id="inner"><float name="reflectance" value="$grey"/></bsdf></bsdf>
<shape type="rectangle" id="behind"><transform name="to_world"><scale value="9"/></transform>{}</shape>
<shape type="sphere" id="ball"><float name="radius" value="0.1"/><ref id="{}"/></shape></scene>"""


@pytest.mark.parametrize(
    ("word", "wall", "ball"),
    [
        ("outer", '<ref id="outer"/>', "inner"),
        ("inner", '<ref id="outer"/>', "inner"),
        ("behind", '<bsdf type="twosided" id="own"><bsdf type="diffuse"/></bsdf>', "own"),
    ],
)
def test_pictures_replacements_and_copies_are_the_same(llvm_rgb, tmp_path, word, wall, ball):
    """Of a wall that is seen from behind, and whose material, or what is in it, is that of a ball, too."""
    path = tmp_path / "twisted.xml"
    path.write_text(TWISTED.format(wall, ball))
    black = '<bsdf type="lambert"><float name="reflectance" value="0.1"/></bsdf>'
    (tmp_path / "copy.xml").write_text(with_material(path, word, black))
    source = BSDFSource("lambert", "lambert", "lambert", None, {"reflectance": "0.1"})
    replaced = SceneFile(str(path), box_filter=True, replaced={word: source})
    scenes = replaced.load(), SceneFile(str(tmp_path / "copy.xml"), box_filter=True).load()
    stage = staged(path, word)
    pictures = [np.array(mi.render(it, spp=16)) for it in scenes]
    with stage.showing(mi.load_dict({"type": "lambert", "reflectance": 0.1}), Pose()):
        pictures.append(np.array(mi.render(stage.scene, spp=16)))
    assert pictures[0][0, 0] == pytest.approx(0.1, rel=0.1)  # the ball reflects, too
    for it in pictures[1:]:
        np.testing.assert_allclose(it, pictures[0], rtol=1e-5)


def test_a_material_and_a_shape_that_has_it_are_both_replaced(twins):
    for replaced in ({"one": GREY, "left": BLACK}, {"left": BLACK, "right": BLACK, "one": GREY}):
        scene = SceneFile(str(twins), replaced=replaced).load()
        right = "Ward" if "right" in replaced else "Lambert"
        assert [type(it.bsdf()).__name__ for it in scene.shapes()] == ["Ward", right, "BSDF"]


def test_part_of_a_mixture_is_not_shown_in_part(llvm_rgb, tmp_path):
    path = tmp_path / "mixed.xml"
    mixture = '<bsdf type="blendbsdf"><float name="weight" value="0.5"/><ref id="outer"/><ref id="inner"/></bsdf>'
    path.write_text(TWISTED.format(mixture, "inner"))
    with pytest.raises(ValueError, match="inner is also part of other materials"):
        staged(path, "inner")


def test_a_mesh_that_is_refused_breaks_no_picture(client, tmp_path):
    """While a mesh without vertices is alive, Dr.Jit compiles no kernel."""
    mesh = "ply\nformat ascii 1.0\nelement vertex 0\n" + "".join(f"property float {it}\n" for it in "xyz")
    (tmp_path / "e.ply").write_text(f"{mesh}element face 0\nproperty list uchar int vertex_indices\nend_header\n")
    with pytest.raises(ValueError, match="has no triangles") as told:
        client.scenes.add(tmp_path / "e.ply", "e.ply")
    assert of(client.show({"type": "lambert"}, views=["picture"]), "picture") and told


def test_values_of_a_material_are_its_own(llvm_rgb, tmp_path):
    """Files are kept loaded: what one subject changes, another one does not see."""
    path = tmp_path / "metal.xml"
    path.write_text('<bsdf version="3.0.0" type="roughconductor"><float name="alpha" value="0.25"/></bsdf>')
    materials = Materials({"metal.xml": BSDFSource(str(path), "metal.xml", str(path))})
    usual = {"type": "given", "file": "metal.xml"}
    found = []
    for values in {}, {"alpha": 0.5}, {"alpha": 0.75, "eta": "dark"}, {}:
        with suppress(StateError), materials.loaded(usual | values) as loaded:
            found.append(float(mi.traverse(loaded)["alpha.value"][0]))
    assert found == [0.25, 0.5, 0.25]


def test_camera_and_light_are_moved_and_come_back(client, tmp_path):
    """The light from ωi comes from the left at φi = 0, where lobes show it, and from the right at 180°."""
    mi.Bitmap(np.array([[[3, 0, 0], [0, 0, 3]]], np.float32)).write(str(tmp_path / "two.exr"))
    assert client.scenes.add(tmp_path / "two.exr", "two.exr") == {"stage": "two.exr"}
    mi.load_dict({"type": "cube"}).write_ply(str(tmp_path / "box.ply"))
    assert client.scenes.add(tmp_path / "box.ply", "box.ply") == {"shape": "box.ply"}

    def picture(**members):
        (found,) = of(client.show({"type": "lambert"}, views=["picture"], size=64, **members), "picture")
        return np.frombuffer(found["payload"], np.uint8).reshape(64, 64, 4)[..., :3].astype(float)

    usual, *moved = (picture(**it) for it in ({}, {"yaw": 90}, {"pitch": 60}, {"turn": 90}, {"shape": "box.ply"}))
    assert all(abs(it - usual).mean() > 2 for it in moved)
    assert (picture() == usual).all()
    left, right = (picture(stage="incidence", theta=80, phi=phi)[20:35] for phi in (0, 180))
    assert left[:, :32].mean() > 1.5 * left[:, 32:].mean() and right[:, 32:].mean() > 1.5 * right[:, :32].mean()
    one, other = (picture(stage="two.exr", turn=turn)[:, :32].mean(axis=(0, 1)) for turn in (0, 180))
    assert abs((one - other)[[0, 2]]).min() > 5 and (one - other)[0] * (one - other)[2] < 0


def test_a_material_is_written_into_a_copy_of_the_scene(llvm_rgb, tmp_path):
    text = (ROOT / "scenes" / "cornell_box.xml").read_text()
    (tmp_path / "room.xml").write_text(text)
    client = Client(UserScene(tmp_path / "room.xml", "ward"))
    client.show({"type": "burley", "roughness": 0.25}, views=[])
    for name in ("room-burley.xml", "room-burley-2.xml"):
        client.session.ask({"type": "save", "what": "scene"})
        assert name in of(client.work(), "written")[0]["text"]
    assert (tmp_path / "room.xml").read_text() == text
    written = mi.load_file(str(tmp_path / name))
    (shape,) = [it for it in written.shapes() if it.id() == "ward"]
    assert mi.traverse(shape.bsdf())["roughness.value"] == 0.25
    assert abs(len((tmp_path / name).read_text()) - len(text)) < 800


# --- Exported pages ---------------------------------------------------------------------------------------------------


def exported(subjects, **vary):
    data = {"subjects": [{"bsdf": it, "name": it["type"]} for it in subjects]}
    return page(parse({**data, "size": 64}, STAGES), Materials(), Client().scenes, data, vary)


def test_an_exported_page_holds_each_place_of_its_scrubbers(llvm_rgb, monkeypatch):
    """For those who have the parameter."""
    monkeypatch.setattr("mi_brdfs.explorer.export.SPP", 1)
    monkeypatch.setattr("mi_brdfs.explorer.export.LARGEST", 8e5)
    source = exported([{"type": "ward", "alpha": 0.19}, {"type": "lambert"}], theta=(0, 40, 80), alpha=(0.1, 0.2))
    held = json.loads(re.search(r'id="exported">(.*?)</script>', source)[1])
    assert [(it["name"], it["start"]) for it in held["scrubbers"]] == [("theta", 1), ("alpha", 1)]
    data, places = gzip.decompress(base64.b64decode(held["data"])), {}
    for at, length, is_text in held["frames"]:
        told = opened(data[:length].decode() if is_text else data[:length])
        places.setdefault((told.get("view", told["type"]), told["subject"]), []).append(tuple(at))
        data = data[length:]
    grid = [(theta, alpha) for alpha in (0, 1) for theta in (0, 1, 2)]
    assert places["lobe", 0] == places["polar", 0] == grid and places["lobe", 1] == [(it, None) for it in range(3)]
    assert places["albedo", 0] == places["picture", 0] == [(None, 0), (None, 1)]
    assert "sampler" not in held["views"]


def test_the_scripts_of_an_exported_page_can_be_one():
    """What their outermost level names is theirs alone."""
    scripts = [it.read_text() for it in CLIENT.iterdir() if it.name.endswith(".js")]
    declared = re.compile(r"^(?:export )?(?:async )?(?:function|class|const|let) (\w+)", re.MULTILINE)
    names = [name for script in scripts for name in declared.findall(script)]
    assert len(names) > 100 and sorted(set(names)) == sorted(names)


def test_a_page_that_is_too_large_is_refused(llvm_rgb, monkeypatch):
    monkeypatch.setattr("mi_brdfs.explorer.export.SPP", 1)
    monkeypatch.setattr("mi_brdfs.explorer.export.LARGEST", 1000)
    with pytest.raises(StateError, match=r"The page would have .* fewer values of parameters"):
        exported([{"type": "lambert"}], theta=(0,))


# --- Tours ------------------------------------------------------------------------------------------------------------


def test_every_step_of_a_tour_can_be_shown(client):
    with pytest.raises(ValueError, match="a tour has a title"):
        parse_tour("x", "# Title\n\n## Step\n\nno state\n")
    assert len(tours()) >= 6
    for tour in tours():
        state = {"subjects": [{"bsdf": {"type": "walter"}}]}
        for step in tour["steps"]:
            state |= step["state"]
            subjects = [it["bsdf"] for it in state["subjects"]]
            found = client.show(*subjects, **{k: v for k, v in state.items() if k != "subjects"} | {"views": []})
            assert not [it["error"] for it in of(found, "subject") if it["error"]], step["title"]
            assert step["text"]
