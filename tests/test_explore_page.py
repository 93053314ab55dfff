"""The explorer's page in Chromium, where it is installed, and its server by its own process."""

import asyncio
import base64
import json
import os
import re
import shutil
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path
from urllib.parse import unquote
from urllib.request import urlopen

import mitsuba as mi
import numpy as np
import psutil
import pytest
from explorer_page import Page, alone, edited, serving
from support import LOFT, ROOT
from test_cli import invoke

from mi_brdfs.explorer import explore
from mi_brdfs.mitsuba.registry import own_models

FEW = "from mi_brdfs.explorer import export, stages; stages.MOST = export.SPP = 4"
"""Pictures with few samples, as the machine has other things to do."""
SHADES = """() => {
    const lobe = document.querySelector('#view-lobe canvas');
    const { width, height } = lobe;
    const context = Object.assign(document.createElement('canvas'), { width, height }).getContext('2d');
    context.drawImage(lobe, 0, 0);
    return new Set(context.getImageData(0, 0, width, height).data.filter((_, k) => k % 4 === 3)).size;
}"""
"""How many opacities the lobe's picture has: more if its edges are smooth."""
CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)


@pytest.fixture(scope="module")
def server(tmp_path_factory):
    """The address of a server, and the file with what it tells on its terminal."""
    told = tmp_path_factory.mktemp("server") / "stderr"
    with told.open("w") as stderr:
        process, address = serving("ward", "walter", "-D", "alpha=0.2", first=FEW, stderr=stderr)
    yield address, told
    process.terminate()
    process.wait(20)


@pytest.fixture
def address(server):
    address, told = server
    before = len(told.read_text())
    yield address
    assert "Traceback" not in told.read_text()[before:], told.read_text()[before:]


# --- The server -------------------------------------------------------------------------------------------------------


def connected(address, conversation):
    """Run a conversation over a new socket."""
    from aiohttp import ClientSession

    async def talk():
        async with ClientSession() as client, client.ws_connect(f"{address}socket", max_msg_size=1 << 26) as ws:
            page = Page(ws)
            hello = await page.frame()
            return await conversation(page, hello, client)

    return asyncio.run(talk())


def test_the_server_greets_and_answers(address):
    async def conversation(page, hello, client):
        assert hello["type"] == "hello" and len(hello["presets"]) > 1000
        assert [it["bsdf"]["type"] for it in hello["state"]["subjects"]] == ["ward", "walter"]
        await page.send({"type": "lambert"}, views=["picture", "polar"])
        found = await page.until("picture", "polar")
        assert found["picture"]["spp"] == 1

    connected(address, conversation)


MALFORMED = [
    ("no JSON", "This is no message"),
    ("{}", "This is no message"),
    ('{"type": "shell"}', "There is no message 'shell'"),
    ('{"type": "state", "serial": "x", "state": {"subjects": [{"bsdf": {"type": "ward"}}]}}', "This is no message"),
    *((json.dumps({"type": "state", "state": {"subjects": [{"bsdf": {"type": "ward"}}], "theta": it}}),
       "theta is a number") for it in (10**400, np.nan, np.inf)),
    ("[" * 60_000, "This is no message"),
    (f'{{"type": {"[" * 900}{"]" * 900}}}', "This is no message"),
    (b'{"type": "cancel"}', "This is no message"),
    ("x" * 65_537, "A message has 65536 letters at most"),
    ('{"type": "chi2", "subject": 0}', "Nothing is shown yet"),
    ('{"type": "chi2", "subject": 9}', "subject is a number from 0 to 5"),
    ('{"type": "chi2", "subject": true}', "subject is a number from 0 to 5"),
    ('{"type": "fit", "subject": 0, "model": 3}', "A fit needs a model and a metric"),
    ('{"type": "save", "what": "everything"}', "What can be saved is exr, page or scene"),
    ('{"type": "save", "what": "page", "state": []}', "The state of a page is an object"),
    ('{"type": "save", "what": "page", "state": {"subjects": "x"}}', "The state of a page is an object, with one"),
    (b"x" * 100_000_000, "A message has 65536 letters at most"),
]  # fmt: skip


def test_a_malformed_message_is_answered_in_a_sentence(address):
    async def conversation(page, hello, client):
        for message, sentence in MALFORMED:
            await (page.socket.send_str(message) if isinstance(message, str) else page.socket.send_bytes(message))
            assert sentence in (await page.frame())["text"], message[:60]
        await page.send({"type": "lambert"}, views=["polar"])
        await page.until("polar")

    connected(address, conversation)


STATE = {
    "type": "state", "serial": 1,
    "state": {"subjects": [{"bsdf": {"type": "ward", "alpha": 0.2}, "hidden": False}], "views": ["polar"], "theta": 30},
}  # fmt: skip
MESSAGES = [
    STATE, STATE, STATE, {"type": "chi2", "subject": 0}, {"type": "save", "what": "exr", "subject": 0},
    {"type": "fit", "subject": 0, "model": "lambert", "metric": "log"},
]  # fmt: skip
WRONG = [
    None, True, -1, 0, 3, 99, 1e38, 1e308, float("nan"), float("-inf"), 10**30, 10**400, "", "x", "\ud800", "a" * 5000,
    [], {}, [[]], [1, 2], [1e30] * 3, ["xray"], "ward", "tabulated", "given", {"type": "given", "file": "x"},
    {"type": "dielectric", "eta": 0}, {"type": "roughplastic", "alpha": "x"}, {"type": "diffuse", "reflectance": 5},
]  # fmt: skip


