"""The formulas of the manual pages, read as trees: nothing is lost, and their values are those of the reference."""

import inspect
import re

import numpy as np
import pytest
import reference
from scipy import special
from website.formulas import FRACTIONS, SUPERSCRIPTS, Node, Number, Symbol, read
from website.search import find
from website.tex import tex

from mi_brdfs.integrators.shading import Shading
from mi_brdfs.mitsuba.registry import own_models

PAGES = {plugin.plugins[0]: inspect.cleandoc(plugin.__doc__) for plugin in [*own_models(), Shading]}


def parameters(name):
    plugin = next(plugin for plugin in [*own_models(), Shading] if plugin.plugins[0] == name)
    return {word for row in plugin.parameter_rows()[1:] for word in re.findall(r"\w+", row[0])}


def formulas(name):
    """The trees of all formulas of a page, each with its text."""
    for paragraph in PAGES[name].split("\n\nExample\n")[0].split("\n\n"):
        displayed = paragraph.startswith("    ")
        for text in re.split(r",\s{2,}|\n(?=    )", paragraph) if displayed else [re.sub("``.*?``", "☐", paragraph)]:
            for start, end, node in find(text, parameters(name), displayed):
                yield text[start:end], node


# --- Reading and setting --------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "text, expected",
    [
        ("f = ρ/π", r"f = \frac{\rho}{\pi}"),
        ("2ρ/(k+1) cosθ_i^k", r"\frac{2\, \rho}{k + 1}\, \cos^{k} \theta_{i}"),
        ("ρs D G / (4 cosθ_i)", r"\frac{\rho_{s}\, D\, G}{4\, \cos \theta_{i}}"),
        ("√(p/2) (1-p)²", r"\sqrt{\frac{p}{2}}\, \left(1 - p\right)^{2}"),
        ("(c - s)/2s", r"\frac{c - s}{2\, s}"),
        ("|wi_xy + wo_xy|²", r"\left|\omega_{i,xy} + \omega_{o,xy}\right|^{2}"),
        ("cosᵞθ_h", r"\cos^{\gamma} \theta_{h}"),
        ("x^(-1/2)", "x^{- 1/2}"),
        ("max(0, r·wo)ⁿ⁺¹", r"\max\left(0,\; r \cdot \omega_{o}\right)^{n + 1}"),
        ("mix(0.1, Ē, sheen_tint)", r"\operatorname{mix}\left(0.1,\; \bar{E},\; \mathrm{sheen\_tint}\right)"),
        ("S'(u) >= ½", r"S'\left(u\right) \ge \frac{1}{2}"),
        ("w (1-u)", r"w\, \left(1 - u\right)"),
        ("w(1-u)", r"w\left(1 - u\right)"),
    ],
)
def test_tex(text, expected):
    assert tex(read(text)) == expected


@pytest.mark.parametrize("text", ["", "1 +", "(a", "a)", "a/b/c", "max(", "x^", "Σ", "a & b", "a = (b = c)"])
def test_what_is_no_formula_is_refused(text):
    with pytest.raises(ValueError):
        read(text)


@pytest.mark.parametrize(
    "text, found",
    [
        ("J. F. Blinn, Journal 5(2), 2000, pp. 1-3.", []),
        ("A surface of albedo a, in a (dark) room.", []),
        ("is at most ρs (F = 1), and 2.9 ρs for n = 10.", ["ρs", "F = 1", "2.9 ρs", "n = 10"]),
        ("by a factor of 4/π, with h = (wi+wo)/|wi+wo| and F.", ["4/π", "h = (wi+wo)/|wi+wo|", "F"]),
        ("V-cavity, half-vector, f-number, 30 %, 89.9°, mi_brdfs.lobes", []),
        ("For the correlated form: E. Heitz, Understanding masking.", []),
    ],
)
def test_formulas_are_found_in_text(text, found):
    assert [text[start:end] for start, end, _ in find(text)] == found


