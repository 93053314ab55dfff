"""Malformed input: one sentence that says what is wrong and what would be right, no crash, and nothing left behind."""

from __future__ import annotations

import difflib
import gc
import itertools
import re
import sys

import mitsuba as mi
import numpy as np
import psutil
import pytest
from fuzzing import examples, typical, ways
from hypothesis import assume
from hypothesis import strategies as st
from support import call, direction
from test_cli import invoke

from mi_brdfs.bench.pictures import sphere
from mi_brdfs.mitsuba.errors import one_line
from mi_brdfs.mitsuba.registry import own_models
from mi_brdfs.model import Model

FEW = "lambert", "ward", "cooktorrance", "lafortune"
"""The models that are tried by default, and more often: pairs, words, conductors and lobes are among their
parameters."""
MODELS = pytest.mark.parametrize(
    "model",
    [pytest.param(model, marks=() if model.plugins[0] in FEW else pytest.mark.slow) for model in own_models()],
    ids=[model.plugins[0] for model in own_models()],
)


def refusal(load, *arguments):
    """The error of loading something, as a user sees it: in one line that a terminal shows as it is."""
    with pytest.raises(RuntimeError) as caught:
        load(*arguments)
    sentence = one_line(caught.value)
    assert sentence.isprintable() and len(sentence) < 600 and "Traceback" not in sentence, ascii(sentence[:600])
    return sentence


def usual(options):
    """A plugin's properties, as good as any."""
    return options.words | {quantity.name: typical(quantity) for quantity in options.quantities}


# --- Values ---------------------------------------------------------------------------------------------------------


def neither_numbers_nor_textures():
    plugins = ("constant", "sphere", "diffuse", "ward", "hdrfilm", "independent", "path", "isotropic", "box")
    others = [mi.ScalarTransform4f(), [0.1, 0.2, 0.3], mi.ScalarPoint2f(1, 2), mi.Float(0.5)]
    others.append(mi.Bitmap(np.zeros((2, 2))))
    texts = st.sampled_from(["", "\0", "\x1b[31m", "x" * 10_000]) | st.text().map("?{}".format)
    return st.sampled_from([{"type": plugin} for plugin in plugins] + others) | texts


def colours(channels):
    """Colours and spectra."""
    values = st.tuples(channels, channels, channels)
    rgb = values.map(lambda value: {"type": "rgb", "value": list(value)})
    return rgb | values.map(lambda value: {"type": "spectrum", "value": list(zip((400, 550, 700), value, strict=True))})


def wrong_quantity(quantity):
    """What a number or a colour may not be."""
    low, high = quantity.limits
    beyond = st.floats(max_value=low, exclude_max=True) | st.integers(max_value=int(low) - 1) | st.just(np.nan)
    if high < np.inf:
        beyond |= st.floats(min_value=high, exclude_min=True) | st.integers(min_value=int(high) + 1)
    wrong_colours = colours(beyond) if quantity.colour else colours(st.just(typical(quantity)))
    return neither_numbers_nor_textures() | st.booleans() | beyond | wrong_colours


def wrong_word(words):
    """What a choice among some words may not be."""
    textures = st.sampled_from([{"type": "uniform", "value": 0.5}, {"type": "checkerboard"}])
    wrong = neither_numbers_nor_textures() | st.floats() | st.integers() | colours(st.just(0.5)) | textures
    return wrong if True in words else wrong | st.booleans()


@MODELS
@pytest.mark.usefixtures("llvm_rgb")
def test_values(model):
    """Every parameter is given as what it may not be, one after the other."""
    known, plugin = ways(model.declared()), model.plugins[0]
    wrong, given_beside = {}, {}
    for options in known:
        for quantity in options.quantities:
            wrong.setdefault(quantity.name, wrong_quantity(quantity))
        for name in options.words:
            wrong.setdefault(name, wrong_word([other.words.get(name) for other in known]))
        given_beside = {name: usual(options) for name in usual(options)} | given_beside

    @examples(30 if plugin in FEW else 8, st.fixed_dictionaries(wrong))
    def fuzz(values):
        for name, value in values.items():
            sentence = refusal(mi.load_dict, {"type": plugin, **given_beside[name], name: value})
            assert sentence.startswith(f"{plugin}: {name} = ") and sentence.endswith("."), sentence
            assert re.search(r"(; it|\? It) must be ", sentence), sentence

    fuzz()


