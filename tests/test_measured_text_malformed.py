"""Text files that are damaged, or written in another way: one sentence with the file's name and the place, or the same
values."""

import contextlib
import re
import struct
import time
import tracemalloc

import numpy as np
import pytest
from support import written

from mi_brdfs.measured import FileError, read, summarize

ZEMAX = """# Made for a test
Source  Measured
Symmetry  PlaneSymmetrical
SpectralContent  Monochrome
ScatterType  BRDF
SampleRotation  1
0
AngleOfIncidence  2
10 50
ScatterAzimuth 3
0 90 180
ScatterRadial 2
0 30

Monochrome
DataBegin
TIS 0.1
0.1 0.2
0.1 0.3
0.1 0.4
TIS 0.2
0.2 0.5
0.2 0.6
0.2 0.7
DataEnd
"""
LIGHTTOOLS = """# Made for a test
Source Measured
Symmetry PlaneSymmetrical
SpectralContent Monochrome
ScatterAzimuth 3
90 180 270
ScatterRadial 2
0 30
DataBegin
AOI 0
POI 0
Side Front
Wavelength 550
ScatterType BRDF
TIS 0.1
0.1 0.2
0.1 0.3
0.1 0.4
AOI 40
TIS 0.2
0.2 0.5
0.2 0.6
0.2 0.7
DataEnd
"""
CORNELL = """# A test
# num wls
3
# wls
400 500
600
# rows

0.3 0 0.2 3.1 0.1 0.2 0.3
0.3 0 0.6 -1 0.3 0.4 0.5
0.6 0 0.2 -2 0.5 0.6 0.7
"""
ALTA = """#SAMPLE "A test"
#DIM 3 1
#VS 0
#PARAM_IN ISOTROPIC_TL_TV_PROJ_DPHI
#PARAM_OUT INV_STERADIAN
0.3  -0.5  0.1  0.1
0.3  -0.2  0.0  0.2
0.6  0.5  -0.1  0.3
"""
CSV = """# material: a test
theta_i_deg,phi_i_deg,theta_o_deg,phi_o_deg,r,g,b
0,0,10,20,0.1,0.2,0.3
30,0,40,180,0.2,0.3,0.4
30,0,50,170,0.3,0.4,0.5
"""


def replaced(text, old, new):
    assert old in text
    return text.replace(old, new, 1)


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
    yield with_last("a row too short", re.split("[ ,]", rows[last])[0])
    yield with_last("a row twice as long", rows[last].strip() + " " + rows[last].strip())
    yield with_last("bytes in a row", "\x00\x01\x80\xff")
    yield with_last("a line without end", "1" * (1 << 20))


def wide(count):
    """A CSV of one direction and many wavelengths."""
    names = ",".join(map(str, range(1, count + 1)))
    return f"theta_i_deg,theta_o_deg,phi_o_deg,{names}\n10,20,30{count * ',1'}\n"


ZEMAX_DAMAGE = [
    *any_table(ZEMAX),
    ("a transmission", replaced(ZEMAX, "BRDF", "BTDF"), False),
    ("no radial angles", replaced(ZEMAX, "ScatterRadial 2\n0 30\n", ""), True),
    ("a count of many digits", replaced(ZEMAX, "ScatterRadial 2", "ScatterRadial " + "9" * 5000), True),
    ("too few angles", replaced(ZEMAX, "10 50", "10"), True),
    ("too many angles", replaced(ZEMAX, "10 50", "10 20 50"), True),
    ("an angle twice", replaced(ZEMAX, "10 50", "10 10"), False),
    ("an angle that is NaN", replaced(ZEMAX, "10 50", "10 nan"), False),
    ("no data", ZEMAX.partition("DataBegin")[0], True),
    ("TIS within a block", replaced(ZEMAX, "0.1 0.3", "TIS 0.1\n0.1 0.3"), True),
    ("a missing channel", ZEMAX.replace("  Monochrome", " XYZ").replace("\nMono", "\nTristimulusX"), True),
]
LIGHTTOOLS_DAMAGE = [
    *any_table(LIGHTTOOLS),
    ("only transmission", replaced(LIGHTTOOLS, "Type BRDF", "Type BTDF"), False),
    ("two planes of incidence", replaced(LIGHTTOOLS, "AOI 40", "AOI 40\nPOI 90"), False),
    ("an incidence twice", replaced(LIGHTTOOLS, "AOI 40", "AOI 0"), True),
    ("an incidence that is no number", replaced(LIGHTTOOLS, "AOI 40", "AOI grazing"), True),
    ("an unknown keyword", replaced(LIGHTTOOLS, "Side Front", "Face Front"), True),
    ("tristimulus values with one missing", replaced(LIGHTTOOLS, "Monochrome", "XYZ"), False),
]
CORNELL_DAMAGE = [
    *any_table(CORNELL, counted=False),
    ("a count of 10 GB", replaced(CORNELL, "\n3\n", "\n1250000000\n"), True),
    ("a count of none", replaced(CORNELL, "\n3\n", "\n0\n"), True),
    ("a wavelength too many", replaced(CORNELL, "\n600", "\n600 700"), True),
    ("a wavelength of NaN", replaced(CORNELL, "400", "nan"), True),
    ("no rows", CORNELL.partition("0.3 0")[0], True),
    ("an angle that is NaN", replaced(CORNELL, "0.3 0 0.6", "0.3 0 nan"), True),
]
ALTA_DAMAGE = [
    *any_table(ALTA, counted=False),
    ("a cut", ALTA.replace("3 1", "1 3").replace("ISOTROPIC_TL_TV_PROJ_DPHI", "COS_TH"), False),
    ("no parametrisation", replaced(ALTA, "#PARAM_IN", "#PARAM"), False),
    ("an unknown output", replaced(ALTA, "INV_STERADIAN", "ENERGY"), False),
    ("no output", replaced(ALTA, "#PARAM_OUT", "#PARAM"), False),
    ("a count of many digits", replaced(ALTA, "3 1", "3 " + "9" * 5000), False),
    ("dimensions of another parametrisation", replaced(ALTA, "3 1", "4 1"), False),
    ("outputs without wavelengths", replaced(ALTA, "3 1", "3 5"), False),
    ("binary data", replaced(ALTA, "#VS 0", "#FORMAT binary"), False),
    ("a view below the surface", replaced(ALTA, "-0.2", "-2.2"), True),
    ("a view that is NaN", replaced(ALTA, "-0.2", "nan"), True),
]
CSV_DAMAGE = [
    *any_table(CSV, counted=False),
    ("no unit", replaced(CSV, "theta_i_deg", "theta_i"), True),
    ("no theta_i", replaced(CSV, "theta_i_deg", "theta_o_rad"), True),
    ("no phi_o", replaced(CSV, "phi_o_deg", "450"), True),
    ("of no direction", replaced(CSV, "theta_o_deg", "theta_deg"), True),
    ("an unknown column", replaced(CSV, ",b", ",temperature"), True),
    ("two wavelengths of the same", replaced(CSV, "r,g,b", "450,450.0,500"), True),
    ("a wavelength of 0", replaced(CSV, "r,g,b", "0nm,500,550"), True),
    ("more wavelengths than can be read", wide(4097), False),
    ("f among many wavelengths", replaced(wide(4097), "4096,", "f,"), True),
    ("rgb and wavelengths", replaced(CSV, ",b", ",450"), True),
    ("f and f cos", replaced(CSV, ",b", ",b_cos"), True),
    ("an unknown quantity", "# quantity: reflectance\n" + CSV, True),
    ("a quantity that contradicts", "# quantity: f\n" + CSV.replace("r,g,b", "r_cos,g_cos,b_cos"), True),
    ("no rows", "".join(CSV.splitlines(keepends=True)[:2]), True),
    ("an angle that is missing", replaced(CSV, "30,0,40", "30,,40"), True),
]
ENDINGS = {"zemax": "bsdf", "lighttools": "bsdf", "cornell": "brdf", "alta": "dat", "csv": "csv"}


