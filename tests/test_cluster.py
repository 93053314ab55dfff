"""Workers return what this process would have, also when some are killed; what cannot work is refused in a sentence."""

import gc
import json
import os
import shutil
import signal
import subprocess
import sys
import threading
import time
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from socketserver import BaseRequestHandler

import dask
import drjit as dr
import mitsuba as mi
import numpy as np
import psutil
import pytest
from cluster_tasks import ends_at_three, last_breath, powers, work
from support import LOFT, ROOT
from test_cli import invoke

import mi_brdfs
from mi_brdfs.cluster import ClusterError, Failed, client, run
from mi_brdfs.cluster.passes import passes_on
from mi_brdfs.cluster.worker import _file
from mi_brdfs.mitsuba import guests
from mi_brdfs.mitsuba.registry import info
from mi_brdfs.rendering import passes as rendering
from mi_brdfs.rendering.passes import PassesError, one_thread, pass_source, render
from mi_brdfs.rendering.scene_file import SceneFile

pytestmark = pytest.mark.usefixtures("llvm_rgb")

SCENE = (ROOT / "tests" / "rows" / "scenes" / "parts.xml").read_text()
MATERIAL = """<scene version="3.0.0"><bsdf type="MODEL" id="checked">
    <texture type="bitmap" name="reflectance"><string name="filename" value="textures/checks.png"/></texture>
</bsdf></scene>"""


def start(name, *options, folder, **environment):
    """Start a command of Dask's, in a folder where no scene is."""
    path = os.pathsep.join([str(ROOT), str(ROOT / "tests")])
    return subprocess.Popen(
        [sys.executable, "-m", f"distributed.cli.dask_{name}", *options, "--no-dashboard"],
        cwd=folder, env=os.environ | {"PYTHONPATH": path, **environment}, start_new_session=True,
        stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
    )  # fmt: skip


def scheduler_in(folder):
    process = start("scheduler", "--host", "127.0.0.1", "--port", "0", "--scheduler-file", "s.json", folder=folder)
    while not (folder / "s.json").exists():
        assert process.poll() is None
        time.sleep(0.05)
    return process, json.loads((folder / "s.json").read_text())["address"]


@pytest.fixture(scope="module")
def address(tmp_path_factory):
    """A scheduler and two workers, started by their commands as on other machines."""
    folder = tmp_path_factory.mktemp("machine")
    scheduler, address = scheduler_in(folder)
    workers = start("worker", address, "--nthreads", "1", "--nworkers", "2", folder=folder)
    yield address
    workers.terminate()
    workers.wait()
    scheduler.kill()
    scheduler.wait()


@pytest.fixture
def scene(tmp_path):
    """A scene of several files."""
    return scene_in(tmp_path)


def scene_in(folder, integrator="path", model="diffuse"):
    (folder / "parts").mkdir()
    (folder / "textures").mkdir()
    (folder / "scene.xml").write_text(SCENE.replace("INTEGRATOR", integrator))
    (folder / "parts/material.xml").write_text(MATERIAL.replace("MODEL", model))
    checks = np.indices((8, 8)).sum(axis=0)[..., None] % 2 * [0.2, 0.5, 0.7] + 0.1
    mi.Bitmap(checks.astype(np.float32)).convert(component_format=mi.Struct.Type.UInt8).write(
        str(folder / "textures/checks.png")
    )
    return folder / "scene.xml"


def worker_processes():
    """The workers that this process started."""
    children = [it for it in psutil.Process().children() if it.status() != "zombie"]
    return [it for it in children if "--no-nanny" in it.cmdline()]


def test_workers_return_what_a_serial_run_does(address):
    tasks = {str(number): (number,) for number in range(6)}
    serial = dict(run(powers, tasks, shared=(2.5,)))
    keys, results = zip(*run(powers, iter(tasks.items()), shared=(2.5,), scheduler=address), strict=True)
    assert sorted(keys) == sorted(tasks)
    assert all(np.array_equal(serial[key], result) for key, result in zip(keys, results, strict=True))