def corrupted(value, rng):
    """A message with something in it replaced, removed or added."""
    if isinstance(value, (dict, list)) and value and rng.random() < 0.8:
        value = value.copy()
        key = list(value)[rng.integers(len(value))] if isinstance(value, dict) else rng.integers(len(value))
        if rng.random() < 0.15:
            del value[key]
        else:
            value[key] = corrupted(value[key], rng)
        return value
    return WRONG[rng.integers(len(WRONG))]


def test_two_hundred_corrupted_messages_leave_the_session_alive(address):
    rng = np.random.default_rng(5)

    async def conversation(page, hello, client):
        await page.send({"type": "lambert"}, views=["polar"])
        for k in range(200):
            message = json.dumps(corrupted(MESSAGES[rng.integers(len(MESSAGES))], rng))
            cut = rng.integers(len(message)) if k % 20 == 0 else None
            await (page.socket.send_bytes(message.encode()) if k % 20 == 1 else page.socket.send_str(message[:cut]))
        page.serial = 10**6
        await page.send({"type": "lambert", "reflectance": 0.3}, views=["polar"])
        told = set()
        while (frame := await page.frame()).get("serial") != page.serial or frame["name"] != "polar":
            told |= {frame[it] for it in ("error", "text") if isinstance(frame.get(it), str)}
        assert len(told) > 10 and all(it.isprintable() and "Traceback" not in it for it in told), told

    connected(address, conversation)


REFUSED = [
    ("upload?name=x.bsdf", {"data": b""}, 422, "x.bsdf is empty"),
    ("upload", {"data": b"\0" * 99}, 422, "unnamed is of no known format"),
    ("upload?name=%00%ff%zz.%00", {"data": b"\0" * 99}, 422, "is of no known format"),
    ("upload?name=x", {"data": {"file": "x"}}, 422, "An upload is the bytes of a file"),
    ("upload?name=x", {"json": {}}, 422, "An upload is the bytes of a file"),
    ("upload?name=x", {"data": b"x", "headers": {"Content-Type": "multipart/form-data"}}, 422, "An upload is"),
    ("upload?name=x", {"data": b"x", "headers": {"Content-Encoding": "gzip"}}, 422, "x is of no known format"),
    ("upload?name=my%20mesh.ply", {"data": b"ply\nno mesh"}, 422, "my mesh.ply"),
    ("upload?name=x.binary", {"data": bytes((64 << 20) + (1 << 18))}, 413, "A file may have 64 MiB at most."),
    *((f"upload?name=x.{kind}", {"data": data}, 422, '{"error": ') for kind, data in (
        ("binary", b"no MERL file"), ("bsdf", b"\0" * 1000), ("exr", os.urandom(5000)), ("obj", b"v 0 0 nought"),
        ("ply", b"ply"))),
    (f"client/{'x' * 300}.js", {}, 404, "Not Found"),
]  # fmt: skip


def test_a_malformed_request_is_answered_in_a_sentence(address):
    async def conversation(page, hello, client):
        for path, options, status, sentence in REFUSED:
            method = "POST" if "upload" in path else "GET"
            async with client.request(method, address + path, **options) as answer:
                told = await answer.text()
            assert answer.status == status and sentence in told and not re.search("/tmp|Traceback", told), path

    connected(address, conversation)


def test_what_is_no_request_is_refused(address):
    for request in (
        b"GET / HTTP/1.1\r\nno header\r\n\r\n",
        b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\nX: " + b"x" * 9000 + b"\r\n\r\n",
        b"POST /upload?name=x HTTP/1.1\r\nHost: 127.0.0.1\r\nTransfer-Encoding: chunked\r\n\r\nno chunk\r\n",
    ):
        with socket.create_connection(("127.0.0.1", int(address.rstrip("/").rpartition(":")[2]))) as connection:
            connection.sendall(request)
            assert connection.recv(1000).startswith(b"HTTP/1.0 400 "), request[:20]


@pytest.mark.parametrize(
    "hosts, ours, others",
    [
        (["Desk.local", "0.0.0.0"], ["192.0.2.7:80", "[::1]:80", "desk.local:80"], ["evil.example", "DESK"]),
        (["fd00::2"], ["[fd00::2]:8490"], ["[fd00::3]:8490"]),
    ],
)
def test_names_of_a_machine(hosts, ours, others):
    """On all networks, other pages can give their own names our address, but not go by an address."""
    from mi_brdfs.explorer.server import Explorer

    explorer = Explorer(None, [], {}, hosts, False)
    assert all(map(explorer._is_ours, ours)) and not any(map(explorer._is_ours, others))