@pytest.mark.parametrize("name", PAGES)
def test_nothing_is_lost(name):
    """Every letter and sign of a formula is in its tree, once."""
    for text, node in formulas(name):
        signs = "".join(SUPERSCRIPTS.get(letter) or "/".join(FRACTIONS.get(letter, letter)) for letter in text)
        assert sorted(written(node)) == sorted(re.sub(r"[\s^·]", "", signs)), text


def written(node):
    """A tree as plain text, without spaces, dots and signs of powers; those of cosines and the like come last."""
    if isinstance(node, Number | Symbol):
        return node.text if isinstance(node, Number) else node.name
    parts = [*map(written, node.parts)]
    match node.kind:
        case "call":
            return f"{node.signs[0]}({parts[0]})"
        case "group":
            return f"({parts[0]})"
        case "abs":
            return f"|{parts[0]}|"
        case "root":
            return f"√({parts[0]})" if isinstance(node.parts[0], Node) else f"√{parts[0]}"
        case "power" | "product" | "dot":
            return "".join(parts)
        case "quotient":
            return "/".join(parts)
        case "sum":
            return "".join(sign + part for sign, part in zip(node.signs, parts, strict=True))
        case "relation" | "list":
            return parts[0] + "".join(sign + part for sign, part in zip(node.signs, parts[1:], strict=True))
        case _:
            return node.kind + parts[0]


# --- Values ---------------------------------------------------------------------------------------------------------


class Page:
    """A page's formulas to compute with, for pairs of directions, an array of shape (3, N) each."""

    FUNCTIONS = {
        "exp": np.exp, "log": np.log, "tan": np.tan, "Γ": special.gamma, "max": np.maximum, "min": lambda *x: np.min(
            np.broadcast_arrays(*x), axis=0), "mix": lambda a, b, t: (1 - t) * a + t * b,
    }  # fmt: skip

    def __init__(self, name, wi, wo, symbols, choice=()):
        self.definitions = {}
        for text in choice:
            assert text.removeprefix("S = ").removeprefix("G = ") in " ".join(PAGES[name].split()), text
        for node in [*(node for _, node in formulas(name)), *map(read, choice)]:
            if isinstance(node, Node) and node.kind == "relation" and node.signs[0] == "=":
                self.define(node, replace=node in [read(text) for text in choice])
        half = (wi + wo) / np.sqrt(((wi + wo) ** 2).sum(axis=0))
        theta_i, theta_o = np.arccos(wi[2]), np.arccos(wo[2])
        phi = np.arctan2(wi[1], wi[0]) - np.arctan2(wo[1], wo[0])
        self.values = {
            "wi": wi, "wo": wo, "h": half, "n": np.array([[0], [0], [1]]), "π": np.pi, "θ_i": theta_i, "θ_o": theta_o,
            "θ_h": np.arccos(half[2]), "φ": phi, **symbols,
        }  # fmt: skip
        if "n" in symbols:  # an exponent
            self.values["r"] = wi * [[-1], [-1], [1]]

    def define(self, node, replace):
        left = node.parts[0]
        name = left.signs[0] if isinstance(left, Node) and left.kind == "call" else getattr(left, "name", "f")
        bound = []
        if isinstance(left, Node) and left.kind == "call":
            inner = left.parts[0]
            bound = [part.name for part in (inner.parts if isinstance(inner, Node) else [inner])]
        if replace or name not in self.definitions:
            self.definitions[name] = bound, node.parts[1]

    def __call__(self, node):
        if isinstance(node, Number):
            return float(node.text)
        if isinstance(node, Symbol):
            return self.symbol(node.name)
        match node.kind:
            case "call":
                return self.call(node)
            case "power":
                return self(node.parts[0]) ** self(node.parts[1])
        parts = [self(part) for part in node.parts]
        match node.kind:
            case "group" | "Σ":
                return parts[0]
            case "root":
                return np.sqrt(parts[0])
            case "abs":
                return np.sqrt((parts[0] ** 2).sum(axis=0)) if np.ndim(parts[0]) == 2 else np.abs(parts[0])
            case "dot":
                return (parts[0] * parts[1]).sum(axis=0)
            case "product":
                result = 1
                for part in parts:
                    result = result * part
                return result
            case "quotient":
                return parts[0] / parts[1]
            case "sum":
                return sum(-part if sign == "-" else part for sign, part in zip(node.signs, parts, strict=True))
        raise ValueError(node.kind)

    def symbol(self, name):
        if name in self.values:
            return self.values[name]
        if trig := re.fullmatch("(cos|sin|tan)(.+)", name):
            return getattr(np, trig[1])(self.symbol(trig[2]))
        base, _, axes = name.partition("_")
        if base in self.values and axes in ("x", "y", "z", "xy"):
            return self.values[base][slice(2) if axes == "xy" else "xyz".index(axes)]
        return self(self.definitions[name][1])

    def call(self, node):
        name, inner = node.signs[0], node.parts[0]
        arguments = [*map(self, inner.parts)] if isinstance(inner, Node) and inner.kind == "list" else [self(inner)]
        function = self.values.get(name, self.FUNCTIONS.get(name))
        if callable(function):
            return function(*arguments)
        bound, body = self.definitions[name]
        before, self.values = self.values, self.values | dict(zip(bound, arguments, strict=False))
        result = self(body)
        self.values = before
        return result


