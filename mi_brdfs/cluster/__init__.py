"""Function calls, here or on many processes and machines.

Mitsuba's tasks are of one kind: a function of plain data that takes a second or more and returns arrays and numbers.
:func:`run` calls it for each task: in this process, in worker processes of this machine, or on the workers of a Dask
cluster. Only the last two need the extra ``cluster``.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Any

from ..starting import signals_held
from .worker import Failed, call

__all__ = ["ClusterError", "Failed", "run"]


class ClusterError(RuntimeError):
    """Why a run cannot begin or go on: no scheduler there, no workers, other versions, or the scheduler has gone."""


def run(
    function: Callable,
    tasks: Mapping[str, tuple] | Iterable[tuple[str, tuple]],
    *,
    workers: int | None = None,
    scheduler: str | None = None,
    shared: tuple = (),
) -> Iterator[tuple[str, Any]]:
    """Call ``function(*shared, *arguments)`` for each task, and yield its key and result, in the order in which they
    end. Each key comes once.

    Without ``workers`` and ``scheduler``, all calls are made here. Worker processes have the variant that is active
    here and the models registered here, except those that the script that runs or a notebook defines, and run one task
    at a time. The tasks of one that dies go to the others; one of this machine is started again. When the iterator is
    closed, or Ctrl-C is pressed, the calls that run here end at once, those of a scheduler's workers when done.

    Args:
        function: one that can be imported by name, on the workers' machines too. It gets all it needs as arguments,
            also the seed, and returns plain data: no arrays of Dr.Jit and no objects of Mitsuba.
        tasks: the arguments by key. An iterable of pairs is asked for as many as the workers need; so it may be
            endless, and depend on what came back.
        workers: the number of processes to start on this machine, which share its cores.
        scheduler: the address of a Dask scheduler, ``tcp://host:8786``, whose workers have one thread for tasks
            (``--nthreads 1``), and the versions of mi_brdfs, Mitsuba, Dr.Jit and Python that there are here.
        shared: arguments that all calls have in common, sent to each worker once.

    Yields:
        The key of a task, and what the function returned; :class:`Failed` if it raised an exception, or if every
        worker that had it died.

    Raises:
        ValueError: for a negative number of workers.
        ImportError: without the extra.
        ClusterError: see there.
    """
    if workers is not None and workers < 0:
        raise ValueError(f"There cannot be {workers} workers: give the number of processes to start.")
    pairs = iter(tasks.items() if isinstance(tasks, Mapping) else tasks)
    if not workers and not scheduler:
        return ((key, call(function, (*shared, *arguments))) for key, arguments in pairs)
    if function.__module__ == "__main__":
        raise ClusterError(f"{function.__name__} is defined in the script that runs; put it into a module of its own.")
    with signals_held():
        try:
            import distributed  # noqa: F401
        except ImportError:
            raise ImportError('workers need the extra "cluster": pip install "mi_brdfs[cluster]"') from None
        from .client import run_on_workers

    return run_on_workers(function, pairs, workers, scheduler, shared)