def test_other_pages_of_the_browser_are_refused(address):
    from aiohttp import WSServerHandshakeError

    async def conversation(page, hello, client):
        for headers in ({"Host": "evil.example"}, {"Origin": "https://evil.example"}):
            for method, path in ("GET", ""), ("POST", "upload"):
                async with client.request(method, address + path, headers=headers) as answer:
                    assert answer.status == 403
            with pytest.raises(WSServerHandshakeError):
                await client.ws_connect(f"{address}socket", headers=headers)
        for path in ("client/../server.py", "client/..%2fserver.py", "client/server.py", "etc/passwd"):
            async with client.get(address + path) as answer:
                assert answer.status == 404

    connected(address, conversation)


def uploaded(address, name, payload):
    async def conversation(page, hello, client):
        async with client.post(f"{address}upload", params={"name": name}, data=payload) as answer:
            return answer.status, await answer.json()

    return connected(address, conversation)


def test_an_uploaded_file_of_any_name_is_a_subject(address):
    names = ["paint (1).bsdf", "it's \"gold\"; 100%25 'a'.bsdf", "<b>&amp;$5.bsdf", f"{'é' * 296}.bsdf",
             f"x.{'b' * 298}", "漆\n\\\u202e\0.xml"]  # fmt: skip
    answers = [uploaded(address, f"../../{name}", LOFT.read_bytes()) for name in names]
    assert [(status, answer["name"]) for status, answer in answers] == [(200, name) for name in names]

    async def conversation(page, hello, client):
        for _, answer in answers:
            await page.send({"type": "tabulated", "file": answer["file"]}, views=["polar"])
            found = await page.until("subject", "polar")
            assert found["subject"]["error"] is None

    connected(address, conversation)


def test_a_page_that_is_killed_leaves_the_server_alive(address):
    async def conversation(page, hello, client):
        await page.send({"type": "ward"}, views=["picture"], size=512)
        page.socket._response.connection.transport.abort()

    connected(address, conversation)
    test_the_server_greets_and_answers(address)


@pytest.mark.usefixtures("llvm_rgb")
def test_a_port_in_use_is_said_in_a_sentence():
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        done = invoke("explore", "--no-browser", "--port", taken.getsockname()[1])
    assert done.exit_code == 2 and re.search(r"port \d+ is in use; choose another", done.stderr)


def end(process, address, sent, folder):
    """A signal ends a server, and leaves nothing in the folder of temporary files."""
    uploaded(address, "x.bsdf", LOFT.read_bytes())
    assert len(list(folder.glob("*/upload-1.bsdf"))) == 1
    process.send_signal(sent)
    assert process.wait(20) == 128 + sent and not list(folder.iterdir())


@pytest.mark.slow
@pytest.mark.usefixtures("ctrl_c")
def test_ctrl_c_ends_it_and_leaves_nothing(tmp_path, monkeypatch):
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    end(*serving("lambert"), signal.SIGINT, tmp_path)


def frame_ancestors(address):
    with urlopen(address) as answer:
        return re.search("frame-ancestors ([^;]*)", answer.headers["Content-Security-Policy"])[1]


def test_a_notebook_gets_its_page_and_ends_it(address, tmp_path, monkeypatch):
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    monkeypatch.chdir(tmp_path.parent)
    shutil.copy(LOFT, "-x.bsdf")
    red, grey = ({"type": "rgb", "value": value} for value in ([1, 0, 0], 0.5))
    ward = {"type": "ward", "alpha": np.float32(0.3), "specular_reflectance": red, "diffuse_reflectance": grey}
    page = explore(ward, "-x.bsdf", Path("-x.bsdf"))
    assert "<iframe" in page._repr_html_() and "alpha" in page.address
    own, _, state = page.address.partition("#")
    first, *files = (it["bsdf"] for it in json.loads(unquote(state))["subjects"])
    assert first["specular_reflectance"] == [1, 0, 0] and first["diffuse_reflectance"] == [0.5] * 3

    async def conversation(page, hello, client):
        for file in files:
            await page.send(file, views=["polar"])
            await page.until("polar")

    connected(own, conversation)
    assert {"http://localhost:*", "vscode-webview:"} <= set(frame_ancestors(own).split())
    assert frame_ancestors(address) == "'none'"
    assert list(tmp_path.iterdir())
    page._process.stdin.close()  # as the notebook's end does
    page._process.wait(20)
    assert not list(tmp_path.iterdir())
    page.close()
    with pytest.raises(OSError):
        connected(own, lambda it, hello, client: it.send({"type": "lambert"}))


@pytest.mark.usefixtures("llvm_rgb")
def test_a_notebook_is_told_what_cannot_be_shown(monkeypatch):
    """Before there is a server."""
    monkeypatch.setattr(subprocess, "Popen", None)
    for given, sentence in [
        *((it, "cannot be shown; give a dict") for it in (None, 5, {}, {"type": 5}, mi.load_dict({"type": "ward"}))),
        ({"type": "wrd"}, "no BSDF 'wrd' here; did you mean 'ward'"),
        ("wrd", "no BSDF 'wrd' here; did you mean 'ward'"),
        ({"type": "ward", "alpha": {"type": "checkerboard"}}, "alpha must be a number"),
        ({"type": "twosided", "bsdf": {"type": "ward"}}, "bsdf must be a number"),
        ({"type": "tabulated"}, "A file is not here"),
        ({"type": "ward", "file": 3, "alpha": [1]}, "alpha must be a number"),
    ]:
        with pytest.raises(ValueError, match=sentence):
            explore(given)
    with pytest.raises(ValueError, match="A page shows 6 BSDFs at most, not 7"):
        explore(*["ward"] * 7)


