"""Race: the competitors, live and stored, and where the race time stands. Everything here belongs to one thread.

Flights are flown turn by turn, never at once: two threads in numba's parallel loops abort the process.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from time import perf_counter

from web.choices import Choices, FlightFactory, Numbers
from web.competitor import Competitor, named, stored_competitor
from web.live import LiveCompetitor
from web.notices import Notice, Notices
from web.pace import Pace

REST = 0.02  # [s] between two turns while nothing is flown
TRAJECTORIES_PERIOD = 0.06  # [s] of wall clock between two fans


@dataclass(frozen=True, eq=False)
class Snapshot:
    """What a page shows."""

    t: float = 0.0  # race time [s]
    end: float = 0.0  # of the race so far [s]
    playing: bool = False
    flying: bool = False  # some competitor is live and not at its end
    speed: float = 1.0  # asked for
    factor: float = 0.0  # race seconds a second, measured
    competitors: tuple[Competitor, ...] = ()
    race: int = 0  # counts the races: another number, another scene
    notices: tuple[Notice, ...] = ()


class Race:
    def __init__(self, flight_factory: FlightFactory, root: str):
        self.watched = False  # whether somebody wants to see the planner
        self.notices = Notices()
        self._hangar, self._root = flight_factory, root
        self._live: list[LiveCompetitor] = []
        self._stored: tuple[Competitor, ...] = ()
        self._choices: list[Choices] = []
        self._numbers = Numbers()
        self._t, self._count, self._looked = 0.0, 0, 0.0
        self._playing = False
        self._pace = Pace()

    def start(self, choices: Sequence[Choices], runs: Sequence[Path] = ()) -> None:
        """Fly these side by side with stored runs. Raises ValueError, RunError; then the old race stays."""
        stored = [stored_competitor(path) for path in runs]
        flights = [self._hangar.flight(c) for c in choices]
        if len({x.spec["course_text"] for x in (*stored, *flights)}) > 1:
            for flight in flights:
                flight.close()
            raise ValueError("side by side: expected runs of one course, got several")
        self.end_flights()
        self._live, self._stored, self._choices = [], tuple(stored), list(choices)
        for c, flight in zip(choices, flights, strict=True):
            self._live.append(LiveCompetitor(flight, self._root, c.sampler))
            self._numbers = c.numbers or self._hangar.numbers(c.preset, c.sampler)
        if not all(flight.is_cached for flight in flights):
            self.notices.add("wait", "Compiling the planner for this machine", "once; it takes some 20 s")
        self._begin()

    def restart(self) -> None:
        """The same race from its beginning: live flights anew, stored runs from t = 0."""
        if self._choices:
            self.start(self._choices, [competitor.folder for competitor in self._stored if competitor.folder])
        else:
            self._begin()

    def turn(self) -> float:
        """Fly one frame of the competitor that is farthest behind, or let a replay move on. -> [s] to wait"""
        if not self._playing:
            return REST
        competitor = self._behind()
        if competitor is None:
            self._move(min(self._pace.now(), self._end))
            self._playing = self._t < self._end
            return REST
        wait = self._pace.until(competitor.t + competitor.flight.period)
        if wait <= 0.0:
            self._advance(competitor)
        return max(wait, 0.0)

    def play(self, on: bool | None = None) -> None:
        """None: the other way round. A replay at its end begins again."""
        self._playing = not self._playing if on is None else on
        if self._playing and self._behind() is None and self._t >= self._end:
            self._t = 0.0
        self._pace.anchor(self._t)

    def step(self, by: int = 1) -> None:
        """One control period; a replay also goes back."""
        self._playing = False
        competitor = self._behind()
        if competitor is not None:
            self._advance(competitor)
        elif competitors := [competitor for competitor in self._competitors() if len(competitor.t)]:
            t = competitors[0].t
            self.scrub(float(t[min(max(competitors[0].at(self._t) + by, 0), len(t) - 1)]))

    def scrub(self, t: float) -> None:
        """Show the race at t [s]; nothing while something flies."""
        if self._behind() is None:
            self._t = min(max(t, 0.0), self._end)
            self._pace.anchor(self._t)

    def jump(self) -> None:
        """To the next event of any competitor."""
        later = [e.t for competitor in self._competitors() for e in competitor.events if e.t > self._t + 1e-6]
        if later and self._behind() is None:
            self._playing = False
            self.scrub(min(later))

    def set_speed(self, factor: float) -> None:
        """Race seconds a second; a live flight gets as near as the machine can."""
        self._pace.speed = factor
        self._pace.anchor(self._t)

    def tune(self, numbers: Numbers) -> None:
        """Every live flight plans with these from its next plan on; each change is put on its record."""
        before = asdict(self._numbers)
        changed = {name: value for name, value in asdict(numbers).items() if value != before[name]}
        self._numbers = numbers
        for competitor in self._live if changed else ():
            if competitor.outcome is None:
                competitor.tune(numbers, [{"name": k, "from": before[k], "to": v} for k, v in changed.items()])

    def end_flights(self) -> None:
        """Keep what is worth it; what has been flown stays in view."""
        for competitor in self._live:
            if competitor.outcome is None:
                competitor.end()
        self._playing = False

    def snapshot(self) -> Snapshot:
        return Snapshot(
            t=self._t,
            end=self._end,
            playing=self._playing,
            flying=self._behind() is not None,
            speed=self._pace.speed,
            factor=self._pace.factor if self._playing else 0.0,
            competitors=named(self._competitors()),
            race=self._count,
            notices=self.notices.recent,
        )

    def _begin(self) -> None:
        self._count += 1
        self._t, self._playing = 0.0, True
        self._pace.anchor(0.0)

    def _advance(self, competitor: LiveCompetitor) -> None:
        try:
            frame = competitor.advance()
        except (ValueError, FloatingPointError) as error:
            self.notices.add("error", f"{competitor.name}: the flight broke off", str(error))
            competitor.end()
            return
        self.notices.of(competitor.name, frame, competitor.laps)
        self._move(max(frame.t, self._t))
        if self.watched and competitor is self._live[0] and perf_counter() - self._looked > TRAJECTORIES_PERIOD:
            competitor.look()
            self._looked = perf_counter()
        if frame.outcome is not None:
            competitor.end()
            self._playing = self._behind() is not None

    def _move(self, t: float) -> None:
        self._t = t
        self._pace.mark(t)

    def _behind(self) -> LiveCompetitor | None:
        return min(
            (competitor for competitor in self._live if competitor.outcome is None),
            key=lambda competitor: competitor.t,
            default=None,
        )

    def _competitors(self) -> list[Competitor]:
        return [*(competitor.competitor() for competitor in self._live), *self._stored]

    @property
    def _end(self) -> float:
        """Of the longest competitor [s]."""
        ends = [competitor.t for competitor in self._live] + [
            float(competitor.t[-1]) for competitor in self._stored if len(competitor.t)
        ]
        return max(ends, default=0.0)
