"""Worker processes on this machine."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

# A worker is in a session of its own, as Ctrl-C is for this process alone.
DETACHED: dict[str, Any] = (
    {"start_new_session": True} if os.name == "posix" else {"creationflags": 0x200}  # CREATE_NEW_PROCESS_GROUP
)


class Processes:
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
        """How often one ended with an error, and not by a signal."""

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
