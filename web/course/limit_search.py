"""LimitSearch: the search of a course's least time in a separate process.

The search is the same as in `race limit`, and stores its solutions in the folder of limits among
the runs. In a separate process it does not slow down flights on the page.
"""

from __future__ import annotations

import multiprocessing as mp
import os
import threading
from collections.abc import Callable
from contextlib import suppress
from importlib.util import find_spec
from multiprocessing.connection import Connection
from typing import NamedTuple

from quadsim.files.extras import needs_extra
from quadsim.limit.keeper import Keeper
from quadsim.limit.limits import LimitProblem, limits_folder
from quadsim.record.run import RunError
from quadsim.record.whole_files import try_writing

# Nodes on the way to a gate, as in `race limit`
NODES = 20
# Low priority of the process beside flights
NICE = 10


class Progress(NamedTuple):
    """The progress of a search."""

    # state or error in one line
    text: str
    # least time so far [s], None: none yet
    best: float | None = None
    is_over: bool = False


class LimitSearch:
    """A search that runs until it has ended or is cancelled.

    Args:
        problem: the race.
        runs_dir: the folder of runs.

    Raises:
        ValueError: the optimiser is not installed.
    """

    def __init__(self, problem: LimitProblem, runs_dir: str):
        if find_spec("casadi") is None:
            raise ValueError(needs_extra("casadi", "limit"))
        self.problem = problem
        self.progress = Progress("starting")
        self._is_cancelled = False
        context = mp.get_context("spawn")
        self._reports, reports = context.Pipe(duplex=False)
        # daemon: the process ends with the page
        self._process = context.Process(
            target=_search, args=(problem, runs_dir, NODES, reports), daemon=True
        )
        self._process.start()
        # Close the writing end here, so that reading ends with the process
        reports.close()
        self._reader = threading.Thread(target=self._read, name="limit", daemon=True)
        self._reader.start()

    @property
    def is_on(self) -> bool:
        """Whether the search is running."""
        return not self.progress.is_over

    def cancel(self) -> None:
        """End the search; stored solutions are kept."""
        self._is_cancelled = True
        self._process.terminate()
        self._reader.join()

    def _read(self) -> None:
        """Take the reports of the process until it ends."""
        with suppress(EOFError, OSError):
            while True:
                self.progress = self._reports.recv()
        self._process.join()
        if self.is_on:
            # The process has ended without a report
            how = "cancelled" if self._is_cancelled else "the search broke off: try it again"
            self.progress = Progress(how, self.progress.best, is_over=True)


def _search(problem: LimitProblem, runs_dir: str, nodes: int, reports: Connection) -> None:
    """Search in this process and report each iteration."""
    os.nice(NICE)
    best: float | None = None

    def report(text: str, is_over: bool = False) -> None:
        reports.send(Progress(text, best, is_over))

    def progress(start: str, count: int) -> Callable[[int, float], None]:
        def show(iteration: int, time: float) -> None:
            report(f"{start}, {count} nodes: iteration {iteration}, {time:.3f} s")

        return show

    report("loading the optimiser")
    from quadsim.limit.search import Search

    try:
        folder = limits_folder(runs_dir)
        try_writing(folder)
        keeper = Keeper(problem, folder, problem.best_known(folder))
        search = Search(problem)
        for attempt in search.attempts([], nodes, progress):
            keeper.keep(search.stored([attempt]))
            best = keeper.best.time if keeper.best else None
        keeper.finish()
    except (ValueError, RunError) as error:
        report(f"cannot be searched: {error}", is_over=True)
        return
    found = (
        "no start led to a race that holds" if best is None else f"best known limit {best:.3f} s"
    )
    report(found, is_over=True)
