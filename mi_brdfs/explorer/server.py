"""The server of the page: HTTP for its files and uploads, a websocket for a session; from a free port to Ctrl-C."""

from __future__ import annotations

import asyncio
import contextlib
import errno
import ipaddress
import logging
import re
import signal
import socket
import tempfile
from collections import ChainMap
from collections.abc import Callable, Sequence
from itertools import count
from pathlib import Path
from typing import Any

from aiohttp import WSMsgType, web
from aiohttp.http_exceptions import HttpProcessingError

from .. import __version__
from ..measured import FileError, read
from ..mitsuba.errors import one_line
from ..mitsuba.registry import all_models, presets
from ..parameters.messages import brief, printable
from ..probe.sources import BSDFSource, is_measured
from ..starting import Terminated
from .export import CLIENT, index
from .materials import BALLS_ACROSS, Materials, kinds
from .session import Engine, Session
from .stages import LIGHTS, MESHES, Setting, UserScene
from .state import UPLOAD, StateError, checked_request, decoded, parse
from .tours import tours
from .views import Frame, text

PORT = 8490
"""Where a page is looked for; if it is taken and none was asked for, any free one does."""
LARGEST_UPLOAD = 64 << 20
LARGEST_FRAME = 128 << 20
"""The bytes of a message, too long or not, that are waited for: more end the connection."""
MOST_WAITING = 200
"""The most frames that wait for a page to read them; a page that reads none is let go."""
UPLOADS = 16
"""The most files that a session may hold."""
POLICY = (
    "default-src 'self'; img-src 'self' data: blob:; style-src 'self' 'unsafe-inline'; object-src 'none'; "
    "frame-ancestors "
)
NOTEBOOKS = (
    "http://localhost:* https://localhost:* http://127.0.0.1:* https://127.0.0.1:* vscode-file: vscode-webview: "
    "https://colab.research.google.com https://*.googleusercontent.com"
)
"""Who may frame the page that a notebook asks for: Jupyter, VS Code and Colab, with a kernel on this machine."""
MALFORMED = HttpProcessingError, web.RequestPayloadError
"""What aiohttp says of requests that are none."""
LOCAL = "127.0.0.1", "localhost", "::1"
ANY = {"0.0.0.0", "::"}
"""The addresses of all networks, which a machine has other names in."""


