"""Session: a race on its own thread, which executes commands and publishes snapshots.

A flight never waits for a page.
"""

from __future__ import annotations

import queue
import threading
import traceback
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Concatenate, ParamSpec

from quadsim.record.run import RunError
from quadsim.web.cockpit import Cockpit
from quadsim.web.race import REST, AnyChoices, PageRace, TakeOff, take_off
from quadsim.web.snapshot import Snapshot

Arguments = ParamSpec("Arguments")


class Session:
    """A race that any thread may command and look at.

    `session.tell(PageRace.start, choices)` queues a command; `session.snapshot` is the present
    state of the race.

    Args:
        root: the folder of runs.
        take_off: function that begins a live flight of the given choices.

    Attributes:
        cockpit: receives the sticks of the flying visitor.
    """

    def __init__(self, root: str, take_off: TakeOff = take_off):
        self.root = root
        self.snapshot = Snapshot()
        self.cockpit = Cockpit()
        self._race = PageRace(root, take_off, self.cockpit)
        self._commands: queue.SimpleQueue[Callable[[], float | None]] = queue.SimpleQueue()
        self._started: object = None  # choices and runs of the last start
        self._is_starting = False  # whether a start is queued
        self._closing = False
        self._worker = threading.Thread(target=self._run, name="race", daemon=True)
        self._worker.start()

    def tell(
        self,
        command: Callable[Concatenate[PageRace, Arguments], None],
        *arguments: Arguments.args,
        **keywords: Arguments.kwargs,
    ) -> None:
        """Queue a call of a method of PageRace. Its errors become notices."""
        self._commands.put(partial(command, self._race, *arguments, **keywords))

    def start(self, choices: Sequence[AnyChoices], runs: Sequence[Path] = ()) -> bool:
        """Queue a start; the same one again is dropped until its first plan is ready.

        A visitor who sees nothing happen presses START again, which would begin anew.

        Returns:
            Whether the start is queued.
        """
        asked = (tuple(choices), tuple(runs))
        if asked == self._started and (self._is_starting or self.snapshot.is_taking_off):
            return False
        self._started = asked
        self._is_starting = True
        self._commands.put(partial(self._start, *asked))
        return True

    def _start(self, choices: Sequence[AnyChoices], runs: Sequence[Path]) -> None:
        """Begin a race, on the race's thread."""
        try:
            self._race.start(choices, runs)
        finally:
            self.snapshot = self._race.snapshot()
            self._is_starting = False

    def flies(self, visitor: int) -> bool:
        """Return whether a visitor flies by hand in this moment."""
        s = self.snapshot
        return s.flying and s.by_hand and self.cockpit.pilot == visitor

    def show_trajectories(self, on: bool) -> None:
        """Switch the sampled trajectories on or off; each update takes 0.3 ms."""
        self._race.show_trajectories = on

    def close(self) -> None:
        """End every flight, store the flights with a passed gate, and end the thread."""
        self.tell(PageRace.end_flights)
        self._commands.put(self._end)
        self._worker.join()

    def _run(self) -> None:
        """Run commands as they come, and turns of the race between them, until closed."""
        wait = 0.0
        while not self._closing:
            wait = self._do(self._next(wait)) or 0.0
            self.snapshot = self._race.snapshot()

    def _next(self, wait: float) -> Callable[[], float | None]:
        """Return the next command, or a turn of the race after `wait` seconds."""
        try:
            return self._commands.get(timeout=wait)
        except queue.Empty:
            return self._race.turn

    def _do(self, command: Callable[[], float | None]) -> float | None:
        """Run a command; return the time to wait for the next one [s], None for no wait."""
        notices = self._race.notices
        try:
            return command()
        except (ValueError, RunError) as error:
            notices.add("error", "Cannot do that", str(error))
        except Exception as error:
            # An unforeseen error must not end the thread that flies.
            traceback.print_exc()
            notices.add("error", "The race broke off", f"{type(error).__name__}: {error}")
            if command == self._race.turn:
                self._race.halt()
        return REST

    def _end(self) -> None:
        self._closing = True
