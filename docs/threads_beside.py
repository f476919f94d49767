"""Time control steps on one and two threads, alone and beside one and two busy processes.

It takes half a minute on a machine that has nothing else to do:

    .venv/bin/python docs/threads_beside.py
"""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from time import perf_counter

import numpy as np
from shared import control_steps

from quadsim import Spec

COURSE = "split_s_swift"
STEPS = 400


def main() -> None:
    """Print the median and the mean of each case, and the ratios of two threads to one."""
    for count in (0, 1, 2):
        with ExitStack() as busy:
            for _ in range(count):
                busy.enter_context(busy_process())
            one, two = step_times(1), step_times(2)
        ratios = np.median(two) / np.median(one), two.mean() / one.mean()
        print(
            f"{count} busy: one thread {np.median(one):.2f} ms, two {np.median(two):.2f} ms; "
            f"ratio of medians {ratios[0]:.2f}, of means {ratios[1]:.2f}"
        )


@contextmanager
def busy_process() -> Iterator[None]:
    """Keep a core busy, in a session of its own as another user's program is."""
    command = [sys.executable, "-c", "while True: pass"]
    process = subprocess.Popen(command, start_new_session=True)
    try:
        yield
    finally:
        process.kill()
        process.wait()


def step_times(threads: int) -> np.ndarray:
    """Return the times of control steps of the preset `race` from the start [ms].  (STEPS,)"""
    return control_steps(Spec.of(COURSE, threads=threads), STEPS, perf_counter)


if __name__ == "__main__":
    main()
