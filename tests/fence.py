"""A fence between the kinds of tests: what a test does, its marks say.

A test without a mark is a function of plain Python and NumPy: `make quick` runs nothing else. One
that compiles or runs compiled loops, starts a process or binds a port without the mark for it fails
at once, with the name of the mark. So no list of slow tests is kept, and none is forgotten.
"""

from __future__ import annotations

import multiprocessing.util
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import pytest
from numba.core.dispatcher import Dispatcher

COMPILED = "compiled"
PROCESS = "process"
SOCKET = "socket"
MARKS = (COMPILED, PROCESS, SOCKET)
# Kinds of tests that run by commands of their own, or drive the page in a browser.
EVERYTHING = ("browser", "docs", "page", "regression")

DOES = {
    COMPILED: "compiles or runs compiled loops",
    PROCESS: "starts a process",
    SOCKET: "binds a port",
}
# Events of sys.audit by which a process starts
STARTS = ("subprocess.Popen", "os.fork", "os.forkpty", "os.posix_spawn")
# Matplotlib lists a machine's fonts by this program, when it is imported there for the first time.
LISTS_FONTS = "fc-list"


class Fence:
    """Watches what the running test does."""

    def __init__(self) -> None:
        self._allowed = set(MARKS)
        # What the running test has done without its mark; a test does not see what fails in
        # another thread.
        self.done: set[str] = set()
        # Compiled functions of this process, and the code that is taken from them for now
        self._compiled: dict[Any, None] = {}
        self._hidden: list[tuple[Any, list[Any]]] = []
        self._watch_compiler()
        self._watch_processes()

    @contextmanager
    def around(self, item: pytest.Item) -> Iterator[None]:
        """Let a test do what its marks say, and nothing else."""
        marks = {mark.name for mark in item.iter_markers()}
        self._allowed = set(MARKS) if marks & set(EVERYTHING) else marks & set(MARKS)
        self.done.clear()
        if COMPILED in self._allowed:
            self._show_code()
        else:
            self._hide_code()
        try:
            yield
        finally:
            self._allowed = set(MARKS)

    def fail(self, what: str) -> None:
        """Fail the running test for what it does, in one line."""
        __tracebackhide__ = True
        self.done.add(what)
        pytest.fail(f"mark it @pytest.mark.{what}: it {DOES[what]}", pytrace=False)

    def _watch_compiler(self) -> None:
        """See each function that is compiled, or read from the cache of compiled code."""
        compile_ = Dispatcher.compile

        def watched(function: Any, signature: Any) -> Any:
            if COMPILED not in self._allowed:
                self.fail(COMPILED)
            self._compiled[function] = None
            return compile_(function, signature)

        Dispatcher.compile = watched

    def _hide_code(self) -> None:
        """Let functions that earlier tests have compiled ask for the compiler again."""
        for function in self._compiled:
            if function.overloads:
                self._hidden.append((function, list(function.overloads.values())))
                function._reset_overloads()

    def _show_code(self) -> None:
        """Give the functions their code back."""
        for function, overloads in self._hidden:
            for overload in overloads:
                function.add_overload(overload)
        self._hidden.clear()

    def _watch_processes(self) -> None:
        """See each process that starts and each port that is bound."""
        spawn = multiprocessing.util.spawnv_passfds

        def watched(*arguments: Any) -> int:
            if PROCESS not in self._allowed:
                self.fail(PROCESS)
            return spawn(*arguments)

        multiprocessing.util.spawnv_passfds = watched

        def heard(event: str, arguments: tuple[Any, ...]) -> None:
            starts = event in STARTS and arguments[:1] != (LISTS_FONTS,)
            if starts and PROCESS not in self._allowed:
                self.fail(PROCESS)
            # The address of a port is a tuple; that of a pipe between processes is a path.
            is_port = event == "socket.bind" and isinstance(arguments[1], tuple)
            if is_port and SOCKET not in self._allowed:
                self.fail(SOCKET)

        sys.addaudithook(heard)


FENCE = Fence()


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item: pytest.Item) -> Iterator[None]:
    """Run a test, with its fixtures, within the fence."""
    with FENCE.around(item):
        return (yield)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_call(item: pytest.Item) -> Iterator[None]:
    """Fail a test whose other threads did something without its mark, which it does not see."""
    result = yield
    for what in FENCE.done:
        FENCE.fail(what)
    return result
