"""Snapshot: a race as one visitor sees it, at its latest time or at the time of a playhead."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, NamedTuple

from quadsim.web.race.competitor import SAME_TIME, Competitor
from quadsim.web.race.notices import Notice


class Preparing(NamedTuple):
    """The progress of the preparations after START was pressed.

    Attributes:
        what: flights that are built, or planners that are compiled.
        number: number of the present flight or planner, from 1.
        of: number of all of them.
    """

    what: Literal["building", "compiling"]
    number: int
    of: int


@dataclass(frozen=True, eq=False)
class Snapshot:
    """The race as a page shows it.

    The snapshot of a session is the race at its latest time; quadsim.web.race.playhead makes the
    snapshot that a visitor watches from it.
    """

    t: float = 0.0  # race time that is shown [s]
    end: float = 0.0  # end of the longest competitor so far [s]
    flown: float = 0.0  # last time that can be shown [s]; `end` may be later with stored runs
    playing: bool = False  # whether the time that is shown goes on
    flying: bool = False  # whether a live competitor is still flying
    factor: float = 0.0  # race time per wall-clock time, of flights as measured
    competitors: tuple[Competitor, ...] = ()
    race: int = 0  # number of the race; a page draws a new scene when it changes
    notices: tuple[Notice, ...] = ()
    preparing: Preparing | None = None  # what the flights wait for; None: they do not
    by_hand: bool = False  # whether a competitor is flown by hand; the race then runs in real time
    waiting: bool = False  # whether the race waits for the start of the manual flight
    speed: float = 1.0  # race seconds per second that are asked for
    began: float = 0.0  # when the race began, on the wall clock [s]
    is_live: bool = True  # whether it is the race at its latest time

    @property
    def is_taking_off(self) -> bool:
        """Whether flights have begun, and no plan of any of them is ready yet."""
        live = [entry for entry in self.competitors if entry.live]
        return self.flying and not any(len(entry.t) for entry in live)

    @property
    def step(self) -> tuple[int, Preparing | None, bool, bool]:
        """The step of a start that the race has come to; a page shows each at once."""
        return self.race, self.preparing, self.is_taking_off, self.t > 0.0

    @property
    def has_flights(self) -> bool:
        """Whether the race was flown here; else it is a replay of stored runs."""
        return any(entry.live for entry in self.competitors)

    @property
    def next_event(self) -> float | None:
        """The time of the first frame with the next event [s]; None: there is no event to show."""
        frames = [
            entry.first_frame_with(event) for entry in self.competitors for event in entry.events
        ]
        later = [t for t in frames if self.t + SAME_TIME < t <= self.flown + SAME_TIME]
        return min(later, default=None)
