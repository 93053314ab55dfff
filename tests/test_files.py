"""Files that the commands read and write: on disks that are full or cannot be written to, under names of any bytes."""

import csv
import errno
import json
import os
import re
import signal
import subprocess
import sys
import time
import warnings
from contextlib import contextmanager

import mitsuba as mi
import numpy as np
import pytest
from matplotlib.figure import Figure
from support import LOFT, ROOT
from test_cli import SCENE, command, invoke

import mi_brdfs
from mi_brdfs.cli import main, options
from mi_brdfs.loading import versioned
from mi_brdfs.mentioned import mentioned
from mi_brdfs.plot.command import write as write_figure
from mi_brdfs.rendering.output import write
from mi_brdfs.sweep import Sweep, plan, store

PAINT = ROOT / "scenes" / "measured" / "aeroglaze_z307.bsdf"
FITTED = "--model", "lambert", "--starts", "1"


# --- Ends ------------------------------------------------------------------------------------------------------------


def test_sigterm_leaves_nothing_of_a_file_that_is_written(tmp_path):
    """Also where `timeout` sends it, which does so twice."""
    process = subprocess.Popen(command("convert", "ward", "it.binary"), cwd=tmp_path, stderr=subprocess.PIPE)
    while not list(tmp_path.iterdir()):
        time.sleep(0.001)
    for _ in range(2):
        process.send_signal(signal.SIGTERM)
    assert (process.communicate()[1], process.returncode) == (b"", 143)
    assert not list(tmp_path.iterdir())


# --- Full disks -----------------------------------------------------------------------------------------------------


@contextmanager
def full_disk():
    """Files end after 100 bytes."""
    resource = pytest.importorskip("resource")
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (100, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


def curve():
    figure = Figure()
    figure.add_subplot().plot(np.random.default_rng(1).random(100))
    return figure


def noise(kind):
    return mi.Bitmap(np.random.default_rng(1).integers(0, 255, (9, 9, 3)).astype(kind))


@pytest.mark.parametrize(
    "name, write",
    [
        ("fits.json", lambda path: options.write_json(path, ["long"] * 100)),
        ("page.html", lambda path: options.write_text(path, "long" * 100)),
        # Smaller than the buffer that a file is written from.
        ("picture.exr", lambda path: write(noise(np.float32), path)),
        ("picture.png", lambda path: write(noise(np.uint8), path)),
        ("figure.pdf", lambda path: write_figure(curve(), path)),
    ],
)
def test_a_full_disk_leaves_what_was_there(name, write, tmp_path, capsys):
    (tmp_path / name).write_text("before")
    with pytest.raises(OSError if name == "figure.pdf" else (OSError, RuntimeError)), full_disk():
        write(tmp_path / name)
    assert [path.read_text() for path in tmp_path.iterdir()] == ["before"]


def test_a_link_stays_when_its_file_is_replaced(tmp_path):
    (tmp_path / "link.png").symlink_to(tmp_path / "picture.png")
    write(noise(np.uint8), tmp_path / "link.png")
    assert (tmp_path / "link.png").is_symlink()
    assert np.array_equal(mi.Bitmap(str(tmp_path / "picture.png")), noise(np.uint8))


LONG = "long" * 75
"""More letters than a file system takes."""


def ended(*words, **options):
    """How a command ends in a process, and what it says."""
    done = subprocess.run(command(*words), stderr=subprocess.PIPE, text=True, **options)
    return done.returncode, done.stderr


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="there is no /dev/full")
def test_a_full_disk_behind_the_standard_output_gets_a_sentence(tmp_path):
    """And files are written."""
    target = tmp_path / "x.json"
    with open("/dev/full", "w") as full:
        for words in ("--version",), ("measured", PAINT, "--json", target):
            told = "mi-brdfs: cannot write to the standard output: No space left on device\n"
            assert ended(*words, stdout=full) == (1, told)
    assert target.is_file()
    assert "mi-brdfs: cannot write /dev/full: No space" in invoke("plot", "ward", "-o", "/dev/full").stderr
    assert "-o /dev/full: write a .exr, .png, .jpg or" in invoke("show", "ward", "-o", "/dev/full").stderr


def test_files_are_written_also_if_nobody_reads_on(tmp_path):
    """As behind ``head``, which ends after some lines."""
    reading, writing = os.pipe()
    os.close(reading)
    assert ended("measured", PAINT, "--json", tmp_path / "x.json", stdout=writing) == (0, "")
    os.close(writing)
    assert (tmp_path / "x.json").is_file()


