"""Each command in a terminal of 80 columns: no line is longer, and nothing is cut off."""

import contextlib
import io
import os
import re
import struct
import subprocess
import sys

import pytest
from rich.cells import cell_len
from test_cli import invoke

from mi_brdfs.cli.terminal import Terminal

fcntl, pty, termios = (pytest.importorskip(name) for name in ("fcntl", "pty", "termios"))

COLUMNS = 80
QUICK = [
    *(f"{name} -h" for name in ("", "show", "render", "gallery", "plot", "convert", "check", "energy", "bench")),
    "list", "info ward", "info microfacet", "presets", "presets ngan/cook-torrance/chrome",
    "show lambert --size 16 --spp 2", "render scene.xml", "plot lambert --kind albedo",
    "check lambert phong scene.xml --only finite --only albedo",
]  # fmt: skip
LONG = ["doctor", "gallery lambert --size 16 --spp 4", "convert phong phong.binary", "energy lambert",
        "bench lambert scene.xml"]  # fmt: skip
PROCESS = """
import sys
import mi_brdfs.bench.comparison as it
from mi_brdfs.cli import app
it.CALL_ROUNDS, it.FIRST_ROUNDS = 3, 1
for line in sys.argv[1:]:
    try:
        app(line.split(), prog_name="mi-brdfs")
    except SystemExit as end:
        print(f"\\nended {end.code}: {line}", flush=True)
"""
"""Carries out one command after the other, and measures less than usual."""
SCENE = """<scene version="3.0.0"><integrator type="direct"/>
<sensor type="perspective"><film type="hdrfilm"><integer name="width" value="8"/></film></sensor>
<shape type="sphere"><bsdf type="twosided" id="a_material_whose_name_is_long_and_goes_on_for_more_than_a_line_of_text_">
<bsdf type="lambert"/></bsdf></shape><emitter type="constant"/></scene>"""


def captured(commands, folder):
    """What a terminal gets of each command, without control sequences, after which it has ended well."""
    ours, theirs = pty.openpty()
    fcntl.ioctl(theirs, termios.TIOCSWINSZ, struct.pack("HHHH", 40, COLUMNS, 0, 0))
    env = {name: value for name, value in os.environ.items() if name not in ("COLUMNS", "LINES", "NO_COLOR")}
    process = subprocess.Popen(
        [sys.executable, "-c", PROCESS, *commands],
        cwd=folder, env=env | {"TERM": "xterm"}, stdin=theirs, stdout=theirs, stderr=theirs,
    )  # fmt: skip
    os.close(theirs)
    data = b""
    with contextlib.suppress(OSError):  # the other end was closed
        while read := os.read(ours, 1 << 16):
            data += read
    os.close(ours)
    assert process.wait() == 0
    text = re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "", data.decode())
    for line in commands:
        shown, ended, text = text.partition(f"ended 0: {line}")
        assert ended, f"{line}: {shown[-1000:]}"
        yield line, shown


@pytest.mark.parametrize("commands", [QUICK, pytest.param(LONG, marks=pytest.mark.slow)])
def test_it_fits_the_terminal(commands, tmp_path):
    pytest.importorskip("matplotlib")
    pytest.importorskip("mitsuba_oidn")
    (tmp_path / "scene.xml").write_text(SCENE)
    for command, text in captured(commands, tmp_path):
        lines = [line for line in re.split(r"[\r\n]+", text) if line.strip()]
        assert len(lines) > 0 and "Traceback" not in text
        # What must not be folded: a formula, a name.
        wide = [line for line in lines if cell_len(line) > COLUMNS and not line.startswith("    ")]
        assert not [line for line in wide if "a_material_whose_name" not in line], (command, wide)
        progress = ("Checking", "Rendering", "Measuring")
        assert not [line for line in lines if re.search(r"…\s*│?$", line) and not line.startswith(progress)], command


EVIL = "a\x1b[31m\x9b1m\u202eb"
"""Letters that control a terminal: ESC, a C1 control, one that turns the direction of writing."""


@pytest.mark.parametrize(
    "words",
    [
        (f"x{EVIL}",),
        (f"--{EVIL}",),
        ("upgrade", EVIL),
        ("show", f"<bsdf type='{EVIL}'/>"),
        ("list", "--import", "evil.py"),
    ],
)
def test_no_sentence_controls_the_terminal(words, tmp_path):
    (tmp_path / "evil.py").write_text(f"raise ValueError({EVIL!r})")
    done = invoke(*words, cwd=tmp_path)
    assert done.exit_code == 2 and "31m" in done.stderr
    assert all(letter.isprintable() or letter == "\n" for letter in done.stderr), done.stderr


@pytest.mark.parametrize("is_terminal", [True, False])
def test_no_result_controls_the_terminal(is_terminal):
    """Other programs get it as it is."""
    out = Terminal(file=io.StringIO(), force_terminal=is_terminal, color_system=None, markup=False, soft_wrap=True)
    out.print(f"{EVIL}\n")
    assert out.file.getvalue() == ("a�[31m�1m�b\n\n" if is_terminal else f"{EVIL}\n\n")
