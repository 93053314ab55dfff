"""Sweeps: the same results however they are made, and none is made twice or lost."""

import csv
import json
import os
import re
import sys

import drjit as dr
import mitsuba as mi
import numpy as np
import psutil
import pyarrow as pa
import pytest
from pyarrow import parquet
from support import ROOT
from test_cli import interrupted, invoke

import mi_brdfs
from mi_brdfs.fit import METRICS, fit, observe
from mi_brdfs.mitsuba import guests
from mi_brdfs.mitsuba.registry import find_model
from mi_brdfs.models.lambert import Lambert
from mi_brdfs.sweep import Store, StoreWarning, Sweep, medians, plan, wall
from mi_brdfs.sweep.store import SCHEMA

LOFT = [ROOT / "scenes" / "measured" / f"AnoBlack{name}.bsdf" for name in ("EC1onAlum", "EC2onAlum", "NiTEonINVAR")]
MODELS, METRIC = ["lambert", "phong"], ["log", "cube-root"]


def swept(folder, files=LOFT[:2], models=MODELS, metrics=METRIC, **settings):
    return Sweep(files, models, folder, metrics=metrics, **{"starts": 1} | settings)


def fitted(sweep, *where):
    """The number of fits that were made."""
    outcomes = list(sweep.fit(*where))
    assert not any(outcome.error for outcome in outcomes)
    return sum(outcome.size for outcome in outcomes)


def results(folder):
    """All rows of a folder by key, without what differs from run to run."""
    rows = list(Store(folder / "results").rows())
    assert len({row["key"] for row in rows}) == len(rows)  # no duplicates
    return {row["key"]: {name: row[name] for name in row if name != "seconds"} for row in rows}


@pytest.fixture(scope="module")
def serial(tmp_path_factory):
    """A folder with all fits, made in this process."""
    folder = tmp_path_factory.mktemp("serial")
    with mi.variant_context("llvm_ad_rgb"):
        assert fitted(swept(folder)) == 8
    return folder


# --- The same results, each once ------------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.usefixtures("llvm_rgb")
def test_a_killed_worker_costs_nothing_but_time(serial, tmp_path):
    """The results of two workers, of which one is killed, are those of this process, bit for bit."""
    sweep = swept(tmp_path)
    outcomes = sweep.fit(2)
    sizes = [next(outcomes).size]
    workers = [it for it in psutil.Process().children(recursive=True) if "dask_worker" in " ".join(it.cmdline())]
    assert len(workers) == 2
    workers[0].kill()
    sizes += [outcome.size for outcome in outcomes if not outcome.error]
    assert sum(sizes) == sweep.finished() == sweep.total == 8
    assert results(tmp_path) == results(serial)


@pytest.mark.usefixtures("llvm_rgb")
def test_extras_that_are_not_installed(tmp_path, monkeypatch):
    """Without Dask one process fits; what is asked for and cannot be had is named."""
    monkeypatch.setitem(sys.modules, "distributed", None)
    words = "sweep", LOFT[0], "--model", "lambert", "--starts", 1, "-o", tmp_path / "sweep"
    done = invoke(*words)
    assert done.exit_code == 0 and "lambert" in done.stdout, done.stderr
    assert 'one process fits; pip install "mi_brdfs[cluster]"' in done.stderr
    monkeypatch.delitem(sys.modules, "mi_brdfs.gallery")
    monkeypatch.delattr("mi_brdfs.gallery")
    monkeypatch.setitem(sys.modules, "PIL", None)
    for option, extra in ("--workers=2", "cluster"), ("--render", "gallery"):
        done = invoke(*words, option)
        assert done.exit_code == 1 and f"mi_brdfs[{extra}]" in done.stderr and done.stderr.count("\n") == 1


