"""PageRace: the race that a page shows, with live and stored competitors.

Flights go on at their own pace. The time that a visitor watches is the visitor's own, see
quadsim.web.race.playhead.

Flights are flown in turns on one thread: two threads in numba's parallel loops abort the process.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Sequence
from pathlib import Path
from time import perf_counter
from typing import Protocol

from quadsim.racing.hand import Hand
from quadsim.web.race.cockpit import Cockpit
from quadsim.web.race.competitor import Competitor, named
from quadsim.web.race.live_flight import FlownFrame, LiveFlight
from quadsim.web.race.live_heat import LiveHeat
from quadsim.web.race.notices import Notices
from quadsim.web.race.pace import Pace
from quadsim.web.race.snapshot import Preparing, Snapshot
from quadsim.web.race.stored_competitor import stored_competitor
from quadsim.web.state.choices import Choices, HeatChoices, expect_one_hand, names_of
from quadsim.web.state.numbers import Change
from quadsim.web.stored.again import AgainChoices, HeatAgainChoices

AnyChoices = Choices | HeatChoices | AgainChoices | HeatAgainChoices
TakeOff = Callable[[AnyChoices], "Flyer"]

REST = 0.02  # wait between two turns before a person raises the throttle [s]
IDLE = 1.0  # wait while nothing is flown; a command ends it [s]
TRAJECTORIES_PERIOD = 0.06  # wall-clock time between updates of the sampled trajectories [s]


class Flyer(Protocol):
    """A live flight, or a race of several vehicles in one world."""

    period: float  # [s]
    is_cached: bool
    hand: Hand | None  # the controller of a manual flight

    @property
    def t(self) -> float:
        """The time of the last frame [s]."""
        ...

    @property
    def entries(self) -> tuple[Competitor, ...]:
        """The flights for display."""
        ...

    @property
    def is_over(self) -> bool:
        """Whether all flights have ended."""
        ...

    def show_as(self, entries: Sequence[Competitor]) -> None:
        """Show the flights under other names."""
        ...

    def keep_in(self, root: str) -> None:
        """Store the flights in this folder of runs when they end."""
        ...

    def turn(self) -> list[FlownFrame]:
        """Fly one period."""
        ...

    def change(self, change: Change) -> None:
        """Use a changed number from the next plan on."""
        ...

    def update_trajectories(self) -> None:
        """Take the sampled trajectories of the last plan, for display."""
        ...

    def end(self) -> None:
        """Store the flights."""
        ...

    def close(self) -> None:
        """Free the world."""
        ...


def take_off(choices: AnyChoices) -> Flyer:
    """Begin the chosen flight or race. Raises ValueError, RunError."""
    if isinstance(choices, HeatChoices | HeatAgainChoices):
        return LiveHeat(choices)
    return LiveFlight(choices)


class PageRace:
    """Live flights together with stored runs, for use by one thread.

    Args:
        root: the folder of runs.
        take_off: function that starts a live flight from its choices.
        cockpit: source of the sticks of a manual flight; None: a new one.
        prepares: called with what `start` is about to do, which takes seconds.
    """

    def __init__(
        self,
        root: str,
        take_off: TakeOff = take_off,
        cockpit: Cockpit | None = None,
        prepares: Callable[[Preparing], None] = lambda _: None,
    ):
        self.show_trajectories = False  # whether a page shows the sampled trajectories
        self.notices = Notices()
        self._root = root
        self._take_off = take_off
        self._prepares = prepares
        self._choices: list[AnyChoices] = []
        self._live: list[Flyer] = []
        self._stored: tuple[Competitor, ...] = ()
        self._count = 0
        self._t = 0.0
        self._halted = False  # whether the flights were broken off by an error
        self._began = 0.0
        self._trajectories_at = 0.0
        self._pace = Pace()
        self._speed = 1.0  # requested real-time factor, for races without a manual flight
        self._cockpit = cockpit or Cockpit()
        self._hand: Hand | None = None
        self._waiting = False

    def start(self, choices: Sequence[AnyChoices], runs: Sequence[Path] = ()) -> None:
        """Fly the choices together with stored runs.

        Raises:
            ValueError, RunError: a flight or run cannot be flown or shown; the old race continues.
        """
        stored = tuple(stored_competitor(path) for path in runs)
        flights = self._built(choices)
        live = [entry for flight in flights for entry in flight.entries]
        courses = {entry.course.text for entry in (*stored, *live)}
        if len(courses) > 1:
            for flight in flights:
                flight.close()
            raise ValueError("side by side: expected runs of one course, got several")
        self.end_flights()
        self._hand = next((flight.hand for flight in flights if flight.hand), None)
        self._choices = list(choices)
        self._live = flights
        for flight in flights:
            flight.keep_in(self._root)
        live = [entry for flight in flights for entry in flight.entries]
        shown = list(named([*live, *stored]))
        for flight in flights:
            flight.show_as([shown.pop(0) for _ in flight.entries])
        self._stored = tuple(shown)
        self._begin()

    def _built(self, choices: Sequence[AnyChoices]) -> list[Flyer]:
        """Return the flights of choices, ready to begin; if one fails, all are closed.

        Raises:
            ValueError: a flight cannot be flown; the message names it in one line.
        """
        alone = [one for one in choices if isinstance(one, Choices)]
        expect_one_hand(alone)
        names = names_of(alone)
        names += ["the race"] * (len(choices) - len(names))
        flights: list[Flyer] = []
        for number, (name, one) in enumerate(zip(names, choices, strict=True), 1):
            self._prepares(Preparing("building", number, len(choices)))
            try:
                flights.append(self._take_off(one))
            except ValueError as error:
                for flight in flights:
                    flight.close()
                if len(choices) == 1:
                    raise
                raise ValueError(f"{name}: {error}") from None
        return flights

    def replay(self, runs: Sequence[Path], begun: Callable[[int], None]) -> None:
        """Show stored runs together.

        Args:
            runs: their folders.
            begun: called with the number of the race.

        Raises:
            ValueError, RunError: see `start`.
        """
        self.start([], runs)
        begun(self._count)

    def restart(self) -> None:
        """Fly the same race anew."""
        if self._choices:
            self.start(self._choices, [entry.folder for entry in self._stored if entry.folder])

    def turn(self) -> float:
        """Fly one frame of the competitor that is farthest behind.

        Returns:
            The time to wait before the next turn [s].
        """
        flight = self._next_to_fly()
        if flight is None or self._halted:
            return IDLE
        if self._waiting and flight.t >= 0.0 and not self._begins_by_hand():
            return REST
        wait = self._pace.until(flight.t + flight.period)
        if wait <= 0.0:
            self._advance(flight)
        return max(wait, 0.0)

    def halt(self) -> None:
        """Fly no further, after an error; the flights can be ended all the same."""
        self._halted = True

    def set_speed(self, factor: float) -> None:
        """Set the real-time factor, which a live flight reaches if the machine is fast enough.

        Raises:
            ValueError: a competitor is flown by hand, in real time.
        """
        self._speed = factor
        if self._hand and self._flying:
            raise ValueError(
                f"speed: expected 1 x real time while a person flies, got {factor:g}: "
                "it will hold for the next race"
            )
        self._pace.speed = factor
        self._pace.anchor(self._t)

    def change(self, change: Change, name: str = "") -> None:
        """Let live flights use a changed number from their next plan on.

        Args:
            change: the number.
            name: name of the competitor; "": all live competitors.

        Raises:
            ValueError: a race in one world keeps the numbers of its start.
        """
        for flight in self._flying:
            if not name or any(entry.name == name for entry in flight.entries):
                flight.change(change)

    def end_flights(self) -> None:
        """End every live flight; the page keeps showing them."""
        for flight in self._flying:
            flight.end()

    def snapshot(self) -> Snapshot:
        """Return the race as it is now."""
        flying = bool(self._flying)
        moves = flying and not self._halted
        return Snapshot(
            t=self._t,
            end=self._end,
            flown=self._flown if flying else self._end,
            playing=moves,
            flying=flying,
            factor=self._pace.factor if moves else 0.0,
            competitors=tuple(self._competitors),
            race=self._count,
            notices=self.notices.recent,
            preparing=self._compiling,
            by_hand=self._hand is not None,
            waiting=self._waiting and flying,
            speed=self._pace.speed,
            began=self._began,
        )

    def _begin(self) -> None:
        """Begin another race at t = 0."""
        give_back()  # memory that the last race has freed
        self._count += 1
        self.notices.race = self._count
        self._t = 0.0
        self._began = perf_counter()
        self._halted = False
        self._waiting = self._hand is not None
        self._cockpit.serve(self._hand)
        self._pace.speed = 1.0 if self._hand else self._speed
        self._pace.anchor(0.0)

    def _begins_by_hand(self) -> bool:
        """Return whether the manual pilot is ready; if so, begin."""
        if not self._cockpit.is_ready:
            return False
        assert self._hand
        self._hand.begin()
        self._waiting = False
        self._pace.anchor(0.0)
        return True

    def _advance(self, flight: Flyer) -> None:
        """Fly one frame."""
        try:
            flown = flight.turn()
        except (ValueError, FloatingPointError) as error:
            names = ", ".join(entry.name for entry in flight.entries)
            self.notices.add("error", f"{names}: the flight broke off", str(error))
            flight.end()
            return
        for entry, frame in flown:
            self.notices.add_events(entry, frame)
        self._t = max(flight.t, self._t)
        self._pace.mark(self._t)
        due = perf_counter() - self._trajectories_at > TRAJECTORIES_PERIOD
        if due and self.show_trajectories and flight is self._live[0]:
            flight.update_trajectories()
            self._trajectories_at = perf_counter()
        if flight.is_over:
            flight.end()

    def _next_to_fly(self) -> Flyer | None:
        """Return the live flight with the earliest time."""
        return min(self._flying, key=lambda flight: flight.t, default=None)

    @property
    def _flying(self) -> list[Flyer]:
        """The live flights that have not ended."""
        return [flight for flight in self._live if not flight.is_over]

    @property
    def _compiling(self) -> Preparing | None:
        """The planner that is compiled; None: all are."""
        new = [flight for flight in self._live if not flight.is_cached]
        waiting = [flight for flight in new if not flight.is_over and not len(flight.entries[0].t)]
        if not waiting:
            return None
        return Preparing("compiling", len(new) - len(waiting) + 1, len(new))

    @property
    def _flown(self) -> float:
        """The latest time of the running flights [s]."""
        return max((flight.t for flight in self._flying), default=0.0)

    @property
    def _competitors(self) -> list[Competitor]:
        """All competitors, the live ones first."""
        return [*(entry for flight in self._live for entry in flight.entries), *self._stored]

    @property
    def _end(self) -> float:
        """The end of the longest competitor [s]."""
        return max((entry.last_t for entry in self._competitors), default=0.0)


def give_back() -> None:
    """Return free memory of the C library's heap to the operating system.

    A race allocates and frees many arrays. glibc keeps free memory between arrays in use, so a page
    that flies races for hours would grow. C libraries without `malloc_trim` (macOS, Windows, musl)
    return memory by themselves, or not at all.
    """
    try:
        trim = ctypes.CDLL(None).malloc_trim
    except (OSError, TypeError, AttributeError):
        return
    trim(0)
