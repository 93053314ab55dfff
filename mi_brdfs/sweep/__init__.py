"""Fits of many models to many materials, by several metrics, in parallel, and resumed where they ended.

From Python::

    from mi_brdfs.sweep import Sweep, medians
    sweep = Sweep(["a.binary", "b.binary"], ["ward", "walter"], "sweep", metrics=["log", "cube-root"])
    for outcome in sweep.fit(workers=2):         # what is finished is in the folder, and is not fitted again
        print(outcome)
    print(medians(sweep.rows()))

It needs ``pip install 'mi_brdfs[sweep]'``, and for more than one process ``mi_brdfs[cluster]``.
"""

from ..cluster import ClusterError
from ..measured import FileError
from .plan import Outcome, Sweep
from .store import MEDIANS, Store, StoreWarning, csv, medians

__all__ = ["MEDIANS", "ClusterError", "FileError", "Outcome", "Store", "StoreWarning", "Sweep", "csv", "medians"]