@pytest.mark.usefixtures("llvm_rgb")
def test_what_is_finished_is_not_made_again(serial, tmp_path, monkeypatch):
    calls = []

    def counted(model, jobs, starts):
        calls.extend((model, metric, seed) for _, metric, seed in jobs)
        return made(model, jobs, starts)

    made = plan.fit_material
    monkeypatch.setattr(plan, "fit_material", counted)
    assert fitted(swept(serial)) == 0 and not calls
    assert fitted(swept(serial, LOFT[1::-1], MODELS[::-1], METRIC[::-1])) == 0 and not calls

    files = [tmp_path / "a.bsdf", tmp_path / "b.bsdf"]
    for file, own in zip(files, LOFT, strict=False):
        file.write_bytes(own.read_bytes())
    (own,) = {row["file"] for row in swept(serial, files[:1]).rows()}  # known by its content
    assert own == str(files[0])
    folder, one = tmp_path / "made", {"models": ["lambert"], "metrics": ["log", "log"]}
    assert fitted(swept(folder, files, **one)) == 2
    assert fitted(swept(folder, files, ["lambert"], ["log", "l2"])) == 2 and calls[-1] == ("lambert", "l2", 0)
    assert fitted(swept(folder, files[:1], **one, seeds=[0, 1])) == 1 and calls[-1] == ("lambert", "log", 1)
    assert fitted(swept(folder, files[:1], **one, starts=2)) == 1
    files[0].write_bytes(LOFT[2].read_bytes())
    assert fitted(swept(folder, files, **one)) == 1
    monkeypatch.setattr(plan, "__version__", "0.0.1")
    assert fitted(swept(folder, files, **one)) == 2


@pytest.mark.usefixtures("llvm_rgb")
def test_a_fit_does_not_depend_on_those_beside_it(serial, tmp_path):
    fitted(swept(tmp_path, LOFT[1:2], ["phong"], ["cube-root"]))
    ((key, row),) = results(tmp_path).items()
    assert row == results(serial)[key]


@pytest.mark.usefixtures("llvm_rgb")
def test_a_fit_compiles_two_kernels():
    """Values, and values with derivatives: neither the number of lanes nor the addresses of NumPy's arrays matter, so
    that the memory of a process that makes many fits stays as it is."""
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
        dr.kernel_history_clear()
        fit(observe(LOFT[0]), "phong", starts=4)
        kernels = [each for each in dr.kernel_history() if each["type"] == dr.KernelType.JIT]
    assert len(kernels) > 20 and len({each["hash"] for each in kernels}) == 2


GUEST = '''
from mi_brdfs.models.lambert import Lambert

class Grey(Lambert):
    """Grey."""
    plugins = ("grey",)
'''


def test_a_guest_is_known_by_its_source(tmp_path, as_before):
    found = []
    (tmp_path / "grey_parts").mkdir()
    for text, shade, tint in ((GUEST, 1, 1), (GUEST + "# edited", 1, 1), (GUEST, 1, 1), (GUEST, 0.5, 1), (GUEST, 1, 2)):
        (tmp_path / "grey_guest.py").write_text(f"import grey_shades, grey_parts.tints\n{text}", encoding="utf-8")
        (tmp_path / "grey_shades.py").write_text(f"SHADE = {shade}  # beside it", encoding="utf-8")
        (tmp_path / "grey_parts" / "tints.py").write_text(f"TINT = {tint}  # below it", encoding="utf-8")
        guests.import_models(str(tmp_path / "grey_guest.py"))
        found.append(plan.versions(find_model("grey")))
    assert found[0] == found[2] and len({*found}) == 4


def test_own_models_are_known_by_their_version_where_they_are_installed_and_else_by_their_sources(
    tmp_path, monkeypatch
):
    ward, version = find_model("ward"), f"mi_brdfs {plan.__version__}, Mitsuba {mi.__version__}"
    found = []
    for folder in ("first", "second"):
        monkeypatch.setattr(plan, "OWN", tmp_path / folder)
        plan.OWN.mkdir()
        (plan.OWN / "lobe.py").write_text(folder)
        found.append(plan.versions(ward))
    assert len({*found}) == 2 and all(it.startswith(f"{version}, sources ") for it in found)
    monkeypatch.setattr("site.getsitepackages", lambda: [str(tmp_path)])
    assert plan.versions(ward) == version