def test_killed_workers_cost_no_task_and_a_failure_is_one_tasks(ctrl_c):
    """Of tasks without end; when no more results are wanted, no process is left."""
    results = {}
    iterator = run(work, ((str(number), (number,)) for number in range(10**9)), workers=2)
    for key, result in iterator:
        assert key not in results
        results[key] = result
        if len(results) in (1, 4):
            worker_processes()[0].kill()
        if results.keys() >= set(map(str, range(10))):
            break
    assert len(worker_processes()) == 2
    assert not [it for it in gc.callbacks if "GCDiagnosis" in repr(it)]  # it swallows Ctrl-C
    before = time.perf_counter()
    iterator.close()
    assert not worker_processes()
    assert time.perf_counter() - before < 3
    assert results.pop("3") == Failed("3 is not a number that I like")
    assert all(result[:2] == (int(key), "llvm_ad_rgb") for key, result in results.items())
    assert len({result[2] for result in results.values()} - {os.getpid()}) >= 2


@pytest.mark.usefixtures("ctrl_c")
def test_ctrl_c_waits_until_dask_is_imported(monkeypatch):
    """Some of its modules make an ImportError of it."""

    class Struck:
        def find_spec(self, name, *_):
            if name == client.__name__:
                os.kill(os.getpid(), signal.SIGINT)

    monkeypatch.setattr(mi_brdfs.cluster, "client", client)
    monkeypatch.delitem(sys.modules, client.__name__)
    monkeypatch.setattr(sys, "meta_path", [Struck(), *sys.meta_path])
    with pytest.raises(KeyboardInterrupt):
        run(powers, {}, workers=1)
    assert client.__name__ in sys.modules


@pytest.mark.slow
def test_a_task_of_which_workers_die_is_given_out_again(tmp_path):
    with dask.config.set({"distributed.scheduler.allowed-failures": 0}):
        assert list(run(last_breath, {"a": (str(tmp_path), 1)}, workers=1)) == [("a", "alive")]


@pytest.mark.slow
def test_what_a_worker_has_finished_before_it_dies_is_computed_again(monkeypatch):
    """The worker of all others ends with one task, by whose status nobody takes it for one that could not start."""
    monkeypatch.setattr(client, "ROUNDS", 2)
    results = dict(run(ends_at_three, {str(number): (number,) for number in range(6)}, workers=1))
    assert results.pop("3") == Failed("each worker that had this task died")
    assert results == {str(number): number for number in (0, 1, 2, 4, 5)}


@pytest.fixture
def small_passes(monkeypatch):
    monkeypatch.setattr(rendering, "_samples_per_pass", lambda threads: 4 * 32 * 24)


@pytest.mark.usefixtures("small_passes")
@pytest.mark.parametrize(
    "integrator, variant",
    [
        ("path", "llvm_ad_rgb"),
        *(
            pytest.param(*each, marks=pytest.mark.slow)
            for each in [("shading", "llvm_ad_rgb"), ("ptracer", "llvm_ad_rgb"), ("path", "scalar_rgb")]
        ),
    ],
)
def test_a_picture_of_workers_is_that_of_one_thread_in_every_bit(tmp_path, address, integrator, variant):
    file = SceneFile(str(scene_in(tmp_path, integrator)), {"radius": "1.2"})
    with mi.variant_context(variant):
        loaded = file.load()
        with one_thread():
            expected = render(loaded, spp=32, seed=5)
        picture = render(loaded, spp=32, seed=5, passes=passes_on(file, scheduler=address))
        assert np.array_equal(np.array(expected.bitmap), np.array(picture.bitmap))
        assert np.array(picture.image).std() > 0.05


def test_lights_are_in_the_same_order_whenever_a_scene_is_loaded(tmp_path):
    """Or the same random number would choose another one in another process. Mitsuba orders shapes that it merges by
    where they are in memory."""
    place = '<transform name="to_world"><translate x="{}"/></transform>'
    light = f'<shape type="rectangle">{place}<emitter type="area"/></shape>'
    (tmp_path / "scene.xml").write_text(f'<scene version="3.0.0">{"".join(map(light.format, range(9)))}</scene>')
    for _ in range(5):
        scene = SceneFile(str(tmp_path / "scene.xml")).load()
        assert [round(shape.bbox().center().x) for shape in scene.shapes()] == [*range(9)]


def test_one_thread_puts_the_sums_of_workers_together(tmp_path):
    """A film's reconstruction filter adds to pixels of others; the film is large enough for several threads."""
    path = scene_in(tmp_path, "shading")
    path.write_text(path.read_text().replace('value="32"', 'value="512"').replace('value="24"', 'value="384"'))
    scene = mi.load_file(str(path))

    def passes(scene, sensor, jobs):
        for seed, spp in jobs:
            with one_thread():
                sums = scene.integrator().sums(scene, scene.sensors()[sensor], seed, spp)
                dr.eval(sums)
            yield sums

    with one_thread():
        expected = np.array(render(scene, spp=1).bitmap)
    for _ in range(3):
        assert np.array_equal(np.array(render(scene, spp=1, passes=passes).bitmap), expected)


