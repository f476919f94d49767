"""Session: a race on its own thread, which executes commands and publishes snapshots.

A flight never waits for a page.
"""

from __future__ import annotations

import queue
import threading
import traceback
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Concatenate, ParamSpec

from quadsim.record.run import RunError
from quadsim.web.race.cockpit import Cockpit
from quadsim.web.race.page_race import REST, AnyChoices, PageRace, TakeOff, take_off
from quadsim.web.race.snapshot import Preparing, Snapshot

Arguments = ParamSpec("Arguments")


@dataclass(eq=False)
class Start:
    """A start of flights, as a session was asked for it.

    Attributes:
        choices, runs: the flights, and the stored runs beside them.
        race: number of the race that it began; 0: it was refused; None: it is awaited.
    """

    choices: tuple[AnyChoices, ...]
    runs: tuple[Path, ...]
    race: int | None = None

    def is_same(self, other: Start) -> bool:
        """Return whether another start asks for the same flights and runs."""
        return (self.choices, self.runs) == (other.choices, other.runs)


class Session:
    """A race that any thread may command and look at.

    `session.tell(PageRace.start, choices)` queues a command; `session.snapshot` is the present
    state of the race.

    Args:
        root: the folder of runs.
        take_off: function that begins a live flight of the given choices.

    Attributes:
        cockpit: receives the sticks of the flying visitor.
        steps: called when a start has gone on by a step, such as a flight that is built, or its
            first plan; on the thread of the race.
    """

    def __init__(self, root: str, take_off: TakeOff = take_off):
        self.root = root
        self.snapshot = Snapshot()
        self.cockpit = Cockpit()
        self.steps: Callable[[], object] = lambda: None
        self._race = PageRace(root, take_off, self.cockpit, self._show)
        self._commands: queue.SimpleQueue[Callable[[], float | None]] = queue.SimpleQueue()
        self._last: Start | None = None  # None: another command came after it
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
        self._last = None
        self._commands.put(partial(command, self._race, *arguments, **keywords))

    def start(self, choices: Sequence[AnyChoices], runs: Sequence[Path] = ()) -> Start:
        """Queue a start; the same one again is dropped until its first plan is ready.

        A visitor who sees nothing happen presses START again, which would begin anew. After any
        other command, such as STOP, the start is meant.

        Returns:
            The start; the earlier one if this one is dropped.
        """
        asked = Start(tuple(choices), tuple(runs))
        last = self._last
        if last and last.is_same(asked) and self._is_taking_off(last):
            return last
        self._last = asked
        self._commands.put(partial(self._start, asked))
        return asked

    def _is_taking_off(self, start: Start) -> bool:
        """Return whether a start is awaited, or no plan of its race is ready yet."""
        s = self.snapshot
        return start.race is None or (start.race == s.race and s.is_taking_off)

    def _show(self, preparing: Preparing) -> None:
        """Show what a start does, before the race begins."""
        self._publish(replace(self.snapshot, preparing=preparing))

    def _publish(self, s: Snapshot) -> None:
        """Let others see the race as it is now."""
        is_step = s.step != self.snapshot.step
        self.snapshot = s
        if is_step:
            self.steps()

    def _start(self, start: Start) -> None:
        """Begin a race, on the race's thread."""
        race = 0
        try:
            self._race.start(start.choices, start.runs)
            race = self._race.snapshot().race
        finally:
            # Whoever knows the race finds it in the snapshot.
            self._publish(self._race.snapshot())
            start.race = race

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
            self._publish(self._race.snapshot())

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