@pytest.mark.skipif(os.name == "nt", reason="Windows keeps a folder that a process works in")
def test_a_working_folder_that_is_gone_gets_a_sentence(tmp_path):
    told = "mi-brdfs: the working folder is gone; change to one that is there\n"
    assert ended("--version", cwd=tmp_path, preexec_fn=tmp_path.rmdir) == (1, told)


def test_letters_that_the_output_cannot_have_are_replaced():
    done = subprocess.run(command("info", "ward"), capture_output=True, env=os.environ | {"PYTHONIOENCODING": "ascii"})
    assert (done.returncode, done.stderr) == (0, b"") and b"?" in done.stdout


def swept(folder):
    return invoke("sweep", LOFT, *FITTED, "--workers", "0", "-o", folder)


@pytest.mark.usefixtures("llvm_rgb")
def test_a_sweep_tells_of_a_full_disk(tmp_path, monkeypatch):
    def write_table(table, file):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(store.parquet, "write_table", write_table)
    done = swept(tmp_path / "made")
    assert (done.exit_code, done.stdout, done.stderr.splitlines()) == (1, "", [
        f"mi-brdfs: cannot write to {tmp_path / 'made'}: No space left on device",
        "0 of 1 fits are finished; the same command tries the others again.",
    ])  # fmt: skip
    assert not list((tmp_path / "made" / "results").iterdir())


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="there are no pipes with names")
def test_results_that_are_no_files_are_left_out(tmp_path):
    os.mkfifo(tmp_path / "pipe.parquet")
    with pytest.warns(store.StoreWarning, match=r"pipe\.parquet holds no fits, and is left out: it is no regular file"):
        assert not list(store.Store(tmp_path).rows())


@pytest.mark.usefixtures("llvm_rgb")
def test_a_sweep_sees_that_its_folder_cannot_be_written_to_before_it_fits(tmp_path, monkeypatch):
    monkeypatch.setattr(plan, "fit_material", lambda *_: pytest.fail("it fits"))
    (tmp_path / "results").touch()
    done = swept(tmp_path)
    assert done.exit_code == 1 and f"mi-brdfs: cannot write to {tmp_path}: File exists\n" in done.stderr


# --- Files that are read ---------------------------------------------------------------------------------------------

WALL = """<scene version="3.0.0"><default name="tex" value="wall"/><include filename="parts/lamp.xml"/>
<shape type="sphere"><bsdf type="diffuse" id="wall"><texture type="bitmap" name="reflectance">
<string name="filename" value="$tex.png"/></texture></bsdf></shape></scene>"""
INLINE = '<texture type="bitmap"><string name="filename" value="wall.png"/></texture>'