def test_a_server_that_cannot_be_heard_is_ended(monkeypatch):
    started = []

    class Mute(subprocess.Popen):
        def __init__(self, *args, **options):
            super().__init__(*args, **options)
            self.stdout.close()
            started.append(self)

    monkeypatch.setattr(subprocess, "Popen", Mute)
    with pytest.raises(ValueError, match="closed file"):
        explore("ward")
    assert started[0].returncode is not None


def test_a_server_with_many_warnings_goes_on(monkeypatch):
    """More of them than a pipe holds."""

    class Talkative(subprocess.Popen):
        def __init__(self, command, **options):
            code = "import sys; print('here', flush=True); sys.stderr.write('x' * 300_000); print('done')"
            super().__init__([sys.executable, "-c", code], **options)

    monkeypatch.setattr(subprocess, "Popen", Talkative)
    page = explore("ward")
    try:
        page._process.wait(20)
    finally:
        page.close()
    assert page._process.stdout.read() == "done\n"


def test_a_saved_file_of_models_is_read_again(tmp_path, tmp_path_factory, monkeypatch):
    """Within two seconds; what is wrong with it is told, and the former models stay. SIGTERM then leaves nothing."""
    file, temporary = tmp_path / "chalk.py", tmp_path_factory.mktemp("temporary")
    monkeypatch.setenv("TMPDIR", str(temporary))
    text = (
        "import mi_brdfs\n\nclass Chalk(mi_brdfs.models.lambert.Lambert):\n"
        '    """Chalk."""\n\n    plugins = ("chalk",)\n    title = "first"\n'
    )
    file.write_text(text)
    process, address = serving("lambert", "--import", str(file))

    async def conversation(page, hello, client):
        await page.send({"type": "lambert"}, views=["polar"])
        await page.until("polar")
        for saved, kind in ((text.replace("first", "again"), "reloaded"), ("import\n", "error")):
            (tmp_path / "new").write_text(saved)
            (tmp_path / "new").replace(file)  # at once, so that no half of it is read
            start = time.perf_counter()
            while (frame := await page.frame(5))["type"] != kind:
                pass
            assert time.perf_counter() - start < 2
        assert "chalk.py: line 1" in frame["text"]

    try:
        connected(address, conversation)
        end(process, address, signal.SIGTERM, temporary)
    finally:
        process.terminate()


@pytest.mark.slow
def test_random_edits_leave_the_memory_as_it_is(monkeypatch):
    """Rounds of edits of some models, after those that compile most kernels: nothing crashes or gets stuck."""
    # Have glibc return what is freed: otherwise the size is that of its free lists, which come and go by 60 MiB.
    for name, value in (("TRIM_THRESHOLD_", 65536), ("MMAP_THRESHOLD_", 65536), ("ARENA_MAX", 2)):
        monkeypatch.setenv(f"MALLOC_{name}", str(value))
    process, address = serving("lambert")
    sizes = []

    async def conversation(page, hello, client):
        rng, told = np.random.default_rng(3), {}
        views = ["picture", "lobe", "polar", "cartesian", "albedo", "slice", "hemisphere", "sampler"]
        names = hello["models"][::8]
        for name in names:
            await page.send({"type": name}, views=views)
            told[name] = (await page.until("subject", *views))["subject"]

        async def edits():
            name = names[rng.integers(len(names))]
            for _ in range(rng.integers(1, 20)):
                bsdf = edited(told[name]["bsdf"] or {"type": name}, told[name]["controls"], rng)
                stage = ("studio", "lamp", "point")[rng.integers(3)]
                await page.send(bsdf, views=views, theta=float(rng.uniform(0, 89)), stage=stage)
                await asyncio.sleep(rng.exponential(0.02))
            await page.until(*views)

        for _ in range(3 * len(names)):  # each new kernel takes memory
            await edits()
        for _ in range(20):
            await edits()
            sizes.append(psutil.Process(process.pid).memory_info().rss / 2**20)

    try:
        connected(address, conversation)
    finally:
        process.terminate()
    assert np.median(sizes[-6:]) - np.median(sizes[:7]) < 15, sizes


# --- The page ---------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def browser():
    if CHROMIUM is None:
        pytest.skip("there is no Chromium")
    playwright = pytest.importorskip("playwright.sync_api", reason="there is no Playwright")
    with playwright.sync_playwright() as running:
        flags = ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
        yield running.chromium.launch(executable_path=CHROMIUM, args=flags)


