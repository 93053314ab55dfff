"""Models from other people's code: ``register``, and entry points of installed packages."""

import importlib.metadata
import re
import sys
import textwrap

import mitsuba as mi
import numpy as np
import pytest
from support import call, direction, python
from test_cli import invoke as command

import mi_brdfs
from mi_brdfs.bench.pictures import first_picture, in_new_process
from mi_brdfs.lobes import LambertLobe
from mi_brdfs.mitsuba import guests
from mi_brdfs.mitsuba.registry import find_model
from mi_brdfs.models.eon import EON
from mi_brdfs.parameters import Reflectance

pytestmark = pytest.mark.usefixtures("as_before")


def matte(brightness, **members):
    """A model that reflects its colour times a brightness."""

    class Matte(mi_brdfs.Model):
        """A matte surface."""

        colour = Reflectance(0.5, "colour")

        def lobes(self, p):
            return (LambertLobe(brightness * p.colour),)

    for name, value in members.items():
        setattr(Matte, name, value)
    return Matte


def brightness(plugin):
    """π f of light from straight above."""
    wi, wo = np.float32([direction(20)]), np.float32([direction(0)])
    return call(mi.load_dict({"type": plugin}).eval, mi.BSDFContext(), wi, wo)[0][0, 0] * np.pi


def test_a_model_is_known_in_every_variant(variant):
    """Whether the variant was active before or not; and to whatever takes a name."""
    model = mi_brdfs.register(matte(0.5))
    assert model.plugins == ("matte",)
    assert brightness("matte") == pytest.approx(0.25)
    with mi.variant_context("llvm_ad_mono"):
        assert brightness("matte") == pytest.approx(0.25)
    assert mi_brdfs.list_models().index("matte") == mi_brdfs.list_models().index("metallicroughness") - 1
    page = mi_brdfs.info("matte")
    assert page.startswith("A matte surface.") and "Not measured." in page and "colour" in page


@pytest.mark.usefixtures("llvm_rgb")
def test_an_edited_model_takes_its_own_place():
    """As when the cell of a notebook runs again; aliases that it no longer has are no longer listed."""
    mi_brdfs.register(matte(0.5, plugins=("matte", "dull")))
    mi_brdfs.register(matte(0.8))
    assert brightness("matte") == pytest.approx(0.4)
    assert "dull" not in mi_brdfs.list_models()
    with mi.variant_context("llvm_ad_mono"):
        assert brightness("matte") == pytest.approx(0.4)


@pytest.mark.usefixtures("llvm_rgb")
@pytest.mark.parametrize(
    "name, owner", [("ward", "mi_brdfs.models.ward.Ward"), ("diffuse", "Mitsuba"), ("shading", "mi_brdfs")]
)
def test_names_of_others_are_refused(name, owner):
    with pytest.raises(ValueError, match=f'Matte: the name "{name}" belongs to {owner}; choose another one'):
        mi_brdfs.register(matte(0.5, plugins=(name,)))


@pytest.mark.usefixtures("llvm_rgb")
def test_a_name_can_be_taken_explicitly():
    mi_brdfs.register(matte(0.5, plugins=("eon",)), replace=True)
    assert brightness("eon") == pytest.approx(0.25)
    mi_brdfs.register(EON, replace=True)
    assert brightness("eon") != pytest.approx(0.25)
    mi_brdfs.register(matte(0.5, plugins=("eon", "matt")), replace=True)
    mi_brdfs.register(matte(0.5, plugins=("matt",)))  # which gives the name up
    assert "matt" in mi_brdfs.list_models()
    mi_brdfs.register(EON, replace=True)


@pytest.mark.parametrize(
    "model, error, message",
    [
        (matte(1, plugins=()), ValueError, "Matte has no name: leave out plugins, or give it one"),
        (matte(1, __doc__=None), ValueError, "Matte has no docstring: write its manual page there"),
        (matte(1, plugins=("my matte",)), ValueError, "Matte: 'my matte' cannot be a plugin name; use letters"),
    ],
)
def test_what_is_no_model_is_refused(model, error, message):
    with pytest.raises(error, match=message):
        mi_brdfs.register(model)


@pytest.mark.slow
def test_a_plugin_of_somebody_else_is_replaced_with_a_warning():
    code = """
    import mitsuba as mi
    mi.set_variant("scalar_rgb")
    class Other(mi.BSDF):
        def __init__(self, props):
            mi.BSDF.__init__(self, props)
    mi.register_bsdf("microfacet", Other)
    import mi_brdfs
    print(type(mi.load_dict({"type": "microfacet"})).__name__)
    """
    done = python(textwrap.dedent(code))
    assert done.stdout == "Microfacet\n", done.stderr
    assert done.stderr.count("UserWarning") == 1
    assert 'replaces the BSDF "microfacet", registered by another package' in done.stderr