@pytest.fixture
def room(tmp_path, monkeypatch):
    """Files of all kinds that commands read, of which none may change."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "parts").mkdir()
    names = "m.csv m.json m.html m.png m.xml wall.png coat.png shot-polar.png wall_log.jpg parts/sky.exr"
    for name in names.split():
        (tmp_path / name).write_text(name)
    (tmp_path / "room.xml").write_text(WALL)
    (tmp_path / "shot.xml").write_text(WALL.replace("$tex", "shot-polar"))
    (tmp_path / "old.xml").write_text(WALL.replace("3.0.0", "0.6.0"))
    (tmp_path / "parts" / "lamp.xml").write_text(
        "<scene version='3.0.0'><emitter><s value='sky.exr'/></emitter></scene>"
    )
    (tmp_path / "parts" / "link.json").symlink_to(tmp_path / "m.json")
    os.link(tmp_path / "m.json", tmp_path / "hard.json")
    (tmp_path / "guest.py").write_text("import mi_brdfs\nclass Guest(mi_brdfs.Model):\n    'Dull.'\n")
    files = {file: file.read_bytes() for file in tmp_path.rglob("*") if file.is_file()}
    yield tmp_path
    assert files == {file: file.read_bytes() for file in tmp_path.rglob("*") if file.is_file()}


@pytest.mark.parametrize(
    "line",
    [
        "measured m.json --json m.json", "measured m.html ./m.json --json parts/../m.json",
        "measured m.json --json parts/link.json", "measured parts/link.json --json hard.json",
        "measured m.png --plot m.png", "fit m.json --json m.json", "fit m.html -o m.html", "plot m.png -o m.png",
        "plot shot.xml", "plot m.png:quantity=f -o m.png", "plot room.xml:wall -o wall.png",
        "plot room.xml:wall:tex=coat -o coat.png", "plot ward:alpha=wall.png -o wall.png",
        "plot ward -D alpha=wall.png,coat.png -o coat.png", f"plot {INLINE.replace(' ', '@')} -o wall.png",
        "explore m.html --export m.html", "explore --environment m.html --export m.html",
        "explore --mesh m.html --export m.html",
        "check room.xml --junit room.xml", "check room.xml --junit parts/lamp.xml",
        "check ward --against room.xml --junit room.xml", "bench m.json --json m.json", "convert m.csv m.csv",
        "convert room.xml:wall room.xml", "render room.xml -o wall.exr", "render room.xml -Dtex=coat -o coat.png",
        "render room.xml -o parts/sky.exr", "render m.xml --replace wall=room.xml:wall -o wall.png",
        "show room.xml:wall -o wall.png", "sweep wall_log.jpg --model lambert --render -o .",
        "upgrade old.xml -o old.xml", "upgrade old.xml -o parts/lamp.xml",
    ],
)  # fmt: skip
def test_no_command_writes_over_what_it_reads(line, room):
    done = invoke(*(word.replace("@", " ") for word in line.split()))
    assert done.exit_code == 2 and done.stdout == "", done.output
    assert re.search(r"^mi-brdfs: \S+ \S+: the command reads this file( as \S+)?; write to another one$", done.stderr)


@pytest.mark.parametrize(
    "line", ["check ward --json l.json --junit l.xml", "fit m.csv --json l.json -o ./l.xml", "show ward -o l.png"]
)
def test_no_two_outputs_are_one_file(line, room):
    for name in ("l.png", "l.exr", "l.json", "l.xml"):
        (room / name).symlink_to("both.png")
    done = invoke(*line.split())
    assert done.exit_code == 2 and re.search("is the same file; give each its own", done.stderr), done.output


@pytest.mark.usefixtures("llvm_rgb")
def test_what_names_no_file_and_what_is_none_is_written(tmp_path, monkeypatch):
    """Titles, what swallows all, and plugins."""
    monkeypatch.chdir(tmp_path)
    for _ in range(2):
        words = "plot", "lambert", "--kind", "albedo", "--title", "a.png", "--labels", "a.png", "-o", "a.png"
        assert invoke(*words).exit_code == 0
    for file in (os.devnull, os.devnull, "lambert.json", "lambert.json"):
        words = "check", "lambert", "--only", "finite", "--json", file
        done = invoke(*words, *(["--junit", file] if file == os.devnull else []))
        assert done.exit_code == 0, done.stderr


@pytest.mark.usefixtures("llvm_rgb")
def test_folders_of_results_keep_what_is_no_result(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    fitted, drawn, refused = (
        f"fit {LOFT} --model lambert --save .",
        "gallery lambert -o .",
        "is there, and no such result",
    )
    for name, line, sentence in (
        (f"{LOFT.stem}-lambert.xml", fitted, refused), ("index.html", drawn, refused),
        ("lambert.png", drawn, "it has other pictures"),
    ):  # fmt: skip
        (tmp_path / name).write_text("mine")
        done = invoke(*line.split())
        assert done.exit_code == 2 and sentence in done.stderr
        assert (tmp_path / name).read_text() == "mine"
        (tmp_path / name).unlink()


@pytest.mark.parametrize("line", [
    "measured --json m.csv m.csv", "fit --json m.csv", "bench --json m.csv lambert", "check --json m.xml lambert",
    "check --junit m.csv lambert", "check --html m.csv lambert", "explore --export m.csv m.csv",
    "upgrade -o m.csv old.xml",
])  # fmt: skip
def test_a_name_that_was_forgotten_costs_no_file(line, room):
    done = invoke(*line.split())
    assert done.exit_code == 2 and re.fullmatch(r"mi-brdfs: \S+ m\.\w+: write a \.[^\n]+\n", done.stderr), done.stderr


@pytest.mark.parametrize(
    ("before", "encoding"), [("", "utf-16"), ("", "utf-16-be"), ("", "utf-32"), ("\n" * 120, "utf-8")]
)
def test_scenes_are_read_in_all_encodings_before_pictures_take_places(before, encoding, room):
    scene = room / "coded.xml"
    scene.write_bytes((before + WALL).encode(encoding))
    done = invoke("render", "coded.xml", "-o", "wall.png")
    scene.unlink()
    assert done.exit_code == 2 and "the command reads this file" in done.stderr


def test_comments_and_defaults_name_no_file(room):
    """A command may be given again that wrote what they name."""
    scene = room / "shot.xml"
    scene.write_text(
        f'<!-- render -o="m.png" -->{WALL}'.replace("<include", '<default name="out" value="m.png"/><include')
    )
    assert str(room / "m.png") not in map(os.path.realpath, mentioned([str(scene)]).values())
    assert str(room / "wall.png") in map(os.path.realpath, mentioned([str(scene)]).values())
    scene.write_text(WALL.replace("$tex", "shot-polar"))


def test_what_stands_beside_a_scene_is_not_looked_for_elsewhere(tmp_path, monkeypatch):
    """So the same command, from another folder, may be given again; what only JSON names is in the working folder."""
    scene = tmp_path / "scene" / "wall.xml"
    scene.parent.mkdir()
    scene.write_text('<scene version="3.0.0"><string name="filename" value="wood.png"/></scene>')
    (tmp_path / "scene" / "fit.json").write_text('{"filename": "wood.png"}')
    for path in (tmp_path / "wood.png", tmp_path / "scene" / "wood.png"):
        path.write_bytes(b"")
    monkeypatch.chdir(tmp_path)
    found = [set(map(os.path.realpath, mentioned([name]).values())) for name in ("scene/wall.xml", "scene/fit.json")]
    assert [str(tmp_path / "wood.png") in it for it in found] == [False, True]
    assert all(str(tmp_path / "scene" / "wood.png") in it for it in found)


@pytest.mark.parametrize("text", ["<!--" * 100_000, "<default " * 50_000])
def test_what_is_never_closed_takes_no_time(text, tmp_path):
    (tmp_path / "open.xml").write_text(f'<scene version="3.0.0">{text}')
    start = time.process_time()
    with pytest.raises((ValueError, RuntimeError)):
        mi_brdfs.load_legacy(tmp_path / "open.xml")
    assert versioned("<!-- a -->" * 40) == "<!-- a -->" * 40
    assert time.process_time() - start < 10


def test_files_of_the_folder_of_merl_are_kept(room, monkeypatch):
    monkeypatch.setenv("MI_BRDFS_MERL_DIR", str(room / "parts"))
    done = invoke("convert", "merl:filename=sky.exr", "parts/sky.exr")
    assert done.exit_code == 2 and "the command reads this file" in done.stderr


def test_scenes_that_include_each_other_take_little_time(tmp_path):
    """A third of a second, not five as when each of their parameters was looked for."""
    names = [f"scene{k}.xml" for k in range(60)]
    for k, name in enumerate(names):
        others = (
            f'<default name="p{k}_{j}" value="{it}"/><include filename="$p{k}_{j}"/>' for j, it in enumerate(names)
        )
        (tmp_path / name).write_text(f'<scene version="3.0.0">{"".join(others)}</scene>')
    start = time.process_time()
    assert len(mentioned([str(tmp_path / names[0])])) == 60
    assert time.process_time() - start < 2


@pytest.mark.parametrize("include", ['<include filename="first.xml"/>',
                                     '<default name="x" value="pipe"/><include filename="$x"/>'])  # fmt: skip
def test_pipes_are_refused_wherever_they_are_named(include, tmp_path):
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "first.xml").write_text('<scene version="3.0.0"><include filename="pipe"/></scene>')
    (tmp_path / "scene.xml").write_text(f'<scene version="3.0.0">{include}</scene>')
    with pytest.raises(ValueError, match="pipe: it is a pipe or a device; name a file"):
        mi_brdfs.load_legacy(tmp_path / "scene.xml")
    with pytest.raises(ValueError, match="it is a pipe or a device"):
        mi_brdfs.load_legacy("/dev/zero")


def test_a_model_that_ends_the_process_ends_no_command_well(tmp_path, as_before):
    (tmp_path / "leaver.py").write_text("import sys\nimport mi_brdfs\nclass Leaver(mi_brdfs.Model):\n    'Leaves.'\n"
                                        "    def lobes(self, p):\n        sys.exit(0)\n")  # fmt: skip
    done = invoke("check", "leaver", "--only", "finite", "--import", tmp_path / "leaver.py")
    assert done.exit_code != 0, done.output


# --- Names that are not UTF-8 ---------------------------------------------------------------------------------------

BAD = os.fsdecode(b"coat\xff")
COLUMNS = "theta_i_deg,theta_o_deg,delta_phi_deg,f\n"
GRID = [f"{i},{o},{d},{0.2 + i / 900}\n" for i in (0, 40, 80) for o in (0, 40, 80) for d in (0, 90, 180)]
REFUSED = r"Mitsuba takes only names in UTF-8; rename \S*coat�"


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A folder with files of such names, and the working directory."""
    monkeypatch.chdir(tmp_path)
    try:
        (tmp_path / f"{BAD}.csv").write_text(COLUMNS + "".join(GRID))  # its material has the file's name
    except (OSError, UnicodeEncodeError):
        pytest.skip("the file system has only names in UTF-8")
    for name in (BAD, "scene"):
        (tmp_path / f"{name}.xml").write_text(SCENE.replace("triangle.obj", str(tmp_path / "triangle.obj")))
    (tmp_path / "triangle.obj").write_text("v -1 -1 0\nv 1 -1 0\nv 0 1 0\nf 1 2 3\n")
    return tmp_path


