"""Text files that are damaged, or written in another way: one sentence with the file's name and the place, or the same
values."""

import numpy as np
import pytest

from mi_brdfs.measured import FileError, read

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


def replaced(text, old, new):
    assert old in text
    return text.replace(old, new, 1)


def any_table(text):
    """What can happen to every text table: (name, bytes, whether a line is at fault)."""
    rows = text.splitlines(keepends=True)
    last = max(k for k, row in enumerate(rows) if row[0].isdigit())
    yield "half", text[: len(text) // 2], True
    yield "a third", text[: len(text) // 3], True
    yield "without its last row", "".join(rows[:last]), True
    yield "a word for a number", "".join([*rows[:last], rows[last].replace("0.", "O.", 1), *rows[last + 1 :]]), True
    yield "a row too short", "".join([*rows[:last], rows[last].split()[0] + "\n", *rows[last + 1 :]]), True
    yield "a row twice as long", "".join([*rows[:last], rows[last].strip() + " " + rows[last], *rows[last + 1 :]]), True
    yield "bytes in a row", "".join([*rows[:last], "\x00\x01\x80\xff\n", *rows[last + 1 :]]), True
    yield "a line without end", "".join([*rows[:last], "1" * (1 << 20) + "\n", *rows[last + 1 :]]), True


ZEMAX_DAMAGE = [
    *any_table(ZEMAX),
    ("a transmission", replaced(ZEMAX, "BRDF", "BTDF"), False),
    ("an unknown symmetry", replaced(ZEMAX, "PlaneSymmetrical", "Spherical"), False),
    ("an unknown spectrum", replaced(ZEMAX, "Monochrome", "Hyperspectral"), False),
    ("no radial angles", replaced(ZEMAX, "ScatterRadial 2\n0 30\n", ""), True),
    ("a count that is no number", replaced(ZEMAX, "ScatterRadial 2", "ScatterRadial two"), True),
    ("a negative count", replaced(ZEMAX, "ScatterRadial 2", "ScatterRadial -2"), True),
    ("a count of 10 GB", replaced(ZEMAX, "ScatterRadial 2", "ScatterRadial 1250000000"), True),
    ("counts of 10 GB together", ZEMAX.replace("3\n0 90", "3000\n0 90").replace("2\n10", "2000\n10"), True),
    ("too few angles", replaced(ZEMAX, "10 50", "10"), True),
    ("too many angles", replaced(ZEMAX, "10 50", "10 20 50"), True),
    ("an angle twice", replaced(ZEMAX, "10 50", "10 10"), False),
    ("an angle of incidence of 95 degrees", replaced(ZEMAX, "10 50", "10 95"), False),
    ("an angle that is NaN", replaced(ZEMAX, "10 50", "10 nan"), False),
    ("no data", ZEMAX.partition("DataBegin")[0], True),
    ("TIS within a block", replaced(ZEMAX, "0.1 0.3", "TIS 0.1\n0.1 0.3"), True),
    (
        "a missing channel",
        ZEMAX.replace("Content  Monochrome", "Content XYZ").replace("\nMono", "\nTristimulusX"),
        True,
    ),
]
LIGHTTOOLS_DAMAGE = [
    *any_table(LIGHTTOOLS),
    ("only transmission", replaced(LIGHTTOOLS, "Type BRDF", "Type BTDF"), False),
    ("only the back", replaced(LIGHTTOOLS, "Front", "Back"), False),
    ("an unknown symmetry", replaced(LIGHTTOOLS, "PlaneSymmetrical", "Spherical"), False),
    ("two planes of incidence", replaced(LIGHTTOOLS, "AOI 40", "AOI 40\nPOI 90"), False),
    ("an incidence twice", replaced(LIGHTTOOLS, "AOI 40", "AOI 0"), False),
    ("an incidence of 120 degrees", replaced(LIGHTTOOLS, "AOI 40", "AOI 120"), False),
    ("an incidence that is no number", replaced(LIGHTTOOLS, "AOI 40", "AOI grazing"), True),
    ("no azimuths", replaced(LIGHTTOOLS, "ScatterAzimuth 3\n90 180 270\n", ""), True),
    ("a count of 10 GB", replaced(LIGHTTOOLS, "ScatterRadial 2", "ScatterRadial 1250000000"), True),
    ("counts of 10 GB together", LIGHTTOOLS.replace("3\n90", "3000\n90").replace("2\n0", "2000\n0"), True),
    ("an unknown keyword", replaced(LIGHTTOOLS, "Side Front", "Face Front"), True),
    ("tristimulus values with one missing", replaced(LIGHTTOOLS, "Monochrome", "XYZ"), False),
]


def damage():
    for format, cases in (("zemax", ZEMAX_DAMAGE), ("lighttools", LIGHTTOOLS_DAMAGE)):
        for name, text, at_a_line in cases:
            yield pytest.param(text, at_a_line, id=f"{format}: {name}")


@pytest.mark.parametrize("text, at_a_line", list(damage()))
def test_damage_is_one_sentence(tmp_path, text, at_a_line):
    path = tmp_path / "x.bsdf"
    path.write_bytes(text.encode("latin-1"))
    with pytest.raises(FileError) as caught:
        read(path)
    message = str(caught.value)
    assert message.startswith(str(path))
    assert "\n" not in message
    assert message.endswith(".")
    assert len(message) < len(str(path)) + 200
    assert ("in line " in message) == at_a_line


def written(folder, text):
    path = folder / "x.bsdf"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return read(path)


@pytest.mark.parametrize("text", [ZEMAX, LIGHTTOOLS], ids=["zemax", "lighttools"])
@pytest.mark.parametrize(
    "change",
    [
        lambda text: text.replace("\n", "\r\n"),
        lambda text: text.replace(" ", "\t"),
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
    expected, found = written(tmp_path, text), written(tmp_path, change(text))
    assert found.format == expected.format
    np.testing.assert_array_equal(found.data.values, expected.data.values)
    assert found.stated_albedos == expected.stated_albedos


def test_missing_and_negative_values_are_kept(tmp_path):
    for text in (ZEMAX, LIGHTTOOLS):
        values = written(tmp_path, text.replace("0.5", "nan").replace("0.6", "-0.6").replace("0.7", "inf")).data.values
        assert [np.isnan(values).sum(), (values < 0).sum(), np.isinf(values).sum()] == [1, 1, 1]
