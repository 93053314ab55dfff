"""The command line: what it prints and writes, what it says of errors, how it ends; in processes where these matter."""

import contextlib
import os
import re
import shutil
import signal
import subprocess
import sys
import time

import mitsuba as mi
import numpy as np
import pytest
from support import LOFT, ROOT, environment
from test_llvm import BAD, needs_bad
from typer.main import get_command
from typer.testing import CliRunner

import mi_brdfs
from mi_brdfs.cli import app
from mi_brdfs.mitsuba import llvm
from mi_brdfs.probe.sources import value_of

TURNED = '<rotate y="1" angle="180"/>'
SCENE = (ROOT / "tests" / "rows" / "scenes" / "sheet.xml").read_text()


@pytest.fixture
def folder(tmp_path):
    """A scene in a folder of its own, beside the folder that the commands run in."""
    (tmp_path / "scenes").mkdir()
    (tmp_path / "work").mkdir()
    (tmp_path / "scenes" / "box.xml").write_text(SCENE)
    shutil.copy(ROOT / "tests" / "rows" / "scenes" / "triangle.obj", tmp_path / "scenes")
    return tmp_path


def command(*arguments):
    return [sys.executable, "-m", "mi_brdfs", *map(str, arguments)]


def run(*arguments, cwd=None, library=None):
    env = environment(library)
    return subprocess.run(command(*arguments), cwd=cwd, env=env, capture_output=True, text=True, timeout=180)


def invoke(*words, cwd="."):
    """The result of a command that runs in this process."""
    before = os.getcwd()
    os.chdir(cwd)
    try:
        return CliRunner().invoke(app, [*map(str, words)])
    finally:
        os.chdir(before)


def test_types_are_listed_and_have_pages():
    words = invoke("list").stdout
    assert all(name in words.split() for name in mi_brdfs.list_models())
    assert "Ward" in next(line for line in words.splitlines() if line.startswith("ward "))
    page = invoke("info", "ward").stdout
    assert page.startswith(mi_brdfs.info("ward").splitlines()[0])
    assert "alpha_u" in page and "``" not in page


