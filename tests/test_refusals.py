"""What users type that is wrong is told in one sentence, before anything is written."""

import shlex
import shutil
import struct
import zlib

import pytest
from support import LOFT, ROOT, rows
from test_cli import SCENE, invoke

PLY = """ply
format ascii 1.0
element vertex 3
property float x
property float y
property float z
element face 2
property list uchar int vertex_indices
end_header
0 0 0
1 0 0
0 1 0
3 0 1 2
3 0 1 3
"""
"""A mesh whose second face has a fourth vertex."""
SERIALIZED = (
    struct.pack("<HH", 0x041C, 4)
    + zlib.compress(struct.pack("<I2s2Q9f6I", 0x1000, b"m", 3, 2, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 1, 2, 0, 1, 3))
    + struct.pack("<QI", 0, 1)
)
"""The same mesh: the version, the mesh (float32; its name; counts; positions; faces), and the list of meshes."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("refused")
    shutil.copytree(ROOT / "tests" / "rows" / "scenes", folder, dirs_exist_ok=True)
    shutil.copy(ROOT / "scenes" / "cornell_box.xml", folder / "room.xml")
    shutil.copy(LOFT, folder / "paint.bsdf")
    (folder / "file").touch()
    (folder / "gone_mesh.xml").write_text(SCENE.replace("triangle.obj", "gone.obj"))
    for kind, mesh in ("ply", PLY.encode()), ("serialized", SERIALIZED):
        (folder / f"torn.{kind}").write_bytes(mesh)
        scene = SCENE.replace('"obj"', f'"{kind}"').replace("triangle.obj", f"torn.{kind}")
        (folder / f"torn_{kind}.xml").write_text(scene)
    (folder / "deep.json").write_text("[" * 100_000)
    (folder / "empty.hdr").write_text("#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 0 +X 0\n")
    sides = '<bsdf type="twosided">' * 17 + '<bsdf type="diffuse"/>' + "</bsdf>" * 17
    (folder / "onion.xml").write_text(f'<scene version="3.0.0">{sides}</scene>')
    sheet = (folder / "sheet.xml").read_text()
    grouped = sheet.replace("<shape", '<shape type="merge" id="group"><shape').replace("</shape>", "</shape></shape>")
    (folder / "groups.xml").write_text(grouped)
    for name in "taken.png", "folder.exr", "nook", "hall":
        (folder / name).mkdir()
    (folder / "hall" / "wall_log.jpg").touch()
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
