"""Exceptions, reduced to one line each, and those that are none of Mitsuba's."""

from __future__ import annotations

import re
import sysconfig
import traceback
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from ..parameters.messages import brief, printable
from ..parameters.vocabulary import plugin_hint
from ..starting import Terminated
from .registry import plugin_names

OURS = str(Path(__file__).parents[1])
ERROR = r"^[\w.]+(?:Error|Exception|Warning): "
"""How Python begins what an exception says."""
LIBRARIES = OURS, *(sysconfig.get_path(name) for name in ("purelib", "platlib", "stdlib"))


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
    if line := line_of_author(error):
        sentence = f"{line}: {_kind(error)}: {sentence}"
    return f"{place[1]}: line {place[2]}: {sentence}" if place else sentence


def line_of_author(error: BaseException) -> str:
    """Return where the code of a model, a lobe or a term that is not ours raised an exception, as ``FILE.py, line 3``;
    nothing if none did, or if it is a ValueError, whose sentence its author wrote for others."""
    if _kind(error) in ("ValueError", "ParameterError"):
        return ""
    traced = re.findall(r'^  File "(.+)", line (\d+), in ', str(error), re.MULTILINE)
    traced = traced or [(frame.filename, frame.lineno) for frame in traceback.extract_tb(error.__traceback__)]
    called = [k for k, (file, _) in enumerate(traced) if file.startswith(OURS)]
    own = [(file, line) for file, line in traced[min(called, default=len(traced)) :] if not file.startswith(LIBRARIES)]
    return f"{Path(own[-1][0]).name}, line {own[-1][1]}" if own else ""


def _kind(error: BaseException) -> str:
    """Return the name of an exception's type, or of the one whose traceback is its text."""
    raised = re.findall(ERROR, str(error), re.MULTILINE) if "Traceback (most" in str(error) else []
    return raised[-1].rpartition(".")[2].rstrip(": ") if raised else type(error).__name__


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
    _, found, tail = text.partition("Traceback (most recent call last):")
    if found:
        text = re.split(ERROR, tail, flags=re.MULTILINE)[-1]
    # Text from a scene file must not control the terminal.
    return printable(" ".join(text.split()))