def test_examples_of_the_help_can_be_typed(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name, it in get_command(app).commands.items():
        heading, *examples = it.epilog.split("\n\n")
        assert heading == "Examples:" and examples and it.rich_help_panel
        for program, command, *words in map(str.split, examples):
            assert (program, command) == ("mi-brdfs", name)
            it.make_context(name, words)  # refuses what is no option


WORDS = {
    "ggx": ("walter", ""), "trowbridge-reitz": ("microfacet", "distribution=ggx"),
    "beckmann": ("microfacet", "distribution=beckmann"), "oren-nayar": ("orennayar", ""), "pbr": ("burley", ""),
    "gltf": ("metallicroughness", ""), "principled": ("burley", ""), "roughconductor": ("walter", "material=Au"),
    "Gold": ("walter", "material=Au"), "roughness": ("ward", "alpha"),
}  # fmt: skip


@pytest.mark.parametrize("word", WORDS)
def test_words_of_other_programs_lead_to_models(word):
    """With the option that they need; what is hinted at exists."""
    plugin, option = WORDS[word]
    found = invoke("list", "--search", word).stdout.splitlines()
    (row,) = (line for line in found if line.startswith(f"{plugin} "))
    assert option in row and len(found) < 13
    done = invoke("info", word)
    assert done.exit_code == 1 and done.stdout == "" and done.stderr.count("\n") == 1
    told = re.search("did you mean '(\\w+)'(?: with (\\w+)=([\\w.]+))?", done.stderr)
    with mi.variant_context("scalar_rgb"):
        mi.load_dict({"type": told[1]} | ({told[2]: value_of(told[3])} if told[2] else {}))


def states(text):
    return dict(re.findall(r"^(scalar|llvm|cuda|metal) +(works|missing|aborts|fails)", text, re.MULTILINE))


def test_doctor_tries_every_backend():
    done = invoke("doctor")
    found = states(done.stdout)
    assert found["scalar"] == "works"
    assert set(found) == {variant.split("_")[0] for variant in mi.variants()}
    works = any(found[name] == "works" for name in found if name != "scalar")
    assert done.exit_code == (0 if works else 1)
    assert f"mitsuba {mi.__version__}" in done.stdout and "llvm_ad_spectral_polarized" in done.stdout
    if found["llvm"] == "works" and found.get("cuda") != "works":
        assert re.search(r"LLVM \d+\.\d+\.\d+ \S*libLLVM", done.stdout)
        assert "Everything works" in done.stdout


@pytest.mark.slow
@pytest.mark.parametrize("library", ["/nowhere/libLLVM.so", pytest.param(BAD, marks=needs_bad)])
def test_doctor_of_an_llvm_that_is_not_there_or_aborts(library):
    done = run("doctor", library=library)
    detail = "aborts +the test render died of SIGABRT" if library == BAD else "missing"
    assert re.search(rf"^llvm +{detail}", done.stdout, re.MULTILINE), done.stdout
    assert done.stderr == "" or library != BAD
    if not {"cuda", "metal"} & {name for name, state in states(done.stdout).items() if state == "works"}:
        assert done.returncode == 1 and f"unset {llvm.VARIABLE}" in done.stdout


@pytest.mark.usefixtures("llvm_rgb")
def test_render_writes_an_exr_and_a_display_image_here(folder):
    done = invoke("render", "../scenes/box.xml", "-Dmaterial=ward", "-Dres=20", "--spp", 5, cwd=folder / "work")
    assert done.exit_code == 0, done.stderr
    assert done.stdout.split() == ["box.exr", "box.png"]
    assert re.fullmatch(r"5 samples per pixel in [\d.]+ s, \w+_rgb\.\n", done.stderr)
    assert sorted(file.name for file in (folder / "work").iterdir()) == ["box.exr", "box.png"]
    exr = np.array(mi.Bitmap(str(folder / "work" / "box.exr")))
    png = mi.Bitmap(str(folder / "work" / "box.png"))
    assert exr.shape == (20, 20, 3) and exr.dtype == np.float32 and exr.mean() > 0.1
    assert list(png.size()) == [20, 20] and np.array(png).mean() > 20


def test_the_output_option_names_either_file_and_the_seed_the_noise(folder):
    pixels = []
    for name, seed in ("a", 1), ("b", 1), ("c", 2):
        words = "--variant", "scalar_rgb", "--seed", seed, "-o", f"work/{name}.jpg"
        done = invoke("render", "scenes/box.xml", *words, cwd=folder)
        assert done.stdout.split() == [f"work/{name}.exr", f"work/{name}.jpg"]
        assert "3 samples per pixel" in done.stderr
        pixels.append(np.array(mi.Bitmap(str(folder / "work" / f"{name}.exr"))))
        assert list(mi.Bitmap(str(folder / "work" / f"{name}.jpg")).size()) == [24, 24]
    np.testing.assert_allclose(pixels[0], pixels[1], rtol=1e-4)
    assert not np.allclose(pixels[0], pixels[2], rtol=1e-3)


def test_a_mesh_that_an_old_scene_lacks_is_a_cube_if_asked_for(folder):
    old = SCENE.replace("3.0.0", "0.6.0").replace("to_world", "toWorld").replace("sample_count", "sampleCount")
    (folder / "old.xml").write_text(old.replace("triangle.obj", "gone.obj"))
    words = "render", "old.xml", "--variant", "scalar_rgb"
    done = invoke(*words, cwd=folder)
    assert done.exit_code == 1 and "gone.obj" in done.stderr and "--lenient" in done.stderr
    done = invoke(*words, "--lenient", cwd=folder)
    assert done.exit_code == 0, done.stderr
    seen = np.array(mi.Bitmap(str(folder / "old.exr")))[..., 0]
    assert seen[12, 12] < 0.9 and seen[0, 0] == pytest.approx(1)  # a grey cube before the sky


@pytest.mark.usefixtures("llvm_rgb")
@pytest.mark.parametrize("processes", [0, pytest.param(1, marks=pytest.mark.slow)])
def test_materials_of_a_scene_are_replaced(folder, processes):
    """By the id of a BSDF, wherever it is referred to, or of a shape; also where it had none. What was seen from both
    sides still is."""
    (folder / "balls.xml").write_text(
        '<scene version="3.0.0"><integrator type="path"/><emitter type="constant"/><sensor type="orthographic">'
        '<transform name="to_world"><scale x="3" y="3"/><lookat origin="0,0,5" target="0,0,0" up="0,1,0"/></transform>'
        '<film type="hdrfilm"><integer name="width" value="3"/><integer name="height" value="3"/>'
        '<rfilter type="box"/></film></sensor><bsdf type="diffuse" id="paint"/>'
        + "".join(
            f'<shape type="rectangle" id="{id}">{inner}<transform name="to_world">{turn}<translate x="{x}" y="{y}"/>'
            "</transform></shape>"
            for id, x, y, inner, turn in (
                ("a", -2, 0, '<ref id="paint"/>', ""),
                ("b", 0, 0, '<ref id="paint"/>', ""),
                ("c", 2, 0, "", ""),
                ("back", 0, 2, '<bsdf type="twosided" id="both"><bsdf type="diffuse"/></bsdf>', TURNED),
            )
        )
        + "</scene>"
    )
    words = ["--workers", processes] * bool(processes)
    black, white = "lambert:reflectance=0", "lambert:reflectance=1"
    for replaced, expected, back in [
        ((f"paint={black}", f"c={white}", f"both={white}"), [0, 0, 1], 1),
        ((f"a={white}", f"b={black}", "back=thindielectric"), [1, 0, 0.5], 1),
    ]:
        options = [word for it in replaced for word in ("--replace", it)]
        done = invoke("render", "balls.xml", "--spp", 256, "-o", "it.exr", *options, *words, cwd=folder)
        assert done.exit_code == 0, done.stderr
        picture = np.array(mi.Bitmap(str(folder / "it.exr")))[..., 0]
        np.testing.assert_allclose([*picture[1], *picture[::2, 1]], [*expected, back, 1], atol=0.02)


@pytest.mark.slow
def test_mitsubas_warnings_go_to_stderr(folder):
    done = run("render", "scenes/box.xml", "--variant", "llvm_ad_mono", cwd=folder)
    assert done.stdout.split() == ["box.exr", "box.png"]
    assert "Monochrome mode" in done.stderr


@pytest.mark.parametrize(
    "words, status, told",
    [
        (["--variant", "cuda_ad_rgb"], 1, "cuda_ad_rgb does not work on this machine; `mi-brdfs doctor` says why\n"),
        (["--variant", "llvm_ad_rgb"], 1, "unset it\n"),
        ([], 0, "using scalar_rgb, which is slow: unset it\n"),
    ],
)
def test_variants_that_do_not_work_here(words, status, told, folder, monkeypatch):
    """They are refused, and without a choice the next best is used."""
    works = mi.set_variant

    def set_variant(name):
        if name == "cuda_ad_rgb":
            raise ImportError
        works(name)

    monkeypatch.setattr(mi, "variants", lambda: ["scalar_rgb", "llvm_ad_rgb", "cuda_ad_rgb"])
    monkeypatch.setattr(mi, "set_variant", set_variant)
    monkeypatch.setattr(llvm, "problem", lambda: "unset it")
    done = invoke("render", "scenes/box.xml", *words, cwd=folder)
    assert done.exit_code == status and done.stderr.startswith(f"mi-brdfs: {told}")
    assert ("scalar_rgb." in done.stderr and "box.exr" in done.stdout) == (status == 0)


@pytest.mark.slow
@needs_bad
def test_without_a_choice_a_bad_llvm_is_avoided(folder):
    done = run("render", "scenes/box.xml", cwd=folder, library=BAD)
    assert done.returncode == 0 and "box.exr" in done.stdout
    if "cuda" not in done.stderr:
        assert f"unset {llvm.VARIABLE}" in done.stderr and "scalar_rgb." in done.stderr


NOTHING = "Interrupted; nothing was written."
HOURS = "render", "scenes/box.xml", "--spp", 10**6


def interrupted(folder, *arguments, running, times=1):
    """Start a command on a terminal, and press Ctrl-C once ``running`` shows on it."""
    pty = pytest.importorskip("pty")
    terminal, its_end = pty.openpty()
    env = {**os.environ, "TERM": "xterm"}
    process = subprocess.Popen(
        command(*arguments), cwd=folder, stdout=subprocess.PIPE, stderr=its_end, text=True, env=env
    )
    os.close(its_end)
    shown = ""
    while not re.search(running, shown):
        shown += os.read(terminal, 1024).decode(errors="replace")
    time.sleep(1)
    for _ in range(times):
        process.send_signal(signal.SIGINT)
        time.sleep(0.1)
    out, _ = process.communicate(timeout=60)
    with contextlib.suppress(OSError):  # the end of a terminal
        while data := os.read(terminal, 1024):
            shown += data.decode(errors="replace")
    os.close(terminal)
    return process.returncode, out, shown


@pytest.mark.usefixtures("ctrl_c")
def test_ctrl_c_keeps_what_is_finished(folder):
    status, out, err = interrupted(folder, *HOURS, "--variant", "llvm_ad_rgb", running=r"[1-9]\d*/1000000")
    assert status == 130
    assert out.split() == ["box.exr", "box.png"]
    finished = re.search(r"Interrupted; the image has the (\d+) of 1000000 samples per pixel", err)
    assert finished and int(finished[1]) > 0 and "Traceback" not in err
    exr = np.array(mi.Bitmap(str(folder / "box.exr")))
    assert exr[0, 0] == pytest.approx(1, rel=0.01)  # the constant emitter, so sums and weights belong together


@pytest.mark.slow
@pytest.mark.usefixtures("ctrl_c")
def test_a_second_ctrl_c_aborts_at_once(folder):
    status, out, err = interrupted(
        folder, *HOURS, "--variant", "llvm_ad_rgb", "-Dres=4096", running="Rendering", times=2
    )
    assert status == 130 and out == ""
    assert "Aborted; nothing was written." in err and "Traceback" not in err
    assert not list(folder.glob("*.exr"))


@pytest.mark.usefixtures("ctrl_c")
def test_ctrl_c_ends_the_start_in_a_sentence():
    """In the midst of the imports, of which some would make another error of it."""
    python, *words = command("sweep", "gone.bsdf")
    with subprocess.Popen([python, "-X", "importtime", *words], stderr=subprocess.PIPE, text=True) as process:
        next(line for line in process.stderr if "mi_brdfs.mitsuba.llvm" in line)
        process.send_signal(signal.SIGINT)
        told = [line for line in process.stderr if "import time:" not in line]
    assert (process.returncode, told) == (130, ["Interrupted; nothing was written.\n"])


def interrupted_in_a_kernel(*_, **__):
    """As where Dr.Jit records a Python function."""
    raise RuntimeError("dr.while_loop(): …") from KeyboardInterrupt()


RESUMED = "Interrupted; 0 of 1 fits are finished: the same command goes on from there."


@pytest.mark.usefixtures("llvm_rgb")
@pytest.mark.parametrize(
    "where, arguments, sentence",
    [
        ("mi_brdfs.rendering.scene_file.SceneFile.load", ["render", "box.xml"], NOTHING),
        ("mi_brdfs.rendering.passes.render", ["render", "box.xml"], NOTHING),
        ("mi_brdfs.probe.sources.find_sources", ["show", "lambert"], NOTHING),
        ("mi_brdfs.probe.sources.find_sources", ["check", "lambert"], NOTHING),
        ("mi_brdfs.bench.comparison.compare", ["bench", "lambert"], NOTHING),
        ("mi_brdfs.measured.convert", ["convert", LOFT, "it.csv"], NOTHING),
        ("mi_brdfs.probe.largest_albedo.default_albedo", ["energy", "lambert"], NOTHING),
        ("mi_brdfs.gallery.gallery", ["gallery"], "Interrupted; nothing is finished, nothing was written."),
        ("mi_brdfs.explorer.materials.Materials.loaded", ["explore", "lambert"], NOTHING),
        ("mi_brdfs.explorer.server.serve", ["explore", "lambert", "--port", "0"], "Ended."),
        ("mi_brdfs.explorer.export.page", ["explore", "lambert", "--export", "it.html"], NOTHING),
        ("mi_brdfs.sweep.plan.checked", ["sweep", LOFT], NOTHING),
        ("mi_brdfs.sweep.plan.observe", ["sweep", LOFT, "--model", "ward", "--workers", "0"], RESUMED),
        ("mi_brdfs.sweep.plan.fit", ["sweep", LOFT, "--model", "ward", "--workers", "0"], RESUMED),
    ],
)
def test_ctrl_c_that_a_kernel_wraps_is_no_error(where, arguments, sentence, folder, monkeypatch):
    monkeypatch.setattr(where, interrupted_in_a_kernel)
    done = invoke(*arguments, cwd=folder / "scenes")
    assert (done.exit_code, done.stderr) == (130, f"{sentence}\n")