@pytest.mark.usefixtures("llvm_rgb", "as_before")
def test_a_guest_is_of_a_file_and_for_workers_of_a_module(tmp_path):
    """Which a notebook's is not, and one of a function, as here, or of the script that runs."""
    for where, told in (("nowhere", "no file"), (__name__, "the script that runs")):
        members = {"__doc__": "A guest.", "__module__": where, "plugins": ("guest",)}
        mi_brdfs.register(type("Guest", (Lambert,), members), replace=True)
        with pytest.raises(ValueError, match=f"guest is defined in {told}"):
            next(swept(tmp_path, models=["guest"]).fit(workers=1))


# --- Files ----------------------------------------------------------------------------------------------------------


@pytest.mark.usefixtures("llvm_rgb")
def test_files_that_hold_no_fits_are_told_and_made_anew(tmp_path):
    sweep = swept(tmp_path, LOFT[:1])
    fitted(sweep)
    first, second = sorted((tmp_path / "results").glob("*.parquet"))
    first.write_bytes(first.read_bytes()[:-100])
    parquet.write_table(pa.table({"x": [1]}), tmp_path / "results" / "foreign.parquet")
    with pytest.warns(StoreWarning) as told:
        assert sweep.finished() == 2
    assert len(told) == 2 and "foreign.parquet holds no fits, and is left out: it has no column" in str(told[0].message)
    with pytest.warns(StoreWarning):
        assert fitted(sweep) == 2 and sweep.finished() == 4
    assert {path.name for path in (tmp_path / "results").iterdir()} == {first.name, second.name, "foreign.parquet"}
    kept = parquet.read_table(first)
    for name, value, told in (
        ("bsdf", "[1", "Expecting"),
        ("bsdf", None, "the JSON object must be"),
        ("albedo", "high", "Failed to parse string: 'high'"),
    ):
        damaged = pa.array([value] * len(kept), pa.string())
        parquet.write_table(kept.set_column(kept.schema.get_field_index(name), name, damaged), first)
        with pytest.warns(StoreWarning, match=f"holds no fits, and is left out: {told}"):
            assert len(list(Store(tmp_path / "results").rows())) == 2


@pytest.mark.usefixtures("llvm_rgb")
def test_results_of_what_a_file_became_are_not_kept_as_those_of_what_it_was(serial, tmp_path, monkeypatch):
    """Its size and its time are as before."""
    file = tmp_path / "a.bsdf"
    file.write_bytes(LOFT[0].read_bytes())
    sweep, pictures = swept(tmp_path, [file]), wall.Wall(swept(serial, [file]))
    pictures.folder = tmp_path
    before = file.stat()
    file.write_bytes(LOFT[1].read_bytes())
    os.utime(file, ns=(before.st_atime_ns, before.st_mtime_ns))
    assert file.stat().st_size == before.st_size
    sentence = f"{file} has changed since the sweep began; give the same command again."
    assert {outcome.error for outcome in sweep.fit()} == {sentence} and sweep.finished() == 0
    monkeypatch.setattr(wall, "SIZE", 32)
    monkeypatch.setattr(wall, "SPP", 4)
    measured = pictures.cells["log"][next(iter(sweep.files))][0]
    pictures.cells = {"log": {"": [measured]}}
    assert [outcome.error for outcome in pictures.render()] == [sentence] and pictures.finished() == 0


# --- Tables and pictures --------------------------------------------------------------------------------------------


def made_up(model, metric, content, held_out, seed=0):
    errors = {f"{name}_{part}": None for name in METRICS for part in ("fitted", "held_out")}
    own = {f"{metric}_held_out": held_out, f"{metric}_fitted": None if held_out is None else held_out / 2}
    return {"model": model, "metric": metric, "content": content, "seed": seed, **errors, **own}


