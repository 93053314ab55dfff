"""Read the formulas of manual pages, which are plain text.

The text is the only source. A slash without spaces divides what touches it, ``2ρ/(k+1) cosθ``; a slash between spaces
divides the product before it by the next factor, ``D G / (4 cosθ_i cosθ_o)``. A name that touches an opening bracket is
a function.
"""

from __future__ import annotations

import re
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
    "td", "ts", "sd", "ss", "C1", "C2", "C3", "dω_h", "dω", "NL", "NV", "NH", "VH",
}  # fmt: skip
"""Symbols of more than one Latin letter."""

GREEK = {
    "α": "alpha", "β": "beta", "γ": "gamma", "θ": "theta", "κ": "kappa", "μ": "mu", "π": "pi", "ρ": "rho", "σ": "sigma",
    "ε": "varepsilon",
    "φ": "varphi", "ω": "omega", "Γ": "Gamma", "Λ": "Lambda", "η": "eta",
}  # fmt: skip
LETTER = f"[{''.join(GREEK)}]"
TOKEN = re.compile(
    rf"""(?P<space>\s+)
    |(?P<number>\d+(?:\.\d+)?)
    |(?P<trig>(?:cos|sin|tan)(?:[²⁴ⁿᵞ])?(?:[θφ](?:_[a-z])?|[αβ]))
    |(?P<name>π|dω_h|dω|{LETTER}(?:_[a-z]+|[uvdsc](?![a-z]))?|Ē|[A-Za-z]+\d?(?:_[a-z]+)?'?)
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
