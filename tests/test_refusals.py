"""What users type that is wrong is told in one sentence, before anything is written."""

import shlex
import shutil

import pytest
from support import LOFT, ROOT, rows
from test_cli import SCENE, invoke


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("refused")
    shutil.copytree(ROOT / "tests" / "rows" / "scenes", folder, dirs_exist_ok=True)
    shutil.copy(ROOT / "scenes" / "cornell_box.xml", folder / "room.xml")
    shutil.copy(LOFT, folder / "paint.bsdf")
    (folder / "file").touch()
    (folder / "gone_mesh.xml").write_text(SCENE.replace("triangle.obj", "gone.obj"))
    for name in "taken.png", "folder.exr", "nook":
        (folder / name).mkdir()
    return folder


@pytest.mark.usefixtures("llvm_rgb")
@pytest.mark.parametrize("status, words, told", [row.split(" | ") for row in rows("refusals.txt")], ids=lambda it: it)
def test_what_is_wrong_is_told_in_a_sentence(folder, monkeypatch, status, words, told):
    monkeypatch.setattr("mi_brdfs.explorer.export.SPP", 1)
    before = sorted(folder.rglob("*"))
    done = invoke(*shlex.split(words), cwd=folder)
    assert (done.exit_code, done.stdout) == (int(status), ""), done.output
    assert done.stderr.startswith("mi-brdfs: ") and done.stderr.count("\n") == 1
    assert all(part in done.stderr for part in told.split(" … ")), done.stderr
    assert sorted(folder.rglob("*")) == before
