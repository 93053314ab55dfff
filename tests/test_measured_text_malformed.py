"""Text files that are damaged, or written in another way: one sentence with the file's name and the place, or the same
values."""

import contextlib
import re
import struct
import time

import numpy as np
import pytest
from support import ROOT, refused, rows, traced, written

from mi_brdfs.measured import FileError, read, summarize

SAMPLES = ROOT / "tests" / "rows" / "measured"
FILES = {"zemax": "zemax.bsdf", "lighttools": "lighttools.bsdf", "cornell": "cornell.brdf", "alta": "alta.dat",
         "csv": "rows.csv"}  # fmt: skip
TEXTS = {format: (SAMPLES / name).read_text(encoding="utf-8") for format, name in FILES.items()}
ENDINGS = {format: name.rpartition(".")[2] for format, name in FILES.items()}
ZEMAX, LIGHTTOOLS, CORNELL, ALTA, CSV = TEXTS.values()


def any_table(text, counted=True):
    """What can happen to every text table: (name, text, whether a line is at fault). Some say how many rows there
    are."""
    rows = text.splitlines(keepends=True)
    last = max(k for k, row in enumerate(rows) if row[0].isdigit())

    def with_last(name, row):
        return name, "".join([*rows[:last], row + "\n", *rows[last + 1 :]]), True

    if counted:
        yield "a third", text[: len(text) // 3], True
        yield "without its last row", "".join(rows[:last]), True
    yield with_last("a word for a number", rows[last].strip().replace("0.", "O.", 1))
    yield with_last("a number of Python's", rows[last].strip().replace("0.", "0_0.", 1))
    yield with_last("a row too short", re.split("[ ,]", rows[last])[0])
    yield with_last("a row twice as long", rows[last].strip() + " " + rows[last].strip())
    yield with_last("bytes in a row", "\x00\x01\x80\xff")
    yield with_last("a line without end", "1" * (1 << 20))


def wide(count):
    """A CSV of one direction and many wavelengths."""
    names = ",".join(map(str, range(1, count + 1)))
    return f"theta_i_deg,theta_o_deg,phi_o_deg,{names}\n10,20,30{count * ',1'}\n"


def damage():
    for format, text in TEXTS.items():
        for name, damaged, at_a_line in any_table(text, format in ("zemax", "lighttools")):
            yield pytest.param(damaged, ENDINGS[format], at_a_line, id=f"{format}: {name}")
    for format, name, place, *changes in (row.split(" | ") for row in rows("measured/damage.txt")):
        text = TEXTS[format]
        for old, new in (change.replace("\\n", "\n").split(" =>") for change in changes):
            old, cut, _ = old.partition("…")
            assert old in text
            text = text.partition(old)[0] if cut else text.replace(old, new[1:].replace("9…9", "9" * 5000), 1)
        yield pytest.param(text, ENDINGS[format], place == "line", id=f"{format}: {name}")
    yield pytest.param(wide(4097), "csv", False, id="more wavelengths than can be read")


@pytest.mark.parametrize("text, ending, at_a_line", list(damage()))
def test_damage_is_one_sentence(tmp_path, text, ending, at_a_line):
    path = tmp_path / f"x.{ending}"
    path.write_bytes(text.encode("latin-1"))
    message = refused(path)
    assert len(message) < len(str(path)) + 200 and ("in line " in message) == at_a_line


def read_from(folder, text, ending="bsdf"):
    return read(written(folder, f"x.{ending}", text))


@pytest.mark.parametrize("text", [ZEMAX, LIGHTTOOLS], ids=["zemax", "lighttools"])
@pytest.mark.parametrize(
    "change",
    [
        lambda text: text.replace("\n", "\r\n"),
        lambda text: text.replace(" ", ", "),
        lambda text: text.replace("Symmetry", "SYMMETRY").replace("ScatterAzimuth", "scatterazimuth"),
        lambda text: text.replace("\n", " # said aside\n"),
        lambda text: text.replace("\n", "\n\n").replace("0.1 0.2", "0.1\n0.2"),
        lambda text: "\ufeff" + text,
        lambda text: text.encode("utf-16"),
        lambda text: text.replace("Made", "Größe, µm:").encode("latin-1"),
        lambda text: text.replace("DataEnd\n", ""),
        lambda text: "# a comment\n" * 500 + text,
    ],
)
def test_spellings_read_the_same(tmp_path, text, change):
    expected, found = read_from(tmp_path, text), read_from(tmp_path, change(text))
    assert found.format == expected.format
    np.testing.assert_array_equal(found.data.values, expected.data.values)
    assert found.stated_albedos == expected.stated_albedos


@pytest.mark.parametrize("format", TEXTS)
def test_missing_and_negative_values_are_kept(tmp_path, format):
    text, ending = TEXTS[format], ENDINGS[format]
    mark = "," if ending == "csv" else " "
    head, _, _ = text.removesuffix("DataEnd\n").rstrip().rpartition(mark)
    for number, kept in [("nan", np.nan), ("inf", np.nan), ("1e39", np.nan), ("-1e300", np.nan), ("-0.3", -0.3)]:
        values = read_from(tmp_path, f"{head}{mark}{number}\n", ending).data.values
        np.testing.assert_array_equal(values[~(abs(values) < 1e9) | (values < 0)], [kept])


HOSTILE = "\x1b]0;a title\x07\x9b31m\u202e\u2066Ø\u2028"
NOTED = {
    "zemax": ("bsdf", f"# Sample: {HOSTILE}\n# Remark {HOSTILE}\n# Made by: {HOSTILE}\n" + ZEMAX),
    "alta": ("dat", ALTA.replace("A test", HOSTILE).replace("#VS", f"#MADE {HOSTILE}\n#VS")),
    "csv": ("csv", CSV.replace("a test", HOSTILE)),
    "mbsdf": ("mbsdf", f'NVIDIA ARC MBSDF V1\nname="{HOSTILE}"\n{HOSTILE}="{HOSTILE}"\nMBSDF_DATA=\n'),
}


@pytest.mark.parametrize("format", NOTED)
def test_no_text_of_a_file_controls_a_terminal(tmp_path, format):
    """Its notes and its name, where they are told and where errors quote them."""
    ending, text = NOTED[format]
    path = tmp_path / f"{HOSTILE}\n.{ending}"
    path.write_bytes(text.encode() + (struct.pack("<3I4f", 0, 1, 1, 1, 1, 1, 1)[:16] if format == "mbsdf" else b""))
    measurement = read(path)
    summary = summarize(measurement)
    told = [measurement.material, *measurement.notes, *measurement.notes.values(), summary.file]
    assert "Ø" in measurement.material
    assert all(text.isprintable() for text in [*told, *(cell for row in summary.rows() for cell in row)])
    path.write_bytes(text.replace("DATA", HOSTILE).replace("0.1", HOSTILE).encode())
    with pytest.raises(FileError) as caught:
        read(path)
    assert str(caught.value).isprintable()


@pytest.mark.slow
@pytest.mark.parametrize("text, ending", [(CORNELL, "brdf"), (CSV, "csv")], ids=["cornell", "csv"])
def test_memory(tmp_path, text, ending):
    """Reading takes no more than twice the file beyond what it returns."""
    head, _, row = text.rstrip().rpartition("\n")
    path, row = tmp_path / f"x.{ending}", re.sub(r"(\.\d)", r"\g<1>000000000", row)
    path.write_text(head + "\n" + 40_000 * (row + "\n"))
    read(path)
    measurement, left, peak = traced(lambda: read(path))
    assert len(measurement.data.values) > 40_000
    assert peak - left < 2 * path.stat().st_size


@pytest.mark.parametrize(
    "text, ending, sentence",
    [
        ("# light " + "1" * 50_000 + "\n" + ZEMAX, "bsdf", ""),
        ("# A" + " " * 50_000 + "b\n" + ZEMAX, "bsdf", ""),
        ("theta_i_deg,theta_o_deg,phi_o_deg,450" + " " * 50_000 + "x\n0,0,0,1\n", "csv", "is no angle such as"),
        ("theta_i_deg,theta_o_deg,phi_o_deg,f,\n0,0,0,1,\n", "csv", "column 5 of the header has no name"),
        ("NVIDIA ARC MBSDF V1\n" + "\n" * 1_000_000, "mbsdf", "below it a block of data"),
    ],
    ids=["digits", "spaces", "spaces in a name", "no name", "lines"],
)
def test_time(tmp_path, text, ending, sentence):
    """Long words take no time that grows with their square: half a minute and more, or for ever."""
    path = tmp_path / f"long.{ending}"
    path.write_text(text)
    start = time.process_time()
    with pytest.raises(FileError, match=sentence) if sentence else contextlib.nullcontext():
        read(path)
    assert time.process_time() - start < 2
