"""Notices: what is worth interrupting a person for."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

from quadsim.race.events import Frame

CRASHES = ("hit", "ground", "bounds")


@dataclass(frozen=True)
class Notice:
    number: int  # counts up, so that a page shows each once
    kind: str  # error, crash, lap, wait
    title: str
    text: str


class Notices:
    def __init__(self) -> None:
        self._recent: deque[Notice] = deque(maxlen=20)
        self._number = 0

    @property
    def recent(self) -> tuple[Notice, ...]:
        return tuple(self._recent)

    def add(self, kind: str, title: str, text: str) -> None:
        self._number += 1
        self._recent.append(Notice(self._number, kind, title, text))

    def of(self, name: str, frame: Frame, laps: tuple[float, ...]) -> None:
        """A crash, a best lap or the end, if this frame brought one."""
        for e in frame.events:
            if e.kind in CRASHES:
                what = {"hit": f"hit gate {e.gate}", "ground": "hit the ground", "bounds": "left the bounds"}[e.kind]
                self.add("crash", f"{name}: {what}", f"at {e.t:.2f} s, {e.speed:.1f} m/s")
            if e.kind == "timeout":
                self.add("crash", f"{name}: out of time", f"after {e.t:.1f} s")
        lap_ended = any(e.kind == "pass" for e in frame.events) and frame.passed and laps
        if lap_ended and len(laps) > 1 and laps[-1] == min(laps) and abs(sum(laps) - frame.t) < 0.02:
            self.add("lap", f"{name}: best lap", f"{laps[-1]:.3f} s")
        if frame.outcome == "finished":
            self.add("lap", f"{name}: finished", f"{len(laps)} laps in {sum(laps):.3f} s")