@pytest.fixture
def called(monkeypatch, capfdbinary):
    """Run the command, and return its exit status, its output in bytes, and its messages. Pictures are small."""
    for name, value in ("fit.appearance.SIZE", 48), ("fit.appearance.SAMPLES", 4), ("sweep.wall.SIZE", 16):
        monkeypatch.setattr(f"mi_brdfs.{name}", value)

    def called(*words):
        monkeypatch.setattr(sys, "argv", ["mi-brdfs", *words])
        monkeypatch.setattr(warnings, "formatwarning", warnings.formatwarning)
        with pytest.raises(SystemExit) as ended:
            main()
        out, err = capfdbinary.readouterr()
        return ended.value.code or 0, out, err.decode()

    return called


def slow(*values):
    return pytest.param(*values, marks=pytest.mark.slow)


@pytest.mark.usefixtures("llvm_rgb")
@pytest.mark.parametrize("words", [("list", "--import", LONG + ".py"), ("plot", "ward", "-o", LONG + ".png")])
def test_a_name_that_is_too_long_gets_a_sentence(called, words):
    assert called(*words) == (1, b"", f"mi-brdfs: {words[-1]}: File name too long\n")


@pytest.mark.usefixtures("llvm_rgb")
@pytest.mark.parametrize(
    "words, status, sentence",
    [
        slow(["measured", f"{BAD}.csv", "--plot", f"{BAD}.png", "--json", f"{BAD}.json"], 0, ""),
        (["check", f"{BAD}.csv", "--only", "finite"], 0, ""),
        (["check", f"{BAD}.xml", "--only", "finite"], 2, REFUSED),
        slow(["convert", f"{BAD}.csv", f"{BAD}.bsdf"], 0, ""),
        (["render", f"{BAD}.xml", "--spp", "1"], 1, REFUSED),
        (["render", "scene.xml", "--spp", "1", "-o", f"{BAD}.exr"], 0, "1 samples per pixel"),
        slow(["fit", f"{BAD}.csv", *FITTED, "--json", f"{BAD}.json", "-o", f"{BAD}.html"], 0, ""),
        (["sweep", "gone\udcff.csv"], 1, "gone�.csv: No such file"),
    ],
)
def test_names_that_are_not_utf_8_work_or_get_a_sentence(words, status, sentence, folder, called):
    found, out, err = called(*words)
    assert found == status, err
    assert re.search(sentence, err) and "Traceback" not in err and "nanobind" not in err
    for name in words:
        path = folder / name
        assert status or BAD not in name or path.exists()
        if path.suffix in (".json", ".html") and path.exists():
            text = path.read_text(encoding="utf-8")
            assert "coat" not in text or re.search(r"coat(\\udcff|\\ufffd|�)", text)
    if words[0] == "render" and not status:
        assert b"coat\xff" in out


@pytest.mark.slow
@pytest.mark.usefixtures("llvm_rgb")
def test_a_sweep_keeps_and_prints_such_names(folder, called):
    for _ in range(2):  # fitted, and from the store
        words = "sweep", f"{BAD}.csv", *FITTED, "-o", BAD, "--workers", "0", "--table", "csv", "--render"
        status, out, err = called(*words)
        assert "Traceback" not in err and "nanobind" not in err
        (row,) = csv.DictReader(os.fsdecode(out).splitlines())
        assert (status, row["file"], row["model"]) == (0, f"{BAD}.csv", "lambert")
    (kept,) = Sweep([f"{BAD}.csv"], ["lambert"], BAD, starts=1).store.rows(["file"])
    assert kept == {"file": r"coat\udcff.csv"}
    assert json.loads(row["bsdf"])["type"] == "lambert"