@pytest.mark.usefixtures("llvm_rgb")
def test_limits_are_as_float32_has_them():
    """In which Mitsuba keeps colours: that of 0.01 is less."""
    mi.load_dict({"type": "cooktorrance", "eta": {"type": "rgb", "value": (0.01, 100, 1)}, "k": 60.0})


# --- Names ----------------------------------------------------------------------------------------------------------


NEAR = 0.6


def likeness(*words):
    return difflib.SequenceMatcher(None, *words).ratio()


@st.composite
def misspelt(draw, names):
    """A name, and how someone may write it in a hurry."""
    name = draw(st.sampled_from(names))
    k = draw(st.integers(0, len(name) - 1))
    letter = draw(st.sampled_from("aeiou_xyz1"))
    ends = name[k + 1 :], letter + name[k:], letter + name[k + 1 :], name[k::-1] + name[k + 1 :]
    return name, name[:k] + draw(st.sampled_from(ends))


@MODELS
@pytest.mark.usefixtures("llvm_rgb")
def test_unknown_names(model):
    """Messages name a known one that is near or longer, if there is any; whatever the name is."""
    plugin, known = model.plugins[0], [name for parameter in model.declared() for name in parameter.names]

    @examples(30 if plugin in FEW else 8, st.tuples(misspelt(known), st.text(min_size=1)))
    def fuzz(names):
        (name, wrong), text = names
        assume(wrong not in [*known, "type", "id", ""] and text not in known)
        sentence = refusal(mi.load_dict, {"type": plugin, wrong: 0.5})
        found = re.match(
            rf"{plugin}: unknown parameter {wrong}; (?:did you mean (\w+)\? Known|known) are .+\.$", sentence
        )
        assert found, sentence
        if found[1]:
            assert found[1] in known and (likeness(found[1], wrong) >= NEAR or found[1].startswith(wrong)), sentence
        else:
            assert likeness(name, wrong) < NEAR and not (len(wrong) > 2 and name.startswith(wrong)), sentence
        refusal(mi.load_dict, {"type": plugin, text: 0.5})

    fuzz()


@pytest.mark.usefixtures("llvm_rgb")
@pytest.mark.parametrize("level", [mi.LogLevel.Error, mi.LogLevel.Warn, mi.LogLevel.Debug])
def test_mitsuba_judges_unknown_names(level, capfd):
    """As its parser is told to, and with our sentence."""
    config = mi.parser.ParserConfig(mi.variant())
    config.unused_properties = level
    wrong = {"type": "ward", "alpha": 0.3, "diffuse": 0.1, "aniso": {"type": "checkerboard"}}
    state = mi.parser.parse_dict(config, {"type": "sphere", "bsdf": wrong})
    sentences = ["ward: unknown parameter diffuse; did you mean diffuse_reflectance?", "ward: unknown parameter aniso;"]
    if level == mi.LogLevel.Error:
        with pytest.raises(RuntimeError) as caught:
            mi.parser.instantiate(config, state)
        told = str(caught.value)
        assert "Traceback" not in told
    else:
        assert str(mi.parser.instantiate(config, state).bsdf()).startswith("Ward[")
        told = "".join(capfd.readouterr())
    assert [sentence in told for sentence in sentences] == [level != mi.LogLevel.Debug] * 2, told


# --- Scene files ----------------------------------------------------------------------------------------------------


def ward(body):
    return f'<bsdf type="ward" version="3.0.0">{body}</bsdf>'


PARAMETERS = {
    "infinite": '<float name="alpha" value="1e999"/>',
    "a huge integer": f'<integer name="alpha" value="{"9" * 30}"/>',
    "a file name of escapes": '<spectrum name="diffuse_reflectance" filename="&#27;[31m&#7;&#10;gone"/>',
    "a folder as a texture": '<texture name="alpha" type="bitmap"><string name="filename" value="."/></texture>',
    "a megabyte": f'<string name="variant" value="{"x" * 10**6}"/>',
    "escapes": '<string name="variant" value="&#27;[31mred&#7;&#10;&#9;"/>',
    "escapes in a name": '<float name="&#27;[31mred&#7;" value="1"/>',
    "right to left": '<string name="variant" value="\u202edraw"/>',
    "20000 names": "".join(f'<float name="p{k}" value="1"/>' for k in range(20_000)),
}
"""What stands inside a plugin, beside what ``test_values`` gives it. Documents that are malformed otherwise are refused
by Mitsuba's parser."""


