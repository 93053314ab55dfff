"""Options that several commands share."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import mitsuba as mi
import typer

from .. import writing
from ..mitsuba import llvm
from ..mitsuba.fastest import fastest
from ..names import check_name
from ..starting import signals_held
from ..variants import is_measurable
from .files import OUTPUTS, check_output
from .terminal import Exit, err, fail, failing

if TYPE_CHECKING:
    from ..probe.sources import BSDFSource


def parameters_option(help: str, metavar: str = "name=value") -> Any:
    return typer.Option("-D", "--param", metavar=metavar, help=help)


PAGES = ".html", ".htm"
FIGURES = ".png", ".svg", ".pdf", ".jpg"
"""The endings of files with drawings."""


def file_option(name: str, help: str, metavar: str = "FILE", endings: Sequence[str] = (), *also: str) -> Any:
    """Return an option for a file to be written, which may have other names, too."""
    names = ["-o", "--output"] if name == "-o" else [name]
    return typer.Option(*names, *also, metavar=metavar, help=help, callback=written(name, endings))


def written(name: str, endings: Sequence[str] = ()) -> Callable:
    """Return a callback that checks a file to be written before the work whose result it is to hold."""

    def checked(parameter: typer.CallbackParam, file: Path | None) -> Path | None:
        OUTPUTS.add(parameter.name or "")
        check_output(name, file, endings)
        return file

    return checked


Json = Annotated[Path | None, file_option("--json", "Also write all that is found to this file.", endings=[".json"])]

Scheduler = Annotated[
    str | None, typer.Option(metavar="ADDRESS", help="Work on the workers of a Dask scheduler, tcp://HOST:PORT.")
]


def check_workers(workers: int | None, scheduler: str | None) -> None:
    if scheduler is not None and (workers or not scheduler):
        fail("give --workers, or --scheduler tcp://HOST:PORT, whose workers are started beside it", Exit.USAGE)


Parameters = Annotated[
    list[str] | None,
    parameters_option(
        "Set a parameter of each material that has it to a number, a word, true, false, #rrggbb or 'r;g;b', or a "
        "<default> of its XML; may be repeated."
    ),
]


def material_argument(count: str = "", metavar: str = "MATERIAL…") -> Any:
    """Return an argument for one material or for several, whose help says what these may be."""
    help = (
        "A plugin, a preset, a measured file, XML, FILE.xml:ID, fit.json:MODEL; each with its own parameters, as in "
        "ward:alpha_u=.1,alpha_v=.3."
    )
    return typer.Argument(metavar=metavar, help=f"{count} {help}".strip())


Types = Annotated[
    list[str] | None, typer.Argument(metavar="TYPE…", help="Types or aliases, as `list` shows them. Default: all.")
]

Labels = Annotated[
    str | None, typer.Option(metavar="NAME,…", help="The names of the materials, in place of what was typed.")
]

AnyVariant = Annotated[
    str | None,
    typer.Option(help="Default: cuda_ad_rgb, metal_ad_rgb or llvm_ad_rgb, whichever works, else scalar_rgb."),
]
"""The option --variant of commands that render."""

TracingVariant = Annotated[
    str | None, typer.Option(help="Vectorized and unpolarized. Default: cuda_ad_rgb, metal_ad_rgb or llvm_ad_rgb.")
]
"""The option --variant of commands that measure."""
Lenient = Annotated[
    bool, typer.Option("--lenient", help="Put cubes and grey in the place of meshes and textures that old scenes lack.")
]
"""The option of commands that upgrade scenes."""
KINDS = {
    "": "a vectorized and unpolarized variant",
    "_rgb": "an rgb variant",
    "_ad_rgb": "an rgb variant with derivatives",
}
"""What variants whose names have an ending are called in messages."""


def parameters_of(definitions: list[str] | None) -> dict[str, str]:
    """Return the values of ``-D`` and ``--param`` options, as text. Of one name, the last counts."""
    parameters: dict[str, str] = {}
    for definition in definitions or []:
        name, equals, value = definition.partition("=")
        if not equals or not name:
            fail(f"-D {definition}: write -D name=value", Exit.USAGE)
        with failing(Exit.USAGE, ValueError):
            check_name(definition)
        parameters[name] = value
    return parameters


def quantity_of(parameters: dict[str, str]) -> Any:
    """Return what the parameter ``quantity`` says that a measured file holds, which is read and has no others."""
    parameters = {"quantity": "stated"} | parameters
    for name in parameters.keys() - {"quantity"}:
        fail(f"-D {name}: a measured file has no parameter but quantity", Exit.USAGE)
    return parameters["quantity"]


def sources_of(words: list[str], parameters: dict[str, str]) -> list[BSDFSource]:
    """Return the BSDFs that words stand for, each with those of the parameters that it has, or fail with a sentence."""
    from ..probe.sources import find_sources, shared  # imports numpy

    found: list[BSDFSource] = []
    with failing(Exit.USAGE, Exception):
        given = shared(words, parameters)
    for word, own in zip(words, given, strict=True):
        with failing(Exit.USAGE, Exception, about=word):
            found += find_sources(word, own)
    return found


def source_of(word: str, parameters: dict[str, str], verb: str = "name") -> BSDFSource:
    """Return the one BSDF that a word stands for."""
    source, *others = sources_of([word], parameters)
    if others:
        words = ", ".join(it.word for it in (source, *others))
        fail(f"{word} has several materials; {verb} one of {words}", Exit.USAGE)
    return source


@contextmanager
def writing_to(file: Path) -> Iterator[None]:
    """Fail with a sentence about a file that cannot be written."""
    try:
        yield
    except OSError as error:
        fail(f"cannot write {file}: {error.strerror or error}")


def write_text(file: Path | None, text: str) -> None:
    if file is not None:
        with writing_to(file):
            writing.write_text(file, text)


def write_json(file: Path | None, data: list | dict) -> None:
    write_text(file, json.dumps(data, indent=1) + "\n")


def set_variant(wanted: str | None) -> str:
    """Activate the requested variant, or the fastest that works, and return its name."""
    if wanted and wanted not in mi.variants():
        fail(f"there is no variant {wanted}; this Mitsuba has {', '.join(mi.variants())}")
    chosen, problem = wanted or fastest() or "scalar_rgb", llvm.problem()
    if problem and chosen.startswith("llvm"):
        fail(problem)
    if problem and not wanted and chosen == "scalar_rgb":
        err.print(f"mi-brdfs: using scalar_rgb, which is slow: {problem}")
    try:
        with signals_held():
            mi.set_variant(chosen)
    except ImportError:
        fail(f"{chosen} does not work on this machine; `mi-brdfs doctor` says why")
    return chosen


def set_tracing_variant(wanted: str | None, ending: str = "") -> str:
    """Do the same among the variants that commands which measure can use, with names that have a given ending."""
    chosen = set_variant(wanted)
    if is_measurable(chosen) and chosen.endswith(ending):
        return chosen
    kind = KINDS[ending if is_measurable(chosen) else ""]
    fail(f"this needs {kind}, not {chosen}", Exit.USAGE if wanted else Exit.ERROR)
