"""The gallery as an HTML page beside its pictures."""

from __future__ import annotations

from html import escape
from itertools import groupby
from typing import NamedTuple

import mitsuba as mi

from .. import __version__
from ..model import Model

STYLE = """
:root { color-scheme: light; --ink: #222; --faint: #666; --line: #ccc }
body { margin: 0 auto; padding: 1rem; max-width: 68rem; font: 1rem/1.45 system-ui, sans-serif; color: var(--ink);
  background: #fff }
h2 { margin: 3rem 0 0.5rem; border-top: 1px solid var(--line); padding-top: 1rem }
h2 span, footer { color: var(--faint); font-weight: normal }
a { color: inherit }
nav p { margin: 0.3rem 0; color: var(--faint) }
nav a { margin-right: 0.6rem; color: var(--ink); display: inline-block; padding: 0.2rem 0 }
img { max-width: 100%; height: auto }
@media (max-width: 45rem) { .sheet { display: block; overflow-x: auto } .sheet img { max-width: 44rem }
  .wall img { max-width: none } }
p + pre { white-space: pre-wrap }
pre { overflow-x: auto; padding: 0.6rem 0.8rem; background: #f5f5f5; font-size: 0.85rem }
"""


class Section(NamedTuple):
    """A model on the page."""

    model: type[Model]
    year: str
    portrait: dict
    rows: list[tuple[str, list[str]]]
    """Headings and captions of the contact sheet."""
    presets: list[str]
    """The published materials that are shown."""


def page(sections: list[Section], quality: str) -> str:
    """Return the page as text; ``quality`` says how the pictures were made."""
    links = "\n".join(
        f"<p>{family + ': ' if family else ''}{' '.join(map(_link, group))}</p>"
        for family, group in groupby(sections, key=lambda section: section.model.family)
    )
    parts = "\n".join(map(_section, sections))
    return f"""<!doctype html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>BRDF gallery</title>
<style>{STYLE}</style>
</head>
<body>
<header>
<h1>What BRDFs look like</h1>
<p>The models of mi_brdfs by family and year, in one studio, each family in one colour and about equally rough. The
tangent dp_du runs around the body. Diffuse and cartoon models are shown under a point light from the left; the curve
below a picture is the luminance across its middle, beside that of the first one. Pictures are larger behind their
links.</p>
<a class="sheet" href="overview.png"><img src="overview.png"
alt="A picture of each model: {", ".join(section.model.plugins[0] for section in sections)}"></a>
<nav>
{links}
</nav>
</header>
<main>
{parts}
</main>
<footer><p>mi_brdfs {escape(__version__)}, Mitsuba {escape(mi.__version__)}, {escape(mi.variant())}:
{escape(quality)}</p></footer>
</body>
</html>
"""


def _link(section: Section) -> str:
    name = section.model.plugins[0]
    return f'<a href="#{name}">{name}</a>'


def _section(section: Section) -> str:
    name, *aliases = section.model.plugins
    also = f", also <code>{'</code>, <code>'.join(aliases)}</code>" if aliases else ""
    alt = "; ".join(f"{heading}: {', '.join(captions)}" for heading, captions in section.rows)
    image = _picture(f"{name}.png", "sheet", alt)
    wall = _picture(f"{name}_presets.jpg", "sheet wall", ", ".join(section.presets))
    return f"""<section id="{name}">
<h2>{name} <span>{section.year}{also}</span></h2>
<p>{_code(section.model.summary())}</p>
{image}
{wall}
<p>The picture in the overview shows</p>
<pre>{escape(str(section.portrait))}</pre>
<details><summary>Reference</summary>
<pre>{escape(section.model.manual())}</pre>
</details>
</section>"""


def _picture(file: str, kind: str, alt: str) -> str:
    """Return a picture and what is larger behind it, if it shows anything."""
    return f'<a class="{kind}" href="{file}"><img src="{file}" alt="{escape(alt)}" loading="lazy"></a>' if alt else ""


def _code(text: str) -> str:
    """Return the HTML of a text with reStructuredText literals."""
    return "".join(f"<code>{escape(p)}</code>" if k % 2 else escape(p) for k, p in enumerate(text.split("``")))
