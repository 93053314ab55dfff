"""Plugin dicts as XML."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any


def to_xml(bsdf: Mapping[str, Any], id: str = "") -> str:
    """Return a plugin dict of numbers, words and rgb colours as XML, to paste into a scene; with an id, to be a file of
    its own, which a scene may ``<include>``."""
    lines = [f"    {_element(name, value)}" for name, value in bsdf.items() if name != "type"]
    alone = f' version="3.0.0" id={_quoted(id)}' if id else ""
    return "\n".join([f"<bsdf{alone} type={_quoted(bsdf['type'])}>", *lines, "</bsdf>"])


def _element(name: str, value: Any) -> str:
    if isinstance(value, dict):
        kind, text = "rgb", ", ".join(f"{number:.7g}" for number in value["value"])
    elif isinstance(value, bool):
        kind, text = "boolean", str(value).lower()
    elif isinstance(value, str):
        kind, text = "string", value.replace("$", "\\$")  # what follows a bare one is the name of a parameter
    else:
        kind, text = "float", f"{value:.7g}"
    return f"<{kind} name={_quoted(name)} value={_quoted(text)}/>"


def _quoted(text: str) -> str:
    from xml.sax.saxutils import quoteattr  # 20 ms: only when needed

    return quoteattr(text)
