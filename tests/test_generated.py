"""What is generated is made from what there is now, and one command says what is not."""

import pytest
import typer
from generate import made, scenes
from generate.__main__ import everything, main
from generate.made import ROOT, Page, Picture
from typer.testing import CliRunner

import mi_brdfs
from mi_brdfs.mitsuba import registry
from mi_brdfs.mitsuba.registry import own_models
from mi_brdfs.models.lambert import Lambert


def name(made):
    return made.path.relative_to(ROOT).as_posix()


def command(*arguments):
    app = typer.Typer()
    app.command()(main)
    return CliRunner().invoke(app, arguments)


def test_digests_are_of_the_pictures():
    assert set(made.read_digests()) == {name(each) for each in everything() if isinstance(each, Picture)}


class Chalk(Lambert):
    """Chalk (1899).

    Example
    -------
    {"type": "chalk", "reflectance": 0.9}
    """


def test_another_model_makes_its_own_pages_and_pictures_stale(monkeypatch, as_before, llvm_rgb):
    """And what shows all models. Before, nothing is stale: models of others are none of ours."""
    Chalk.plugins = ("chalk",)
    mi_brdfs.register(Chalk)
    done = command("--check")
    assert (done.exit_code, done.stdout) == (0, ""), f"{done.output}: run python docs/generate"
    wrong = command("nothing")
    assert wrong.exit_code == 2 and "nothing is called nothing" in wrong.stderr
    is_own = registry.is_own
    monkeypatch.setattr(registry, "is_own", lambda model: model is Chalk or is_own(model))
    assert {name(each) for each in everything() if each.is_stale()} == {
        "README.md", "mi_brdfs/models/README.md", "scenes/catalogue.xml",
        "docs/thumbnails/chalk.png", "docs/thumbnails/large/chalk.jpg", "docs/sweeps/chalk.jpg", "docs/lobes/chalk.png",
        "docs/gallery.jpg", "mi_brdfs/explorer/client/models.jpg",
    }  # fmt: skip
    text = scenes.catalogue()
    assert text.count('<shape type="sphere" id=') == len(own_models())
    assert text.count('        <bsdf type="chalk">\n            <float name="reflectance" value="0.9"/>\n') == 1
    assert "minnaert 1941" in text and "lambert 1760, chalk 1899, minnaert 1941" in " ".join(text.split())


@pytest.fixture
def drawn(monkeypatch, tmp_path):
    """A picture in a folder of its own, and what it is made from."""
    monkeypatch.setattr(made, "ROOT", tmp_path)
    monkeypatch.setattr(made, "DIGESTS", tmp_path / "digests.txt")
    sources = ["a", b"b"]
    return Picture(tmp_path / "picture.png", lambda: sources, lambda path: path.write_bytes(b"drawn")), sources


def test_pictures_and_pages_are_stale_until_they_are_made(drawn):
    picture, sources = drawn
    assert picture.is_stale()
    picture.make()
    assert not picture.is_stale() and picture.path.read_bytes() == b"drawn"
    sources[:] = ["ab", b""]
    assert picture.is_stale()
    picture.make()
    assert not picture.is_stale()
    picture.path.unlink()
    assert picture.is_stale()
    picture.make()
    page = Page(picture.path.with_name("page.md"), lambda: "now")
    assert page.is_stale()
    page.make()
    assert not page.is_stale()
    made.write_digests(made.read_digests() | {"gone.png": "0"})
    assert set(made.read_digests()) == {"picture.png"}


def test_scenes_are_read_without_comments_and_with_their_files(tmp_path):
    def sources(comment, spp, texture):
        (tmp_path / "t.png").write_bytes(texture)
        text = f'<scene version="3.0.0"><!-- {comment} --><integer name="s" value="{spp}"/>\n'
        (tmp_path / "s.xml").write_text(text + '<string name="filename" value="t.png"/></scene>')
        return scenes.read(tmp_path / "s.xml")

    first = sources("one", 1, b"t")
    assert first == sources("two", 1, b"t")
    assert first != sources("one", 2, b"t") and first != sources("one", 1, b"u")
