"""What a plugin costs over time: no kernels compiled on updates, no time or memory lost on loading."""

import subprocess
import sys

import drjit as dr
import mitsuba as mi
import pytest
from catalogue import SMOOTH


def scene_of(bsdf):
    return {
        "type": "scene",
        "integrator": {"type": "path", "max_depth": 3},
        "sensor": {
            "type": "perspective",
            "to_world": mi.ScalarTransform4f().look_at([0, 0, 4], [0, 0, 0], [0, 1, 0]),
            "film": {"type": "hdrfilm", "width": 16, "height": 16},
        },
        "shape": {"type": "sphere", "bsdf": bsdf},
        "sky": {"type": "constant"},
    }


@pytest.mark.usefixtures("llvm_rgb")
@pytest.mark.parametrize("name", SMOOTH)
def test_updates_compile_no_kernel(name):
    """After the first update of a parameter no value of it makes a kernel that was not there. Whether one is compiled
    depends on the cache that earlier runs left on the disk: so kernels are told by their hashes."""
    scene = mi.load_dict(scene_of(SMOOTH[name]))
    params = mi.traverse(scene)
    keys = [key for key in params.keys() if key.startswith("shape.bsdf.")]

    def launched():
        return {kernel["hash"] for kernel in dr.kernel_history([dr.KernelType.JIT])}

    with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
        for key in keys:
            known = set()
            for step in range(4):
                params[key] = params[key] * 0.95
                params.update()
                dr.eval(mi.render(scene, params, spp=4, seed=step))
                kernels = launched()
                assert kernels and (step == 0 or kernels <= known), key
                known |= kernels


CYCLES = """
import statistics, time
import mi_brdfs, mitsuba as mi, drjit as dr
mi.set_variant("{variant}")
from catalogue import SMOOTH
from test_resources import scene_of

def resident():
    with open("/proc/self/statm") as statm:
        return int(statm.read().split()[1]) * 4096 / 2**20

rounds = max(16, -(-200 // len(SMOOTH)))
times, memory = [], []
for seed in range(rounds):
    times.append([])
    for bsdf in SMOOTH.values():
        start = time.thread_time()
        dr.eval(mi.render(mi.load_dict(scene_of(bsdf)), spp=1, seed=seed))
        dr.sync_thread()
        times[-1].append(time.thread_time() - start)
    memory.append(resident())
early, late = ([min(of_model) for of_model in zip(*part)] for part in (times[1:6], times[-5:]))
print(statistics.median(b / a for a, b in zip(early, late)), memory[-1] - memory[1])
"""


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="reads the resident memory from /proc")
@pytest.mark.parametrize("variant", ["llvm_ad_rgb"])
def test_loading_200_times_loses_neither_time_nor_memory(variant, pytestconfig):
    """In a process of its own, round after round over all models. The last five rounds take as long as the first five
    after a warm-up, by the time of the thread that loads and traces: the best of the five, which a busy machine
    disturbs least, and its median over the models. A machine that is busier at the end slows them, too: then the next
    process tells. Memory grows by less than 5 MB."""
    for _ in range(3):
        done = subprocess.run(
            [sys.executable, "-c", CYCLES.format(variant=variant)],
            capture_output=True, text=True, timeout=600, cwd=pytestconfig.rootpath / "tests",
        )  # fmt: skip
        assert done.returncode == 0, done.stderr
        slower, growth = map(float, done.stdout.split())
        assert growth < 5
        if slower < 1.15:
            break
    assert slower < 1.15
