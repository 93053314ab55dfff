"""Write the sources of the site: the repository's own pages, divided and linked anew."""

from __future__ import annotations

import os
import re
import shutil
from collections.abc import Callable
from functools import partial
from itertools import groupby
from pathlib import Path, PurePosixPath

from generate import models, scenes
from generate.made import ROOT

from mi_brdfs.gallery.contents import by_family, year
from mi_brdfs.integrators.shading import Shading
from mi_brdfs.mitsuba.registry import own_models
from mi_brdfs.model import Model, Plugin
from mi_brdfs.tabulated.tabulated import Tabulated

from . import live, notebooks
from .reference import inline, outside_code, with_formulas

GUIDE = {
    "docs/python.md": "guide/python",
    "docs/command_line.md": "guide/command_line",
    "docs/measured.md": "guide/measured",
    "docs/machines.md": "guide/machines",
    "docs/mitsuba_06.md": "guide/mitsuba_06",
    "docs/questions.md": "guide/questions",
    "docs/limits.md": "guide/limits",
}
"""Pages of the guide by file."""

FILES = GUIDE | {
    "README.md": "index",
    "CONTRIBUTING.md": "development",
    "CHANGELOG.md": "changelog",
    "docs/testing.md": "testing",
    "mi_brdfs/models/README.md": "reference/index",
    "docs/folklore.md": "folklore",
    "docs/bench.md": "bench",
    "docs/extending.md": "extending",
    "docs/sampling.md": "sampling",
    "scenes/README.md": "scenes",
    "scenes/shading/README.md": "shading",
    "scenes/polarization/README.md": "polarization",
    "notebooks/README.md": "notebooks/index",
}
"""Pages by file of the repository."""

OTHERS: tuple[type[Plugin], ...] = (Tabulated, Shading)
"""The plugins that are no models."""

TITLES = {"bench": "Benchmarks", "testing": "Test coverage", "guide/limits": "Known limits"}
"""Titles of pages whose files are called by a word."""

PICTURES = "notebooks/pictures"
"""Where the pictures of notebooks are."""


def write_pages(folder: Path) -> None:
    """Write all pages, and the pictures and files that they show, into a folder."""
    for page, (origin, text) in _pages(folder).items():
        path = folder / f"{page}.md"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(_linked(text, PurePosixPath(origin), folder), encoding="utf-8")


def _pages(folder: Path) -> dict[str, tuple[str, str]]:
    """Return the text of each page with the file that its links start from."""
    pages = {page: (file, (ROOT / file).read_text(encoding="utf-8")) for file, page in FILES.items()}
    pages["index"] = ("README.md", _front(folder))
    pages["folklore"] = ("docs/folklore.md", _folklore(pages["folklore"][1]))
    for page, title in TITLES.items():
        origin, text = pages[page]
        pages[page] = origin, re.sub(r"\A# .*", f"# {title}", text)
    for page in ("shading", "polarization"):
        text = re.sub(r"^## \[(\w+)\]\((.*)\)$", r"## \1\n\n[\2](\2)", pages[page][1], flags=re.MULTILINE)
        pages[page] = (f"scenes/{page}/README.md", text)
    pages["scenes"] = ("scenes/README.md", _scenes())
    pages["gallery"] = ("mi_brdfs/models/README.md", _gallery())
    pages["reference/index"] = ("mi_brdfs/models/README.md", _reference())
    for model in own_models():
        pages[f"reference/{model.plugins[0]}"] = ("mi_brdfs/models/README.md", _model(model, models.model_page))
    pages["reference/tabulated"] = ("mi_brdfs/models/README.md", _model(Tabulated, lambda _: models.data_page()))
    pages["reference/shading"] = ("mi_brdfs/models/README.md", _model(Shading, lambda _: models.integrator_page()))
    for name in notebook_order():
        path = ROOT / "notebooks" / f"{name}.ipynb"
        pages[f"notebooks/{name}"] = (f"notebooks/{name}.ipynb", notebooks.markdown(path, folder / PICTURES))
    index = re.sub(r"\[(.*)\]\((\w+)\.ipynb\)", partial(_glance, folder / PICTURES), pages["notebooks/index"][1])
    pages["notebooks/index"] = ("notebooks/README.md", f"{index}\n{_hidden(notebook_order())}\n")
    return pages


# --- Texts ----------------------------------------------------------------------------------------------------------


