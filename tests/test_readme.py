"""README.md and the guide in docs work as they stand, from top to bottom, and what they say of numbers and of other
files is so."""

import glob
import importlib.util
import json
import re
import shlex
import shutil
import sys
import types
from pathlib import Path

import mitsuba as mi
import numpy as np
import pytest
from support import ROOT, python
from test_cli import invoke
from typer.main import get_command

import mi_brdfs
from mi_brdfs.cli import app

README = (ROOT / "README.md").read_text(encoding="utf-8")
GUIDE = ["README.md", *(f"docs/{page}.md" for page in ("python", "command_line", "machines", "measured", "mitsuba_06"))]
PROJECT = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
TEXT = "".join((ROOT / page).read_text(encoding="utf-8") for page in GUIDE)

# --- Its blocks -----------------------------------------------------------------------------------------------------

SHORTER = {
    "mi-brdfs render": " --spp 4",
    "mi-brdfs show": " --spp 4",
    "mi-brdfs gallery": " --size 64 --spp 4",
}
"""What the guide names to make commands that take long shorter, and here is added to them."""
NARROWER = "-Dwidth=1280", "-Dwidth=160"
"""What takes the place of a large picture's width."""
LESS = {"mi-brdfs fit": " --starts 1", "mi-brdfs check": " --only albedo"}
"""And what is added besides: their own tests ask for all."""
SMALLER = {
    "explorer.export.SPP": 4, "fit.appearance.SIZE": 48, "fit.appearance.SAMPLES": 4,
    "bench.comparison.CALL_ROUNDS": 3, "bench.comparison.FIRST_ROUNDS": 1,
}  # fmt: skip
"""Constants for which there is no option."""


def blocks(language):
    return re.findall(rf"```{language}\n(.*?)```", TEXT, re.DOTALL)


def lines():
    """Return the lines of all shell blocks and the commands that answer questions, each once, without what makes and
    fills an environment, as the tests run in one, and without the command that runs them."""
    answers = re.findall(r"`(mi-brdfs\s[^`]*)`", README.split("## Questions\n")[1].split("\n## ")[0])
    found = {}
    for line in [*"".join(blocks("sh")).splitlines(), *(" ".join(answer.split()) for answer in answers)]:
        parts = [part for part in re.split(r"\s+#", line)[0].split(" && ") if not makes_environment(part)]
        parts = [
            part.replace(*NARROWER) + next((more for c, more in (SHORTER | LESS).items() if part.startswith(c)), "")
            for part in parts
        ]
        if parts and not parts[0].startswith("python -m pytest"):
            found[" && ".join(parts)] = True
    return list(found)


def makes_environment(command):
    return command.startswith(("python3 -m venv", ". .venv", "pip install"))


@pytest.fixture(scope="module")
def checkout(tmp_path_factory):
    leave_out = shutil.ignore_patterns(".*", "__pycache__", "*.egg-info")
    return Path(shutil.copytree(ROOT, tmp_path_factory.mktemp("readme") / "checkout", ignore=leave_out))


QUICK = "list", "info", "presets", "plot", "convert", "upgrade"


@pytest.mark.usefixtures("llvm_rgb")
@pytest.mark.parametrize(
    "line", [pytest.param(it, marks=[] if it.split()[1] in QUICK else pytest.mark.slow) for it in lines()]
)
def test_shell(line, checkout, monkeypatch):
    """In this process, with words and patterns as a shell takes them."""
    monkeypatch.chdir(checkout)
    for constant, value in SMALLER.items():
        monkeypatch.setattr(f"mi_brdfs.{constant}", value)
    name, *words = shlex.split(line, comments=True)
    done = invoke(*(it for word in words for it in (sorted(glob.glob(word)) if "*" in word else [word])))
    assert name == "mi-brdfs" and done.exit_code == 0, done.output


def test_no_command_is_left_out():
    assert {line.split()[1] for line in lines()} == set(get_command(app).commands)
    assert all(words in TEXT for words in (NARROWER[0], *map(str.strip, SHORTER.values())))