def directions(seed, count=200):
    """Directions above the surface, of shape (3, count)."""
    rng = np.random.default_rng(seed)
    z, phi = rng.uniform(0.02, 1, count), rng.uniform(0, 2 * np.pi, count)
    return np.array([np.sqrt(1 - z**2) * np.cos(phi), np.sqrt(1 - z**2) * np.sin(phi), z])


DS = {"ρd": 0.3, "ρs": 0.6}
ALPHAS = {"αu": 0.2, "αv": 0.5}
CASES = [
    ("lambert", {"ρ": 0.6}, [], (0.6,)),
    ("minnaert", {"ρ": 0.6, "k": 1.7}, [], (0.6, 1.7, "published")),
    ("minnaert", {"ρ": 0.6, "k": 1.7}, ["f cosθ_o = ρ/π (cosθ_i cosθ_o)^k"], (0.6, 1.7, "none")),
    ("orennayar", {"ρ": 0.6, "σ": 0.4}, ["f = ρ/π (C1 + B max(0, cosφ) sinα tanβ)"], (0.6, 0.4, "qualitative")),
    ("phong", DS | {"n": 20}, [], (0.3, 0.6, 20, "energy")),
    ("phong", DS | {"n": 20}, ["f cosθ_o = ρs max(0, r·wo)ⁿ/π"], (0, 0.6, 20, "original")),
    *(("blinnphong", DS | {"n": 20}, [k], (0.3, 0.6, 20, word)) for word, k in {
        "energy": "K = (n+2)(n+4) / (8π (2^(-n/2) + n))", "approximate": "K = (n+8)/(8π)", "ndf": "K = (n+2)/(2π)",
    }.items()),
    *(("ward", DS | ALPHAS, [s], (0.3, 0.6, 0.2, 0.5, word)) for word, s in {
        "balanced": "S = 1/(4 (wi·h)² h_z⁴)", "ward": "S = 1/(4 √(cosθ_i cosθ_o))",
        "ward-duer": "S = 1/(4 cosθ_i cosθ_o)",
    }.items()),
    ("brady", DS | {"f0": 0.1, "α": 1.3, "β": 0.5, "K": 1}, [], (0.3, 0.6, 0.1, 1.3, 0.5, "none")),
    *(("cooktorrance", DS | {"α": 0.3, "F": np.ones_like}, [d], (0.3, 0.6, 0.3, word, "modern")) for word, d in {
        "beckmann": "D = exp(-tan²θ_h/α²) / (π α² cos⁴θ_h)",
        "ggx": "D = α² / (π (sin²θ_h + α² cos²θ_h)²)",
    }.items()),
    ("cooktorrance", DS | {"α": 0.3, "n": 2 / 0.09 - 2, "F": np.ones_like}, ["D = (n+2)/(2π) cosθ_h^n"],
     (0.3, 0.6, 0.3, "blinn", "modern")),
    ("kurt", DS | ALPHAS | {"ks": 0.6, "f0": 0.1, "κ": 0.2}, [],
     (0.3, [{"specular_reflectance": 0.6, "f0": 0.1, "alpha_u": 0.2, "alpha_v": 0.5, "kurt_exponent": 0.2}])),
    ("lafortune", {"ρd": 0.3, "ρ_l": 0.6, "Cx": -0.9, "Cy": -0.8, "Cz": 0.7, "n": 9}, [],
     (0.3, [{"specular_reflectance": 0.6, "cx": -0.9, "cy": -0.8, "cz": 0.7, "exponent": 9}], "none")),
    ("low", {"ρd": 0.3, "A": 2, "B": 50, "C": 1.5, "F": lambda cos: reference.fresnel_dielectric(cos, 1.5)}, [],
     (0.3, 2, 50, 1.5, 1.5, "microfacet")),
    *(("metallicroughness", {"C": 0.7, "metallic": 0.3, "r": 0.4}, [k], (0.7, 0.3, 0.4, word)) for word, k in {
        "direct": "k = (r+1)²/8", "ibl": "k = r²/2",
    }.items()),
    *(("walter", DS | ALPHAS | {"F": np.ones_like}, [g], (0.3, 0.6, 0.2, 0.5, word, np.ones_like)) for word, g in {
        "separable": "G = 1/((1+Λ(wi))(1+Λ(wo)))", "correlated": "G = 1/(1+Λ(wi)+Λ(wo))",
    }.items()),
    ("ashikhminshirley", {"Rd": 0.3, "Rs": 0.2, "nu": 8, "nv": 90}, [], (0.3, 0.2, 8, 90)),
    *(("schlick", {"C": 0.6, "C'": 0.3, "r": 0.2, "p": 0.4}, [d], (0.6, 0.3, 0.2, 0.4, word)) for word, d in {
        "shadowed": "D = G(cosθ_i) G(cosθ_o) Z A / (4π cosθ_i cosθ_o)", "plain": "D = Z A / (4π cosθ_i cosθ_o)",
    }.items()),
    ("toon", DS | {"td": 0.5, "sd": 0.1, "b": 0.2, "ts": 0.8, "ss": 0.1, "Zd": np.pi, "Zs": np.pi}, [],
     (0.3, 0.5, 0.1, 0.2, 0.6, 0.8, 0.1, "none")),
    ("wrap", {"ρ": 0.6, "Z": np.pi, "w": 0.5, "n": 2}, [], (0.6, 0.5, 2, "hemisphere", "none")),
]  # fmt: skip
"""A model, the values of the symbols, formulas chosen from its page, and the arguments of its reference."""


@pytest.mark.parametrize("name, symbols, choice, arguments", CASES)
def test_values(name, symbols, choice, arguments):
    """What the page says is what the reference computes, times the cosine of wo."""
    wi, wo = directions(1), directions(2)
    page = Page(name, wi, wo, symbols, choice)
    whole = next(node for node in [*map(read, choice), *(node for _, node in formulas(name))] if is_brdf(node))
    value = page(whole.parts[1]) * (1 if "cosθ_o" in written(whole.parts[0]) else wo[2])
    expected = getattr(reference, name)(wi.T, wo.T, *arguments)
    np.testing.assert_allclose(value, expected, rtol=1e-9, atol=1e-12 * expected.max())


def is_brdf(node):
    left = written(node.parts[0]) if isinstance(node, Node) and node.kind == "relation" else ""
    return left in ("f", "fcosθ_o", "f|cosθ_o|")