@pytest.mark.usefixtures("llvm_rgb")
@pytest.mark.parametrize("name", PARAMETERS)
def test_hostile_documents(name):
    refusal(mi.load_string, ward(PARAMETERS[name]))


FILES = {
    "empty": b"",
    "binary": bytes(range(256)) * 100,
    "latin-1": ward('<string name="variant" value="é"/>').encode("latin-1"),
    "itself": b'<scene version="3.0.0"><include filename="itself.xml"/></scene>',
    "escapes": ward(PARAMETERS["escapes"]).encode(),
    "a name with spaces": ward(PARAMETERS["infinite"]).encode(),
}


@pytest.mark.usefixtures("llvm_rgb")
@pytest.mark.parametrize("command, name", [("check", "binary"), *(("render", name) for name in FILES)])
def test_hostile_files(command, name, tmp_path):
    """On the command line: an error in one line that names the file and the line."""
    (tmp_path / f"{name}.xml").write_bytes(FILES[name])
    done = invoke(command, f"{name}.xml", cwd=tmp_path)
    assert done.exit_code in (1, 2) and done.stdout == ""
    assert done.stderr.startswith(f"mi-brdfs: {name}.xml: line 1") and done.stderr[:-1].isprintable(), done.stderr


@pytest.mark.usefixtures("llvm_rgb")
def test_ids_are_no_markup(tmp_path):
    """A report names materials by their ids, whatever stands in them."""
    body = '<shape type="sphere"><bsdf type="lambert" id="[/red]"/></shape>'
    (tmp_path / "[b].xml").write_text(f'<scene version="3.0.0">{body}</scene>')
    done = invoke("check", "--only", "finite", "[b].xml", cwd=tmp_path)
    assert done.exit_code == 0 and "[b].xml:[/red]: passed" in done.stdout, done.stderr


# --- What is left behind --------------------------------------------------------------------------------------------


def failures(count):
    """Fail to load plugins, at one point or another, and as parts of others."""
    texture = {"type": "bitmap", "bitmap": mi.Bitmap(np.zeros((64, 64, 3), np.float32))}
    wrong = [
        {"type": "lambert", "reflectance": texture, "nope": 1},
        {"type": "ward", "diffuse_reflectance": texture, "alpha": 7},
        {"type": "ward", "alpha": texture, "variant": "wrad"},
        {"type": "microfacet", "specular_reflectance": texture, "distribution": "abc"},
        {"type": "walter", "f0": texture, "eta": 1.5},
        {"type": "twosided", "nested": {"type": "ward", "diffuse_reflectance": texture, "alpha": 7}},
    ]
    for given, _ in zip(itertools.cycle(wrong), range(count), strict=False):
        with pytest.raises(RuntimeError):
            mi.load_dict(given)


def alive():
    """How many models there are."""
    gc.collect()
    return sum(isinstance(thing, Model) for thing in gc.get_objects())


@pytest.mark.usefixtures("llvm_rgb")
def test_failures_leave_no_model_behind():
    """And what is right still loads and works."""
    before, bsdf = alive(), mi.load_dict({"type": "lambert"})
    assert alive() == before + 1
    failures(200)
    assert alive() == before + 1
    (value,) = call(bsdf.eval, mi.BSDFContext(), direction(0)[None], direction(0)[None])
    np.testing.assert_allclose(value, 0.5 / np.pi, rtol=1e-6)
    picture = np.array(mi.render(mi.load_dict(sphere({"type": "ward"}, 16)), spp=1))
    assert np.isfinite(picture).all() and picture.any()


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="memory is measured on Linux")
@pytest.mark.usefixtures("llvm_rgb")
def test_failures_keep_no_memory():
    """Three hundred, each with a texture of 48 kB, would keep 14 MB each time. Pools that memory is kept in grow at
    first, so one round of four that leaves less than 5 MB behind will do."""

    levels = [psutil.Process().memory_info().rss / 2**20]
    for _ in range(4):
        failures(300)
        levels.append(psutil.Process().memory_info().rss / 2**20)
    assert min(np.diff(levels)) < 5
