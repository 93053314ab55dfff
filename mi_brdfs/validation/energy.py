"""What a BSDF may reflect: what the manual page of a plugin of ours says of its configuration."""

from __future__ import annotations

from math import isfinite
from typing import Any, NamedTuple


class Limits(NamedTuple):
    """``largest`` is None if no limit is known, or none exists."""

    largest: float | None
    reason: str
    default: float | None
    """The largest albedo of the default parameters, if it has these and they are known."""


def energy_limits(bsdf, conserves: bool | None, default: bool) -> Limits:
    model = getattr(bsdf, "model", None)
    energy = getattr(model, "energy", None)
    measured = energy.default if energy is not None and default else None
    if conserves is not None:
        return Limits(1 if conserves else None, "it receives", measured)
    if energy is None:
        return Limits(None, "", None)
    largest = min((albedo for given, albedo in energy.largest if _applies(given, model)), default=None)
    if largest is None or not isfinite(largest):
        return Limits(None, "", measured)
    reason = "it receives" if largest <= 1 else f"the {largest:g} times that the manual page states"
    return Limits(max(largest, 1), reason, measured)


def _applies(given: dict[str, Any], model) -> bool:
    """Whether a configuration on the page includes the model's. One that fixes numbers is taken not to."""
    chosen = model.parameters.chosen
    return all(
        chosen.get(name) in (value if isinstance(value, tuple) else (value,)) for name, value in given.items()
    ) and not any(isinstance(value, float) for value in given.values())