def test_a_scene_and_its_copy_are_found_from_any_folder(scene, tmp_path, monkeypatch):
    """Also with box filters; the copy does without the files."""
    monkeypatch.chdir(tmp_path.parent)
    name = str(scene.relative_to(tmp_path.parent))
    file = SceneFile(name, {"radius": "0.9"}, box_filter=True)
    copy, expected = file.copied(), np.array(mi.render(mi.load_file(name, radius="0.9"), spp=4)).mean()
    loaded = file.load()
    assert loaded.sensors()[0].film().rfilter().is_box_filter()
    for path in tmp_path.iterdir():
        shutil.rmtree(path) if path.is_dir() else path.unlink()
    monkeypatch.chdir("/")
    pictures = [np.array(mi.render(each, spp=4)) for each in (loaded, copy.load())]
    assert np.array_equal(*pictures) and pictures[0].mean() == pytest.approx(expected, rel=0.01)


@pytest.mark.slow
@pytest.mark.usefixtures("small_passes")
def test_a_crop_with_aovs_of_workers_is_that_of_one_thread(scene, address):
    scene.write_text(
        scene.read_text().replace(
            '<integrator type="path"/>',
            '<integrator type="aov"><string name="aovs" value="z:depth"/><integrator type="path"/></integrator>',
        )
    )
    file, window = SceneFile(str(scene)), [3, 2, 20, 18]
    loaded = file.load()
    rendering.crop(loaded.sensors()[0], *window)
    with one_thread():
        expected = render(loaded, spp=64)
    picture = render(loaded, spp=64, passes=passes_on(file, window=window, scheduler=address))
    assert picture.spp == 64
    assert np.array_equal(np.array(expected.bitmap), np.array(picture.bitmap))


@pytest.mark.usefixtures("small_passes", "ctrl_c")
def test_ctrl_c_keeps_the_finished_passes(scene, address):
    file = SceneFile(str(scene))
    picture = render(
        file.load(), spp=1 << 20, on_pass=lambda *_: os.kill(os.getpid(), signal.SIGINT),
        passes=passes_on(file, scheduler=address),
    )  # fmt: skip
    assert picture.interrupted and picture.spp == 4


GUEST = """from mi_brdfs.models.lambert import Lambert

class Twin(Lambert):
    \'\'\'Lambert's twin.\'\'\'
    plugins = ("twin",)
"""


@pytest.mark.usefixtures("as_before")
def test_models_of_a_file_go_along(tmp_path, address):
    file = tmp_path / "twins.py"
    file.write_text(GUEST)
    guests.import_models(str(file))
    assert dict(run(info, {"a": ("twin",)}, scheduler=address))["a"].startswith("Lambert's twin.")
    # As on a machine that has another file there.
    assert _file(str(file), GUEST) == str(file)
    copy = Path(_file(str(file), GUEST + "# edited"))
    assert copy.name == "twins.py" and copy.read_text().endswith("# edited") and file.read_text() == GUEST
    shutil.rmtree(copy.parent)


def test_the_command_renders_on_a_scheduler(scene, address, tmp_path):
    words = "render", "../scene.xml", "--scheduler", address, "-D", "radius=.5", "--spp", 8
    done = invoke(*words, cwd=tmp_path / "parts")
    assert done.exit_code == 0, done.output
    assert {"scene.exr", "scene.png"} <= {path.name for path in (tmp_path / "parts").iterdir()}


NO_SCHEDULER = (
    "No Dask scheduler of a similar version answers at {}; "
    "give the address that `dask scheduler` prints when it starts, tcp://HOST:PORT."
)


@pytest.mark.parametrize("scheduler", ["tcp://127.0.0.1:1", "nonsense"])
def test_a_wrong_address_is_one_sentence(scheduler, scene, tmp_path, monkeypatch):
    monkeypatch.setattr(client, "CONNECTING", 1)
    done = invoke("render", scene, "--scheduler", scheduler, "-o", tmp_path / "x.exr")
    assert done.exit_code == 1 and done.stderr == f"mi-brdfs: {NO_SCHEDULER.format(scheduler)}\n"


class Silent(BaseRequestHandler):
    def handle(self):
        time.sleep(8)


