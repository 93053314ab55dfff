"""Files as bytes and as lines of text. What is read is checked against the file's size first, and no line is held that
no table would have; every complaint names the file, and the offset or the line."""

from __future__ import annotations

import codecs
import hashlib
import os
import re
import stat
from array import array
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from ..parameters.messages import printable

LONGEST = 1 << 20
"""The characters of a line beyond which a file is no table."""


class FileError(ValueError):
    """A file that cannot be read. The message is one sentence that names the file and, where there is one, the offset
    or the line, without what would control a terminal in the file's name or its text."""

    def __init__(self, message: str) -> None:
        super().__init__(printable(message))


def checked(path: str | Path) -> Path:
    """Return the path of a file, in the folder of the environment variable MI_BRDFS_MERL_DIR if only that has it. Raise
    a FileError if it cannot be read, is no file or has nothing in it."""
    path, folder = Path(path), os.environ.get("MI_BRDFS_MERL_DIR")
    if folder and not path.exists() and (Path(folder) / path).is_file():
        path = Path(folder) / path
    try:
        status = path.stat()
    except (OSError, ValueError) as error:
        raise FileError(f"{path}: {reason(error)}.") from None
    if stat.S_ISDIR(status.st_mode):
        raise FileError(f"{path} is a directory; give a file in it.")
    if not stat.S_ISREG(status.st_mode):
        raise FileError(f"{path} is not a regular file.")
    if not os.access(path, os.R_OK):
        raise FileError(f"{path}: Permission denied.")
    if not status.st_size:
        raise FileError(f"{path} is empty.")
    return path


def content_hash(path: str | Path) -> str:
    """Return the SHA-256 of a file, as another content may have the same size and time, or raise a FileError."""
    try:
        return hashlib.sha256(Path(path).read_bytes()).hexdigest()
    except OSError as error:
        raise FileError(f"{named(path)}: {reason(error)}.") from None


def named(path: str | Path) -> str:
    """Return a path as it can be shown, without what would control a terminal or is not in UTF-8."""
    return printable(str(path))


def reason(error: Exception) -> str:
    """Return why the system refused a file."""
    return (isinstance(error, OSError) and error.strerror) or str(error)


class BinaryFile:
    """Reads a little-endian binary file from its start on."""

    def __init__(self, path: Path) -> None:
        self.path, self.size, self.offset = path, path.stat().st_size, 0

    @property
    def left(self) -> int:
        """The bytes behind the offset."""
        return max(self.size - self.offset, 0)

    def error(self, problem: str, offset: int | None = None) -> FileError:
        return FileError(f"{self.path}: at byte {self.offset if offset is None else offset}, {problem}.")

    def take(self, dtype: Any, count: int, what: str) -> np.ndarray:
        """Return the next ``count`` numbers, and move behind them. Raise a FileError if the file ends before; ``what``
        says in plural what is missing."""
        dtype = np.dtype(dtype).newbyteorder("<")
        needed = int(count) * dtype.itemsize
        if needed > self.left:
            raise self.error(
                f"{needed:,} bytes of {what} should follow, but the file ends after {self.left:,}; "
                "it is truncated, or of another format"
            )
        values = np.fromfile(self.path, dtype=dtype, count=int(count), offset=self.offset)
        if len(values) < count:
            raise self.error(f"{what} are missing; the file became shorter while it was read")
        self.offset += needed
        return values


def _foreign(error: UnicodeError) -> tuple[str, int]:
    """Take bytes that are not in UTF-8 as Windows' Western letters, which contain those of Latin-1."""
    assert isinstance(error, UnicodeDecodeError)
    return error.object[error.start : error.end].decode("cp1252", errors="replace"), error.end


FOREIGN = "mi_brdfs.foreign"
codecs.register_error(FOREIGN, _foreign)


