"""Scenes of Mitsuba 0.2 to 0.6: read, and written as scenes of Mitsuba 3."""

from .document import root_of
from .upgrade import Change, Upgraded, is_new, upgrade

__all__ = ["Change", "Upgraded", "is_new", "root_of", "upgrade"]
