"""Scenes of Mitsuba 0.2 to 0.6: read, written as scenes of Mitsuba 3, and loaded."""

from .upgrade import Change, Upgraded, load, load_legacy, upgrade, versioned

__all__ = ["Change", "Upgraded", "load", "load_legacy", "upgrade", "versioned"]