class EntryPoint:
    """An entry point that loads what it is given."""

    dist = None

    def __init__(self, name, brought):
        self.name, self.brought = name, brought

    def load(self):
        if isinstance(self.brought, Exception):
            raise self.brought
        return self.brought


@pytest.mark.usefixtures("llvm_rgb")
def test_entry_points_bring_models_and_failures_stay_alone(monkeypatch):
    entries = [EntryPoint("broken", ImportError("No module named 'nowhere'")), EntryPoint("matte", matte(0.3))]
    monkeypatch.setattr(importlib.metadata, "entry_points", lambda group: entries)
    with pytest.warns(UserWarning, match="The entry point broken is skipped: ImportError: No module named 'nowhere'"):
        guests.register_installed()
    assert brightness("matte") == pytest.approx(0.15)


GUEST = """
import mi_brdfs
from mi_brdfs.lobes import LambertLobe
from mi_brdfs.parameters import Choice, Number, Reflectance


class Chalk(mi_brdfs.Model):
    \"\"\"Chalk, which somebody else has written.\"\"\"

    reflectance = Reflectance(0.5, "albedo")
    dust = Number(0.5, (0, 1), "dust")
    mood = Choice(("bright", "dim"), "mood")

    def lobes(self, p):
        return (LambertLobe(p.reflectance * (1 if self.mood == "bright" else 0.5)),)
"""


@pytest.fixture
def guest(tmp_path, monkeypatch, llvm_rgb):
    """A file with a model in the working directory."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "chalk.py").write_text(GUEST)
    return tmp_path


def test_commands_take_in_a_file(guest):
    """Each of them, without a line of the project about the model."""
    option = "--import", "chalk.py"
    assert "Chalk, which somebody else has written." in command("list", *option).stdout
    page = command("info", "chalk", *option).stdout
    assert "reflectance" in page and "Not measured." in page
    assert command("plot", "chalk", *option, "-o", "lobes.png").exit_code == 0


def test_files_keep_apart_what_has_the_name_of_another(tmp_path):
    """Of a file elsewhere, and of a module of Python that is not loaded yet."""
    files = [tmp_path / folder / name for folder, name in (("one", "own.py"), ("two", "own.py"), ("two", "pyclbr.py"))]
    for k, file in enumerate(files):
        file.parent.mkdir(exist_ok=True)
        file.write_text(GUEST.replace("Chalk", f"Chalk{k}"))
        guests.import_models(str(file))
    assert {"chalk0", "chalk1", "chalk2"} <= {*mi_brdfs.list_models()}
    assert {str(file) for file in files} <= {*guests.sources()}
    assert getattr(sys.modules.get("pyclbr"), "__file__", "") != str(files[2])


def test_a_file_imports_what_is_beside_it(tmp_path):
    (tmp_path / "tones.py").write_text("WHITE = 1.0")
    (tmp_path / "toned.py").write_text(f"from tones import WHITE\n{GUEST.replace('Chalk', 'Toned')}")
    guests.import_models(str(tmp_path / "toned.py"))
    assert "toned" in mi_brdfs.list_models()


def test_a_file_registers_what_a_function_makes(tmp_path):
    body = textwrap.indent(GUEST.replace("Chalk", "Made"), "    ")
    (tmp_path / "made.py").write_text(f"def make():{body}    mi_brdfs.register(Made)\n\n\nmake()\n")
    guests.import_models(str(tmp_path / "made.py"))
    assert "made" in mi_brdfs.list_models() and guests.source(find_model("made")) == str(tmp_path / "made.py")


def test_a_file_that_failed_may_register_the_same_again(tmp_path):
    """As one whose BSDFs of Mitsuba's own kind need a variant, which is set before a second try."""
    made = textwrap.indent(GUEST.replace("Chalk", "Mixed"), "    ")
    file = tmp_path / "mixed.py"
    file.write_text(f"def make():{made}    mi_brdfs.register(Mixed)\n\n\nmake()\nraise AttributeError")
    with pytest.raises(ImportError, match="line 20: AttributeError"):
        guests.import_models(str(file))
    file.write_text(file.read_text().replace("raise AttributeError", ""))
    guests.import_models(str(file))
    assert guests.source(find_model("mixed")) == str(file)