class TextFile:
    """Reads a text file line by line, in UTF-8, UTF-16 with its mark, or Latin-1, with any line ends."""

    def __init__(self, path: Path) -> None:
        self.path, self.line = path, 0
        self.comments: list[str] = []
        self.row_lines = array("q")
        with path.open("rb") as file:
            self._encoding = encoding(file.read(4))

    def lines(self) -> Iterator[str]:
        """Yield the lines, without the white space around them; ``line`` is the number of the last one, from 1."""
        with self.path.open(encoding=self._encoding, errors=FOREIGN) as file:
            while text := file.readline(LONGEST):
                self.line += 1
                if len(text) == LONGEST:
                    raise self.error(f"there are more than {LONGEST:,} characters: this is no table")
                yield text.strip()

    def content(self) -> Iterator[str]:
        """Yield what lines have beside comments, where they have anything, and collect the comments."""
        for text in self.lines():
            text, _, comment = text.partition("#")
            if comment := comment.strip("# \t"):
                self.comments.append(comment)
            if text := text.strip():
                yield text

    def rows(self) -> Iterator[list[str]]:
        """Yield the words of lines, between white space and commas."""
        return filter(None, (text.replace(",", " ").split() for text in self.content()))

    def error(self, problem: str, line: int | None = None) -> FileError:
        return FileError(f"{self.path}: in line {self.line if line is None else line}, {problem}.")

    def numbers(self, words: Sequence[str], what: str = "a number") -> list[float]:
        """Return words as numbers, also ``nan`` and ``inf``, or raise a FileError."""
        if "_" not in "".join(words):  # which Python allows
            with suppress(ValueError):
                return list(map(float, words))
        bad = next(word for word in words if not is_number(word))
        raise self.error(f"{shortened(bad)} should be {what}")

    def table(self, rows: Iterable[Sequence[str]], columns: int, what: str, more: bool = False) -> np.ndarray:
        """Return rows of words as numbers, shape (rows, columns); with ``more``, further columns are left out.
        ``row_lines`` has the line of each. Raise a FileError if a row has fewer numbers or more, or there is no row;
        ``what`` says what columns are."""
        numbers = array("d")
        self.row_lines = array("q")
        for words in rows:
            if not words:
                continue
            if len(words) < columns or (len(words) > columns and not more):
                raise self.error(f"there are {len(words)} numbers, but should be {columns}: {what}")
            numbers.extend(self.numbers(words[:columns]))
            self.row_lines.append(self.line)
        if not numbers:
            raise self.error("the file ends without a row of numbers")
        return np.frombuffer(numbers).reshape(-1, columns)

    def list_of(self, rows: Iterable[Sequence[str]], count: int, what: str, each: str) -> np.ndarray:
        """Return as many numbers as are announced, from as many rows as they fill. Raise a FileError if there are fewer
        or more; ``what`` says in plural what they are, and ``each`` what one is."""
        found: list[float] = []
        for row in rows:
            found += self.numbers(row, each)
            if len(found) > count:
                raise self.error(f"there are {len(found)} {what}, but {count} were announced")
            if len(found) == count:
                return np.array(found)
        raise self.error(f"the file ends after {len(found)} of {count} {what}")

    def stated(self, *names: str) -> str:
        """Return what a comment ``name: …`` or ``name = …`` says, of the first pattern of names that has one."""
        for name in names:
            for comment in self.comments:
                if match := re.match(rf"(?i){name}\s*[:=]\s*(\S.*)", comment):
                    return match[1]
        return ""


def encoding(head: bytes) -> str:
    """Return the encoding that the first bytes of a text file show."""
    return "utf-16" if head.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)) else "utf-8-sig"


def decoded(data: bytes) -> str:
    """Return the text of bytes, those of a text file from its start on or a name in a binary one."""
    return data.decode(encoding(data[:4]), errors=FOREIGN)


def is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return "_" not in word


def whole(word: str) -> int:
    """Return a count, 0 if a word is none or has more than nine digits."""
    return int(word) if word.isdecimal() and len(word) < 10 else 0


def shortened(word: str) -> str:
    """Return a word as it can be quoted in a sentence."""
    return repr(word if len(word) <= 24 else word[:20] + "…")


def opening(head: bytes) -> list[str]:
    """Return the first lines of a text file, in small letters."""
    return [line.strip().lower() for line in decoded(head).splitlines()]


def first_words(lines: list[str]) -> list[str]:
    """Return the words of the first line that is no comment."""
    words = (line.partition("#")[0].replace(",", " ").split() for line in lines)
    return next(filter(None, words), [])
