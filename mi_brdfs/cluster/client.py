"""The client's side of a run on Dask workers."""

from __future__ import annotations

import asyncio
import logging
import os
import queue
import subprocess
import sys
import time
import uuid
import warnings
from collections.abc import Callable, Iterator
from concurrent.futures import wait
from contextlib import ExitStack, contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import dask
from distributed import CancelledError, Client, Future, LocalCluster, futures_of
from distributed.comm import connect
from distributed.gc import disable_gc_diagnosis
from distributed.scheduler import KilledWorker
from distributed.utils import LoopRunner, sync

from . import ClusterError
from .worker import Failed, Setup, call_as, problem, setup, versions

CONNECTING = 3
"""Seconds to wait for a scheduler."""
JOINING = 10
"""Seconds to wait for a first worker."""
SILENT = 30
"""Seconds without an answer after which a scheduler counts as gone."""
ROUNDS = 4
"""How often a task is given to workers anew after those that had it died, each time as often as the scheduler allows,
four times by default."""
AHEAD = 2
"""Tasks submitted per worker: each runs one, and one is there when it ends; more would wait for one worker while
another, which joined later, has nothing to do."""
LOOKING = 0.1
"""Seconds to wait for a result before looking after the workers; these are counted again after as many while some of
this machine's have not joined …"""
LOOKING_ON = 1
"""… and after these otherwise."""
# A worker is in a session of its own, as Ctrl-C is for this process alone.
DETACHED: dict[str, Any] = (
    {"start_new_session": True} if os.name == "posix" else {"creationflags": 0x200}  # CREATE_NEW_PROCESS_GROUP
)


