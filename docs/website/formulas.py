"""Read the formulas of manual pages, which are plain text, and set them in TeX.

The text is the only source. A slash without spaces divides what touches it, ``2ρ/(k+1) cosθ``; a slash between spaces
divides the product before it by the next factor, ``D G / (4 cosθ_i cosθ_o)``. A name that touches an opening bracket is
a function.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator
from dataclasses import dataclass, field

# --- Nodes ----------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Symbol:
    name: str


@dataclass(frozen=True)
class Number:
    text: str


@dataclass(frozen=True)
class Node:
    """An operation: call, root, abs, group, power, dot, product, quotient, sum, list, relation, Σ, ∫, Π."""

    kind: str
    parts: tuple[Symbol | Number | Node, ...]
    signs: tuple[str, ...] = ()
    """Of a sum, before each part; of a relation or list, between the parts; of a call, its name."""


Expression = Symbol | Number | Node

# --- Words ----------------------------------------------------------------------------------------------------------

SUPERSCRIPTS = dict(zip("⁰¹²³⁴⁵⁶⁷⁸⁹⁺⁻ⁿᵞ", "0123456789+-nγ", strict=True))
FRACTIONS = {"½": ("1", "2"), "¼": ("1", "4")}
RELATIONS = ("<=", ">=", "=", "<", ">", "∝", "→", "≠")
BIG = "Σ∫Π"
FUNCTIONS = {"exp", "log", "max", "min", "cos", "sin", "tan", "mix"}
PAIRS = {
    "wi", "wo", "nu", "nv", "fd", "fs", "fss", "Rd", "Rs", "Cx", "Cy", "Cz", "Cmax", "ks", "f0", "Dc", "Gc", "Zd", "Zs",
    "td", "ts", "sd", "ss", "C1", "C2", "C3", "dω_h",
}  # fmt: skip
"""Symbols of more than one Latin letter."""

GREEK = {
    "α": "alpha", "β": "beta", "γ": "gamma", "θ": "theta", "κ": "kappa", "μ": "mu", "π": "pi", "ρ": "rho", "σ": "sigma",
    "φ": "varphi", "ω": "omega", "Γ": "Gamma", "Λ": "Lambda", "η": "eta",
}  # fmt: skip
LETTER = f"[{''.join(GREEK)}]"
TOKEN = re.compile(
    rf"""(?P<space>\s+)
    |(?P<number>\d+(?:\.\d+)?)
    |(?P<trig>(?:cos|sin|tan)(?:[²⁴ⁿᵞ])?(?:θ(?:_[a-z])?|[φαβ]))
    |(?P<name>π|dω_h|{LETTER}(?:_[a-z]+|[uvdsc](?![a-z]))?|Ē|[A-Za-z]+\d?(?:_[a-z]+)?'?)
    |(?P<power>[{"".join(SUPERSCRIPTS)}]+)
    |(?P<sign><=|>=|[-+/·()|,;=<>∝→≠^√{BIG}{"".join(FRACTIONS)}])""",
    re.VERBOSE,
)


@dataclass(frozen=True)
class Token:
    kind: str
    text: str
    spaced: bool


def tokens(text: str) -> list[Token]:
    """Return the tokens of a formula; ValueError where it is none."""
    found, at, spaced = [], 0, False
    while at < len(text):
        match = TOKEN.match(text, at)
        if not match:
            raise ValueError(f"no formula: {text[at:]!r}")
        if match.lastgroup != "space":
            found.append(Token(match.lastgroup, match[0], spaced))
        spaced, at = match.lastgroup == "space", match.end()
    return found


# --- Reading --------------------------------------------------------------------------------------------------------


def read(text: str) -> Expression:
    """Return a formula as a tree; ValueError where it is none."""
    reader = _Reader(tokens(text))
    result = reader.relation()
    if reader.at < len(reader.tokens):
        raise ValueError(f"left over: {reader.tokens[reader.at].text!r}")
    return result


@dataclass
class _Reader:
    tokens: list[Token]
    at: int = 0
    bars: list[bool] = field(default_factory=list)
    """Whether a bar closes, for each bracket that is open."""

    def peek(self, *texts: str) -> bool:
        return self.at < len(self.tokens) and self.tokens[self.at].text in texts

    def take(self, *texts: str) -> Token:
        if self.at == len(self.tokens) or (texts and self.tokens[self.at].text not in texts):
            raise ValueError(f"expected {' or '.join(texts)}")
        self.at += 1
        return self.tokens[self.at - 1]

    def chain(self, kind: str, part, *signs: str) -> Expression:
        """Return parts between signs, or the only one."""
        parts, between = [part()], []
        while self.peek(*signs):
            between.append(self.take().text)
            parts.append(part())
        return Node(kind, tuple(parts), tuple(between)) if between else parts[0]

    def relation(self) -> Expression:
        return self.chain("relation", self.list, *RELATIONS)

    def list(self) -> Expression:
        return self.chain("list", self.sum, ",", ";")

    def sum(self) -> Expression:
        signs = [self.take().text if self.peek("+", "-") else ""]
        parts = [self.product()]
        while self.peek("+", "-"):
            signs.append(self.take().text)
            parts.append(self.product())
        return Node("sum", tuple(parts), tuple(signs)) if signs != [""] else parts[0]

    def product(self) -> Expression:
        """Read factors and quotients, those between spaces over all before them."""
        if self.peek(*BIG):
            return Node(self.take().text, (self.product(),))
        factors = [self.touching()]
        while self.at < len(self.tokens):
            if self.peek("/"):
                self.take()
                factors = [Node("quotient", (_product(factors), self.touching()))]
            elif self.peek("·"):
                self.take()
                factors.append(self.touching())
            elif self.starts():
                factors.append(self.touching())
            else:
                break
        return _product(factors)

    def touching(self) -> Expression:
        """Read factors without spaces between them, and what they are divided by."""
        factors, above = [self.power()], None
        while self.at < len(self.tokens) and not self.tokens[self.at].spaced:
            if self.peek("/"):
                if above is not None:
                    raise ValueError("a quotient of quotients")
                self.take()
                above, factors = _product(factors), [self.power()]
            elif self.peek("·"):
                self.take()
                factors[-1] = Node("dot", (factors[-1], self.power()))
            elif self.starts():
                factors.append(self.power())
            else:
                break
        below = _product(factors)
        return below if above is None else Node("quotient", (above, below))

    def starts(self) -> bool:
        """Return whether a factor starts here."""
        token = self.tokens[self.at]
        if token.text == "|":
            return not (self.bars and self.bars[-1])
        return token.kind in ("number", "trig", "name") or token.text in ("(", "√", *FRACTIONS)

    def power(self) -> Expression:
        base = self.factor()
        while self.at < len(self.tokens):
            token = self.tokens[self.at]
            if token.kind == "power":
                self.take()
                exponent = read("".join(SUPERSCRIPTS[letter] for letter in token.text))
            elif token.text == "^":
                self.take()
                sign = self.take().text if self.peek("-") else ""
                exponent = self.factor()
                exponent = Node("sum", (exponent,), (sign,)) if sign else exponent
            else:
                break
            base = Node("power", (base, exponent))
        return base

    def factor(self) -> Expression:
        token = self.take()
        if token.kind == "number":
            return Number(token.text)
        if token.kind == "trig":
            name, exponent, angle = re.fullmatch(r"(\w{3})([²⁴ⁿᵞ]?)(.*)", token.text).groups()
            symbol = Symbol(name + angle)
            return Node("power", (symbol, read(SUPERSCRIPTS[exponent]))) if exponent else symbol
        if token.kind == "name":
            called = self.peek("(") and not self.tokens[self.at].spaced and token.text != "π"
            return Node("call", self.bracket(self.take()).parts, (token.text,)) if called else Symbol(token.text)
        if token.text in FRACTIONS:
            return Node("quotient", tuple(map(Number, FRACTIONS[token.text])))
        if token.text == "√":
            inside = self.factor()
            return Node("root", inside.parts if isinstance(inside, Node) and inside.kind == "group" else (inside,))
        if token.text in ("(", "|"):
            return self.bracket(token)
        raise ValueError(f"no factor: {token.text!r}")

    def bracket(self, opening: Token) -> Node:
        bar = opening.text == "|"
        self.bars.append(bar)
        inside = self.list()
        self.take("|" if bar else ")")
        self.bars.pop()
        return Node("abs" if bar else "group", (inside,))


def _product(factors: list[Expression]) -> Expression:
    return Node("product", tuple(factors)) if len(factors) > 1 else factors[0]


# --- Setting --------------------------------------------------------------------------------------------------------

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
            shown = (rf"\{name}" if name in FUNCTIONS - {"mix"} else rf"\operatorname{{{name}}}"
                     if name in FUNCTIONS else symbol(name))  # fmt: skip
            return rf"{shown}\left({parts[0]}\right)"
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
    if name == "dω_h":
        return r"\mathrm{d}\omega_h"
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


# --- Finding --------------------------------------------------------------------------------------------------------

STRONG = re.compile(
    rf"[=^√/·<>∝→≠|_{BIG}{''.join(SUPERSCRIPTS)}{''.join(GREEK)}Ē]|\w\+\w|\b(\d-[A-Z]|[a-z]-[a-z])\b|\b[A-Za-z]\("
)
INITIAL = re.compile(r"\.[-\s]*[A-Z]")
"""What follows the initial of a name."""
ENDS = re.compile(r"[.,;:)]")


def find(text: str, parameters: Collection[str] = (), display: bool = False) -> Iterator[tuple[int, int, Expression]]:
    """Yield the formulas in a paragraph with where they start and end, each as long as possible. Names of parameters
    may stand in them."""
    words = [match.span() for match in re.finditer(r"\S+", text)]
    done = 0
    for k, (start, _) in enumerate(words):
        if start < done:
            continue
        for first in _starts(text, start):
            if found := _longest(text, first, words[k:], parameters, display):
                end, node = found
                yield first, end, node
                done = end
                break


def _starts(text: str, start: int) -> Iterator[int]:
    yield start
    while text[start] == "(" and start + 1 < len(text):
        start += 1
        yield start


def _longest(text: str, first: int, words: list[tuple[int, int]], parameters, display) -> tuple[int, Expression] | None:
    """Return the end of the longest formula from here, and its tree."""
    ends = []
    for start, end in words:
        word = text[max(start, first) : end]
        core = re.sub(r"[.,;:)]+$", "", word)
        if core and not _is_mathematical(core, parameters):
            break
        last = end
        ends.append(last)
        while ENDS.match(text[last - 1]) and last - 1 > max(start, first):
            last -= 1
            ends.append(last)
        so_far = text[first:end]
        if re.search(r"[.,;:]$", word) and so_far.count("(") <= so_far.count(")"):
            break
    for end in sorted(set(ends), reverse=True):
        piece = text[first:end]
        if _is_formula(piece, text[end : end + 4], display):
            try:
                return end, read(piece)
            except ValueError:
                continue
    return None


def _is_mathematical(word: str, parameters: Collection[str]) -> bool:
    """Return whether all names of a word are symbols, functions or parameters."""
    try:
        names = [token.text for token in tokens(word.rstrip(".")) if token.kind == "name"]
    except ValueError:
        return False
    known = PAIRS | FUNCTIONS | set(parameters)
    return all(len(base) == 1 or name in known or base in known
               for name in names for base in [name.rstrip("'").partition("_")[0]
                                              if name[0] not in GREEK else name[0]])  # fmt: skip


def _is_formula(piece: str, following: str, display: bool) -> bool:
    """Return whether a piece of text is meant as a formula: it has a sign or a letter that words do not have."""
    if re.fullmatch(r"[A-Za-z]'?", piece):
        name = piece.isupper() and INITIAL.match(following)
        return piece not in "aAI" and not following.startswith("'") and not name
    if piece in PAIRS:
        return True
    if re.search(r"\(\d{4}\)", piece):  # a year
        return False
    if re.match(r"a (?![=<>])", piece) or (not display and piece.endswith(" a")):
        return False
    return bool(STRONG.search(piece)) and not re.fullmatch(r"[\d./ -]+", piece)