class Explorer:
    """What all pages of a server share."""

    def __init__(
        self, engine: Engine, sources: list[BSDFSource], initial: dict[str, Any], hosts: list[str], notebook: bool
    ) -> None:
        # Browsers send names in small letters.
        self.engine, self.initial, self.hosts = engine, initial, [host.lower() for host in hosts]
        self.policy = POLICY + (NOTEBOOKS if notebook else "'none'")
        self.named = {it.word: it for it in sources}
        self.folder = tempfile.TemporaryDirectory(prefix="mi-brdfs-explore-")
        self.uploads: dict[str, BSDFSource] = {}
        self.numbers = count(1)

    def application(self) -> web.Application:
        app = web.Application(client_max_size=LARGEST_UPLOAD, middlewares=[self._guard])
        app.router.add_get("/", self._index)
        app.router.add_get("/client/{name}", self._client)
        app.router.add_get("/socket", self._socket)
        app.router.add_post("/upload", self._upload)
        app.on_shutdown.append(self._close)
        return app

    @web.middleware
    async def _guard(self, request: web.Request, handler: Any) -> web.StreamResponse:
        """Refuse requests that another page of the browser sends, under its own name or under ours."""
        origin = request.headers.get("Origin")
        if not self._is_ours(request.host) or (origin and origin.partition("://")[2].lower() != request.host.lower()):
            raise web.HTTPForbidden(text="This server answers only its own page.")
        response = await handler(request)
        if not response.prepared:
            response.headers["Content-Security-Policy"] = self.policy
            response.headers["Cache-Control"] = "no-store"
        return response

    def _is_ours(self, host: str) -> bool:
        name = (host.rpartition(":")[0] if ":" in host and not host.endswith("]") else host).lower().strip("[]")
        if name in self.hosts or ANY.isdisjoint(self.hosts):
            return name in self.hosts
        # A page of another server can give its name our address, but cannot take an address for its name.
        with contextlib.suppress(ValueError):
            return bool(ipaddress.ip_address(name))
        return False

    async def _index(self, request: web.Request) -> web.Response:
        return web.Response(text=index(), content_type="text/html")

    async def _client(self, request: web.Request) -> web.FileResponse:
        name = request.match_info["name"]
        if name not in {it.name for it in CLIENT.iterdir()}:
            raise web.HTTPNotFound
        return web.FileResponse(CLIENT / name)

    async def _upload(self, request: web.Request) -> web.Response:
        """Keep a measured file, a mesh or an environment map that can be read: the body, named in the address."""
        name = Path(request.query.get("name", "")).name or "unnamed"
        ending = re.search(r"\.(?!xml$)[a-z]{1,9}$", name, re.IGNORECASE)
        try:
            if request.content_type != "application/octet-stream":
                raise FileError("An upload is the bytes of a file, sent as application/octet-stream.")
            payload = await request.read()
            # Others may have arrived while this one was read.
            if len(list(Path(self.folder.name).iterdir())) >= UPLOADS:
                raise FileError(f"There are {UPLOADS} uploaded files already; start the explorer anew.")
            number = next(self.numbers)
            path = Path(self.folder.name) / f"upload-{number}{ending[0] if ending else ''}"
            path.write_bytes(payload)
            is_shown = path.suffix.lower() in (*LIGHTS, *MESHES)

            def take() -> dict[str, str]:
                if is_shown:
                    return self.engine.stages.add(path, brief(name))
                read(path)
                return {}

            try:
                shown = await asyncio.wrap_future(self.engine.call(take))
            except (ValueError, RuntimeError) as error:
                path.unlink()
                kept = "|".join(map(re.escape, (str(path), path.name)))
                raise FileError(re.sub(kept, lambda _: name, one_line(error))) from None
        except MALFORMED:
            return _refusal(400, "This upload is malformed.")
        except web.HTTPRequestEntityTooLarge:
            return _refusal(413, f"A file may have {LARGEST_UPLOAD >> 20} MiB at most.")
        except (FileError, OSError) as error:
            told = printable(str(error)) if isinstance(error, FileError) else f"It cannot be kept: {error.strerror}."
            return _refusal(422, told)
        if shown:
            return web.json_response(shown)
        key = f"{UPLOAD}{number}/{brief(name)}"
        self.uploads[key] = BSDFSource(name, key, str(path))
        return web.json_response({"file": key, "name": name})

    async def _socket(self, request: web.Request) -> web.WebSocketResponse:
        socket = web.WebSocketResponse(max_msg_size=LARGEST_FRAME, heartbeat=20, compress=False)
        await socket.prepare(request)
        loop, outbox = asyncio.get_running_loop(), asyncio.Queue[Frame]()

        def put(frame: Frame) -> None:
            if outbox.qsize() < MOST_WAITING:
                outbox.put_nowait(frame)
            elif request.transport:  # of a page that does not read
                request.transport.abort()

        def send(frame: Frame) -> None:
            with contextlib.suppress(RuntimeError):  # the loop has ended
                loop.call_soon_threadsafe(put, frame)

        session = Session(Materials(ChainMap(self.uploads, self.named)), self.engine.stages, send, outbox.qsize)
        self.engine.sessions.append(session)
        writer = asyncio.create_task(_write(socket, outbox))
        await outbox.put(self._hello())
        try:
            async for message in socket:
                if message.type in (WSMsgType.TEXT, WSMsgType.BINARY):
                    self._take(session, message.data)
        finally:
            session.close()
            writer.cancel()
            self.engine.wake()
        return socket

    def _take(self, session: Session, data: str | bytes) -> None:
        """Hand a message to the session; what is wrong with it is its answer."""
        try:
            message = decoded(data)
            if message["type"] == "state":
                state = parse(message.get("state"), self.engine.stages.names, self.engine.stages.shapes)
                session.show(state, message.get("serial", 0))
            else:
                session.ask(checked_request(message))
        except StateError as error:
            session.send(text(type="error", text=str(error)))
        self.engine.wake()

    def _hello(self) -> str:
        from ..fit import METRICS

        scenes = self.engine.stages
        named = [{"file": it.word, "name": it.name, "kind": "measured" if is_measured(it.source) else "material"}
                 for it in self.named.values()]  # fmt: skip
        return text(
            type="hello",
            version=__version__,
            variant=self.engine.variant,
            types=kinds(),
            presets=presets(),
            across=BALLS_ACROSS,
            files=named,
            scene=scenes.user.scene.name if scenes.user.scene else None,
            stages=scenes.names,
            shapes=scenes.shapes,
            turned=scenes.turned,
            models=[model.plugins[0] for model in all_models()],
            metrics={name: it.text for name, it in METRICS.items()},
            tours=tours(),
            state=self.initial,
        )

    async def _close(self, app: web.Application) -> None:
        self.engine.end()
        self.folder.cleanup()


