"""The server's life: from a free port to Ctrl-C or SIGTERM."""

from __future__ import annotations

import asyncio
import errno
import logging
import signal
import socket
import sys
from collections.abc import Callable
from typing import Any

from aiohttp import web

from ..probe.sources import BSDFSource
from .engine import Engine
from .server import LOCAL, MALFORMED, Explorer
from .stages import UserScene

PORT = 8490
"""Where a page is looked for; if it is taken and none was asked for, any free one does."""


class PortError(ValueError):
    """No page can be served at an address."""


def listening(host: str, port: int | None) -> socket.socket:
    """Return a socket that listens.

    Raises:
        PortError: if the address cannot be had, and why, in a sentence.
    """
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    for wanted in [port] if port is not None else [PORT, 0]:
        found = socket.socket(family)
        found.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            found.bind((host, wanted))
            found.listen()
            return found
        except OSError as error:
            found.close()
            problem = error
    if problem.errno == errno.EADDRINUSE:
        raise PortError(f"port {port} is in use; choose another one, or none")
    raise PortError(f"{host} port {port}: {problem.strerror or problem}")


def _logger() -> logging.Logger:
    """Return what tells of the server's own failures, not of malformed requests, which have their answer."""
    logger = logging.getLogger(__name__)
    logger.addFilter(lambda record: not (record.exc_info and isinstance(record.exc_info[1], MALFORMED)))
    return logger


def serve(
    on: socket.socket,
    host: str,
    variant: str,
    user: UserScene,
    sources: list[BSDFSource],
    initial: dict[str, Any],
    ready: Callable[[str], None],
    notebook: bool,
) -> None:
    """Serve pages, to a notebook if that asks for them, until Ctrl-C; ``ready`` is called with their address."""
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(128 + signal.SIGTERM))
    engine = Engine(variant, user)
    port = on.getsockname()[1]
    explorer = Explorer(engine, sources, initial, list(dict.fromkeys([*LOCAL, host])), notebook)

    async def run() -> None:
        runner = web.AppRunner(explorer.application(), access_log=None, logger=_logger(), auto_decompress=False)
        await runner.setup()
        await web.SockSite(runner, on, shutdown_timeout=1).start()
        ready(f"http://{f'[{host}]' if ':' in host else host}:{port}/")
        try:
            while engine.is_alive():
                await asyncio.sleep(0.5)
        finally:
            await runner.cleanup()

    engine.start()
    try:
        asyncio.run(run())
    finally:
        engine.end()
        engine.join(10)
