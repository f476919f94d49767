"""The number of threads of the compiled loops. Results do not depend on it."""

from __future__ import annotations

import os

import numba


def threads() -> int:
    """Return the number of threads in use."""
    return numba.get_num_threads()


def most_threads() -> int:
    """Return the number of cores that this process may run on."""
    most: int = numba.config.NUMBA_NUM_THREADS  # pyright: ignore[reportPrivateImportUsage, reportAttributeAccessIssue]
    if hasattr(os, "sched_getaffinity"):  # Linux
        most = min(len(os.sched_getaffinity(0)), most)
    return most


def use_threads(n: int | None) -> int:
    """Set the number of threads.

    Args:
        n: the number; None: every core that this process may run on.

    Returns:
        The number in use.

    Raises:
        ValueError: n is not in 1..cores.
    """
    most = most_threads()
    n = most if n is None else n
    if not 1 <= n <= most:
        raise ValueError(f"threads: expected 1 to {most} on this machine, got {n}")
    numba.set_num_threads(n)
    return n
