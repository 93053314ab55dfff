"""``mi-brdfs fit``, as a user types it."""

import json
import re

import drjit as dr
import mitsuba as mi
import pytest
from support import ROOT
from test_cli import interrupted, run

from mi_brdfs.mitsuba.errors import unwrapped_ctrl_c

LOFT = ROOT / "scenes" / "measured" / "AnoBlackEC1onAlum.bsdf"


def test_ranks_models_and_writes_rows(tmp_path):
    (tmp_path / "cut.bsdf").write_bytes(LOFT.read_bytes()[:3000])
    done = run("fit", LOFT, "cut.bsdf", "--model", "ward,lambert", "--starts", 2, "--json", "fits.json", cwd=tmp_path)
    assert done.returncode == 1 and "cut.bsdf" in done.stderr and "Traceback" not in done.stderr
    rows = [line.split()[0] for line in done.stdout.splitlines() if re.match(r"(ward|lambert) +0", line)]
    assert rows == ["ward", "lambert"]
    assert "(E2 of Löw et al. 2012), up to 80°; 359 pairs" in done.stdout and '<bsdf type="ward">' in done.stdout
    fits = json.loads((tmp_path / "fits.json").read_text(encoding="utf-8"))
    assert [row["model"] for row in fits] == ["ward", "lambert"]
    for row in fits:
        assert row["file"] == str(LOFT) and row["metric"] == "log"
        assert row["errors"]["log"]["held_out"] > 0 and row["sigma"] and row["starts"]["tried"] == 2
        with mi.variant_context("scalar_rgb"):
            mi.load_dict(row["bsdf"])


def test_a_guest_is_fitted(tmp_path):
    guest = ROOT / "tests" / "guest" / "mi_brdfs_guest.py"
    done = run("fit", LOFT, "--import", guest, "--model", "regolith", "--starts", 1, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert '<bsdf type="regolith">' in done.stdout


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (("--model", "wart"), "There is no model 'wart'; did you mean 'ward'?"),
        (("--metric", "loglog"), "There is no metric 'loglog'; did you mean 'log'?"),
        (("--variant", "scalar_rgb"), "this needs a vectorized and unpolarized variant, not scalar_rgb"),
        (("--json", "nowhere/x.json"), "--json nowhere/x.json: there is no folder nowhere"),
    ],
)
def test_wrong_usage_gets_a_sentence(arguments, sentence, tmp_path):
    done = run("fit", LOFT, *arguments, cwd=tmp_path)
    assert done.returncode == 2 and done.stdout == ""
    assert sentence in done.stderr and len(done.stderr.splitlines()) == 1


def test_more_starts_than_candidates_are_all_candidates(tmp_path):
    done = run("fit", LOFT, "--model", "lambert", "--starts", 3000, "--json", "fits.json", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    (row,) = json.loads((tmp_path / "fits.json").read_text())
    assert 400 > row["starts"]["tried"] > 100


@pytest.mark.usefixtures("llvm_rgb")
def test_ctrl_c_that_a_kernel_wraps_is_no_failure():
    """Dr.Jit makes a RuntimeError of all that Python functions raise while it records them."""

    def record(error):
        def body(i):
            raise error

        dr.while_loop((mi.UInt(0),), lambda i: i < 3, body)

    with pytest.raises(KeyboardInterrupt), unwrapped_ctrl_c():
        record(KeyboardInterrupt())
    with pytest.raises(RuntimeError, match="while_loop"), unwrapped_ctrl_c():
        record(ValueError("other"))


@pytest.mark.usefixtures("ctrl_c")
def test_ctrl_c_keeps_what_is_finished(tmp_path):
    models = "lambert,burley,ashikhminshirley,brady,cooktorrance,kurt,low,nishino,schlick,walter"
    options = "--model", models, "--starts", 400, "--json", "fits.json", "-o", "fits.html"
    status, out, err = interrupted(tmp_path, "fit", LOFT, *options, running="Fitting burley")
    said = re.search(r"Interrupted; (\d) of 10 fits were finished\.", err)
    assert status == 130 and said and "Traceback" not in err, err
    fitted = [row["model"] for row in json.loads((tmp_path / "fits.json").read_text())]
    assert "lambert" in fitted and len(fitted) == int(said[1]) and all(name in out for name in fitted)
    assert said[0] in (tmp_path / "fits.html").read_text(encoding="utf-8")
