"""Series: the same line-up flown with one seed after another, and what it came to so far."""

from __future__ import annotations

import threading
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from itertools import combinations
from pathlib import Path
from typing import NamedTuple

from quadsim.report.metrics import total_variation
from quadsim.statistics import Mean, mean_interval
from quadsim.web.race.competitor import Competitor
from quadsim.web.race.page_race import AnyChoices
from quadsim.web.race.session import Session, Start
from quadsim.web.race.snapshot import Snapshot
from quadsim.web.state.choices import Choices, HeatChoices

MOST_SEEDS = 50


class FlownSeed(NamedTuple):
    """One flight of a series. time: of the race [s]; None: not finished."""

    seed: int
    time: float | None
    chatter: float  # total variation of the commanded thrust [m/s^2/s]


@dataclass
class SeriesRow:
    """The flights of one competitor, one for each seed flown so far."""

    name: str
    colour: str
    flights: list[FlownSeed] = field(default_factory=list)

    @property
    def times(self) -> list[float]:
        """The times of the flights that finished [s]."""
        return [flight.time for flight in self.flights if flight.time is not None]

    @property
    def time(self) -> Mean:
        """The mean of these times with its interval [s]."""
        return mean_interval(self.times)

    @property
    def is_repeated(self) -> bool:
        """Whether several seeds all gave the same flight, as those of a learned pilot may."""
        flown = {(flight.time, flight.chatter) for flight in self.flights}
        return len(self.flights) > 1 and len(flown) == 1

    @property
    def chatter(self) -> Mean:
        """The mean chatter of the flights that finished with its interval [m/s^2/s]."""
        finished = [flight for flight in self.flights if flight.time is not None]
        return mean_interval([flight.chatter for flight in finished])


class Pair(NamedTuple):
    """Two competitors, and the time of the second less the time of the first, by seed [s]."""

    first: SeriesRow
    second: SeriesRow
    difference: Mean

    @property
    def swapped(self) -> Pair:
        """The same with the second competitor first."""
        one = self.difference
        return Pair(self.second, self.first, Mean(-one.mean, -one.high, -one.low, one.n, one.sd))


class Series:
    """Flies a line-up with `count` seeds in a row; STOP, and any other START, end it.

    Any thread may call the methods.

    Attributes:
        count: number of seeds; 1: START flies once, and no series is kept.
        rows: the competitors.
        race: number of the last race that was kept; 0: there is none.
    """

    def __init__(self, session: Session):
        self._session = session
        self.count = 1
        self.rows: list[SeriesRow] = []
        self.race = 0
        self._choices: list[AnyChoices] = []
        self._runs: Sequence[Path] = ()
        self._start: Start | None = None  # of the seed that is flown
        self._lock = threading.Lock()  # a visitor begins a series while a page asks for a turn

    @property
    def done(self) -> int:
        """Number of seeds that all have flown."""
        return min((len(row.flights) for row in self.rows), default=0)

    @property
    def is_on(self) -> bool:
        """Whether another seed is flown, or will be."""
        return self._start is not None

    @property
    def pairs(self) -> list[Pair]:
        """The paired differences of each two competitors over the seeds that both finished."""
        found = []
        for first, second in combinations(self.rows, 2):
            both = zip(first.flights, second.flights, strict=False)
            differences = [
                b.time - a.time for a, b in both if a.time is not None and b.time is not None
            ]
            found.append(Pair(first, second, mean_interval(differences)))
        return found

    @property
    def first_pair(self) -> Pair | None:
        """The two competitors with the least mean times, the faster one first.

        None: there are no two that both finished with two of the seeds.
        """
        ranked = sorted((row for row in self.rows if row.times), key=lambda row: row.time.mean)
        for pair in self.pairs:
            if {pair.first.name, pair.second.name} == {row.name for row in ranked[:2]}:
                if pair.difference.n < 2:
                    return None
                return pair if pair.difference.mean >= 0.0 else pair.swapped
        return None

    def begin(self, choices: Sequence[AnyChoices], runs: Sequence[Path], count: int) -> None:
        """Start a line-up; with a count beyond 1 its next seeds follow by themselves."""
        with self._lock:
            self.count = count
            self.rows = []
            self.race = 0
            self._choices = list(choices)
            self._runs = runs
            start = self._started(0)
            self._start = start if count > 1 else None

    def end(self) -> None:
        """Start no further seed; what has flown is kept."""
        with self._lock:
            self._start = None

    def turn(self, s: Snapshot) -> None:
        """Keep what a race came to once it has ended, and start the next one."""
        with self._lock:
            if self._start is not None:
                self._start = self._after(self._start, s)

    def _after(self, start: Start, s: Snapshot) -> Start | None:
        """Return the start of the seed that is flown next; None: the series has ended."""
        # A race before this start may be one that Restart began. A refused start has race 0.
        if start.race is None or s.race < start.race:
            return start
        if s.race != start.race:
            return None
        if s.flying:
            return start
        live = [entry for entry in s.competitors if entry.live]
        if not live or any(entry.outcome in (None, "interrupted") for entry in live):
            return None
        self._keep(live)
        self.race = s.race
        return self._started(self.done) if self.done < self.count else None

    def _started(self, step: int) -> Start:
        """Start the race of one seed."""
        return self._session.start([_with_seed(one, step) for one in self._choices], self._runs)

    def _keep(self, live: Sequence[Competitor]) -> None:
        """Keep the flights of a race that has ended."""
        if not self.rows:
            self.rows = [SeriesRow(entry.name, entry.style.colour) for entry in live]
        for row, entry in zip(self.rows, live, strict=True):
            time = sum(entry.laps) if entry.outcome == "finished" else None
            chatter = total_variation(entry.t, entry.x["a_cmd"])
            row.flights.append(FlownSeed(entry.spec.seed, time, chatter))


def _with_seed(choices: AnyChoices, step: int) -> AnyChoices:
    """Return the choices with a later seed; the first one is checked by the flight itself."""
    if not step:
        return choices
    if isinstance(choices, HeatChoices):
        flights = tuple(replace(one, seed=int(one.seed) + step) for one in choices.flights)
        return replace(choices, flights=flights)
    if isinstance(choices, Choices):
        return replace(choices, seed=int(choices.seed) + step)
    return choices