@pytest.fixture
def tab(browser):
    """A page of 1440 pixels, in which no script may fail."""
    context = browser.new_context(viewport={"width": 1440, "height": 900}, accept_downloads=True)
    context.grant_permissions(["clipboard-read", "clipboard-write"])
    page, errors = context.new_page(), []
    page.on("pageerror", lambda error: errors.append(str(error)))
    page.set_default_timeout(60_000)
    yield page
    context.close()
    assert not errors


def opened(tab, address, state=None):
    """Open a page, and wait until it shows a picture, if it is to show one."""
    tab.goto("about:blank")
    tab.goto(address + (f"#{json.dumps(state)}" if state else ""))
    if "picture" in (state or {}).get("views", ["picture"]):
        drawn(tab)


def drawn(tab):
    tab.wait_for_function(
        "() => [...document.querySelectorAll('.pictures canvas')].some(it => it.width > 1 && "
        "it.getContext('2d').getImageData(0, 0, it.width, it.height).data.some(v => v > 0 && v < 255))"
    )


def settled(tab, is_so):
    """Wait until something is so, for ten seconds."""
    for _ in range(100):
        if is_so():
            return
        tab.wait_for_timeout(100)
    raise AssertionError("It has not come about.")


LAMBERT = {"subjects": [{"bsdf": {"type": "lambert"}, "name": "lambert"}]}


def test_the_page_shows_what_it_was_started_with(tab, address):
    """In the colours of reports, and on dark ground, too; side by side, or one over the other."""
    report = (ROOT / "mi_brdfs" / "pages" / "style.css").read_text(encoding="utf-8")
    light, dark = re.findall(r"--series-1: (#\w+)", report)
    tab.emulate_media(color_scheme="light")
    opened(tab, address)
    assert tab.locator("#chips").inner_text().split() == ["ward", "walter"]
    tab.locator("#view-polar .curve").first.wait_for(state="attached")
    head, shaft = (tab.locator(f"#view-polar {it}").bounding_box() for it in ("path.source", "line.incident"))
    assert head["y"] == pytest.approx(shaft["y"], abs=1)  # wi is away from the surface
    assert tab.locator(".pictures canvas").count() == 2
    assert tab.locator("#subject-type").inner_text() == ""  # it has that name
    shown = "document.querySelector('#view-polar .curve').getAttribute('stroke').toLowerCase()"
    tab.wait_for_function(f"() => {shown} === '{light}'")
    tab.locator("#theme").click()
    tab.wait_for_function(f"() => {shown} === '{dark}'")
    assert tab.locator("#compare").input_value() == "side"
    tab.locator("#compare").select_option("wipe")
    divider = tab.get_by_role("slider", name="Divider")
    divider.focus()
    divider.press("Home")
    assert divider.input_value() == "0"
    tab.locator(".divider[aria-valuetext='ward up to 0\u00a0%']").wait_for()
    tab.locator("#compare").select_option("difference")
    tab.wait_for_selector(".pictures canvas")


def test_each_of_two_lobes_keeps_its_hue(tab, address):
    """Also one within the other."""
    greys = [{"bsdf": {"type": "lambert", "reflectance": it}, "name": f"{it}"} for it in (0.4, 0.8)]
    opened(tab, address, {"subjects": greys, "views": ["lobe"], "dark": False})
    hues = """() => {
        const lobe = document.querySelector('#view-lobe canvas');
        const copy = new OffscreenCanvas(lobe.width, lobe.height).getContext('2d');
        copy.drawImage(lobe, 0, 0);
        const { data } = copy.getImageData(0, 0, lobe.width, lobe.height);
        const pixels = Array.from({ length: data.length / 4 }, (_, k) => [data[4 * k], data[4 * k + 2]]);
        return [pixels.filter(([red, blue]) => blue > 2 * red), pixels.filter(([red, blue]) => red > 2 * blue)]
            .map(it => it.length);
    }"""
    settled(tab, lambda: min(tab.evaluate(hues)) > 300)


@pytest.mark.slow
def test_models_and_published_materials_open_one_after_the_other(tab, address):
    """With all kinds of controls, and found by their pictures."""
    opened(tab, address, {**LAMBERT, "views": []})
    for name in ("kurt", "microfacet", "lafortune", "roughdiffuse"):
        state = {"subjects": [{"bsdf": {"type": name}, "name": f"my {name}"}], "views": []}
        tab.evaluate("hash => { location.hash = hash; }", json.dumps(state))
        tab.wait_for_function(
            f"() => document.querySelector('#subject-name').value === 'my {name}' && "
            f"document.querySelector('#subject-type').innerText === '{name}' && "
            "document.querySelector('#controls input')"
        )
        assert not tab.locator("#alert").is_visible() and tab.locator("#subject-error").inner_text() == ""
    tab.locator("#add").click()
    tab.locator("#search").fill("blue acrylic")
    assert tab.locator(".preset b").first.inner_text() == "blue acrylic"
    published, models = [
        tab.evaluate(f"async () => {{ const it = new Image(); it.src = 'client/{name}.jpg'; await it.decode(); "
                     "return [it.naturalWidth, it.naturalHeight]; }")
        for name in ("published", "models")
    ]  # fmt: skip
    assert published[0] / 38 == published[1] / 27  # 1026 square balls
    assert models[0] / len(own_models()) == models[1]
    tab.get_by_label("ngan/ward/blue-acrylic", exact=True).click()
    tab.wait_for_function("() => document.querySelector('#subject-type').innerText === 'ward'")


