"""The site builds without a warning, all of its links lead somewhere, and it needs no network."""

import importlib.util
import io
import re
import subprocess
import sys
from urllib.parse import unquote

import mitsuba as mi
import numpy as np
import pytest
import typer
from generate import models
from generate.made import ROOT
from PIL import Image
from support import Page
from test_explore_page import browser as browser
from typer.testing import CliRunner
from website import live
from website.__main__ import main
from website.pages import write_pages

import mi_brdfs
from mi_brdfs.mitsuba.registry import own_models


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """The folder of the site, built by its command."""
    if any(importlib.util.find_spec(name) is None for name in ("sphinx", "furo", "myst_parser")):
        pytest.skip("the site's extra is not installed: pip install -e '.[site]'")
    folder = tmp_path_factory.mktemp("site") / "html"
    code = (
        "import runpy, sys; del sys.argv[0]; import mi_brdfs.explorer.export as export; export.SPP = 1; "
        "runpy.run_path(sys.argv[0], run_name='__main__')"
    )
    command = [sys.executable, "-c", code, ROOT / "docs" / "website", folder]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300)
    assert (done.returncode, done.stdout, done.stderr) == (0, f"{folder / 'index.html'}\n", "")
    return folder


def read(path):
    return Page(path.read_text(encoding="utf-8"))


def links(page):
    return [given["href"] for tag, given in page.elements if tag == "a" and given.get("href")]


@pytest.mark.slow
def test_links_lead_somewhere_and_nothing_is_loaded_from_elsewhere(site):
    pages = {path: read(path) for path in site.rglob("*.html")}
    anchors = {path: {"", *page.attributes("id")} for path, page in pages.items()}
    assert len(pages) > 45
    for path, page in pages.items():
        loaders = [given for tag, given in page.elements if tag in ("img", "script", "link", "iframe", "source")]
        for target in {given.get(name) for given in loaders for name in ("src", "href")} - {"#", "", None}:
            assert target.startswith("data:") or not re.match(r"\w+:|//", target), (path, target)
            assert target.startswith("data:") or (path.parent / target.split("?")[0]).is_file(), (path, target)
        for target in links(page):
            if re.match(r"\w+:", target):
                assert target.startswith(("https://", "http://")), (path, target)
                continue
            file, _, anchor = unquote(target).partition("#")
            to = (path.parent / file).resolve() if file else path
            assert to.is_file(), (path, target)
            assert to.suffix != ".html" or anchor in anchors[to], (path, target)
    for path in [*site.rglob("*.css"), *site.rglob("*.js")]:
        assert not re.search(r"(url\(|import |src=)[\"']?(https?:)?//", path.read_text(encoding="utf-8")), path


def test_every_page_has_its_source(tmp_path):
    write_pages(tmp_path)
    for name in ("index", "gallery", "guide/python", *(f"reference/{model.plugins[0]}" for model in own_models())):
        assert (tmp_path / f"{name}.md").read_text(encoding="utf-8").lstrip().startswith("#"), name
    rows = re.findall(r"^\| [`a]", models.CHAPTER.read_text(encoding="utf-8"), re.MULTILINE)
    assert (tmp_path / "folklore.md").read_text(encoding="utf-8").count("* **In circulation:**") == len(rows) > 40


@pytest.mark.slow
def test_the_front_page_leads_to_pages_of_the_explorer(site):
    """They are small, have scrubbers, open where they show most, and lead back."""
    front = links(read(site / "index.html"))
    for name in live.PAGES:
        page = site / f"{name}.html"
        text = page.read_text(encoding="utf-8")
        assert '<h1><a href="index.html"' in text
        assert page.name in front and len(text) < 1.5e6 and '"scrubbers": [{"name": "theta"' in text
        values, start = re.search(r'"theta", "values": \[(.*?)\], "start": (\d+)', text).groups()
        assert float(values.split(", ")[int(start)]) == live.PAGES[name][1]
        assert ('"name": "fitted walter"' in text) == (name == "measured_paint") and '"name": "fit.json' not in text


@pytest.mark.slow
def test_links_to_pages_have_pictures_and_formulas_a_font(site):
    for path in (site / "index.html", site / "reference" / "ward.html"):
        (card,) = re.findall(r'<meta property="og:image" content="([^"]+)"', path.read_text(encoding="utf-8"))
        assert tuple(mi.Bitmap(str(path.parent / card)).size()) == (1200, 630)
    (font,) = re.findall(r'@font-face {[^}]*url\("([^"]+)"\)', (site / "_static" / "site.css").read_text())
    assert (site / "_static" / font).read_bytes().startswith(b"wOF2")
    assert "SIL Open Font License" in (site / "_static" / font.replace(".woff2", "_license.txt")).read_text()


