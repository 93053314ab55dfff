"""What a sweep consists of, and what is left of it."""

from __future__ import annotations

import functools
import hashlib
import inspect
import json
from collections.abc import Generator, Iterable, Iterator, Sequence
from itertools import product
from pathlib import Path
from time import perf_counter
from typing import Any, NamedTuple

import mitsuba as mi

from .. import __version__
from ..cluster import Failed, run
from ..fit import STARTS, Observations, find_metric, fit, observe
from ..fit.observations import CUT
from ..measured.files import FileError, checked, content_hash
from ..mitsuba import guests
from ..mitsuba.registry import find_models, is_own
from ..model import Model
from .store import Store, row_of


class Outcome(NamedTuple):
    """How a task ended."""

    size: int
    """How many fits or pictures it had."""
    error: str | None = None
    """Why there are none."""


class Sweep:
    """All fits of some models to some files, and a folder for them.

    A fit is known by the content of its file, the model, the metric, the seed and the settings, the variant, and the
    versions of mi_brdfs and Mitsuba, for a third-party model by the sources of its module and of those beside it: if
    any of them changes, it is made anew (:func:`versions`). Its result depends on nothing else, neither on the other
    fits nor on the workers.

    Args:
        files: measured BRDFs; of two with the same content, the first counts.
        models: names of plugins of this package or of guests.
        folder: where the results go, or are; ``results`` in it has the Parquet files.
        metrics: those that are made small, one at a time.
        seeds: of the random starts, and of what is held out.
        starts: the number of starts of each fit.
        cut: the largest angle to the normal, in degrees.

    Raises:
        ValueError: if there is no such model or metric, or a model is defined in no file.
        FileError: if a file cannot be opened.
    """

    def __init__(
        self,
        files: Iterable[str | Path],
        models: Iterable[str],
        folder: str | Path,
        *,
        metrics: Sequence[str] = ("log",),
        seeds: Sequence[int] = (0,),
        starts: int = STARTS,
        cut: float = CUT,
    ):
        for metric in metrics:
            find_metric(metric)
        found = find_models(models)
        self.folder = Path(folder)
        self.store = Store(self.folder / "results")
        self.models = [model.plugins[0] for model in found]
        self.metrics, self.seeds = list(dict.fromkeys(metrics)), list(dict.fromkeys(seeds))
        self.starts, self.cut = starts, cut
        self.files: dict[str, str] = {}
        """By the SHA-256 of their content."""
        for file in files:
            path = checked(file)
            self.files.setdefault(content_hash(path), str(path))
        self._versions = {model.plugins[0]: versions(model) for model in found}

    def wanted(self) -> Iterator[dict[str, Any]]:
        """Yield what identifies each fit: the first columns of its row."""
        every = product(self.files.items(), self.models, self.metrics, self.seeds)
        for (content, file), model, metric, seed in every:
            identity = {
                "content": content, "model": model, "metric": metric, "seed": seed, "starts": self.starts,
                "cut": float(self.cut), "variant": mi.variant(), "versions": self._versions[model],
            }  # fmt: skip
            yield {"key": digest(identity), "file": file, **identity}

    def finished(self) -> int:
        """Return how many of the fits are in the folder."""
        done = self._done()
        return sum(identity["key"] in done for identity in self.wanted())

    @property
    def total(self) -> int:
        return len(self.files) * len(self.models) * len(self.metrics) * len(self.seeds)

    def rows(self, columns: Iterable[str] | None = None) -> list[dict[str, Any]]:
        """Return the rows of the fits that are finished, each once, in the order of :meth:`wanted` and under the files'
        present names; of ``columns`` at least these."""
        found = {row["key"]: row for row in self.store.rows({"key", *columns} if columns else None)}
        return [found[it["key"]] | {"file": it["file"]} for it in self.wanted() if it["key"] in found]

    def fit(self, workers: int | None = None, scheduler: str | None = None) -> Generator[Outcome, None, None]:
        """Make the fits that are not in the folder, and put them there, those of a model to a material together.
        ``workers`` and ``scheduler`` are as :func:`mi_brdfs.cluster.run` has them.

        Raises:
            OSError: if the folder cannot be written to.
            ValueError: if workers are asked for, and a model is defined in the script that runs.
        """
        for model in find_models(self.models) if workers or scheduler else ():
            if not is_own(model) and not guests.source(model):
                raise ValueError(
                    f"{model.plugins[0]} is defined in the script that runs, or by a function; put its class into a "
                    "module, to be imported by workers."
                )
        left: dict[tuple[str, str], list[dict[str, Any]]] = {}
        done = self._done()
        for identity in self.wanted():
            if identity["key"] not in done:
                left.setdefault((identity["content"], identity["model"]), []).append(identity)
        named = {f"{model}-{digest([it['key'] for it in own])}": own for (_, model), own in left.items()}
        if not named:
            return
        self.store.prepare()
        for name, result in run(fit_material, self._tasks(named), workers=workers, scheduler=scheduler):
            if isinstance(result, Failed):
                yield Outcome(len(named[name]), result.error)
                continue
            self.store.add(name, [row_of(*pair) for pair in zip(named[name], result, strict=True)])
            yield Outcome(len(result))

    def _done(self) -> set[str]:
        return {row["key"] for row in self.store.rows(["key"])}

    def _tasks(self, named: dict[str, list[dict[str, Any]]]) -> Iterator[tuple[str, tuple]]:
        """Yield tasks, with what is seen of one material in memory at a time: workers need not have the files."""
        last, seen = None, dict[int, Observations | str]()
        for name, own in named.items():
            if own[0]["content"] != last:
                last, seen = own[0]["content"], {}
            for identity in own:
                if identity["seed"] not in seen:
                    seen[identity["seed"]] = self._observed(identity)
            jobs = [(seen[it["seed"]], it["metric"], it["seed"]) for it in own]
            yield name, (own[0]["model"], jobs, self.starts)

    def _observed(self, identity: dict[str, Any]) -> Observations | str:
        """Return what a fit sees of a file, or why it cannot."""
        try:
            seen = observe(identity["file"], self.cut, seed=identity["seed"])
            check_content(identity["file"], identity["content"])
            return seen
        except ValueError as error:
            return str(error)


