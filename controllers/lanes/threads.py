"""The number of threads of the compiled loops. Results do not depend on it."""

from __future__ import annotations

import os
import threading

import numba
import numpy as np

from quadsim.files.values import SettingError
from quadsim.files.yaml_errors import shown_value

_chosen = threading.local()  # its `number` is the number that this thread has set


def threads() -> int:
    """Return the number of threads for loops that the calling thread runs."""
    return getattr(_chosen, "number", 0) or most_threads()


def most_threads() -> int:
    """Return the number of cores that this process may run on."""
    most: int = numba.config.NUMBA_NUM_THREADS  # pyright: ignore[reportPrivateImportUsage, reportAttributeAccessIssue]
    if hasattr(os, "sched_getaffinity"):  # Linux
        most = min(len(os.sched_getaffinity(0)), most)
    return most


def use_threads(n: int | None) -> int:
    """Set the number of threads for loops that the calling thread runs.

    Args:
        n: number of threads; None: one for every core that this process may run on.

    Returns:
        The number in use.

    Raises:
        SettingError: n is not an integer from 1 to the number of cores (a ValueError).
    """
    most = most_threads()
    n = most if n is None else n
    is_whole = isinstance(n, int | np.integer) and not isinstance(n, bool)
    if not is_whole or not 1 <= n <= most:
        problem = f"expected 1 to {most} on this machine, got {shown_value(n)}"
        raise SettingError("threads", problem)
    _chosen.number = int(n)
    return int(n)
