from functools import partial
from math import pi, sqrt

import reference as ref
from catalogue import Row


def row(name, ρ, σ, model="qualitative", **given):
    return Row(
        f"orennayar {name}",
        {"type": "orennayar", "model": model, **given},
        partial(ref.orennayar, reflectance=ρ, sigma=σ, model=model),
    )


ROWS = [
    row("default", 0.5, 0.35),
    row("smooth", 0.8, 0, sigma=0, reflectance=0.8),
    row("rough", 0.8, 1, sigma=1, reflectance=0.8),
    row("alpha", 0.5, 0.6 / sqrt(2), alpha=0.6),
    row("full", 0.5, 0.35, "full"),
    row("full dark", 0.05, 0.6, "full", sigma=0.6, reflectance=0.05),
    row("full rough white", 1, 1, "full", sigma=1, reflectance=1.0),
    row("full alpha", 0.8, 0.3 / sqrt(2), "full", alpha=0.3, reflectance=0.8),
]

# The full model turns negative for rough dark surfaces, and has no digits where it does.
EXTREME = [
    row(f"{model} sigma {σ:g}", 1, σ, model, sigma=σ, reflectance=1.0)
    for model in ("qualitative", "full")
    for σ in (0.0, 1e-3, pi / 2)
]

SMOOTH = {
    "orennayar": {"type": "orennayar"},
    "orennayar alpha": {"type": "orennayar", "alpha": 0.7},
    "orennayar full": {"type": "orennayar", "model": "full", "sigma": 0.5},
    "orennayar full alpha": {"type": "orennayar", "model": "full", "alpha": 0.4},
}