@pytest.mark.slow
def test_wide_tables_name_the_column_in_each_cell_and_links_show_pictures(site):
    """A phone shows a row of such a table as a list, and a picture would else be stored, not shown."""
    pages = {path: path.read_text(encoding="utf-8") for path in site.rglob("*.html")}
    assert '<td data-heading="default"><p>0.1</p></td>' in pages[site / "reference" / "ward.html"]
    for path, text in pages.items():
        for table in re.findall(r"<table.*?</table>", text, re.DOTALL):
            assert table.count("<th ") < 4 or table.count("<td data-heading=") == table.count("<td"), path
        assert not re.search(r'download=""[^>]*\.(jpg|png)"', text), path


@pytest.mark.slow
def test_reference_pages_are_the_manual_pages(site):
    """Word for word, apart from the formulas, which are the same ones in MathML."""
    for model in own_models():
        path = site / "reference" / f"{model.plugins[0]}.html"
        shown = re.sub(r"\s+", " ", read(path).text).replace("’", "'")
        for row in models.own_rows(model)[1:]:
            assert all(cell in shown for cell in row[:4]), row
        words = re.findall(r"[A-Za-z]{4,}", mi_brdfs.info(model.plugins[0]).split("\nParameters\n")[0])
        assert not {word for word in words if word not in shown} - {"Example", "Cmax"}, model
        text = path.read_text(encoding="utf-8")
        assert "<math" in text or model.plugins[0] == "roughdiffuse"
        headings = ["Definition", "Properties", "Lobes", "Parameters", "Largest albedo"]
        assert re.findall(r"<h2>([\w ]+)", text) == headings


@pytest.mark.slow
def test_the_front_page_has_the_examples_by_themselves(site):
    """A phone would show the picture of them too small to read."""
    text = (site / "index.html").read_text(encoding="utf-8")
    assert "gallery.jpg" not in text and all(f'href="reference/{it.plugins[0]}.html"' in text for it in own_models())


@pytest.mark.slow
@pytest.mark.parametrize(
    "query, first",
    [
        ("ward", "ward"),
        ("merl", "tabulated"),
        ("GGX", "walter"),
        ("Oren-Nayar", "orennayar"),
        ("rough metal dark", "mi_brdfs"),
        ("dark grazing", "Questions"),
    ],
)
def test_a_search_ranks_titles_and_then_the_summaries_of_plugins_and_of_several_words_questions(
    site, browser, query, first
):
    page = browser.new_page()
    page.goto(f"{(site / 'search.html').as_uri()}?q={query}")
    assert page.locator("#search-results li a").first.inner_text() == first
    page.close()


@pytest.mark.slow
def test_a_phone_shows_commands_and_tables_whole_and_plots_in_the_scheme(site, browser):
    page = browser.new_page(viewport={"width": 390, "height": 844})
    for name in ("index", "guide/command_line", "gallery", "reference/ward"):
        page.goto((site / f"{name}.html").as_uri())
        scrolled = "elements => elements.filter(it => it.scrollWidth > it.clientWidth + 1).map(it => it.textContent)"
        assert page.eval_on_selector_all("html, .highlight-sh pre, .table-wrapper", scrolled) == [], name
    page.goto((site / "notebooks" / "is_my_sampler_right.html").as_uri())
    for kind, wraps in ("text", "pre-wrap"), ("output", "pre"):
        assert page.eval_on_selector(f".highlight-{kind} pre", "it => getComputedStyle(it).whiteSpace") == wraps
    page.goto((site / "reference" / "ward.html").as_uri())
    for scheme in ("light", "dark"):
        page.emulate_media(color_scheme=scheme)
        corner = np.array(Image.open(io.BytesIO(page.locator('img[alt^="Lobes"]').screenshot())))[0, 0]
        assert (corner[:3] > 200).all() if scheme == "light" else (corner[:3] < 60).all()
    page.close()


def command(*arguments):
    app = typer.Typer()
    app.command()(main)
    return CliRunner().invoke(app, [*map(str, arguments)])


def test_a_folder_with_other_files_is_left_alone(tmp_path):
    (tmp_path / "mine.txt").write_text("mine")
    done = command(tmp_path)
    assert (done.exit_code, done.stderr) == (2, f"{tmp_path} is neither empty nor a site\n")
    assert (tmp_path / "mine.txt").is_file()


def test_without_the_extra_the_command_says_so(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "sphinx", None)
    monkeypatch.setitem(sys.modules, "sphinx.application", None)
    monkeypatch.delitem(sys.modules, "website.build", raising=False)
    done = command(tmp_path)
    assert done.exit_code == 2 and "pip install 'mi_brdfs[site]'" in done.stderr and done.stderr.count("\n") == 1