def test_a_picture_that_is_awaited_says_so(tab, address):
    """Until it is there; one that cannot come is not awaited."""
    told = "() => getComputedStyle(document.querySelector('.frame'), '::after').content"
    state = {"subjects": [{"bsdf": {"type": "ward", "alpha": 0.3}, "name": "ward"}], "views": ["picture", "polar"]}
    tab.route_web_socket(re.compile("/socket"), relayed_without_pictures)
    tab.goto(f"{address}#{json.dumps(state)}")
    tab.locator("#view-polar .curve").first.wait_for(state="attached")
    assert "Compiling" in tab.evaluate(told)
    tab.get_by_label("alpha, as a number").fill("-1")
    tab.get_by_label("alpha, as a number").press("Enter")
    tab.wait_for_function(f"() => ({told})() === 'none'")


def relayed_without_pictures(socket):
    server = socket.connect_to_server()
    server.on_message(
        lambda it: socket.send(it) if isinstance(it, str) or b'"type": "picture"' not in it[:400] else None
    )


def test_each_kind_of_control_changes_what_is_shown(tab, address):
    ward = {"type": "ward", "alpha": 0.2, "specular_reflectance": [0.3, 0.3, 0.3]}
    opened(tab, address, {"subjects": [{"bsdf": ward, "name": "ward"}], "views": ["polar"]})
    tab.locator("#view-polar .curve").wait_for(state="attached")
    curve = "() => document.querySelector('#view-polar svg').outerHTML"

    def moved(act):
        before = tab.evaluate(curve)
        act()
        tab.wait_for_function(f"before => ({curve})() !== before", arg=before)

    number = tab.get_by_label("alpha, as a number")
    moved(lambda: (number.fill("0.4"), number.press("Enter")))
    moved(lambda: tab.locator("#controls input[type=range]").nth(2).press("ArrowLeft"))
    moved(lambda: tab.locator("#controls select").first.select_option("ward-duer"))
    red = tab.get_by_label("specular_reflectance, red")
    moved(lambda: (red.fill("0.9"), red.press("Enter")))
    moved(lambda: (tab.locator("#theta-field").fill("70"), tab.locator("#theta-field").press("Enter")))
    moved(lambda: tab.locator("#component").select_option("1"))
    moved(lambda: tab.get_by_label("× cosθo").uncheck())
    number.fill("-1"), number.press("Enter")
    tab.wait_for_function("() => document.querySelector('#editor').innerText.includes('alpha = -1 is not allowed')")
    letters = "location.hash.slice(1).replaceAll('-', '+').replaceAll('_', '/')"
    tab.wait_for_function(f"""() => atob({letters}).includes('"alpha":-1')""")  # the address follows
    letters = tab.evaluate("() => location.hash")[1:]
    kept = json.loads(base64.urlsafe_b64decode(letters + "=" * (-len(letters) % 4)))
    assert kept["subjects"][0]["bsdf"]["alpha"] == -1


@pytest.mark.slow
def test_measured_files_of_any_name_are_loaded_copied_and_fitted(tab, address):
    opened(tab, address, {**LAMBERT, "stage": "point", "views": ["picture"]})
    names = ['it\'s "gold" (1).bsdf', f"<b>%25;a;'b\\{'é' * 280}.bsdf"]
    for count, name in enumerate(names, 2):
        tab.locator("#add").click()
        tab.locator("#file").set_input_files({"name": name, "mimeType": "", "buffer": LOFT.read_bytes()})
        tab.wait_for_function(f"() => document.querySelectorAll('.pictures canvas').length === {count}")
    assert tab.locator(".chip").all_inner_texts() == ["lambert", *names]
    assert tab.locator("#scale").input_value() == "log"
    tab.locator("#share").click()
    tab.locator("#copy-xml").click()
    tab.wait_for_function("async () => (await navigator.clipboard.readText()).includes('<bsdf type=\"tabulated\"')")
    tab.locator("#copy-link").click()
    tab.wait_for_function("async () => (await navigator.clipboard.readText()).startsWith('http')")
    link = tab.evaluate("() => navigator.clipboard.readText()")
    told = tab.locator("#shared").inner_text()
    opened(tab, link)
    assert tab.locator(".chip").all_inner_texts() == ["lambert", *names]
    assert '"' not in link.partition("#")[2] and "works only while this server runs" in told
    assert tab.locator(".chip .warning").count() == 0 and tab.locator(".pictures canvas").count() == 3
    tab.locator(".chip").nth(1).click()
    tab.locator("#fit").click()
    tab.locator("#fit-model").select_option("lambert")
    tab.locator("#fit-start").click()
    tab.locator("#fit-ranking button").click()
    tab.wait_for_selector(".pictures .divider")
    assert tab.locator(".pictures figcaption b").all_inner_texts()[-1] == "lambert, fitted"
    assert not tab.locator("#fit-dialog").is_visible()


