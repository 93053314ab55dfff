"""The explorer as a page without a browser meets it: a server, its frames through the websocket, and edits."""

from __future__ import annotations

import asyncio
import json
import subprocess
import sys
from typing import IO

import numpy as np
from aiohttp import ClientWebSocketResponse, WSMsgType

SIZE = 256


def alone(*arguments: str, first: str = "pass") -> list[str]:
    """The command of the explorer where no other extra is installed, after some other code."""
    others = ["matplotlib", "PIL", "jinja2", "flip_evaluator", "distributed", "pyarrow", "scipy"]
    code = f"import sys; sys.modules.update(dict.fromkeys({others})); from mi_brdfs.cli import main; {first}; main()"
    return [sys.executable, "-c", code, "explore", *arguments]


def serving(
    *arguments: str, first: str = "pass", stderr: int | IO = subprocess.DEVNULL
) -> tuple[subprocess.Popen, str]:
    """Start the explorer on a free port, and return its process and address."""
    command = alone("--no-browser", "--port", "0", *arguments, first=first)
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=stderr, text=True)
    return process, process.stdout.readline().strip()


class Page:
    """A page without a browser."""

    def __init__(self, socket: ClientWebSocketResponse):
        self.socket, self.serial = socket, 0

    async def frame(self, timeout: float = 120) -> dict:
        """The next frame, without its payload."""
        message = await asyncio.wait_for(self.socket.receive(), timeout)
        if message.type == WSMsgType.TEXT:
            found = json.loads(message.data)
        elif message.type == WSMsgType.BINARY:
            found = json.loads(message.data[4 : 4 + int.from_bytes(message.data[:4], "little")])
        else:
            raise ConnectionError(f"the server is gone: {message.type}")
        return {**found, "name": found.get("view", found["type"])}

    async def send(self, bsdf: dict, **members) -> None:
        self.serial += 1
        state = {"subjects": [{"bsdf": bsdf}], "size": SIZE, **members}
        await self.socket.send_str(json.dumps({"type": "state", "serial": self.serial, "state": state}))

    async def until(self, *names: str) -> dict:
        """Frames of the latest state, by name, once there is one of each."""
        found = {}
        while not set(names) <= set(found):
            frame = await self.frame()
            if frame["name"] == "error" or frame.get("error"):
                raise ValueError(frame)
            if frame.get("serial") == self.serial or "serial" not in frame:
                found.setdefault(frame["name"], frame)
        return found


def edited(bsdf: dict, controls: list[dict], rng: np.random.Generator) -> dict:
    """A plugin dict with one of its numbers or colours moved."""
    movable = [it for it in controls if it["kind"] in ("number", "colour") and it["value"] is not None]
    if not movable:
        return bsdf
    control = movable[rng.integers(len(movable))]
    low, high = (control["low"], control["high"])
    if control["kind"] == "colour":
        return {**bsdf, control["name"]: rng.uniform(low, min(high, 1), 3).tolist()}
    share = rng.uniform(0.2, 0.8)
    value = low * (high / low) ** share if control["scale"] == "log" else low + share * (high - low)
    return {**bsdf, control["name"]: value}
