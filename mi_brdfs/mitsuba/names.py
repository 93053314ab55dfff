"""Names of files, as Mitsuba takes them."""

from __future__ import annotations


def check_name(path: str) -> None:
    """Raise a ValueError if Mitsuba cannot be given a path."""
    try:
        path.encode()
    except UnicodeEncodeError:
        raise ValueError(f"Mitsuba takes only names in UTF-8; rename {path}") from None


def tabulated(path: str) -> dict[str, str]:
    """Return the plugin dict of a measured file.

    Raises:
        ValueError: if Mitsuba cannot be given its path.
    """
    check_name(path)
    return {"type": "tabulated", "filename": path}
