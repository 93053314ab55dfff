"""``mi-brdfs energy``: the largest albedos of models that somebody else has written, which are known here."""

import re

import numpy as np
import pytest
from scipy.stats import qmc
from test_cli import invoke

from mi_brdfs.probe.variates import sobol

GUESTS = '''
"""Lambertian surfaces that reflect what they are said to, and more."""
import mi_brdfs
from mi_brdfs.lobes import LambertLobe
from mi_brdfs.parameters import Choice, Flag, Number, OneOf, ParameterError, PerLobe, Reflectance


class Chalk(mi_brdfs.Model):
    """Reflects its colour."""

    colour = Reflectance(0.3, "colour")

    def lobes(self, p):
        return (LambertLobe(p.colour),)


class Glow(mi_brdfs.Model):
    """Gains three tenths."""

    colour = Reflectance(0.3, "colour")
    kind = Choice(("new",), "kind")
    energy = mi_brdfs.Energy(GLOW)

    def lobes(self, p):
        return (LambertLobe(1.3 * p.colour),)


class Paint(mi_brdfs.Model):
    """Reflects what its choices say times a number between 1/4 and 1/2, and has a black lobe beside."""

    diffuse_reflectance = Reflectance(0.25, "colour of the coat below", role="diffuse")
    colour = Reflectance(0.5, "colour")
    depth = Number(0.5, (0.25, 0.5), "depth")
    length = Number(1, (0, float("inf")), "has no effect")
    kind = OneOf({"dull": {}, "wet": {"gloss": Choice(("low", "high"), "gloss")}, "old": {}}, "kind")
    layers = PerLobe(2, wide=Flag(False, "has no effect"))
    bright = Flag(False, "twice as bright")

    def __init__(self, props):
        super().__init__(props)
        if self.kind == "old" and self.bright:
            raise ParameterError("paint: what is old is not bright.")

    def lobes(self, p):
        gloss = 1.1 if self.kind == "wet" and self.gloss == "high" else 1
        brightness = (2 if self.bright else 1) * gloss * p.depth
        return LambertLobe(p.diffuse_reflectance), LambertLobe(brightness * p.colour)


class Broken(mi_brdfs.Model):
    """Fails."""

    colour = Reflectance(0.3, "colour")

    def lobes(self, p):
        return (LambertLobe(p.color),)


class Void(mi_brdfs.Model):
    """Is not a number."""

    colour = Reflectance(0.3, "colour")

    def lobes(self, p):
        return (LambertLobe(p.colour * float("nan")),)
'''
PAINT = """\
energy = Energy(
    0.5,
    [
        ({"kind": ("dull", "old"), "bright": False}, 0.5),
        ({"kind": "dull", "bright": True}, 1),
        ({"kind": "wet", "gloss": "low", "bright": False}, 0.5),
        ({"kind": "wet", "gloss": "low", "bright": True}, 1),
        ({"kind": "wet", "gloss": "high", "bright": False}, 0.55),
        ({"kind": "wet", "gloss": "high", "bright": True}, 1.1),
    ],
)

"""
RIGHT = "0.39, [({}, 1.3)]"


def energy(folder, *words, glow=RIGHT):
    (folder / "guests.py").write_text(GUESTS.replace("GLOW", glow))
    return invoke("energy", *words, "--import", "guests.py", cwd=folder)


pytestmark = pytest.mark.usefixtures("llvm_rgb", "as_before")


@pytest.mark.slow
def test_known_albedos_are_measured(tmp_path):
    done = energy(tmp_path, "chalk", "glow", "paint", glow="1, [({}, 1)]")
    assert done.exit_code == 0 and re.fullmatch(r"3 measured in [\d.]+ s, \w+_rgb\.\n", done.stderr), done.stderr
    chalk, glow, paint = re.split(r"^(?=glow|paint)", done.stdout, flags=re.MULTILINE)
    assert [line.split() for line in chalk.splitlines()[:4]] == [
        ["chalk"],
        ["configuration", "albedo", "energy"],
        ["defaults", "0.30"],
        ["white", "1", "conserved"],
    ]
    assert "energy = Energy(0.3, [({}, 1)])\n" in chalk
    assert re.search(r"^white +1\.3 +gained *$", glow, re.MULTILINE)
    assert f"energy = Energy({RIGHT})\n" in glow
    assert paint.partition("\n\n")[2] == PAINT


WRONG = {
    "exceeded": ("0.39, [({}, 1.28)]", "glow: white: 1.28 is stated, but it is exceeded: found 1.3, at θ = "),
    "too high": ("0.39, [({}, 1.4)]", "glow: white: 1.4 is stated, but it is too high: found 1.3, at θ = "),
    "no limit": ('0.39, [({}, float("inf"))]', "glow: white: no limit is stated, but there is a limit: found 1.3, at"),
    "defaults": ("0.3, [({}, 1.3)]", "glow: defaults: 0.3 is stated, but it is exceeded: found 0.39\n"),
    "right": (RIGHT, ""),
}


@pytest.mark.parametrize("stated, sentence", WRONG.values(), ids=WRONG)
def test_statements_are_compared_with_what_is_found(tmp_path, stated, sentence):
    done = energy(tmp_path, "chalk", "glow", "--check", glow=stated)
    assert done.exit_code == (1 if sentence else 0) and sentence in done.stdout, done.stdout + done.stderr
    assert "chalk states no energy.\n" in done.stderr and done.stdout.count("WRONG") == bool(sentence)


ERRORS = {
    "unknown name": ("chlk", RIGHT, 2, "There is no model 'chlk'; did you mean 'chalk'?"),
    "broken": ("broken", RIGHT, 1, "broken: .*no attribute 'color'"),
    "not a number": ("void", RIGHT, 1, "void: the albedo is not a number at θ = "),
    "no word": ("glow", '1, [({"kind": "old"}, 1)]', 1, "glow: {'kind': 'old'} is no configuration: glow: kind = "),
}


@pytest.mark.parametrize("name, glow, status, sentence", ERRORS.values(), ids=ERRORS)
def test_what_cannot_be_measured_is_told_in_a_sentence(tmp_path, name, glow, status, sentence):
    done = energy(tmp_path, name, glow=glow)
    assert done.exit_code == status and done.stdout == "" and done.stderr.count("\n") == 1, done.stderr
    assert re.search(sentence, done.stderr), done.stderr


# --- What is said of numbers ----------------------------------------------------------------------------------------


def test_variates_are_those_of_sobol():
    """But for the digits that are exchanged, which are those of the first point."""
    found = np.round(sobol(10, 3) * 2.0**24).astype(int)
    expected = np.round(qmc.Sobol(3, scramble=False).random_base2(10) * 2.0**24).astype(int)
    found ^= found[0]
    assert abs(found[np.lexsort(found.T)] - expected[np.lexsort(expected.T)]).max() <= 1
