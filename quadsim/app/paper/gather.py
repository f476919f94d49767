"""Many runs, each made once: those that are missing on every core, one thread each, kept as they finish."""

from __future__ import annotations

import multiprocessing
import os
import signal
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import BrokenExecutor, Executor, ProcessPoolExecutor, as_completed
from contextlib import contextmanager
from pathlib import Path
from threading import Thread
from typing import TypeVar

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from quadsim.app.paper.store import Store
from quadsim.run import RunError

Job = TypeVar("Job")
LINES = 10  # of progress where stderr is no terminal


def gather(jobs: Mapping[str, Job], make: Callable[[Job], dict], path: Path) -> dict[str, dict]:
    """The record of every job by its key: from the file, else made now by `make`, a module's function.

    Raises RunError where a worker process dies, and whatever `make` raises.
    """
    store = Store(path)
    missing = {key: job for key, job in jobs.items() if key not in store.records}
    if missing:
        with _progress(path.stem, len(jobs), len(jobs) - len(missing)) as advance, _workers(len(missing)) as pool:
            under_way = {pool.submit(make, job): key for key, job in missing.items()}
            for future in as_completed(under_way):
                try:
                    store.add(under_way[future], future.result())
                except BrokenExecutor:
                    raise RunError(f"{path}: a worker process has died; the same command goes on from here") from None
                advance()
    return {key: store.records[key] for key in jobs}


@contextmanager
def _workers(jobs: int) -> Iterator[Executor]:
    """As many as there are cores; leaving ends them at once, what they have not finished is lost."""
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    spawn = multiprocessing.get_context("spawn")  # a fork would inherit the locks of threads that it does not have
    pool = ProcessPoolExecutor(min(jobs, len(os.sched_getaffinity(0))), mp_context=spawn, initializer=_settle)
    try:
        yield pool
    finally:
        pool.shutdown(wait=False, cancel_futures=True)
        for worker in multiprocessing.active_children():
            worker.terminate()


def _settle() -> None:
    """One thread each; Ctrl-C is the parent's to answer, and a worker whose parent is gone goes as well."""
    from controllers.rollout.threads import use_threads

    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    use_threads(1)
    Thread(target=_follow, daemon=True).start()


def _follow() -> None:
    parent = multiprocessing.parent_process()
    if parent:
        parent.join()
        os._exit(1)


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