def test_a_kind_of_parameter_that_is_not_complete_is_told_in_a_sentence(guest):
    kind = "class Bare(Parameter):\n    def bind(self, reader):\n        return self.replace()\n"
    text = GUEST.replace("Chalk", "Bared").replace("import Choice", "import Parameter, Choice")
    (guest / "bared.py").write_text(text.replace("class Bared", f"{kind}\n\nclass Bared", 1).replace(
        'mood = Choice(("bright", "dim"), "mood")', 'mood = Bare("mood")'))  # fmt: skip
    done = command("info", "bared", "--import", "bared.py")
    assert done.exit_code == 1 and "Bare does not define rows" in done.stderr and done.stderr.count("\n") == 1


def test_models_that_a_function_makes_are_told_apart_by_their_names():
    def made(name):
        return mi_brdfs.register(type("Made", (EON,), {"__doc__": "Made.", "plugins": (name,)}))

    first, second, edited = made("one"), made("two"), made("one")
    assert first is not edited and find_model("one") is edited and find_model("two") is second


@pytest.mark.slow
@pytest.mark.usefixtures("llvm_rgb")
def test_processes_of_the_bench_know_an_imported_file(guest, monkeypatch):
    """Wherever they run."""
    guests.import_models("chalk.py")
    monkeypatch.chdir("/")
    assert in_new_process(first_picture, [{"type": "chalk"}]) > 0


PLAIN = """
import drjit as dr
import mitsuba as mi


class Plain(mi.BSDF):
    def __init__(self, props):
        mi.BSDF.__init__(self, props)
        self.m_flags = int(mi.BSDFFlags.DiffuseReflection | mi.BSDFFlags.FrontSide)
        self.m_components = [self.m_flags]

    def eval(self, ctx, si, wo, active=True):
        return mi.Spectrum(-1)

    def pdf(self, ctx, si, wo, active=True):
        return mi.Float(1)

    def sample(self, ctx, si, sample1, sample2, active=True):
        return dr.zeros(mi.BSDFSample3f), mi.Spectrum(0)


mi.register_bsdf("plain", Plain)
"""


@pytest.mark.parametrize("jobs", [1, pytest.param(2, marks=pytest.mark.slow)])
def test_check_takes_a_bsdf_that_is_no_model(guest, jobs):
    (guest / "plain.py").write_text(PLAIN)
    done = command("check", "plain", "diffuse", "--import", "plain.py", "--only", "finite", "-j", jobs)
    assert done.exit_code == 1 and "finite, whole: eval is -1" in done.stdout, done.stderr


def test_a_file_takes_the_place_of_no_module(guest):
    (guest / "types.py").write_text((guest / "chalk.py").read_text())
    before = sys.modules["types"]
    done = command("check", "chalk", "--import", "types.py", "--only", "finite")
    assert done.exit_code == 0 and sys.modules["types"] is before, done.stderr


@pytest.mark.parametrize(
    "text, message",
    [
        (None, "--import guest.py: no such file"),
        ("x = 1", "--import guest.py: it defines no subclass of mi_brdfs.Model or mi.BSDF, nor a term"),
        ("import sys\nsys.exit(7)", "--import guest.py: line 2: SystemExit: 7"),
        ("\n1 / 0", "--import guest.py: line 2: ZeroDivisionError: division by zero"),
        ("raise GeneratorExit", "--import guest.py: line 1: GeneratorExit"),
        ("def f(:", "--import guest.py: line 1: invalid syntax"),
        (GUEST.replace("Chalk(", "Ward("), 'the name "ward" belongs to mi_brdfs.models.ward.Ward'),
    ],
)
def test_wrong_files_are_told_in_a_sentence(tmp_path, monkeypatch, text, message):
    monkeypatch.chdir(tmp_path)
    if text is not None:
        (tmp_path / "guest.py").write_text(text)
    done = command("list", "--import", "guest.py")
    assert done.exit_code == 2 and done.stdout == ""
    assert message in done.stderr and done.stderr.count("\n") == 1


@pytest.mark.usefixtures("llvm_rgb")
def test_the_page_on_extending_works(pytestconfig, tmp_path, monkeypatch):
    """Its model has a manual page, and passes checks."""
    monkeypatch.chdir(tmp_path)
    page = (pytestconfig.rootpath / "docs" / "extending.md").read_text(encoding="utf-8")
    code = "\n".join(re.findall(r"```python\n(.*?)```", page, re.S))
    (tmp_path / "lommel.py").write_text(code, encoding="utf-8")
    checks = [word for name in ("chi2", "weight", "reciprocity") for word in ("--only", name)]
    done = command("check", "lommel", "--import", "lommel.py", *checks)
    assert done.exit_code == 0, done.output
    assert "Lommel and Seeliger" in command("info", "lommel", "--import", "lommel.py").stdout