def run_on_workers(
    function: Callable, tasks: Iterator[tuple[str, tuple]], workers: int | None, scheduler: str | None, shared: tuple
) -> Iterator[tuple[str, Any]]:
    """See :func:`mi_brdfs.cluster.run`."""
    with ExitStack() as stack:
        stack.enter_context(_quiet())
        stack.enter_context(dask.config.set({"distributed.comm.timeouts.connect": CONNECTING}))
        processes = None
        if scheduler:
            client = stack.enter_context(_connected(scheduler))
            here = setup(None)
            _check_workers(client, scheduler, here)
        else:
            assert workers
            cluster = stack.enter_context(
                LocalCluster(n_workers=0, processes=True, host="127.0.0.1", scheduler_port=0, dashboard_address=None)
            )
            disable_gc_diagnosis()  # what Python calls while it collects garbage swallows Ctrl-C
            client = stack.enter_context(Client(cluster, timeout=CONNECTING))
            here = setup((os.cpu_count() or 1) // workers)
            processes = _Processes(cluster.scheduler_address, workers)
            stack.callback(processes.end)
            processes.start()
        run = _Run(client, processes, function, (here, shared))
        stack.callback(run.cancel)
        yield from run.results(tasks)


class _Run:
    """The tasks that workers have, and how they fare."""

    def __init__(self, client: Client, processes: _Processes | None, function: Callable, common: tuple[Setup, tuple]):
        self.client, self.processes, self.function = client, processes, function
        self.id = f"mi_brdfs-{uuid.uuid4().hex}"
        self.count = 0
        # Dask gives tasks to workers that have what these need, so all would wait for the first that has it: a
        # scheduler's workers get copies, and those of this machine, which begin later, get it with each task.
        self.common: Any = common
        if not processes:
            self.common = client.submit(_same, common, key=f"{self.id}-common")
            client.replicate([self.common])
        self.pending: dict[Future, tuple[str, tuple, int]] = {}
        self.ended: queue.SimpleQueue[Future] = queue.SimpleQueue()
        self.workers, self.asked = 0, -1.0

    def results(self, tasks: Iterator[tuple[str, tuple]]) -> Iterator[tuple[str, Any]]:
        """Yield keys and results."""
        left, suspects = True, list[tuple[str, tuple, int]]()
        while True:
            # Tasks wait behind others at workers, and share their fate: give those of dead ones out one by one.
            while left and not suspects and len(self.pending) < AHEAD * max(self._worker_count(), 1):
                task = next(tasks, None)
                left = task is not None
                if task:
                    self._submit(*task)
            if not self.pending:
                if not suspects:
                    return
                self._submit(*suspects.pop(0))
            try:
                future = self.ended.get(timeout=LOOKING)
            except queue.Empty:
                self._look_after_workers()
                continue
            key, arguments, rounds = self.pending.pop(future)
            result = self._result(future)
            if self.processes:
                self.processes.failures = 0
            if not isinstance(result, KilledWorker):
                yield key, result
            elif rounds < ROUNDS:
                suspects.append((key, arguments, rounds + 1))
            else:
                yield key, Failed("each worker that had this task died")

    def cancel(self) -> None:
        """Take back what no worker has begun."""
        if self.client.status == "running":
            self.client.cancel([*self.pending, *futures_of(self.common)], force=True)

    def _submit(self, key: str, arguments: tuple, rounds: int = 1) -> None:
        self.count += 1
        task = f"{self.id}-{self.count}"
        future = self.client.submit(
            call_as, self.common, self.function.__module__, self.function.__name__, arguments,
            key=task, pure=False, priority=-self.count,  # in this order, also of those submitted at once
        )  # fmt: skip
        self.pending[future] = key, arguments, rounds
        future.add_done_callback(self.ended.put)

    def _result(self, future: Future) -> Any:
        """Return the result, or that the workers that had the task died."""
        try:
            error = future.exception()
            if error is None:
                return self._fetched(future)
        except KilledWorker as killed:
            return killed
        except (CancelledError, OSError, TimeoutError):
            raise ClusterError(_gone(self.client)) from None
        if isinstance(error, KilledWorker):
            return error
        raise ClusterError(_gone(self.client) if isinstance(error, CancelledError) else _of_worker(error))

    def _fetched(self, future: Future) -> Any:
        """Return the result, which is computed again if its worker has died since: that needs one that lives."""
        loop = self.client.loop.asyncio_loop  # type: ignore[union-attr]
        coming = asyncio.run_coroutine_threadsafe(self.client.gather(future, asynchronous=True), loop)
        try:
            while not wait([coming], LOOKING).done:
                self._look_after_workers()
            return coming.result()
        finally:
            coming.cancel()

    def _worker_count(self) -> int:
        """Return the number of workers, asked for now and then."""
        complete = not self.processes or self.workers >= len(self.processes.running)
        if time.monotonic() - self.asked > (LOOKING_ON if complete else LOOKING):
            try:
                self.workers = len(self.client.nthreads(callback_timeout=SILENT))
            except (OSError, TimeoutError):
                raise ClusterError(_gone(self.client)) from None
            self.asked = time.monotonic()
        return self.workers

    def _look_after_workers(self) -> None:
        if self.client.status != "running":
            raise ClusterError(_gone(self.client))
        self._worker_count()  # or the scheduler is silent
        if self.processes:
            self.processes.start()
            if self.processes.failures > 5 * len(self.processes.running):
                raise ClusterError(f"The worker processes fail: {self.processes.last_words()}")


class _Processes:
    """Dask workers of one task thread each, which are started anew when they end.

    They are started by Dask's command, not by ``multiprocessing``, which would run the main module again in each.
    Without a scheduler they end by themselves.
    """

    def __init__(self, address: str, count: int):
        self.folder = TemporaryDirectory(prefix="mi_brdfs-", ignore_cleanup_errors=True)
        self.command = [
            sys.executable, "-m", "distributed.cli.dask_worker", address, "--nthreads", "1", "--no-nanny",
            "--no-dashboard", "--memory-limit", "0", "--local-directory", self.folder.name, "--death-timeout", "60",
        ]  # fmt: skip
        path = os.pathsep.join(each or os.getcwd() for each in sys.path)
        self.environment = os.environ | {"PYTHONPATH": path, "DASK_LOGGING__DISTRIBUTED": "error"}
        self.running: list[subprocess.Popen | None] = [None] * count
        self.failures = 0
        """How often one ended with an error, and not by a signal, since a task ended."""

    def start(self) -> None:
        """Start those that do not run."""
        for index, process in enumerate(self.running):
            if process is None or process.poll() is not None:
                self.failures += process is not None and process.returncode > 0
                with open(self._log(index), "a") as log:
                    self.running[index] = subprocess.Popen(
                        self.command, env=self.environment, stdin=subprocess.DEVNULL, stdout=log, stderr=log, **DETACHED
                    )

    def last_words(self) -> str:
        """Return the last line that one of them wrote."""
        lines = [line for index in range(len(self.running)) for line in self._log(index).read_text().splitlines()]
        return lines[-1] if lines else "nothing"

    def end(self) -> None:
        """End all at once."""
        for process in self.running:
            if process is not None:
                process.kill()
        for process in self.running:
            if process is not None:
                process.wait()
        self.folder.cleanup()

    def _log(self, index: int) -> Path:
        return Path(self.folder.name, f"{index}.log")


@contextmanager
def _connected(address: str) -> Iterator[Client]:
    runner = LoopRunner()
    runner.start()
    try:
        # A client waits for ever for the greeting of what accepts connections and is no scheduler.
        sync(runner.loop, _greet, address, callback_timeout=CONNECTING)
        client = Client(address, timeout=CONNECTING)
    except Exception:  # none, or whatever the bytes of another protocol are taken for
        raise ClusterError(
            f"No Dask scheduler of a similar version answers at {address}; give the address that `dask scheduler` "
            "prints when it starts, tcp://HOST:PORT."
        ) from None
    finally:
        runner.stop()
    with client:
        yield client


async def _greet(address: str) -> None:
    (await connect(address)).abort()


def _check_workers(client: Client, address: str, here: Setup) -> None:
    try:
        client.wait_for_workers(1, timeout=JOINING)
    except TimeoutError:
        raise ClusterError(
            f"The scheduler at {address} has no workers; start some: dask worker {address} --nthreads 1"
        ) from None
    try:
        found = client.sync(client._run, versions, callback_timeout=JOINING)
    except TimeoutError:
        raise ClusterError(
            f"A worker of the scheduler at {address} has not answered for {JOINING:.0f} s; end or restart it."
        ) from None
    except Exception as error:
        raise ClusterError(_of_worker(error)) from None
    for worker, nthreads in client.nthreads().items():
        if worker in found and (text := problem(found[worker], here.versions, nthreads)):
            raise ClusterError(f"The worker at {worker} {text}.")


def _same(common: Any) -> Any:
    return common


def _gone(client: Client) -> str:
    return f"The scheduler at {client._start_arg if isinstance(client._start_arg, str) else 'this machine'} has gone."


def _of_worker(error: BaseException) -> str:
    if isinstance(error, ModuleNotFoundError) and (error.name or "").split(".")[0] == "mi_brdfs":
        return "A worker cannot import mi_brdfs; install the version that is here on all machines."
    return str(error)


@contextmanager
def _quiet() -> Iterator[None]:
    """Keep Dask's log from the terminal: what matters is raised."""
    names = [name for name in logging.root.manager.loggerDict if name.split(".")[0] in ("distributed", "tornado")]
    audible = [logger for logger in map(logging.getLogger, names) if not logger.disabled]
    for logger in audible:
        logger.disabled = True
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", module="distributed")
        try:
            yield
        finally:
            for logger in audible:
                logger.disabled = False