def test_medians():
    errors = {"ward": [0.1, 0.2, 0.9], "walter": [0.2, 0.1, 0.3], "phong": [0.3, None, 0.8]}
    rows = [made_up(model, "log", k, error) for model, own in errors.items() for k, error in enumerate(own)]
    rows.append(made_up("phong", "l2", 0, 4.0))
    table = [[cell.strip() for cell in line.split("|")[1:-1]] for line in medians(rows).splitlines()]
    assert table[0] == ["metric", "model", "held out", "fitted", "rank", "best in", "files"]
    assert set("".join(table[1])) == {"-", ":"}
    assert table[2:] == [
        ["log", "walter", "0.2", "0.1", "1.3", "2", "3"],
        ["log", "ward", "0.2", "0.1", "2.0", "1", "3"],
        ["log", "phong", "0.55", "0.275", "2.5", "0", "2"],
        ["l2", "phong", "4", "2", "1.0", "1", "1"],
    ]


@pytest.mark.usefixtures("llvm_rgb")
def test_a_wall_is_rendered_once(serial, monkeypatch):
    monkeypatch.setattr(wall, "SIZE", 32)
    monkeypatch.setattr(wall, "SPP", 4)
    sweep = swept(serial, LOFT[:1])
    first = wall.Wall(sweep)
    outcomes = list(first.render())
    assert len(outcomes) == 1 + 4 and not any(outcome.error for outcome in outcomes)
    again = wall.Wall(sweep)
    assert again.finished() == again.total == 5 and not list(again.render())
    assert [path.name for path in again.write()] == ["wall_log.jpg", "wall_cube-root.jpg"]
    picture = np.array(mi.Bitmap(str(serial / "wall_log.jpg"))).astype(float)
    assert picture.shape[0] > 32 and picture.shape[1] > 3 * 32
    assert 0.1 < (abs(picture - picture[0, 0]).max(axis=-1) > 20).mean() < 0.9  # pictures on paper
    (row, *_) = again.cells["log"].values()
    assert [cell.caption.split("\n")[0] for cell in row] == ["measured", "phong", "lambert"]
    assert "best" in row[1].caption and "best" not in row[2].caption


# --- The command ----------------------------------------------------------------------------------------------------


@pytest.mark.usefixtures("llvm_rgb")
def test_the_command_prints_a_table(serial, tmp_path):
    cut = tmp_path / "cut.bsdf"
    cut.write_bytes(LOFT[0].read_bytes()[:3000])
    options = "--model", "lambert,phong", "--metric", "log,cube-root", "--starts", 1, "--table", "csv"
    done = invoke("sweep", *LOFT[:2], cut, *options, "--workers", 0, "-o", "made", cwd=tmp_path)
    assert done.exit_code == 1 and "Traceback" not in done.stderr
    assert done.stderr.count("cut.bsdf") == 1  # for all models
    assert "8 of 12 fits are finished; the same command tries the others again." in done.stderr
    rows = list(csv.DictReader(done.stdout.splitlines()))
    assert list(rows[0]) == SCHEMA.names and len(rows) == 8
    made = results(serial)
    for row in rows:
        known = made[row["key"]]
        assert json.loads(row["bsdf"]) == json.loads(known["bsdf"])
        assert float(row["log_held_out"]) == known["log_held_out"]


@pytest.mark.slow
@pytest.mark.usefixtures("ctrl_c")
def test_ctrl_c_keeps_what_is_finished(tmp_path):
    options = "--model", "lambert,burley", "--metric", ",".join(METRICS), "--starts", 100, "--workers", 2, "-o", "made"
    status, out, err = interrupted(tmp_path, "sweep", *LOFT, *options, running=r"[1-9]/36")
    finished = re.search(r"Interrupted; (\d+) of 36 fits are finished: the same command goes on from there\.", err)
    assert status == 130 and finished and "Traceback" not in err
    assert 0 < len(results(tmp_path / "made")) == int(finished[1]) < 36
    assert "| log " in out
    assert not [it for it in psutil.process_iter(["cmdline"]) if str(tmp_path) in " ".join(it.info["cmdline"] or [])]
