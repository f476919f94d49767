"""Session: a race on a thread of its own. Commands go in, snapshots come out; a flight never waits
for a page."""

from __future__ import annotations

import queue
import threading
import traceback
from collections.abc import Callable
from datetime import datetime
from functools import cache, partial
from pathlib import Path
from typing import Any

import msgspec

from quadsim.record.archive import list_runs
from quadsim.record.run import RunError
from web.flight_factory import FlightFactory
from web.race import REST, Race, Snapshot


class Session:
    """`session.tell(Race.start, choices)` from any thread; `session.snapshot` is the race as it is
    now."""

    def __init__(self, flight_factory: FlightFactory, root: str):
        self.snapshot = Snapshot()
        self._root = root
        self._race = Race(flight_factory, root)
        self._commands: queue.SimpleQueue[Callable[[], Any]] = queue.SimpleQueue()
        self._closing = False
        self._worker = threading.Thread(target=self._run, name="race", daemon=True)
        self._worker.start()

    def tell(self, command: Callable[..., Any], *args: Any) -> None:
        """Queue a call of a method of Race. Errors that it raises become notices."""
        self._commands.put(partial(command, self._race, *args))

    def show_trajectories(self, on: bool) -> None:
        """Whether the sampled trajectories are needed: they cost 0.3 ms now and then."""
        self._race.show_trajectories = on

    def titled_runs(self, most: int) -> dict[str, Path]:
        """Stored runs by what to call them, the latest first: "16:15 split_s_swift colored 16.378
        s"."""
        found: dict[str, Path] = {}
        for path in list_runs(self._root)[: -most - 1 : -1]:
            when, what = _flown_at(path), _flown(path)
            day = "%H:%M" if when.date() == datetime.now().date() else "%d %b %H:%M"
            titles = (f"{when.strftime(clock)} {what}" for clock in (day, f"{day}:%S"))
            found[next((title for title in titles if title not in found), path.name)] = path
        return found

    def close(self) -> None:
        """End every flight, store what has passed a gate, end the thread."""
        self.tell(Race.end_flights)
        self._commands.put(self._end)
        self._worker.join()

    def _run(self) -> None:
        wait = REST
        while not self._closing:
            wait = self._do(self._next(wait)) or 0.0
            self.snapshot = self._race.snapshot()

    def _next(self, wait: float) -> Callable[[], Any]:
        try:
            return self._commands.get(timeout=wait)
        except queue.Empty:
            return self._race.turn

    def _do(self, command: Callable[[], Any]) -> float | None:
        try:
            return command()
        except (ValueError, RunError) as error:
            self._race.notices.add("error", "Cannot do that", str(error))
        except Exception as error:  # an unforeseen error must not end the thread that flies
            traceback.print_exc()
            self._race.notices.add(
                "error", "The race broke off", f"{type(error).__name__}: {error}"
            )
            self._race.play(False)
        return REST

    def _end(self) -> None:
        self._closing = True


class _Chosen(msgspec.Struct):
    course: str
    sampler: str


class _Ended(msgspec.Struct):
    """What a title needs of a run.json."""

    outcome: str
    laps: list[float]
    spec: _Chosen


@cache
def _flown(path: Path) -> str:
    """Course, sampler and time or outcome; the folder's name where they cannot be read."""
    try:
        run = msgspec.json.decode((path / "run.json").read_bytes(), type=_Ended)
    except (OSError, msgspec.DecodeError):
        return path.name
    ended = (
        f"{sum(run.laps):.3f} s"
        if run.outcome == "finished"
        else f"{run.outcome}, lap {len(run.laps) + 1}"
    )
    return f"{run.spec.course} {run.spec.sampler} {ended}"


def _flown_at(path: Path) -> datetime:
    """In local time: from its name, or else when it was written."""
    try:
        return datetime.strptime(
            path.name.partition("_")[0] + "+0000", "%Y%m%dT%H%M%SZ%z"
        ).astimezone()
    except ValueError:
        return datetime.fromtimestamp(path.stat().st_mtime if path.exists() else 0.0).astimezone()
