"""How long an edit in the explorer takes, from a slider's event to the frames of a new picture and of new curves on the
client, through the websocket: ``python tests/latency.py [MODEL…]`` prints medians and 95th percentiles in milliseconds.
"""

from __future__ import annotations

import asyncio
import json
import subprocess
import sys
import time
from typing import IO

import numpy as np
from aiohttp import ClientSession, ClientWebSocketResponse, WSMsgType

EDITS = 30
SIZE = 256
PICTURE, CURVES = ["picture"], ["lobe", "polar", "albedo"]


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
        """Frames of the latest state, by name, once there is one of each; with ``seconds`` that it took."""
        start, found = time.perf_counter(), {}
        while not set(names) <= set(found):
            frame = await self.frame()
            if frame["name"] == "error" or frame.get("error"):
                raise ValueError(frame)
            if frame.get("serial") == self.serial or "serial" not in frame:
                found.setdefault(frame["name"], frame)
        return {**found, "seconds": time.perf_counter() - start}


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


async def measure(address: str, names: list[str] | None) -> None:
    rng = np.random.default_rng(1)
    async with ClientSession() as client, client.ws_connect(f"{address}socket", max_msg_size=1 << 26) as socket:
        page = Page(socket)
        hello = await page.frame()
        print(f"{'model':20}{'picture':>10}{'95 %':>8}{'curves':>10}{'95 %':>8}   ms, {SIZE}², {EDITS} edits of each")
        for name in names or hello["models"]:
            await page.send({"type": name}, views=[*PICTURE, *CURVES])
            told = await page.until("subject", *PICTURE, *CURVES)
            bsdf = told["subject"]["bsdf"] or {"type": name}
            columns = []
            for views in (PICTURE, CURVES):
                seconds = []
                for _ in range(EDITS + 3):
                    await page.send(edited(bsdf, told["subject"]["controls"], rng), views=views)
                    seconds.append((await page.until(*views))["seconds"])
                columns += list(1e3 * np.quantile(seconds[3:], [0.5, 0.95]))
            print(f"{name:20}{columns[0]:10.0f}{columns[1]:8.0f}{columns[2]:10.0f}{columns[3]:8.0f}", flush=True)


if __name__ == "__main__":
    process, address = serving("lambert")
    try:
        asyncio.run(measure(address, sys.argv[1:]))
    finally:
        process.terminate()
