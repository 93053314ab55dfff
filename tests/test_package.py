"""The package as installed: versions, import time, style."""

import ast
import graphlib
import importlib
import os
import subprocess
import sys
import warnings
from pathlib import Path

import mitsuba as mi
import pytest
from support import ROOT, python

import mi_brdfs


def test_mitsuba_versions(monkeypatch):
    """Compared as numbers: 3.10 is newer than 3.9."""
    monkeypatch.setattr(mi, "__version__", "3.7.1")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        importlib.reload(mi_brdfs)
    for version in ("3.7.0", "2.99.0"):
        monkeypatch.setattr(mi, "__version__", version)
        with pytest.raises(ImportError, match=f"mi_brdfs needs Mitsuba 3.7.1 or newer, this is {version}: pip install"):
            importlib.reload(mi_brdfs)
    for version in ("3.10.0", "4.0.0.dev1"):
        monkeypatch.setattr(mi, "__version__", version)
        with pytest.warns(UserWarning, match=f"mi_brdfs was tested with Mitsuba 3.7.1 to 3.9, this is {version}."):
            importlib.reload(mi_brdfs)


@pytest.mark.slow
def test_import_is_fast(tmp_path):
    """At most half as long again as Mitsuba's and NumPy's (0.2 s over Mitsuba's on a machine that imports both in
    0.23 s), of the processor's time, with modules that are compiled, as those of an installed package are. Other
    processes only add to it, so the least of several counts."""
    compiled = {"PYTHONDONTWRITEBYTECODE": "", "PYTHONPYCACHEPREFIX": str(tmp_path)}

    def seconds(names):
        code = f"import time; t = time.process_time(); import {names}; print(time.process_time() - t)"
        return float(python(code, env=os.environ | compiled).stdout)

    seconds("mi_brdfs")  # compiles
    ours, theirs = [], []
    while len(ours) < 2 or (min(ours) >= 1.5 * min(theirs) and len(ours) < 7):
        ours, theirs = [*ours, seconds("mi_brdfs")], [*theirs, seconds("mitsuba, numpy")]
    assert min(ours) < 1.5 * min(theirs), (theirs, ours)


@pytest.mark.parametrize(
    "tool", [["ruff", "check"], pytest.param(["mypy", "--no-incremental"], marks=pytest.mark.slow)], ids=" ".join
)
def test_style_and_types(tool):
    done = subprocess.run([sys.executable, "-m", *tool], capture_output=True, text=True, cwd=ROOT)
    assert done.returncode == 0, done.stdout + done.stderr
    assert (Path(mi_brdfs.__file__).parent / "py.typed").exists()


# fmt: off
TRUNK = {
    "math", "srgb", "observer", "parameters", "microfacet", "lobes", "model", "models", "integrators", "mitsuba",
    "ranges", "names", "variants", "legacy", "loading", "writing", "starting", "given", "preview", "probe", "rendering",
    "__version__",
}
# fmt: on
MAY_IMPORT = {
    "measured": set(),
    "tabulated": {"measured"},
    "plot": {"measured"},
    "pages": {"plot"},
    "validation": {"pages", "plot"},
    "gallery": {"pages"},
    "fit": {"measured", "pages", "plot"},
    "cluster": set(),
    "bench": set(),
    "sweep": {"cluster", "fit", "gallery", "measured"},
    "explorer": {"fit", "measured", "validation"},
}
"""The wings, each with those that it stands on besides the trunk."""


def imports_out_of(room):
    """Yield what a room of the package imports of others, also inside functions: (file, import, rooms)."""
    for file in [room] if room.is_file() else room.rglob("*.py"):
        inside = len(file.relative_to(room).parts)
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ImportFrom) and node.level == inside + 1:
                rooms = {node.module.split(".")[0]} if node.module else {name.name for name in node.names}
                yield file, ast.unparse(node), rooms


@pytest.mark.parametrize("wing", MAY_IMPORT)
def test_wings_stand_on_what_they_may(wing):
    for file, statement, rooms in imports_out_of(Path(mi_brdfs.__file__).parent / wing):
        assert rooms <= TRUNK | MAY_IMPORT[wing], f"{file}: {statement}"


def test_no_rooms_import_one_another():
    """Not even in a circle of several."""
    rooms = [it for it in Path(mi_brdfs.__file__).parent.iterdir() if it.is_dir() or it.suffix == ".py"]
    graph = {it.stem: set().union(*(found for *_, found in imports_out_of(it))) for it in rooms}
    graphlib.TopologicalSorter(graph).prepare()
