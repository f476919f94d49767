"""Runs of an experiment, computed by worker processes and stored in one SQLite file.

A run is defined by a frozen dataclass with all its settings, including the seed, and by a function
from this task to a result. Its key in the file is the text of the task with the versions of the
libraries. A row is written in one transaction as soon as its run has ended, so that an interrupted
command can be continued.
"""

from __future__ import annotations

import io
import sqlite3
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future
from contextlib import closing, contextmanager
from functools import cache
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from rich.progress import track

from quadsim.campaign.run.pool import Pool, finished, open_pool
from quadsim.console import complain, progress_console, uninterrupted
from quadsim.record.provenance import versions
from quadsim.record.run import RunError

FILE = "runs.sqlite"
GO_ON = "the same command continues from there"
LIBRARIES = ("numpy", "numba")  # libraries whose versions affect a run
WAIT = 60.0  # [s] longest wait for another process that writes to the same file
TABLE = "CREATE TABLE IF NOT EXISTS runs (run TEXT PRIMARY KEY, result BLOB NOT NULL)"

Task = TypeVar("Task")
Result = TypeVar("Result", bound=tuple)  # a NamedTuple


def kept_runs(
    tasks: Sequence[Task], fly: Callable[[Task], Result], kind: type[Result], folder: Path
) -> list[Result]:
    """Return the result of each task; results that the folder lacks are computed.

    Args:
        tasks: frozen dataclasses with all settings of a run.
        fly: function at module level that computes a run in a worker process.
        kind: NamedTuple of numbers, texts and arrays that `fly` returns.
        folder: folder that holds FILE with the results.

    Raises:
        RunError: the file cannot be used, or a worker process has died.
        KeyboardInterrupt: finished runs are kept.
    """
    path = folder / FILE
    keys = [run_key(task) for task in tasks]
    with _opened(path) as database:
        results = _read(database, keys, kind)
        missing = [task for key, task in zip(keys, tasks, strict=True) if key not in results]
        done = len(tasks) - len(missing)
        if done and missing:
            complain(f"{done} of {len(tasks)} runs are kept from before")
        try:
            for task, result in _computed(missing, fly):
                results[run_key(task)] = result
                _write(database, run_key(task), result)
                done += 1
        except KeyboardInterrupt:
            if not done:
                raise
            raise KeyboardInterrupt(f"{done} runs are kept in {path}: {GO_ON}") from None
    return [results[key] for key in keys]


def run_key(task: object) -> str:
    """Return the key of a run: its settings and the versions of the libraries."""
    return f"{task!r} {libraries()}"


@cache
def libraries() -> str:
    """Return the versions of the libraries that affect a run."""
    used = versions()
    return " ".join(f"{name} {used[name]}" for name in LIBRARIES)


def _computed(
    tasks: Sequence[Task], fly: Callable[[Task], Result]
) -> Iterator[tuple[Task, Result]]:
    """Yield the results as the runs end, in any order."""
    if not tasks:
        return
    with open_pool() as pool:
        yield from track(
            _in_workers(pool, tasks, fly),
            "running",
            total=len(tasks),
            console=progress_console(),
            transient=True,
        )


def _in_workers(
    pool: Pool, tasks: Sequence[Task], fly: Callable[[Task], Result]
) -> Iterator[tuple[Task, Result]]:
    """Yield the results as the runs end, with one run per worker at a time."""
    waiting = deque(tasks)
    running: dict[Future, Task] = {}
    while waiting or running:
        while waiting and len(running) < pool.window:
            task = waiting.popleft()
            running[pool.submit(fly, task)] = task
        for future in finished(running):
            task = running.pop(future)
            if isinstance(future.exception(), pool.lost):
                raise RunError(f"a worker process has died: {GO_ON}")
            yield task, future.result()


@contextmanager
def _opened(path: Path) -> Iterator[sqlite3.Connection]:
    """Open the file of finished runs, and create it if it is missing. Raises RunError."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with closing(sqlite3.connect(path, timeout=WAIT)) as database:
            database.execute(TABLE)
            yield database
    except (OSError, sqlite3.Error) as error:
        raise RunError(f"{path}: cannot keep runs here: {error}") from error


def _read(
    database: sqlite3.Connection, keys: Sequence[str], kind: type[Result]
) -> dict[str, Result]:
    """Return the stored results by key."""
    kept = {}
    for key in keys:
        row = database.execute("SELECT result FROM runs WHERE run = ?", (key,)).fetchone()
        if row:
            kept[key] = from_bytes(row[0], kind)
    return kept


def _write(database: sqlite3.Connection, key: str, result: tuple) -> None:
    """Store a result."""
    with uninterrupted(), database:  # the context of the database commits
        database.execute("INSERT OR REPLACE INTO runs VALUES (?, ?)", (key, as_bytes(result)))


def as_bytes(result: Any) -> bytes:
    """Return a NamedTuple of numbers, texts and arrays as a compressed archive."""
    buffer = io.BytesIO()
    np.savez_compressed(buffer, **result._asdict())
    return buffer.getvalue()


def from_bytes(data: bytes, kind: type[Result]) -> Result:
    """Return the NamedTuple of this kind from the bytes of `as_bytes`."""
    with np.load(io.BytesIO(data), allow_pickle=False) as arrays:
        columns = {name: arrays[name] for name in arrays.files}
    numbers: dict[str, Any] = {name: a if a.ndim else a.item() for name, a in columns.items()}
    return kind(**numbers)
