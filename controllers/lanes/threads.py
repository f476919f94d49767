"""The number of threads of the compiled loops. Results do not depend on it."""

from __future__ import annotations

import os

import numba
import numpy as np
from numba.np.ufunc import parallel

from controllers.lanes.compiled import lost_threads
from quadsim.files.values import SettingError
from quadsim.files.yaml_errors import shown_value


def threads() -> int:
    """Return the number of threads in use."""
    return numba.get_num_threads()


def most_threads() -> int:
    """Return the number of cores that this process may run on."""
    most: int = numba.config.NUMBA_NUM_THREADS  # pyright: ignore[reportPrivateImportUsage, reportAttributeAccessIssue]
    if hasattr(os, "sched_getaffinity"):  # Linux
        most = min(len(os.sched_getaffinity(0)), most)
    return most


def can_run_side_by_side() -> bool:
    """Return whether loops may run on several threads for several callers at once.

    numba's own threads ("workqueue") serve one caller at a time; OpenMP and TBB threads serve
    several. Which of these is used depends on the machine, and is known after the first loop.
    """
    if lost_threads() or not parallel._is_initialized:
        return False
    layer = numba.threading_layer()  # pyright: ignore[reportPrivateImportUsage]
    return layer in ("omp", "tbb")


def use_threads(n: int | None) -> int:
    """Set the number of threads.

    Args:
        n: the number; None: every core that this process may run on.

    Returns:
        The number in use.

    Raises:
        SettingError: n is no whole number in 1..cores (a ValueError).
    """
    most = most_threads()
    n = most if n is None else n
    is_whole = isinstance(n, int | np.integer) and not isinstance(n, bool)
    if not is_whole or not 1 <= n <= most:
        problem = f"expected 1 to {most} on this machine, got {shown_value(n)}"
        raise SettingError("threads", problem)
    numba.set_num_threads(int(n))
    return int(n)
