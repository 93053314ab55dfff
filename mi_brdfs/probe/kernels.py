"""The kernels that some work launches."""

from __future__ import annotations

from collections.abc import Callable

import drjit as dr


def launched_kernels(work: Callable[[], object]) -> set[int]:
    """Return the kernels that some work launches, by hash: whether one is compiled depends on the cache that earlier
    runs left. ``dr.JitFlag.KernelHistory`` must be set."""
    dr.kernel_history_clear()
    work()
    return {kernel["hash"] for kernel in dr.kernel_history([dr.KernelType.JIT])}