def damage():
    each = ZEMAX_DAMAGE, LIGHTTOOLS_DAMAGE, CORNELL_DAMAGE, ALTA_DAMAGE, CSV_DAMAGE
    for (format, ending), cases in zip(ENDINGS.items(), each, strict=True):
        for name, text, at_a_line in cases:
            yield pytest.param(text, ending, at_a_line, id=f"{format}: {name}")


@pytest.mark.parametrize("text, ending, at_a_line", list(damage()))
def test_damage_is_one_sentence(tmp_path, text, ending, at_a_line):
    path = tmp_path / f"x.{ending}"
    path.write_bytes(text.encode("latin-1"))
    with pytest.raises(FileError) as caught:
        read(path)
    message = str(caught.value)
    assert message.startswith(str(path)) and message.endswith(".") and "\n" not in message
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


@pytest.mark.parametrize(
    "text, ending", [(ZEMAX, "bsdf"), (LIGHTTOOLS, "bsdf"), (CORNELL, "brdf"), (ALTA, "dat"), (CSV, "csv")], ids=ENDINGS
)
def test_missing_and_negative_values_are_kept(tmp_path, text, ending):
    mark = "," if ending == "csv" else " "
    head, _, _ = text.removesuffix("DataEnd\n").rstrip().rpartition(mark)
    for number, kept in [("nan", np.nan), ("inf", np.nan), ("1e39", np.nan), ("-1e300", np.nan), ("-0.3", -0.3)]:
        values = read_from(tmp_path, f"{head}{mark}{number}\n", ending).data.values
        np.testing.assert_array_equal(values[~(abs(values) < 1e9) | (values < 0)], [kept])


HOSTILE = "\x1b]0;a title\x07\x9b31m\u202e\u2066Ø\u2028"
NOTED = {
    "zemax": ("bsdf", f"# Sample: {HOSTILE}\n# Remark {HOSTILE}\n# Made by: {HOSTILE}\n" + ZEMAX),
    "alta": ("dat", replaced(ALTA, "A test", HOSTILE).replace("#VS", f"#MADE {HOSTILE}\n#VS")),
    "csv": ("csv", replaced(CSV, "a test", HOSTILE)),
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
    tracemalloc.start()
    measurement = read(path)
    left, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert len(measurement.data.values) > 40_000
    assert peak - left < 2 * path.stat().st_size


@pytest.mark.parametrize(
    "text, ending, sentence",
    [
        ("# light " + "1" * 50_000 + "\n" + ZEMAX, "bsdf", ""),
        ("# A" + " " * 50_000 + "b\n" + ZEMAX, "bsdf", ""),
        ("theta_i_deg,theta_o_deg,phi_o_deg,450" + " " * 50_000 + "x\n0,0,0,1\n", "csv", "is no angle, no wavelength"),
        ("NVIDIA ARC MBSDF V1\n" + "\n" * 1_000_000, "mbsdf", "more than 10,000 lines of text"),
    ],
    ids=["digits", "spaces", "spaces in a name", "lines"],
)
def test_time(tmp_path, text, ending, sentence):
    """Long words take no time that grows with their square: half a minute and more, or for ever."""
    path = tmp_path / f"long.{ending}"
    path.write_text(text)
    start = time.process_time()
    with pytest.raises(FileError, match=sentence) if sentence else contextlib.nullcontext():
        read(path)
    assert time.process_time() - start < 2
