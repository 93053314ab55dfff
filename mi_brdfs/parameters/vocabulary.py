"""What others call the models, the parameters and the words of choices here."""

from __future__ import annotations

from collections.abc import Iterable

from .messages import meant

METALS = {
    "aluminium": "Al", "aluminum": "Al", "chrome": "Cr", "chromium": "Cr", "copper": "Cu", "gold": "Au",
    "mercury": "Hg", "silver": "Ag", "tungsten": "W",
}  # fmt: skip
OTHERS: dict[str, tuple[str, ...]] = {
    "ggx": ("walter", "microfacet distribution=ggx", "ggx"),
    "trowbridgereitz": ("walter", "microfacet distribution=ggx", "ggx"),
    "beckmann": ("microfacet distribution=beckmann", "cooktorrance", "beckmann"),
    "orennayar": ("orennayar", "roughdiffuse"),
    "pbr": ("metallicroughness", "burley"),
    "gltf": ("metallicroughness",),
    "principled": ("burley",),
    "roughconductor": ("walter material=Au", "microfacet material=Au"),
    "conductor": ("walter material=Au",),
    "metal": ("walter material=Au", "metallicroughness metallic=1"),
    **{name: (f"walter material={symbol}", symbol) for name, symbol in METALS.items()},
    "roughness": ("roughness", "alpha", "sigma", "walter alpha=0.3"),
    "metalness": ("metallic",),
    "shininess": ("exponent",),
    "ior": ("int_ior",),
    "basecolor": ("base_color", "diffuse_reflectance", "reflectance"),
    "color": ("base_color", "diffuse_reflectance", "reflectance"),
    "albedo": ("base_color", "diffuse_reflectance", "reflectance"),
}
"""The plugins, some with an option, the parameters or the words that go by a name elsewhere, the nearest first."""


def key(name: str) -> str:
    """Return a name in small letters and digits only, as these tables have it."""
    return "".join(filter(str.isalnum, name.lower()))


def hint(name: str, known: Iterable[str], quote: str = '"', likeness: float = 0.6) -> str:
    """Return the question whether a known name was meant by another one, with the option that it needs: ``did you mean
    "walter" with material=Au?``; nothing if there is none."""
    known = list(known)
    for other in OTHERS.get(key(name), ()):
        word, _, option = other.partition(" ")
        if word in known:
            return f"did you mean {quote}{word}{quote}" + (f" with {option}?" if option else "?")
    near = meant(name, known, likeness)
    return f"did you mean {quote}{near}{quote}?" if near else ""


def plugin_hint(name: str, known: Iterable[str], quote: str = '"') -> str:
    """Return whether the name of a plugin is another one misspelt, or else how to bring a plugin of one's own, which
    may be called anything: only what is much alike is a slip."""
    return hint(name, known, quote, likeness=0.7) or "if it is your own, import it: --import FILE.py"