@pytest.mark.slow
def test_light_camera_and_shape_are_chosen_by_dragging(tab, address, tmp_path):
    """Of the lobe, ωi; of the picture, the camera."""
    mi.set_variant("llvm_ad_rgb")
    mi.load_dict({"type": "cube"}).write_ply(str(tmp_path / "box.ply"))
    mi.Bitmap(np.ones((2, 4, 3), np.float32)).write(str(tmp_path / "sky.exr"))
    sent = []
    tab.on("websocket", lambda socket: socket.on("framesent", lambda frame: sent.append(str(frame))))

    def dragged(x, y, to_x, to_y):
        tab.mouse.move(x, y)
        tab.mouse.down()
        tab.mouse.move(x + to_x, y + to_y, steps=5)
        tab.mouse.up()

    opened(tab, address, {"subjects": [{"bsdf": {"type": "ward"}, "name": "ward"}], "views": ["picture", "lobe"]})
    tab.locator("#view-lobe canvas").scroll_into_view_if_needed()
    tab.wait_for_selector("#view-lobe .labels .direction")
    boxes = []  # a label that is drawn anew has none for a moment
    settled(tab, lambda: boxes.append(tab.locator("#view-lobe .labels .direction").first.bounding_box()) or boxes[-1])
    box = boxes[-1]
    before = tab.locator("#theta-field").input_value()
    dragged(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2 + 8, -40, 32)
    assert tab.locator("#theta-field").input_value() != before
    settled(tab, lambda: '"dragged":false' in sent[-1])
    assert any('"dragged":true' in frame for frame in sent)
    for file, select in (("box.ply", "#shape"), ("sky.exr", "#stage")):
        tab.locator("#file").set_input_files(str(tmp_path / file))
        tab.wait_for_function(f"() => document.querySelector('{select}').value === '{file}'")
    tab.locator("#turn").fill("90")
    box = tab.locator(".pictures canvas").bounding_box()
    dragged(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2, -80, 40)
    wanted = {"yaw": 40, "pitch": 20, "turn": 90, "shape": "box.ply", "stage": "sky.exr"}
    settled(tab, lambda: json.loads(sent[-1][sent[-1].index("{") :])["state"].items() >= wanted.items())
    assert not tab.locator("#alert").is_visible()


@pytest.mark.slow
def test_a_tour_runs(tab, address):
    opened(tab, address)
    tab.locator("#tours").click()
    tab.locator("#tour-list button, #tour-list a").first.click()
    titles = set()
    for step in (1, 2, 3):  # the page shows a step in the frame after its click
        tab.locator("#tour-name", has_text=f"· {step} of ").wait_for()
        titles.add(tab.locator("#tour-title").inner_text())
        if step < 3:
            tab.locator("#tour-next").click()
    assert len(titles) == 3
    tab.wait_for_function("() => document.querySelectorAll('#grid svg path, #grid canvas').length > 2")
    tab.locator("#tour-leave").click()
    tab.locator("#tour").wait_for(state="hidden")


SCENE = """<scene version="3.0.0"><integrator type="path"/><emitter type="constant"/>
<sensor type="perspective"><film type="hdrfilm"><integer name="width" value="320"/><integer name="height" value="180"/>
</film></sensor><bsdf type="diffuse" id="paint"/><shape type="sphere" id="ball"><point name="center" x="0" y="0" z="9"/>
<ref id="paint"/></shape></scene>"""


@pytest.mark.slow
def test_pictures_keep_the_aspect_of_their_scene(tab, tmp_path):
    (tmp_path / "wide.xml").write_text(SCENE)
    process, address = serving("lambert", "--scene", str(tmp_path / "wide.xml"), first=FEW)
    opened(tab, address)
    box = tab.locator(".pictures canvas").bounding_box()
    tab.locator("#share").click()
    tab.locator("#write-scene").click()
    tab.wait_for_function("() => document.querySelector('#shared').innerText.includes('wide-lambert.xml')")
    process.terminate()
    assert (tmp_path / "wide.xml").read_text() == SCENE and '"lambert"' in (tmp_path / "wide-lambert.xml").read_text()
    assert box["width"] / box["height"] == pytest.approx(16 / 9, rel=0.01)


@pytest.mark.slow
def test_nothing_is_wider_than_the_screen(tab, address):
    small = (
        "() => [...document.querySelectorAll('button, select, input[type=range]')].filter(it => it.offsetParent)"
        ".filter(it => it.getBoundingClientRect().right > innerWidth + 1).map(it => it.outerHTML)"
    )
    for width, scheme in (390, "light"), (1440, "dark"):
        tab.set_viewport_size({"width": width, "height": 844})
        tab.emulate_media(color_scheme=scheme)
        opened(tab, address, {
            "subjects": [{"bsdf": {"type": it}, "name": "W" * 300} for it in ("kurt", "lambert")],
            "compare": "wipe",
            "views": ["picture", "lobe", "polar", "cartesian", "albedo", "slice", "hemisphere", "sampler"],
        })  # fmt: skip
        assert tab.evaluate("() => document.documentElement.scrollWidth") <= width
        assert not tab.evaluate(small)
        name, status = tab.evaluate("""() => {
            const status = document.querySelector('#status');
            Object.assign(status, { textContent: 'Compiling walter …', hidden: false });
            const range = document.createRange();
            range.selectNode(document.querySelector('h1').firstChild);
            return [range.getBoundingClientRect(), status.getBoundingClientRect()];
        }""")
        assert status["left"] > name["right"] or status["top"] > name["bottom"]
        tab.wait_for_selector("#view-polar .sample")
        x, y = tab.evaluate("""() => {
            const sample = document.querySelector('#view-polar .sample').getBoundingClientRect();
            const range = document.createRange();
            range.selectNode(document.querySelector('#view-polar .sample').nextSibling);
            const name = range.getClientRects()[0];
            return [name.left - sample.right, name.top - sample.bottom];
        }""")
        assert x >= 0 > y  # a name begins beside its dash


