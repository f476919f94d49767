"""Session: a race on a thread of its own. Commands go in, snapshots come out; a flight never waits for a page."""

from __future__ import annotations

import queue
import threading
import traceback
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

from quadsim.record.archive import list_runs
from quadsim.record.run import RunError
from web.flight_factory import FlightFactory
from web.race import REST, Race, Snapshot


class Session:
    """`session.tell(Race.start, choices)` from any thread; `session.snapshot` is the race as it is now."""

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

    def runs(self) -> list[Path]:
        """Stored runs, the latest first."""
        return list_runs(self._root)[::-1]

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
            self._race.notices.add("error", "The race broke off", f"{type(error).__name__}: {error}")
            self._race.play(False)
        return REST

    def _end(self) -> None:
        self._closing = True