def _front(folder: Path) -> str:
    """Return README.md with pages to try and the contents of the site, and with examples that suit any width in place
    of its picture of them."""
    text = re.sub(r"<!-- .*? -->\n\n?", "", (ROOT / "README.md").read_text(encoding="utf-8"))
    examples = _linked(_thumbnails(), PurePosixPath("mi_brdfs/models/README.md"), folder)
    text = re.sub(r"^\[!\[[^\]]*\]\(docs/gallery\.jpg\)\].*$", lambda _: examples, text, flags=re.MULTILINE)
    return text.replace("\n## ", f"\n{live.links()}\n\n## ", 1) + _contents()


def _contents() -> str:
    parts = {
        "Guide": list(GUIDE.values()),
        "Gallery": ["gallery", "scenes", "shading", "polarization"],
        "Notebooks": ["notebooks/index"],
        "Reference": ["reference/index", "folklore"],
        "More": ["extending", "sampling", "bench", "testing", "development", "changelog"],
    }
    return "".join(f"\n{_hidden(pages, caption)}\n" for caption, pages in parts.items())


def notebook_order() -> list[str]:
    """Return the names of the notebooks in the order of notebooks/README.md."""
    return re.findall(r"\((\w+)\.ipynb\)", (ROOT / "notebooks" / "README.md").read_text(encoding="utf-8"))


def _glance(pictures: Path, link: re.Match) -> str:
    """Return a link to a notebook, with its picture."""
    (picture,) = pictures.glob(f"{link[2]}_{notebooks.GLANCE}.*")
    return f"[![](/{PICTURES}/{picture.name}){{.glance}}{link[1]}]({link[2]}.ipynb)"


def _hidden(names: list[str], caption: str = "") -> str:
    """Return an entry in the contents for each of some pages."""
    options = [":hidden:", *([f":caption: {caption}"] if caption else [])]
    return "\n".join(["```{toctree}", *options, "", *names, "```"])


def _scenes() -> str:
    """Return the page of the scenes, with a section for each instead of a table."""
    return "\n\n".join([scenes.INTRODUCTION, *map(_scene, scenes.SCENES)]) + "\n"


def _scene(path: Path) -> str:
    first, *others = scenes.paragraphs(path)
    lines = "\n".join(f"* {line}" for line in others)
    large = f"../docs/scenes/large/{path.stem}.jpg"
    picture = f"[![{path.stem}]({large})]({large})"
    command = f"```sh\n{scenes.command(path)}\n```"
    return "\n\n".join(filter(None, [f"## {path.stem}", picture, first, lines, command]))


def _gallery() -> str:
    about = (
        "The models by family and year, each with what it is known for; each picture leads to the page of its model. "
        "Below is the effect of each model's main parameter. Diffuse and cartoon models stand under a point light, "
        "with a curve below each picture: the luminance along its middle line, beside that of the first picture in "
        "orange, as far as the two differ."
    )
    parts = ["# Gallery", about, _thumbnails()]
    for model in by_family(own_models()):
        name = model.plugins[0]
        parts += [f"## {name}", f"{_summary(model)} [Formulas and parameters](#{name})", models.strip_picture(model)]
    return "\n\n".join(parts) + "\n"


def _folklore(chapter: str) -> str:
    """Return the chapter on the folklore with a section for each model in place of its table, and its formulas set."""
    about, _, table = chapter.removeprefix("#").partition("\n| ")
    (_, *labels), _, *rows = [[cell.strip() for cell in line.strip("| ").split("|")] for line in table.splitlines()]
    parts = [with_formulas(about.rstrip().replace("(#shading)", "(../mi_brdfs/models/README.md#shading)"), ())]
    for name, errors in groupby(rows, key=lambda row: row[0].strip("`")):
        own = f"[Its page](../mi_brdfs/models/README.md#{name}) has the published model."
        parts += ["## Any model"] if name == "any" else [f"## {name}", own]
        for _, *cells in errors:
            told = zip(labels, cells, strict=False)
            lines = [f"**{label.capitalize()}:** {inline(cell, ())}" for label, cell in told if cell]
            parts.append("* " + "\\\n  ".join(lines))
    return "\n\n".join(parts) + "\n"


def _thumbnails() -> str:
    """Return the examples of all models by family, with their years and links to their pages."""

    def cell(model: type[Model], heading: str) -> str:
        name = model.plugins[0]
        picture = f"[![{name}](../../docs/thumbnails/large/{name}.jpg)](#{name})"
        return f"{heading}{picture}\n[`{name}`](#{name})\\\n{year(model)}"

    families = groupby(by_family(own_models()), key=lambda it: it.family)
    cells = (cell(model, f"**{family}**" if k == 0 else "") for family, own in families for k, model in enumerate(own))
    return ":::{container} pictures\n" + "\n\n".join(cells) + "\n:::"


