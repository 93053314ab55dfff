"""Exceptions, reduced to one line each, and those that are none of Mitsuba's."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager

from ..parameters.messages import brief, printable
from ..parameters.vocabulary import plugin_hint
from ..starting import Terminated
from .registry import plugin_names


@contextmanager
def unwrapped_ctrl_c() -> Iterator[None]:
    """Raise the KeyboardInterrupt, or the exception of SIGTERM, that is the cause of another exception: of a
    RuntimeError if it reaches the Python functions that Dr.Jit and Mitsuba call, of others if it reaches the import of
    a compiled module."""
    try:
        yield
    except Exception as error:
        cause: BaseException | None = error
        while cause and not isinstance(cause, (KeyboardInterrupt, Terminated)):
            cause = cause.__cause__ or cause.__context__
        if cause:
            raise type(cause)(*cause.args) from error
        raise


def one_line(error: BaseException) -> str:
    """Reduce a Mitsuba exception to one line: its cause, with the place in the scene file if known."""
    while error.__cause__:  # render-time errors keep their cause there
        error = error.__cause__
    text = re.sub(r"\[\w+\.cpp:\d+\] ", "", str(error)) or type(error).__name__
    place = None
    for match in re.finditer(r"(?:At|[Ww]hile loading) (.+?) \(line (\d+), col \d+\): ", text):
        place, rest = match, text[match.end() :]
    broken = re.search(r'Parsing of XML file "(.+)" failed: (.+) \(line (\d+), col \d+\)', text)
    unused = re.findall(r"^ +- \$([^=]+)=", text, re.MULTILINE) if "unused parameters" in text else []
    if broken:
        return f"{broken[1]}: line {broken[3]}: {broken[2]}"
    if unused:
        return f"-D {', '.join(unused)}: the scene has no <default> parameter of this name"
    sentence = _hint(text) or _unknown_type(text) or _last_of_traceback(rest if place else text)
    return f"{place[1]}: line {place[2]}: {sentence}" if place else sentence


def _hint(text: str) -> str | None:
    """What one of our plugins says of the first property that it does not know."""
    pattern = r'unreferenced propert.+? plugin of type "(\w+)":\n  - string ".*?": "(\1: .+?)"$'
    found = re.search(pattern, text, re.DOTALL | re.MULTILINE)
    return found and found[2]


def _unknown_type(text: str) -> str | None:
    """What is wrong where no plugin has a type, and which one may have been meant."""
    found = re.search(r'(\w+) plugin of type "(.+)": .*Plugin "\2" not found', text, re.DOTALL)
    if not found:
        return None
    kind, name = found[1].replace("unknown", "").strip(), brief(found[2])
    return f'there is no {f"{kind} " if kind else ""}plugin "{name}"; {plugin_hint(name, plugin_names())}'


def _last_of_traceback(text: str) -> str:
    """Return the exception's message if ``text`` holds a Python traceback, else ``text``, in one line."""
    _, traceback, tail = text.partition("Traceback (most recent call last):")
    if traceback:
        text = re.split(r"^[\w.]+(?:Error|Exception|Warning): ", tail, flags=re.MULTILINE)[-1]
    # Text from a scene file must not control the terminal.
    return printable(" ".join(text.split()))
