"""Each command in a terminal of 80 columns: no line is longer, and nothing is cut off."""

import os
import re
import struct
import subprocess
import sys

import pytest

fcntl, pty, termios = (pytest.importorskip(name) for name in ("fcntl", "pty", "termios"))

COLUMNS = 80
COMMANDS = {
    "help": ["-h"],
    **{
        f"help of {name}": [name, "-h"]
        for name in ("show", "render", "gallery", "plot", "convert", "check", "energy", "bench")
    },
    "list": ["list"],
    "info": ["info", "ward"],
    "info of the kit": ["info", "microfacet"],
    "presets": ["presets"],
    "a preset": ["presets", "ngan/cook-torrance/chrome"],
    "doctor": ["doctor"],
    "show": ["show", "lambert", "--size", "16", "--spp", "2"],
    "render": ["render", "scene.xml"],
    "gallery": ["gallery", "lambert", "--size", "16", "--spp", "4"],
    "plot": ["plot", "lambert", "--kind", "albedo"],
    "convert": ["convert", "phong", "phong.binary"],
    "check": ["check", "lambert", "phong", "scene.xml", "--only", "finite", "--only", "albedo"],
    "energy": ["energy", "lambert"],
    "bench": ["bench", "lambert", "scene.xml"],
}
SCENE = """<scene version="3.0.0"><integrator type="direct"/>
<sensor type="perspective"><film type="hdrfilm"><integer name="width" value="8"/></film></sensor>
<shape type="sphere"><bsdf type="twosided" id="a_material_whose_name_is_long_and_goes_on_for_more_than_a_line_of_text_">
<bsdf type="lambert"/></bsdf></shape><emitter type="constant"/></scene>"""


def captured(words, folder):
    """What a terminal gets, without control sequences, and the exit status."""
    ours, theirs = pty.openpty()
    fcntl.ioctl(theirs, termios.TIOCSWINSZ, struct.pack("HHHH", 40, COLUMNS, 0, 0))
    env = {name: value for name, value in os.environ.items() if name not in ("COLUMNS", "LINES", "NO_COLOR")}
    process = subprocess.Popen(
        [sys.executable, "-m", "mi_brdfs", *words],
        cwd=folder, env=env | {"TERM": "xterm"}, stdin=theirs, stdout=theirs, stderr=theirs,
    )  # fmt: skip
    os.close(theirs)
    data = b""
    while True:
        try:
            read = os.read(ours, 1 << 16)
        except OSError:  # the other end was closed
            break
        if not read:
            break
        data += read
    os.close(ours)
    return re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "", data.decode()), process.wait()


@pytest.mark.parametrize("words", COMMANDS.values(), ids=COMMANDS)
def test_it_fits_the_terminal(words, tmp_path):
    if words[0] in ("plot", "gallery"):
        pytest.importorskip("matplotlib")
        pytest.importorskip("mitsuba_oidn")
    (tmp_path / "scene.xml").write_text(SCENE)
    text, status = captured(words, tmp_path)
    assert status == 0, text
    lines = [line for line in re.split(r"[\r\n]+", text) if line.strip()]
    assert len(lines) > 0 and "Traceback" not in text
    # What must not be folded: a formula, a name.
    wide = [line for line in lines if len(line) > COLUMNS and not line.startswith("    ")]
    assert not [line for line in wide if "a_material_whose_name" not in line], wide
    progress = ("Checking", "Rendering", "Measuring")
    assert not [line for line in lines if re.search(r"…\s*│?$", line) and not line.startswith(progress)]