def summaries() -> dict[str, str]:
    """Return all names of each plugin and its summary, by the name of its page."""
    return {it.plugins[0]: " ".join([*it.plugins, it.summary()]) for it in [*own_models(), *OTHERS]}


def questions() -> dict[str, list[str]]:
    """Return the questions that pages answer, by the name of the page."""
    texts = {page: (ROOT / file).read_text(encoding="utf-8") for file, page in FILES.items()}
    found = {page: re.findall(r"^\*\*([^*]+\?)\*\*", text, re.MULTILINE) for page, text in texts.items()}
    return {page: asked for page, asked in found.items() if asked}


def _reference() -> str:
    plugins = [*own_models(), *OTHERS]
    introduction = with_formulas(models.INTRODUCTION, ()).rstrip() + " In a terminal, $\\omega_i$ is wi."
    listed = "\n".join(f"* [`{it.plugins[0]}`](#{it.plugins[0]}): {_summary(it)}" for it in plugins)
    return "\n\n".join([introduction, _thumbnails(), listed, _hidden([it.plugins[0] for it in plugins])]) + "\n"


def _summary(plugin: type[Plugin]) -> str:
    return re.sub(r"``(.+?)``", r"`\1`", plugin.summary())


def _model(plugin: type[Plugin], page: Callable[[type[Plugin]], str]) -> str:
    parameters = {word for row in models.own_rows(plugin)[1:] for word in re.findall(r"\w+", row[0])}
    text = with_formulas(re.sub(r"^#(?=#+ )", "", page(plugin), flags=re.MULTILINE), parameters)
    large = re.sub(r"\[!\[(\w+)\]\(\S+?\)\]\((\S+?)\)", r"[![\1](\2){.portrait}](\2)", text, count=1)
    return "\n\n".join(_references(it) for it in large.split("\n\n")) + "\n"


def _references(paragraph: str) -> str:
    """Return a paragraph that has nothing but references as a list."""
    parts = re.split(r"(?<=\))\. (?=[A-Z]\. )", paragraph.replace("\n", " "))
    return "\n".join(f"* {it}" for it in parts) if len(parts) > 1 and re.match(r"[A-Z]\. ", paragraph) else paragraph


# --- Links ----------------------------------------------------------------------------------------------------------


IMAGE = re.compile(r"(!\[[^\]]*\])\((?!\w+:|/)([^)\s]+)\)")
LINK = re.compile(r"((?<!!)\[(?:[^\[\]]|!\[[^\]]*\]\([^)]*\))*\])\((?!\w+:|/)([^)\s]+)\)")


def _linked(text: str, origin: PurePosixPath, folder: Path) -> str:
    """Return a page with its relative links leading to pages of the site, or to copies of the repository's files."""

    def copied(file: str) -> str:
        (folder / "files" / file).parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(ROOT / file, folder / "files" / file)
        return f"/files/{file}"

    def image(match: re.Match) -> str:
        return f"{match[1]}({copied(_path(origin, match[2]))})"

    def link(match: re.Match) -> str:
        target, _, fragment = match[2].partition("#")
        file = _path(origin, target) if target else origin.as_posix()
        if place := _place(file, fragment):
            return f"{match[1]}(/{place})"
        return f"{match[1]}({copied(file)})" if target else match[0]

    return outside_code(text, lambda it: LINK.sub(link, IMAGE.sub(image, it)))


def _path(origin: PurePosixPath, target: str) -> str:
    """Return where a link leads that stands in a file; a folder is its README.md."""
    found = os.path.normpath(origin.parent / target).replace("\\", "/")
    return f"{found}/README.md" if (ROOT / found).is_dir() else found


def _place(file: str, fragment: str) -> str | None:
    """Return the page, with an anchor, for a file of the repository, or None if the site has none."""
    if file == "mi_brdfs/models/README.md" and fragment:
        return "folklore.md" if fragment == "what-the-folklore-gets-wrong" else f"reference/{fragment}.md"
    if file.endswith(".ipynb"):
        return f"{file.removesuffix('.ipynb')}.md"
    return f"{FILES[file]}.md" + (f"#{fragment}" if fragment else "") if file in FILES else None
