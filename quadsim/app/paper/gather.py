"""Runs that are made once: the missing ones on every core, one thread each, kept as they finish."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TypeVar

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from quadsim.app.campaign.pool import Processes, fly_all
from quadsim.app.paper.store import Store
from quadsim.record.run import RunError

Job = TypeVar("Job")
LINES = 10  # of progress where stderr is no terminal


def gather(jobs: Mapping[str, Job], make: Callable[[Job], dict], path: Path) -> dict[str, dict]:
    """The record of every job by its key: from the file, else made now by `make`, a module's function.

    Raises RunError where a run is lost twice with its worker process, and whatever `make` raises.
    """
    store = Store(path)
    missing = {key: job for key, job in jobs.items() if key not in store.records}
    if missing:
        key_of = {id(job): key for key, job in missing.items()}
        with _progress(path.stem, len(jobs), len(jobs) - len(missing)) as advance, Processes() as pool:
            for job, record in fly_all(pool, missing.values(), make):
                if record is None:
                    raise RunError(f"{path}: a worker process has died, twice; the same command goes on from here")
                store.add(key_of[id(job)], record)
                advance()
    return {key: store.records[key] for key in jobs}


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
