"""A Sphinx extension: formulas as MathML, which browsers show without scripts, fonts or a network; and what a page's
HTML needs for narrow screens, and for links to pictures."""

from __future__ import annotations

import re
from html import escape
from itertools import count

from docutils import nodes
from docutils.utils.math import MathError
from docutils.utils.math.latex2mathml import tex2mathml
from sphinx.application import Sphinx
from sphinx.util import logging

logger = logging.getLogger(__name__)

LONG = 100
"""The length in TeX of a formula in a line that may be wider than a narrow page."""
CARD = "_static/card.jpg"
DESCRIPTION = "The classical BRDFs as plugins for Mitsuba 3, and tools that plot, fit and check any BSDF."
MANY = 4
"""The number of columns from which a table is too wide for a phone."""
TABLE = re.compile(r"<table class=\"(.*?)</table>", re.DOTALL)
ROW = re.compile(r"<tr\b.*?</tr>", re.DOTALL)
HEADING = re.compile(r"<th\b[^>]*>(.*?)</th>", re.DOTALL)
SHELL = '<div class="highlight-sh notranslate"><div class="highlight"><pre>'
COMMANDS = re.compile(rf"(?<={SHELL}).*?(?=</pre>)", re.DOTALL)
WORD = re.compile(r'<span class="w">[^<]*</span>|((?:(?!<span class="w">)<span[^>]*>[^<]*</span>|[^<\s])+)')


def setup(app: Sphinx) -> dict[str, bool]:
    app.add_html_math_renderer("mathml", (_inline, None), (_block, None))
    app.config.html_math_renderer = "mathml"
    app.connect("html-page-context", lambda app, page, template, context, doctree: _finish(context))
    return {"parallel_read_safe": True}


# --- Formulas -------------------------------------------------------------------------------------------------------


def _inline(writer, node: nodes.math) -> None:
    formula = _mathml(node)
    writer.body.append(f'<span class="long">{formula}</span>' if len(node.astext()) > LONG else formula)
    raise nodes.SkipNode


def _block(writer, node: nodes.math_block) -> None:
    writer.body.append(f'<div class="formula">{_mathml(node, as_block=True)}</div>\n')
    raise nodes.SkipNode


def _mathml(node: nodes.Element, as_block: bool = False) -> str:
    try:
        return tex2mathml(node.astext(), as_block)
    except MathError as error:
        logger.warning("%s in %s", error, node.astext(), location=node)
        return ""


# --- Pages ----------------------------------------------------------------------------------------------------------


def _finish(context: dict) -> None:
    """Describe the page to sites that show links to it, name the heading in each cell of a wide table, name strips of
    pictures, commands and their words, which browsers would break at hyphens, and let links show pictures, which MyST
    makes downloads."""
    if body := context.get("body"):
        body = TABLE.sub(_with_headings, body)
        body = COMMANDS.sub(_with_words, body)
        body = re.sub(r'<img (?=alt="(?:\w+: |Lobes of \w+ in ))', '<img class="strip" ', body)
        context["metatags"] += _described(context)
        context["body"] = re.sub(r' download=""(?= href="[^"]+\.(?:jpg|png)")', "", body)


def _described(context: dict) -> str:
    """Return what sites that show a link to the page show of it."""
    title, card = re.sub(r"<.*?>", "", context["title"]), context["pathto"](CARD, resource=True)
    words = {"title": title, "type": "website", "description": escape(DESCRIPTION), "image": card}
    return "".join(f'<meta property="og:{name}" content="{text}" />\n' for name, text in words.items())


def _with_words(commands: re.Match) -> str:
    words = WORD.sub(lambda found: f'<span class="word">{found[1]}</span>' if found[1] else found[0], commands[0])
    return "".join(f'<span class="command">{line}</span>' for line in words.splitlines())


def _with_headings(table: re.Match) -> str:
    headings = [re.sub(r"<.*?>", "", text).strip() for text in HEADING.findall(table[0])]
    if len(headings) < MANY:
        return table[0]

    def row(match: re.Match) -> str:
        column = count()
        return re.sub(r"<td\b", lambda _: f'<td data-heading="{headings[next(column)]}"', match[0])

    return f'<table class="many {ROW.sub(row, table[1])}</table>'
