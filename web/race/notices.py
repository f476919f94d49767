"""Notices: messages that a page shows for some seconds."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from itertools import count
from typing import Literal

from quadsim.racing.events import Event, Frame
from quadsim.web.race.competitor import Competitor

Kind = Literal["error", "crash", "lap"]
KEPT = 20  # number of the last notices
LAP_END = 0.02  # time before a frame in which a lap can have ended [s]


@dataclass(frozen=True)
class Notice:
    """A message that a page shows for some seconds."""

    number: int  # counts up, so that a page shows each once
    kind: Kind
    title: str
    text: str
    race: int = 0  # number of the race
    t: float | None = None  # time of the race [s] from which it is shown; None: at once


class Notices:
    """The last notices of a session."""

    def __init__(self) -> None:
        self.race = 0  # number of the present race
        self._recent: deque[Notice] = deque(maxlen=KEPT)
        self._numbers = count(1)

    @property
    def recent(self) -> tuple[Notice, ...]:
        """The last notices, the oldest first."""
        return tuple(self._recent)

    def add(self, kind: Kind, title: str, text: str, t: float | None = None) -> None:
        """Add a notice. t: time of the race to which it belongs [s]; None: to none."""
        number = next(self._numbers)
        self._recent.append(Notice(number, kind, title, text, self.race, t))

    def add_events(self, entry: Competitor, frame: Frame) -> None:
        """Add the notices of a frame: a crash, a best lap, the end of the race."""
        for event in frame.events:
            self._add_end(entry.name, event)
        passed = any(event.kind == "pass" for event in frame.events)
        if passed and _has_best_lap(entry.laps, frame.t):
            self.add("lap", f"{entry.name}: best lap", f"{entry.laps[-1]:.3f} s", frame.t)
        if frame.outcome == "finished":
            laps = "lap" if len(entry.laps) == 1 else "laps"
            flown = f"{len(entry.laps)} {laps} in {sum(entry.laps):.3f} s"
            self.add("lap", f"{entry.name}: finished", flown, frame.t)

    def _add_end(self, name: str, event: Event) -> None:
        """Add a notice of an event that can end a flight."""
        crash = f"at {event.t:.2f} s, {event.speed:.1f} m/s"
        match event.kind:
            case "hit" | "contact":
                self.add("crash", f"{name}: hit {event.place}", crash, event.t)
            case "ground":
                self.add("crash", f"{name}: hit the ground", crash, event.t)
            case "bounds":
                self.add("crash", f"{name}: left the bounds", crash, event.t)
            case "timeout":
                self.add("crash", f"{name}: out of time", f"after {event.t:.1f} s", event.t)
            case "stuck":
                self.add("crash", f"{name}: no progress", f"before gate {event.gate}", event.t)


def _has_best_lap(laps: tuple[float, ...], t: float) -> bool:
    """Return whether the last of several laps ended by t and is the fastest."""
    if len(laps) < 2 or laps[-1] != min(laps):
        return False
    return abs(sum(laps) - t) < LAP_END