@pytest.mark.slow
def test_the_exported_page_works_from_the_disk(tab, tmp_path):
    """It is small and needs no network."""
    exported, name, requests = tmp_path / "page.html", "<!--<script> '1' (1) \udcff.bsdf", []
    shutil.copy(LOFT, tmp_path / name)
    options = "--exposure", "1.5", "--labels", f"chalk,{name}", "--vary", "theta=0,45,85", "--export", "page.html"
    command = alone("ward", name, *options, first=FEW)
    subprocess.run(command, check=True, timeout=200, cwd=tmp_path)
    text = exported.read_text(encoding="utf-8")
    assert len(text) < 3e6 and '"exposure": 1.5' in text and '"name": "chalk"' in text
    assert not re.search(r"""(src|href)=["'](?!data:|#)""", text) and "import " not in text.split("exported")[0]
    tab.on("request", lambda request: requests.append(request.url))
    tab.goto(exported.as_uri())
    drawn(tab)
    assert tab.locator("#view-polar svg path").count() > 1
    assert '"scale": "log"' in text and "10⁻" in tab.locator("#view-polar .figure").inner_html()
    assert tab.locator(".panel").bounding_box()["width"] > 0.95 * 1440
    assert tab.locator(".chip").all_inner_texts() == ["chalk", name]
    words, tops = tab.evaluate("""() => [
        [...document.querySelectorAll('.fixed code')].flatMap(({ childNodes }) => [...childNodes])
            .filter(({ data }) => data)
            .map(it => {
                const range = document.createRange();
                range.selectNode(it);
                return [it.data, range.getClientRects().length];
            }),
        [...document.querySelectorAll('#controls summary, .fixed')].map(it => it.getBoundingClientRect().top),
    ]""")
    assert ["specular_", 1] in words and all(lines == 1 for _, lines in words)  # they end after underscores only
    assert tops.count(min(tops)) == 3  # the caption is beside the values, whose columns start together
    assert [it for it in requests if not it.startswith(("data:", "blob:"))] == [exported.as_uri()]
    lobe = "document.querySelector('#view-lobe canvas').toDataURL()"
    before = tab.evaluate(lobe)
    tab.locator("#view-lobe canvas").press("ArrowLeft")
    tab.wait_for_function(f"before => {lobe} !== before", arg=before)
    assert tab.locator("h1").inner_text().endswith("move θi, turn the lobe, point at a curve")
    tab.locator("[data-view=hemisphere]").click()
    tab.wait_for_selector("#view-hemisphere .ramp")
    maps, ramp = (tab.locator(f"#view-hemisphere {it}").bounding_box() for it in (".maps", ".ramp"))
    assert ramp["width"] == maps["width"] and ramp["y"] - maps["y"] - maps["height"] == pytest.approx(16)
    tab.locator("[data-view=slice]").click()
    scale = tab.locator("#view-slice .bar").inner_text()
    assert "10³" not in scale and "and above" in scale  # a sliver is brighter than all else
    theta = tab.locator("#scrubbers input")
    assert theta.get_attribute("aria-valuetext") == "45"
    before = tab.evaluate(lobe)
    theta.press("End")
    tab.wait_for_function("() => document.querySelector('#view-polar .note').innerText.includes('85°')")
    tab.wait_for_function(f"before => {lobe} !== before", arg=before)
    smooth, shades = tab.evaluate(SHADES), f"shades => ({SHADES})()"
    box = tab.locator("#view-lobe canvas").bounding_box()
    tab.mouse.move(box["x"] + 0.7 * box["width"], box["y"] + 0.8 * box["height"])
    tab.mouse.down()
    tab.mouse.move(box["x"] + 0.75 * box["width"], box["y"] + 0.8 * box["height"])
    tab.wait_for_function(f"{shades} < 0.7 * shades", arg=smooth)  # software draws coarse edges faster
    tab.mouse.up()
    tab.wait_for_function(f"{shades} > 0.9 * shades", arg=smooth)
    tab.add_init_script("Response.prototype.arrayBuffer = () => new Promise(() => {})")  # as long as it unpacks
    tab.reload()
    tab.wait_for_function("() => document.querySelector('h1').innerText.endsWith('Loading …')")
    assert "Loading" in tab.evaluate("() => getComputedStyle(document.querySelector('.frame'), '::after').content")