def fit_material(model: str, jobs: list[tuple[Observations | str, str, int]], starts: int) -> list[dict[str, Any]]:
    """Return the fits of a model to a material, for each metric and seed, as ``to_dict`` has them; a worker's task."""
    found = []
    for material, metric, seed in jobs:
        if isinstance(material, str):
            raise ValueError(material)
        begun = perf_counter()
        (best,) = fit(material, model, metric=metric, starts=starts, seed=seed)
        found.append(best.to_dict() | {"seconds": perf_counter() - begun})
    return found


def check_content(file: str, expected: str) -> None:
    """Raise a FileError if a file has another content than when the sweep began, under which its results are kept."""
    if content_hash(file) != expected:
        raise FileError(f"{file} has changed since the sweep began; give the same command again.")


def digest(data: Any) -> str:
    """Return what tells data of JSON's types from others."""
    return hashlib.sha256(json.dumps(data).encode()).hexdigest()[:24]


OWN = Path(__file__).parents[1]
"""The folder of mi_brdfs."""


def versions(model: type[Model] | None = None) -> str:
    """Return all versions that a result depends on: those of mi_brdfs, of Mitsuba, of the sources of mi_brdfs unless
    these are installed, and of those of a third-party model: of its module, and of what is loaded of its package or,
    unless it is installed, from the folder of its file and those in it."""
    found = f"mi_brdfs {__version__}, Mitsuba {mi.__version__}"
    if not guests.is_installed(OWN):
        found += f", sources {_sources_of(OWN)}"
    if model is None or is_own(model):
        return found
    try:
        sources = [inspect.getsource(it) for it in _beside(inspect.getmodule(model) or model)]
    except (OSError, TypeError):
        raise ValueError(
            f"{model.plugins[0]} is defined in no file; put it into one and import that, as fits are known by the "
            "source of their model."
        ) from None
    return f"{found}, {model.__module__} {digest(sources)}"


def _beside(module: Any) -> list[Any]:
    """Return a module and the loaded ones of its package, or, unless it is installed, of the folder of its file."""
    package, path = module.__name__.partition(".")[0], Path(inspect.getfile(module))
    found = {
        it for it, file in guests.loaded_sources().items() if it.__name__.partition(".")[0] == package
        or (path.parent in file.parents and OWN not in file.parents and not guests.is_installed(path, file))
    }  # fmt: skip
    return sorted({module, *found}, key=lambda it: it.__name__)


@functools.cache
def _sources_of(folder: Path) -> str:
    """Return the digest of the files in a folder when they were first asked for: those that are loaded."""
    files = sorted(path for path in folder.rglob("*") if path.is_file() and "__pycache__" not in path.parts)
    return digest([(str(path.relative_to(folder)), content_hash(path)) for path in files])
