"""Set formulas in TeX."""

from __future__ import annotations

import re

from .formulas import FUNCTIONS, GREEK, Expression, Node, Number, Symbol

SIGNS = {
    "<=": r"\le", ">=": r"\ge", "∝": r"\propto", "→": r"\to", "≠": r"\ne", "Σ": r"\sum", "∫": r"\int", "Π": r"\prod",
}  # fmt: skip


def tex(node: Expression, display: bool = True) -> str:
    """Return a formula in TeX; in lines of text with slashes instead of fractions."""
    if isinstance(node, Number):
        return node.text
    if isinstance(node, Symbol):
        return symbol(node.name)
    parts = [tex(part, display) for part in node.parts]
    match node.kind:
        case "call":
            name = node.signs[0]
            known = rf"\operatorname{{{name}}}" if name == "mix" else rf"\{name}"
            return rf"{known if name in FUNCTIONS else symbol(name)}\left({parts[0]}\right)"
        case "root":
            return rf"\sqrt{{{parts[0]}}}"
        case "abs":
            return rf"\left|{parts[0]}\right|"
        case "group":
            return rf"\left({parts[0]}\right)"
        case "power":
            return _power(node, parts[0])
        case "dot":
            return r" \cdot ".join(parts)
        case "product":
            return r"\, ".join(parts)
        case "quotient":
            return _quotient(node, parts, display)
        case "sum":
            return "".join(f" {sign} {part}" for sign, part in zip(node.signs, parts, strict=True)).strip()
        case "list":
            return parts[0] + "".join(rf"{sign}\; {part}" for sign, part in zip(node.signs, parts[1:], strict=True))
        case "relation":
            return parts[0] + "".join(
                f" {SIGNS.get(sign, sign)} {part}" for sign, part in zip(node.signs, parts[1:], strict=True)
            )
        case _:
            return f"{SIGNS[node.kind]} {parts[0]}"


def _power(node: Node, base: str) -> str:
    below, exponent = node.parts
    exponent = tex(_bare(exponent), display=False)
    if isinstance(below, Symbol) and (trig := re.match("(cos|sin|tan)(.+)", below.name)):
        return rf"\{trig[1]}^{{{exponent}}} {symbol(trig[2])}"
    return f"{base}^{{{exponent}}}"


def _quotient(node: Node, parts: list[str], display: bool) -> str:
    if not display:
        return f"{parts[0]}/{parts[1]}"
    above, below = (tex(_bare(part), display) for part in node.parts)
    return rf"\frac{{{above}}}{{{below}}}"


def _bare(node: Expression) -> Expression:
    """Return an expression without the brackets around it."""
    return node.parts[0] if isinstance(node, Node) and node.kind == "group" else node


def symbol(name: str) -> str:
    """Return a symbol in TeX: its subscript is what follows an underscore or, in short names, the first letter."""
    if trig := re.fullmatch("(cos|sin|tan)(.+)", name):
        return rf"\{trig[1]} {symbol(trig[2])}"
    if name == "Ē":
        return r"\bar{E}"
    if name.startswith("dω"):
        return rf"\mathrm{{d}}{symbol(name[1:])}"
    prime = "'" if name.endswith("'") else ""
    base, _, below = name.rstrip("'").partition("_")
    if len(base) > 3 and base != "Cmax":
        return rf"\mathrm{{{name}}}".replace("_", r"\_")
    if base in ("wi", "wo"):
        below = ",".join(filter(None, (base[1], below)))
        base = "ω"
    elif len(base) > 1:
        base, below = base[0], base[1:]
    base = rf"\{GREEK[base]}" if base in GREEK else base
    below = rf"\mathrm{{{below}}}" if len(below) > 1 and "," not in below else below
    return f"{base}{prime}_{{{below}}}" if below else f"{base}{prime}"
