"""The server's life: from a free port to Ctrl-C."""

from __future__ import annotations

import asyncio
import errno
import socket
from collections.abc import Callable
from typing import Any

from aiohttp import web

from ..measure.sources import BSDFSource
from .engine import Engine
from .server import LOCAL, Explorer
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


def serve(
    on: socket.socket,
    host: str,
    variant: str,
    user: UserScene,
    sources: list[BSDFSource],
    initial: dict[str, Any],
    ready: Callable[[str], None],
) -> None:
    """Serve pages until Ctrl-C; ``ready`` is called with their address."""
    engine = Engine(variant, user)
    port = on.getsockname()[1]
    explorer = Explorer(engine, sources, initial, list(dict.fromkeys([*LOCAL, host])))

    async def run() -> None:
        runner = web.AppRunner(explorer.application(), access_log=None, handle_signals=False)
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