@pytest.mark.slow
def test_python(tmp_path):
    """All blocks in one process, in order; the picture, of an eighth of the samples, is neither dark nor clipped.
    Fits are of small pictures, and short."""
    small = (
        "import mi_brdfs.fit.appearance as it; it.SIZE, it.SAMPLES = 48, 4\n"
        "import mi_brdfs.fit.pictures as it; it.SAMPLES = 1 << 12"
    )
    show = "print(copper['diffuse_reflectance'] + max(copper['specular_reflectance']['value']))"
    code = "\n".join([small, *blocks("python"), show])
    render = "mi.render(mi.load_dict(scene), spp=32)"
    assert code.count(render) == 1
    code = code.replace(render, render.replace("32", "4")).replace(
        '"width": 64, "height": 64', '"width": 16, "height": 16'
    )
    code = code.replace('"body.bsdf.alpha_v"])', '"body.bsdf.alpha_v"], iterations=2)')
    done = python(code, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert float(done.stdout.splitlines()[-1]) <= 1
    picture = np.array(mi.Bitmap(str(tmp_path / "copper.png")))
    assert 40 < picture.mean() < 200 and (picture == 255).all(axis=-1).mean() < 0.05
    red, _, blue = picture[200:350, 100:400, :3].mean(axis=(0, 1))
    assert red > 1.2 * blue


# --- Names and numbers ----------------------------------------------------------------------------------------------


def test_extras_are_there():
    extras = re.findall(r"^(\w+) = ", PROJECT.split("[project.optional-dependencies]")[1].split("\n[")[0], re.M)
    assert set(",".join(re.findall(r'"\.\[([\w,]+)\]"', TEXT)).split(",")) <= {*extras}


def test_links_lead_to_files():
    for page in [*GUIDE, "docs/limits.md", "docs/questions.md", "docs/testing.md", "CONTRIBUTING.md", "CHANGELOG.md"]:
        targets = links((ROOT / page).read_text(encoding="utf-8"))
        assert page != "README.md" or len(targets) > 30
        for file, anchor in targets:
            path = (ROOT / page).parent / file
            assert path.exists(), (page, file)
            assert not anchor or f"## {anchor}\n" in path.read_text(encoding="utf-8").lower(), (page, anchor)


def links(text):
    """Return the relative links of a page, each with its anchor."""
    return re.findall(r"\]\((?!\w+:)([^)#]*)(?:#([\w-]+))?\)", text)


def test_readme_is_short():
    assert len(README.split()) <= 1900


def test_links_are_absolute_where_the_address_is_known(monkeypatch):
    """In the description that the package index shows."""
    interface = types.SimpleNamespace(MetadataHookInterface=type("Hook", (), {"root": str(ROOT)}))
    monkeypatch.setitem(sys.modules, "hatchling.metadata.plugin.interface", interface)
    spec = importlib.util.spec_from_file_location("hatch_build", ROOT / "hatch_build.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    unknown, known = {}, {"urls": {"Source": "https://forge.example/mi_brdfs"}}
    for metadata in unknown, known:
        module.Description().update(metadata)
    assert unknown["readme"]["text"] == README
    text = known["readme"]["text"]
    assert not re.search(r"\]\((?!https://)", text) and text.count("](") == README.count("](")
    assert "](https://forge.example/mi_brdfs/raw/HEAD/docs/gallery.jpg)" in text
    assert "](https://forge.example/mi_brdfs/blob/HEAD/docs/bench.md)" in text


def test_noise_and_speed():
    """The ranges are those of the last bench, rounded."""
    bench = json.loads((ROOT / "docs" / "bench.json").read_text(encoding="utf-8"))
    same = {f"{it['name']} / {it['builtin']['type']}" for it in bench["cases"].values() if it["same"]}
    paragraph = README.split("## Noise and speed\n")[1].split("\n## ")[0]
    said = re.search(r"(\d+) % slower to (\d+) times faster.*?(\d+) to (\d+) times slower", paragraph, re.DOTALL)
    compared = [f for f in bench["figures"] if f["section"] == "variance" and f["subject"] in same]
    noise = [f["value"] for f in compared if f["name"] in ("sphere", "Cornell box")]
    scalar = [f["value"] for f in bench["figures"] if f["section"] == "scalar" and f["targets"]]
    expected = 100 * (max(noise) - 1), 1 / min(noise), min(scalar), max(scalar)
    assert [*map(int, said.groups())] == [*map(round, expected)]


def test_citation():
    citation = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    for ours, theirs in ("version", "version"), ("license", "license"), ("authors = [{ name", "  - name"):
        value = re.search(rf'^{re.escape(ours)} = "(.*?)"', PROJECT, re.MULTILINE)[1]
        assert f"\n{theirs}: {value}\n" in citation
    assert f"\nversion: {mi_brdfs.__version__}\n" in citation