async def _write(socket: web.WebSocketResponse, outbox: asyncio.Queue[Frame]) -> None:
    """Send frames as they come, until the page is gone."""
    with contextlib.suppress(ConnectionError, RuntimeError):
        while True:
            frame = await outbox.get()
            await (socket.send_bytes(frame) if isinstance(frame, bytes) else socket.send_str(frame))


def _refusal(status: int, sentence: str) -> web.Response:
    return web.json_response({"error": sentence}, status=status)


# --- Its life ---------------------------------------------------------------------------------------------------------


def listening(host: str, port: int | None) -> socket.socket:
    """Return a socket that listens, or raise a ValueError that says in a sentence why there is none."""
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    for wanted in [port] if port is not None else [PORT, 0]:
        found = socket.socket(family)
        found.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            found.bind((host, wanted))
            found.listen()
            return found
        except (TypeError, UnicodeError):
            found.close()
            raise ValueError(f"{host}: no host can have this name") from None
        except OSError as error:
            found.close()
            problem = error
    if problem.errno == errno.EADDRINUSE:
        raise ValueError(f"port {port} is in use; choose another one, or none")
    place = host if port is None else f"{host} port {port}"
    raise ValueError(f"{place}: {problem.strerror or problem}")


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
    watched: Sequence[Path],
    sources: list[BSDFSource],
    initial: dict[str, Any],
    ready: Callable[[str], None],
    notebook: bool,
) -> None:
    """Serve pages, to a notebook if that asks for them, until Ctrl-C; ``ready`` is called with their address. Files of
    models that are ``watched`` are imported again when they are saved.

    Raises:
        ValueError: if the user's scene has no such material or shape.
        RuntimeError: what Mitsuba says where it cannot load the scene, the mesh or the environment.
    """
    engine = Engine(variant, user, watched)
    port = on.getsockname()[1]
    own = socket.gethostname()  # asked once: a name server may take long
    names = [own, f"{own}.local", socket.getfqdn()] if host in ANY else []
    explorer = Explorer(engine, sources, initial, list(dict.fromkeys([*LOCAL, host, *names])), notebook)

    async def run() -> bool:
        """Return whether SIGTERM ended it."""
        terminated = asyncio.Event()
        # An exception that a signal raises may end what it interrupts instead; Windows has nothing else.
        with contextlib.suppress(NotImplementedError):
            asyncio.get_running_loop().add_signal_handler(signal.SIGTERM, terminated.set)
        if user != UserScene():  # what is wrong with it is said before there is a page
            first = Setting.of(parse(initial, engine.stages.names, engine.stages.shapes))
            await asyncio.wrap_future(engine.call(lambda: engine.stages.stage(first)))
        runner = web.AppRunner(explorer.application(), access_log=None, logger=_logger(), auto_decompress=False)
        await runner.setup()
        await web.SockSite(runner, on, shutdown_timeout=1).start()
        ready(f"http://{f'[{host}]' if ':' in host else host}:{port}/")
        try:
            while engine.is_alive() and not terminated.is_set():
                with contextlib.suppress(asyncio.TimeoutError):
                    await asyncio.wait_for(terminated.wait(), 0.5)
        finally:
            await runner.cleanup()
        return terminated.is_set()

    engine.start()
    try:
        if asyncio.run(run()):
            raise Terminated(128 + signal.SIGTERM)
    finally:
        engine.end()
        engine.join(10)
