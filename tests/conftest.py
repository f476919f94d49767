"""Fixtures that several test files share, and the order of the tests."""

import gc
import os
import signal
from collections import Counter
from functools import cache
from pathlib import Path

# Otherwise the threads of BLAS spin against those of the compiled loops. The library reads it when
# it is loaded, here and in child processes.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
# Progress is drawn for a terminal that can move its cursor, whatever terminal runs the tests.
os.environ["TERM"] = "xterm-256color"

import numpy as np
import pytest

from tests.skipped import FOLDER, reasons_of, write_outcomes

pytest_plugins = ["tests.fence"]

# A shell's job in the background inherits an ignored Ctrl-C. Tests send it to themselves and to
# commands, so it must work.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)


def pytest_collection() -> None:
    """Switch the garbage collector off while the test modules are imported.

    It would search their many objects again and again, and find nothing.
    """
    gc.disable()


def pytest_collection_finish() -> None:
    """Switch the garbage collector on, and let it leave out what has been imported."""
    gc.freeze()
    gc.enable()


def pytest_runtest_setup() -> None:
    """Let one of several workers plan on one thread: the others have the other cores.

    A command that ran in the test before may have set another number.
    """
    if "PYTEST_XDIST_WORKER" in os.environ:
        from quadsim.controllers.lanes.threads import use_threads

        use_threads(1)


def pytest_sessionstart() -> None:
    """Ask git for the commit once: each run that is stored asks for it, in a process of its own."""
    from quadsim.record import provenance

    provenance.git_commit = cache(provenance.git_commit)
    provenance.git_commit()


@pytest.fixture(scope="session")
def key():
    """Return a key of the counter-based generator."""
    return np.array([20240501, 7], np.uint32)


@pytest.fixture
def on_threads():
    """Return on_threads(n, f), which calls f on n threads. The number before is restored."""
    # This import loads the planner: only tests that ask for threads pay for it.
    from quadsim.controllers.lanes.threads import threads, use_threads

    before = threads()

    def run(n, f):
        if n > len(os.sched_getaffinity(0)):
            pytest.skip(f"needs {n} cores")
        use_threads(n)
        return f()

    yield run
    use_threads(before)


def pytest_terminal_summary(terminalreporter) -> None:
    """Say once for each reason how many tests were skipped for it."""
    reasons = reasons_of(terminalreporter.stats.get("skipped", []))
    for reason, count in Counter(reasons.values()).most_common():
        terminalreporter.write_line(f"{count} skipped: {reason}")
    if FOLDER in os.environ:
        write_outcomes(Path(os.environ[FOLDER]), terminalreporter.stats)
