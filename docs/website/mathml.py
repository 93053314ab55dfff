"""A Sphinx extension: formulas as MathML, which browsers show without scripts, fonts or a network."""

from __future__ import annotations

from docutils import nodes
from docutils.utils.math import MathError
from docutils.utils.math.latex2mathml import tex2mathml
from sphinx.application import Sphinx
from sphinx.util import logging

logger = logging.getLogger(__name__)


def setup(app: Sphinx) -> dict[str, bool]:
    app.add_html_math_renderer("mathml", (inline, None), (block, None))
    app.config.html_math_renderer = "mathml"
    return {"parallel_read_safe": True}


LONG = 100
"""The length in TeX of a formula in a line that may be wider than a narrow page."""


def inline(writer, node: nodes.math) -> None:
    formula = _mathml(node)
    writer.body.append(f'<span class="long">{formula}</span>' if len(node.astext()) > LONG else formula)
    raise nodes.SkipNode


def block(writer, node: nodes.math_block) -> None:
    writer.body.append(f'<div class="formula">{_mathml(node, as_block=True)}</div>\n')
    raise nodes.SkipNode


def _mathml(node: nodes.Element, as_block: bool = False) -> str:
    try:
        return tex2mathml(node.astext(), as_block)
    except MathError as error:
        logger.warning("%s in %s", error, node.astext(), location=node)
        return ""
