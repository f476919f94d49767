"""A flight while it is flown: its frames so far, the notices they give rise to, its pace, its run
when it ends."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import count
from pathlib import Path
from time import perf_counter

from quadsim.race.events import NO_PROGRESS, Event, Frame, flown_laps, lap_penalties
from quadsim.record.archive import RunFolder, remove_unfinished
from quadsim.record.limits import LIMITS, limit_of
from quadsim.record.run import INTERACTIVE, Recorder, columns_of
from web.competitor import CRASHES, Competitor, Legs
from web.flight_factory import Flight

LATE = 0.1  # [s] behind the wall clock, after which the race no longer tries to catch up
WINDOW = 1.0  # [s] over which the real-time factor is measured


class LiveCompetitor:
    """Flown frame by frame, stored in a run folder when it ends; `now` is what the page shows of
    it."""

    def __init__(self, flight: Flight, root: str, name: str):
        self.flight, self._recorder = flight, Recorder()
        self._columns = tuple(columns_of(flight.spec))
        legs, x = Legs(flight.course, flight.spec["laps"]), self._recorder.views(self._columns)
        shown = name, flight.spec, flight.course, legs, x, (), (), None
        limit = limit_of(flight.spec, Path(root) / LIMITS)
        self.now = Competitor(*shown, live=True, start_numbers=flight.numbers, limit=limit)
        remove_unfinished(root)
        self._folder = RunFolder.open(root, flight.spec)

    @property
    def t(self) -> float:
        """Of the last frame [s]; before the first, one period before the start."""
        return self._recorder.last.t if self._recorder.last else -self.flight.period

    def advance(self) -> Frame:
        """Plan, fly one period. The last frame of a flight carries its outcome."""
        frame = next(self.flight.frames)
        self._recorder.add(frame)
        events = tuple(self._recorder.events)
        laps = laps_so_far(events, self.now.legs.gates)
        x, corners = self._recorder.views(self._columns), self.flight.corners()
        self.now = replace(
            self.now, x=x, events=events, laps=laps, outcome=frame.outcome, corners=corners
        )
        return frame

    def update_trajectories(self) -> None:
        """Take the sampled trajectories of the last plan, for display."""
        self.now = replace(self.now, sampled_trajectories=self.flight.sampled_trajectories())

    def tune(self, name: str, value: float | None) -> None:
        """Use this number from the next plan on, None: the preset's; the spec notes {t, name, from,
        to}."""
        noted = [{"t": max(self.t, 0.0), **change} for change in self.flight.tune(name, value)]
        if noted:
            self.now = replace(
                self.now, spec={**self.now.spec, INTERACTIVE: [*self.now.changes, *noted]}
            )

    def end(self) -> None:
        """Free the plant and store the run, unless it was interrupted before its first gate."""
        outcome = self.now.outcome or "interrupted"
        self.now = replace(self.now, outcome=outcome, sampled_trajectories=None, corners=None)
        self.flight.close()
        with self._folder as folder:
            if outcome != "interrupted" or any(e.kind == "pass" for e in self.now.events):
                run = self._recorder.run(self.now.spec)
                self.now = replace(self.now, snapshots=run.snapshots, folder=folder.save(run))


def laps_so_far(events: Sequence[Event], gates: int) -> tuple[float, ...]:
    """Completed, penalties included [s]."""
    completed = sum(e.kind == "pass" for e in events) // gates
    flown, penalties = flown_laps(events, completed), lap_penalties(events, completed)
    return tuple(a + b for a, b in zip(flown, penalties, strict=True))


@dataclass(frozen=True)
class Notice:
    """A message that the page shows for some seconds."""

    number: int  # counts up, so that a page shows each once
    kind: str  # error, crash, lap, wait
    title: str
    text: str


class Notices:
    def __init__(self) -> None:
        self._recent: deque[Notice] = deque(maxlen=20)
        self._numbers = count(1)

    @property
    def recent(self) -> tuple[Notice, ...]:
        return tuple(self._recent)

    def add(self, kind: str, title: str, text: str) -> None:
        self._recent.append(Notice(next(self._numbers), kind, title, text))

    def add_events(self, entry: Competitor, frame: Frame) -> None:
        """Crashes, a best lap or the end of the race, where this frame has one."""
        name, laps = entry.name, entry.laps
        what = {"hit": "hit {place}", "ground": "hit the ground", "bounds": "left the bounds"}
        for e in frame.events:
            if e.kind in CRASHES:
                self.add(
                    "crash",
                    f"{name}: {what[e.kind].format(place=e.place)}",
                    f"at {e.t:.2f} s, {e.speed:.1f} m/s",
                )
            if e.kind == "timeout":
                self.add("crash", f"{name}: out of time", f"after {e.t:.1f} s")
            if e.kind == "stuck":
                self.add(
                    "crash", f"{name}: no progress for {NO_PROGRESS:g} s", f"before gate {e.gate}"
                )
        passed = any(e.kind == "pass" for e in frame.events)
        if passed and len(laps) > 1 and laps[-1] == min(laps) and abs(sum(laps) - frame.t) < 0.02:
            self.add("lap", f"{name}: best lap", f"{laps[-1]:.3f} s")
        if frame.outcome == "finished":
            self.add("lap", f"{name}: finished", f"{len(laps)} laps in {sum(laps):.3f} s")


class Pace:
    """When race time t is due at `speed` race seconds a second."""

    def __init__(self, clock: Callable[[], float] = perf_counter):
        self._clock = clock
        self.speed = 1.0
        self._marks: deque[tuple[float, float]] = deque()
        self.anchor(0.0)

    def anchor(self, t: float) -> None:
        """The race time is t now."""
        self._t, self._wall = t, self._clock()
        self._marks.clear()

    def now(self) -> float:
        """[s] of race time."""
        return self._t + (self._clock() - self._wall) * self.speed

    def until(self, t: float) -> float:
        """Seconds of wall clock until t is due; at most 0 if it is. A long delay is not caught up
        later."""
        wait = (t - self.now()) / self.speed
        if wait < -LATE:
            self._t, self._wall = t, self._clock()
        return wait

    def mark(self, t: float) -> None:
        """t has been flown."""
        wall = self._clock()
        self._marks.append((wall, t))
        while len(self._marks) > 2 and wall - self._marks[0][0] > WINDOW:
            self._marks.popleft()

    @property
    def factor(self) -> float:
        """Race seconds a second, lately; 0 while nothing moves."""
        if len(self._marks) < 2:
            return 0.0
        (w0, t0), (w1, t1) = self._marks[0], self._marks[-1]
        return (t1 - t0) / max(w1 - w0, 1e-9)