class HTTP(BaseHTTPRequestHandler):
    timeout = 8

    def log_message(self, *_):
        """Nothing."""


@pytest.mark.parametrize(("command", "handler"), [("render", Silent), ("sweep", HTTP)])
def test_what_is_no_scheduler_is_not_waited_for(command, handler, scene, tmp_path, monkeypatch):
    """A server that ends a connection after some seconds."""
    assert client.CONNECTING <= 3
    monkeypatch.setattr(client, "CONNECTING", 0.5)
    given = {"render": [scene, "-o", tmp_path / "x.exr"], "sweep": [LOFT, "--model", "lambert", "-o", tmp_path]}
    with ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        address, begun = f"tcp://127.0.0.1:{server.server_port}", time.perf_counter()
        done = invoke(command, *given[command], "--scheduler", address)
        assert time.perf_counter() - begun < 5
        server.shutdown()
    assert done.exit_code == 1 and done.stderr.splitlines()[0] == f"mi-brdfs: {NO_SCHEDULER.format(address)}"


def test_a_function_of_the_script_that_runs_is_refused():
    def task():
        pass

    task.__module__ = "__main__"
    with pytest.raises(ClusterError, match="task is defined in the script that runs; put it into a module"):
        run(task, {"one": ()}, workers=1)
    with pytest.raises(ValueError, match="There cannot be -1 workers"):
        run(task, {"one": ()}, workers=-1)


def test_a_worker_that_has_loaded_other_sources_is_refused(address, tmp_path, as_before):
    """It does not load what a model imports anew, and would call what was there."""
    (tmp_path / "tinted.py").write_text(
        "import tints_beside\nfrom mi_brdfs.models.lambert import Lambert\n"
        'class Tinted(Lambert):\n    """Tinted."""\n    plugins = ("tinted",)\n'
    )
    (tmp_path / "tints_beside.py").write_text("TINT = 1")
    guests.import_models(str(tmp_path / "tinted.py"))
    assert dict(run(work, {"one": (1,)}, scheduler=address)).keys() == {"one"}
    (tmp_path / "tints_beside.py").write_text("TINT = 2")
    with pytest.raises(ClusterError, match=r"has loaded another tints_beside than this process: restart it, with"):
        dict(run(work, {"one": (1,)}, scheduler=address))


def test_other_versions_are_refused(address, monkeypatch):
    monkeypatch.setattr(mi_brdfs.cluster.worker, "__version__", "9.9")
    with pytest.raises(ClusterError, match=r"The worker at tcp://\S+ has mi_brdfs 0.1.0, this process has 9.9\.$"):
        list(run(powers, {"a": (2, 1)}, scheduler=address))


@pytest.mark.slow
@pytest.mark.skipif(os.name != "posix", reason="no way to stop a process there")
@pytest.mark.parametrize("how", ["SIGKILL", "SIGSTOP"])
def test_a_scheduler_that_goes_or_falls_silent(how, tmp_path, monkeypatch):
    monkeypatch.setattr(client, "SILENT", 3)
    scheduler, address = scheduler_in(tmp_path)
    worker = start("worker", address, "--nthreads", "1", "--no-nanny", folder=tmp_path)
    try:
        results = run(work, {str(number): (number,) for number in range(100)}, scheduler=address)
        next(results)
        scheduler.send_signal(getattr(signal, how))
        begun = time.perf_counter()
        with pytest.raises(ClusterError, match=f"^The scheduler at {address} has gone.$"):
            list(results)
        assert time.perf_counter() - begun < 20
    finally:
        for process in worker, scheduler:
            process.kill()
            process.wait()


@pytest.mark.usefixtures("small_passes")
def test_what_is_finished_when_the_scheduler_goes_is_kept(scene):
    """Unless nothing is."""
    loaded, left = SceneFile(str(scene)).load(), 3
    source = pass_source(loaded.integrator())

    def passes(scene, sensor, jobs):
        for _, (seed, spp) in zip(range(left), jobs, strict=False):
            yield source.sums(scene, scene.sensors()[sensor], seed=seed, spp=spp)
        raise PassesError("The scheduler has gone.")

    with pytest.warns(UserWarning, match=r"^The scheduler has gone\.$"):
        picture = render(loaded, spp=32, passes=passes)
    assert (picture.spp, picture.total, picture.interrupted) == (12, 32, True)
    left = 0
    with pytest.raises(PassesError):
        render(loaded, spp=32, passes=passes)
