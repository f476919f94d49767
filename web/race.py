"""Race: the competitors, live and stored, and the race time.

Flights are flown in turns on one thread: two threads in numba's parallel loops abort the process.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter

from web.competitor import Competitor, named, stored_competitor
from web.flight_factory import Choices, FlightFactory
from web.live import LiveCompetitor, Notice, Notices, Pace

REST = 0.02  # [s] between two turns while nothing is flown
TRAJECTORIES_PERIOD = 0.06  # [s] of wall clock between two updates of the sampled trajectories


@dataclass(frozen=True, eq=False)
class Snapshot:
    """The race as a page shows it."""

    t: float = 0.0  # race time [s]
    end: float = 0.0  # of the race so far [s]
    flown: float = 0.0  # what can be shown [s]: less than the end beside a longer stored run
    playing: bool = False
    flying: bool = False  # some live competitor has not ended
    factor: float = 0.0  # race seconds a second, measured
    competitors: tuple[Competitor, ...] = ()
    race: int = 0  # counts the races: for another number, another scene
    notices: tuple[Notice, ...] = ()
    compiling: bool = False  # what flies has no first plan yet, as its planner is being compiled

    @property
    def next_event(self) -> float | None:
        """[s] of the next one that can be shown; None while the race is being flown."""
        later = [
            e.t
            for entry in self.competitors
            for e in entry.events
            if self.t + 1e-6 < e.t <= self.flown
        ]
        return min(later, default=None) if not (self.flying and self.playing) else None


class Race:
    def __init__(self, flight_factory: FlightFactory, root: str):
        self.show_trajectories = False  # whether a page shows the sampled trajectories
        self.notices = Notices()
        self._flight_factory, self._root = flight_factory, root
        self._live: list[LiveCompetitor] = []
        self._stored: tuple[Competitor, ...] = ()
        self._choices: list[Choices] = []
        self._t, self._count, self._trajectories_at = 0.0, 0, 0.0
        self._playing = False
        self._pace = Pace()

    def start(self, choices: Sequence[Choices], runs: Sequence[Path] = ()) -> None:
        """Fly these side by side with stored runs. Raises ValueError, RunError; then the old race
        stays."""
        stored = tuple(stored_competitor(path) for path in runs)
        flights = [self._flight_factory.flight(c) for c in choices]
        if len({x.spec["course_text"] for x in (*stored, *flights)}) > 1:
            for flight in flights:
                flight.close()
            raise ValueError("side by side: expected runs of one course, got several")
        self.end_flights()
        self._choices = list(choices)
        self._live = [
            LiveCompetitor(f, self._root, c.sampler) for c, f in zip(choices, flights, strict=True)
        ]
        shown = named([*(entry.now for entry in self._live), *stored])
        for entry, now in zip(self._live, shown, strict=False):
            entry.now = now
        self._stored = shown[len(self._live) :]
        if not all(flight.is_cached for flight in flights):
            self.notices.add(
                "wait", "Compiling the planner for this machine", "once; it takes some 20 s"
            )
        self._begin()

    def restart(self) -> None:
        """The same race from its beginning: live flights anew, stored runs from t = 0."""
        if self._choices:
            self.start(self._choices, [e.folder for e in self._stored if e.folder])
        else:
            self._begin()

    def turn(self) -> float:
        """Fly one frame of the competitor that is farthest behind, or advance a replay. -> [s] to
        wait"""
        if not self._playing:
            return REST
        entry = self._next_to_fly()
        if entry is None:
            self._move(min(self._pace.now(), self._end))
            self._playing = self._t < self._end
            return REST
        wait = self._pace.until(entry.t + entry.flight.period)
        if wait <= 0.0:
            self._advance(entry)
        return max(wait, 0.0)

    def play(self, on: bool | None = None) -> None:
        """None: toggle. A replay at its end begins again; a flight goes on where it has come to."""
        self._playing = not self._playing if on is None else on
        if self._playing:
            self._t = self._flown if self._flying else self._t if self._t < self._end else 0.0
        self._pace.anchor(self._t)

    def step(self, by: int = 1) -> None:
        """One control period forward or back; a flight goes on from the last one that was flown."""
        self._playing = False
        entry = self._next_to_fly()
        if entry is not None and by > 0 and self._t >= self._flown - 1e-9:
            self._advance(entry)
        elif entries := [e for e in self._competitors if len(e.t)]:
            t = entries[0].t
            self.scrub(float(t[min(max(entries[0].at(self._t) + by, 0), len(t) - 1)]))

    def scrub(self, t: float) -> None:
        """Show the race at t [s]; no effect while it is being flown."""
        if not (self._flying and self._playing):
            self._t = min(max(t, 0.0), self._flown if self._flying else self._end)
            self._pace.anchor(self._t)

    def jump(self) -> None:
        """To the next event of any competitor, if there is one so far."""
        t = self.snapshot().next_event
        if t is not None:
            self._playing = False
            self.scrub(t)

    def set_speed(self, factor: float) -> None:
        """Race seconds a second; a live flight comes as near as the machine can."""
        self._pace.speed = factor
        self._pace.anchor(self._t)

    def tune(self, name: str, value: float | None) -> None:
        """Every live flight uses this number from its next plan on, None: its preset's; its spec
        notes the change."""
        for entry in self._flying:
            entry.tune(name, value)

    def end_flights(self) -> None:
        """They stay in view."""
        for entry in self._flying:
            entry.end()
        self._playing = False

    def snapshot(self) -> Snapshot:
        return Snapshot(
            t=self._t,
            end=self._end,
            flown=self._flown if self._flying else self._end,
            playing=self._playing,
            flying=bool(self._flying),
            factor=self._pace.factor if self._playing else 0.0,
            competitors=tuple(self._competitors),
            race=self._count,
            notices=self.notices.recent,
            compiling=any(
                e.now.outcome is None and not len(e.now.t) and not e.flight.is_cached
                for e in self._live
            ),
        )

    def _begin(self) -> None:
        self._count += 1
        self._t, self._playing = 0.0, True
        self._pace.anchor(0.0)

    def _advance(self, entry: LiveCompetitor) -> None:
        try:
            frame = entry.advance()
        except (ValueError, FloatingPointError) as error:
            self.notices.add("error", f"{entry.now.name}: the flight broke off", str(error))
            entry.end()
            return
        self.notices.add_events(entry.now, frame)
        self._move(max(frame.t, self._t))
        due = perf_counter() - self._trajectories_at > TRAJECTORIES_PERIOD
        if due and self.show_trajectories and entry is self._live[0]:
            entry.update_trajectories()
            self._trajectories_at = perf_counter()
        if frame.outcome is not None:
            entry.end()
            self._playing = bool(self._flying)

    def _move(self, t: float) -> None:
        self._t = t
        self._pace.mark(t)

    def _next_to_fly(self) -> LiveCompetitor | None:
        """The one whose time is the least."""
        return min(self._flying, key=lambda e: e.t, default=None)

    @property
    def _flying(self) -> list[LiveCompetitor]:
        return [e for e in self._live if e.now.outcome is None]

    @property
    def _flown(self) -> float:
        """Until when some flight that goes on has been flown [s]."""
        return max((e.t for e in self._flying), default=0.0)

    @property
    def _competitors(self) -> list[Competitor]:
        return [*(e.now for e in self._live), *self._stored]

    @property
    def _end(self) -> float:
        """Of the longest competitor [s]."""
        return max((float(e.t[-1]) for e in self._competitors if len(e.t)), default=0.0)
