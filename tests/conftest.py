"""Fixtures that several test files share, and the markers by which `make quick` chooses tests.

A test is marked by what it uses, so that nobody keeps lists of tests:

* browser: it asks for the fixture `browser`.
* process: it, a fixture that it asks for, or a helper that they call uses one of PROCESSES.
* flight: it, a fixture or a helper calls one of the project's functions in FLIGHTS, or `race` in a
  folder of FLYING_COMMANDS; or it lies in a folder of FLYING.

A test that takes seconds for another reason carries one of these markers in its own file.
"""

import os
import signal
import sys
from collections.abc import Callable, Iterator
from inspect import isclass, isfunction, ismodule
from pathlib import Path
from types import CodeType

# Otherwise the threads of BLAS spin against those of the compiled loops.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
import pytest

TESTS = Path(__file__).parent
PROJECT = ("quadsim", "controllers", "web")
# Names by which tests start other processes.
PROCESSES = {"subprocess", "Popen", "fork", "multiprocessing", "Processes", "LocalCluster"}
# Functions of the project that fly, train or search for seconds.
FLIGHTS = {
    "fly", "frames", "compare", "simulate", "launch", "flight_frames", "fly_attempt", "fly_all",
}  # fmt: skip
# Folders of tests/ where the commands that tests call fly, and where every test flies or searches.
FLYING_COMMANDS = {"campaign", "learn", "render"}
FLYING = {"courses_nasty", "lap_times", "limit", "paper"}

# A shell's job in the background inherits an ignored Ctrl-C. Tests send it to themselves and to
# commands, so it must work.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark the tests by what they use, and start with the slow files."""
    for item in items:
        if isinstance(item, pytest.Function):
            _mark(item)
    # With `--dist loadfile` a worker takes a whole file. A long file at the end would leave the
    # other worker idle.
    slow = {
        item.path
        for item in items
        if any(map(item.get_closest_marker, ("browser", "flight", "process")))
    }
    items.sort(key=lambda item: item.path not in slow)


def _mark(item: pytest.Function) -> None:
    if "browser" in item.fixturenames:
        item.add_marker("browser")
    used = _Uses()
    used.look(item.function)
    for fixtures in item._fixtureinfo.name2fixturedefs.values():
        for fixture in fixtures:
            used.look(fixture.func)
    if used.names & PROCESSES:
        item.add_marker("process")
    folder = item.path.relative_to(TESTS).parts[0]
    commands = "race" in used.functions and folder in FLYING_COMMANDS
    if folder in FLYING or commands or used.functions & FLIGHTS:
        item.add_marker("flight")


class _Uses:
    """The names that test functions use, and the project's functions among them."""

    def __init__(self) -> None:
        self.names: set[str] = set()
        self.functions: set[str] = set()
        self._seen: set[CodeType] = set()

    def look(self, function: Callable) -> None:
        """Take in a function, and the helpers in tests/ that it calls."""
        code = getattr(function, "__code__", None)
        if code is None or code in self._seen:
            return
        self._seen.add(code)
        names = set(_names(code))
        self.names |= names
        for name in names:
            value = function.__globals__.get(name)
            if ismodule(value) and value.__name__.partition(".")[0] in PROJECT:
                self.functions |= names & FLIGHTS & set(dir(value))
            elif isfunction(value):
                self._call(value)
            elif isclass(value) and _of_tests(value):
                for method in filter(isfunction, vars(value).values()):
                    self.look(method)

    def _call(self, function: Callable) -> None:
        if _of_tests(function):
            self.look(function)
        elif function.__module__.partition(".")[0] in PROJECT:
            self.functions.add(function.__name__)


def _names(code: CodeType) -> Iterator[str]:
    """Yield the names that a function's code and the functions inside it refer to."""
    yield from code.co_names
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from _names(constant)


def _of_tests(value: Callable) -> bool:
    """Return whether a function or class is defined in tests/."""
    file = getattr(sys.modules.get(value.__module__), "__file__", None)
    return file is not None and TESTS in Path(file).parents


@pytest.fixture(scope="session")
def key():
    """Return a key of the counter-based generator."""
    return np.array([20240501, 7], np.uint32)


@pytest.fixture
def on_threads():
    """Return on_threads(n, f), which calls f on n threads. The number before is restored."""
    # This import loads numba: only tests that ask for threads pay for it.
    from controllers.lanes.threads import threads, use_threads

    before = threads()

    def run(n, f):
        if n > len(os.sched_getaffinity(0)):
            pytest.skip(f"needs {n} cores")
        use_threads(n)
        return f()

    yield run
    use_threads(before)
