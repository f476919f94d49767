"""Many runs, each made once: those that are missing on every core, one thread each, kept as they finish."""

from __future__ import annotations

import multiprocessing
import os
import signal
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from multiprocessing.pool import Pool
from pathlib import Path
from typing import TypeVar

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from quadsim.app.paper.store import Store

Job = TypeVar("Job")
LINES = 10  # of progress where stderr is no terminal


def gather(jobs: Mapping[str, Job], make: Callable[[Job], dict], path: Path) -> dict[str, dict]:
    """The record of every job by its key: from the file, else made now by `make`, a module's function."""
    store = Store(path)
    missing = {key: job for key, job in jobs.items() if key not in store.records}
    if missing:
        with _progress(path.stem, len(jobs), len(jobs) - len(missing)) as advance, _workers(len(missing)) as pool:
            for key, record in pool.imap_unordered(_Made(make), missing.items()):
                store.add(key, record)
                advance()
    return {key: store.records[key] for key in jobs}


class _Made:
    """(key, job) -> (key, record), in a worker."""

    def __init__(self, make: Callable):
        self.make = make

    def __call__(self, item: tuple[str, Job]) -> tuple[str, dict]:
        return item[0], self.make(item[1])


@contextmanager
def _workers(jobs: int) -> Iterator[Pool]:
    """As many as there are cores; leaving ends them at once, what they have not finished is lost."""
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    spawn = multiprocessing.get_context("spawn")  # a fork would inherit the locks of threads that it does not have
    with spawn.Pool(min(jobs, len(os.sched_getaffinity(0))), _settle) as pool:
        yield pool


def _settle() -> None:
    from controllers.rollout.threads import use_threads

    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is the parent's to answer
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    use_threads(1)


@contextmanager
def _progress(label: str, total: int, done: int) -> Iterator[Callable[[], None]]:
    """A bar with the time left; where stderr is no terminal, a line now and then."""
    console = Console(stderr=True, highlight=False)
    columns = (TextColumn(label), BarColumn(24), MofNCompleteColumn(), TimeElapsedColumn(), TimeRemainingColumn())
    with Progress(*columns, console=console, transient=True, disable=not console.is_terminal) as bar:
        task = bar.add_task(label, total=total, completed=done)
        every = max(total // LINES, 1)

        def advance() -> None:
            bar.advance(task)
            made = bar.tasks[0]
            if not console.is_terminal and (made.completed % every == 0 or made.finished):
                left = f", {made.time_remaining} s left" if made.time_remaining else ""
                console.print(f"{label}: {made.completed:.0f} of {total}{left}")

        yield advance
