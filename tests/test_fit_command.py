"""``mi-brdfs fit``, as a user types it."""

import json
import re

import drjit as dr
import mitsuba as mi
import pytest
from support import LOFT, ROOT
from test_cli import interrupted, invoke

from mi_brdfs.mitsuba.errors import unwrapped_ctrl_c
from mi_brdfs.starting import Terminated


@pytest.mark.usefixtures("llvm_rgb", "as_before")
def test_ranks_models_and_writes_rows(tmp_path):
    """Also those of a guest; and what cannot be read is told."""
    (tmp_path / "cut.bsdf").write_bytes(LOFT.read_bytes()[:3000])
    guest = ROOT / "tests" / "guest" / "mi_brdfs_guest.py"
    options = "--import", guest, "--model", "regolith,ward,lambert", "--starts", 2, "--json", "fits.json"
    done = invoke("fit", LOFT, "cut.bsdf", *options, cwd=tmp_path)
    assert done.exit_code == 1 and "cut.bsdf" in done.stderr
    rows = [line.split()[0] for line in done.stdout.splitlines() if re.match(r"(ward|lambert|regolith) +0", line)]
    assert rows[0] == "ward" and sorted(rows) == ["lambert", "regolith", "ward"]
    assert "(E2 of Löw et al. 2012), up to 80°; 359 pairs" in done.stdout and '<bsdf type="ward">' in done.stdout
    fits = json.loads((tmp_path / "fits.json").read_text(encoding="utf-8"))
    assert [row["model"] for row in fits] == rows
    for row in fits:
        assert row["file"] == str(LOFT) and row["metric"] == "log"
        assert row["errors"]["log"]["held_out"] > 0 and row["sigma"] and row["starts"]["tried"] == 2
        if row["model"] != "regolith":
            with mi.variant_context("scalar_rgb"):
                mi.load_dict(row["bsdf"])


@pytest.mark.usefixtures("llvm_rgb")
def test_fits_are_files_that_scenes_include(tmp_path):
    """The best, and each in a folder; values at a limit are the limit itself."""
    options = "--model", "walter,lambert", "--starts", 2, "-o", "best.xml", "--save", "all", "--json", "fit.json"
    done = invoke("fit", LOFT, *options, cwd=tmp_path)
    assert done.exit_code == 0, done.stderr
    assert sorted(it.name for it in (tmp_path / "all").iterdir()) == [
        f"{LOFT.stem}-{it}.xml" for it in ("lambert", "walter")
    ]
    best, *_ = json.loads((tmp_path / "fit.json").read_text(encoding="utf-8"))
    assert best["bounds"] == ["specular_reflectance"] and best["bsdf"]["specular_reflectance"] == 1
    assert re.search(r"^specular_reflectance +1 +at its limit$", done.stdout, re.MULTILINE)
    (tmp_path / "scene.xml").write_text(
        '<scene version="3.0.0"><include filename="best.xml"/>'
        f'<shape type="sphere"><ref id="{LOFT.stem}"/></shape></scene>'
    )
    included = mi.load_file(str(tmp_path / "scene.xml")).shapes()[0].bsdf()
    for it in included, mi.load_file(str(tmp_path / "all" / f"{LOFT.stem}-walter.xml")):
        assert str(it) == str(mi.load_dict(best["bsdf"]))


@pytest.mark.usefixtures("llvm_rgb")
def test_earlier_fits_stay_where_nothing_is_fitted(tmp_path):
    (tmp_path / "fits.json").write_text("before")
    (tmp_path / "bad.bsdf").touch()
    done = invoke("fit", "bad.bsdf", "--model", "lambert", "--json", "fits.json", cwd=tmp_path)
    assert done.exit_code == 1 and (tmp_path / "fits.json").read_text() == "before"


@pytest.mark.usefixtures("llvm_rgb")
def test_ctrl_c_that_a_kernel_wraps_is_no_failure():
    """Dr.Jit makes a RuntimeError of all that Python functions raise while it records them."""

    def record(error):
        def body(i):
            raise error

        dr.while_loop((mi.UInt(0),), lambda i: i < 3, body)

    for error in KeyboardInterrupt(), Terminated(143):
        with pytest.raises(type(error)) as raised, unwrapped_ctrl_c():
            record(error)
        assert raised.value.args == error.args
    with pytest.raises(RuntimeError, match="while_loop"), unwrapped_ctrl_c():
        record(ValueError("other"))


@pytest.mark.slow
@pytest.mark.usefixtures("ctrl_c")
def test_ctrl_c_keeps_what_is_finished(tmp_path):
    models = "lambert,burley,ashikhminshirley,brady,cooktorrance,kurt,low,nishino,schlick,walter"
    options = "--model", models, "--starts", 100, "--json", "fits.json", "-o", "fits.html"
    status, out, err = interrupted(tmp_path, "fit", LOFT, *options, running="Fitting burley")
    said = re.search(r"Interrupted; (\d) of 10 fits were finished\.", err)
    assert status == 130 and said and "Traceback" not in err, err
    fitted = [row["model"] for row in json.loads((tmp_path / "fits.json").read_text())]
    assert "lambert" in fitted and len(fitted) == int(said[1]) and all(name in out for name in fitted)
    assert said[0] in (tmp_path / "fits.html").read_text(encoding="utf-8")
