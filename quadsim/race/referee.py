"""Referee: every physics step against every gate -> pass, hit, miss, wrong_way; laps; the end of the flight.

pass       the next gate's plane crossed forward, free of the frame
hit        first contact with a frame: any gate, any direction, before a bounce
wrong_way  any gate's opening crossed backward
miss       the next gate's plane crossed forward beyond the frame, within three half sizes and 2 m: fly back and pass it
A hit, the ground and the bounds end the flight. In the timed mode a hit costs PENALTY seconds instead, and a gate
counts as passed when the centre crosses inside opening and frame, hit or not.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import dist, inf, isfinite

import numpy as np

from quadsim.course import Course
from quadsim.race.events import Event, flown_laps, lap_penalties, sector_times
from quadsim.race.swept import Incident, SweptGate, Vec3, clip, lerp

GROUND_MARGIN = 1e-3  # [m] a sphere this close to the ground is on it
TAKE_OFF = 0.1  # [m] of air below the sphere that arm the ground, so that a flight may start on it
CLEAR = 0.5  # [s] away from a gate, after which touching it again is a new hit
WITNESS = 0.02  # [s] between the referee's contact and the plant's, at most, for one to confirm the other


class Referee:
    """Watches one flight. Raises ValueError for laps on an open course and for a gate too small for the vehicle."""

    def __init__(self, course: Course, radius: float, laps: int, timeout: float, penalties: bool = False):
        self.course, self.radius, self.laps, self.timeout, self.timed = course, radius, laps, timeout, penalties
        self.passed = 0  # gates since the start
        self.outcome: str | None = None  # None while flying; finished, crashed, timeout
        self.events: list[Event] = []
        self._gates = [SweptGate(g, i, radius) for i, g in enumerate(course.gates)]
        self._check()
        self._centres = np.array([g.position for g in course.gates])  # (gates, 3)
        self._reach = np.array([g.reach for g in self._gates])  # (gates,)
        self._touched = [-inf] * len(self._gates)  # when the referee last saw contact [s]
        self._reported = [-inf] * len(self._gates)  # when the plant last reported contact [s]
        self._airborne = False

    @property
    def next_gate(self) -> int:
        """Index of the gate to pass next."""
        return self.passed % len(self._gates)

    @property
    def lap(self) -> int:
        return min(self.passed // len(self._gates) + 1, self.laps)

    @property
    def lap_times(self) -> list[float]:
        """Completed laps with their penalties [s]; without hits they sum to the time of the race."""
        return [t + p for t, p in zip(flown_laps(self.events, self._completed), self.penalties, strict=True)]

    @property
    def penalties(self) -> list[float]:
        """What hits added to each completed lap [s]."""
        return lap_penalties(self.events, self._completed)

    @property
    def splits(self) -> list[list[float]]:
        """Flown seconds from gate to gate, one list a lap."""
        return sector_times(self.events)

    def observe(self, t0: float, p0: Vec3, t1: float, p1: Vec3, contacts: Sequence[str] = ()) -> list[Event]:
        """Judge one physics step, its incidents in the order they happened; nothing more once the flight has ended."""
        if self.outcome is not None:
            return []
        before, speed = len(self.events), dist(p0, p1) / (t1 - t0)
        if isfinite(speed):
            self._judge(t0, p0, t1, p1, speed)
            self._compare(t1, p1, speed, contacts)
        else:  # a plant that has blown up is nowhere
            self._call("bounds", t1, p0, 0.0, Incident(1.0, "bounds"))
        return self.events[before:]

    def _judge(self, t0: float, p0: Vec3, t1: float, p1: Vec3, speed: float) -> None:
        target = self.next_gate
        for incident in sorted(self._incidents(t0, p0, t1, p1), key=lambda i: i.s):
            t = t0 + incident.s * (t1 - t0)
            verdict = self._verdict(incident, target, t, t1) if self.outcome is None else None
            if verdict is not None:
                self._call(verdict, t, lerp(p0, p1, incident.s), speed, incident)

    def _incidents(self, t0: float, p0: Vec3, t1: float, p1: Vec3) -> list[Incident]:
        middle = lerp(p0, p1, 0.5)
        near = ((self._centres - middle) ** 2).sum(axis=1) <= (self._reach + dist(p0, p1) / 2) ** 2
        found = [i for k in np.flatnonzero(near) for i in self._gates[k].incidents(p0, p1)]
        floor = self.radius + GROUND_MARGIN
        self._airborne |= max(p0[2], p1[2]) > self.radius + TAKE_OFF
        if self._airborne and p1[2] <= floor:
            found.append(Incident((p0[2] - floor) / (p0[2] - p1[2]) if p0[2] > floor else 0.0, "ground"))
        low, high = zip(*self.course.bounds, strict=True)
        inside = clip(p0, p1, low, high)  # None for a start outside, which may still come in
        if inside and not clip(p1, p1, low, high):
            found.append(Incident(inside[1], "bounds"))
        if t1 >= self.timeout:
            found.append(Incident((self.timeout - t0) / (t1 - t0), "timeout"))
        return found

    def _verdict(self, incident: Incident, target: int, t: float, t1: float) -> str | None:
        """What the rules call an incident, None if nothing. `target` was next when the step began: the plane of a gate
        that only became next within the step is no miss, or coplanar gates would be missed whenever one is passed."""
        _, kind, k, offset = incident
        if k < 0:
            return kind
        if kind == "touch":
            fresh = t - self._touched[k] >= CLEAR
            self._touched[k] = t1
            return "hit" if fresh else None
        beyond, gate = self._gates[k].beyond(offset), self._gates[k]
        through = beyond <= gate.gate.frame_width  # without penalties, whoever touched the frame has ended before
        if kind == "backward":
            return "wrong_way" if through else None
        if k == self.next_gate and through:
            return "pass"
        close = abs(offset[0]) <= gate.near[0] and abs(offset[1]) <= gate.near[1]
        return "miss" if k == target == self.next_gate and close else None

    def _call(self, kind: str, t: float, position: Vec3, speed: float, incident: Incident) -> None:
        self.events.append(Event(t, kind, incident.gate + 1, self.lap, incident.offset, speed, position))
        if kind == "pass":
            self.passed += 1
            self.outcome = "finished" if self.passed == self.laps * len(self._gates) else None
        elif kind in ("ground", "bounds") or (kind == "hit" and not self.timed):
            self.outcome = "crashed"
        elif kind == "timeout":
            self.outcome = "timeout"

    def _compare(self, t: float, position: Vec3, speed: float, contacts: Sequence[str]) -> None:
        """The plant's contacts are the second witness: one that the referee did not see is put on record, once."""
        touched = {int(name.removeprefix("gate ")) - 1 for name in contacts if name.startswith("gate ")}
        for k in sorted(touched) if self.outcome is None else ():
            if t - self._touched[k] > WITNESS and t - self._reported[k] >= CLEAR:
                _, left, up = self._gates[k].gate.to_local(position)
                self._call("unseen_contact", t, position, speed, Incident(1.0, "contact", k, (left, up)))
            self._reported[k] = t

    @property
    def _completed(self) -> int:
        return self.passed // len(self._gates)

    def _check(self) -> None:
        most = self.laps if self.course.loop else 1
        if not 1 <= self.laps <= most:
            wanted = "at least 1 lap" if self.course.loop else "1 lap, as the course is open"
            raise ValueError(f"{self.course.name}: expected {wanted}, got {self.laps}")
        for number, swept in enumerate(self._gates, 1):
            if min(swept.shaft) <= 0.0:
                width, height = swept.gate.opening
                raise ValueError(
                    f"{self.course.name}: gates[{number - 1}]: expected an opening wider than the vehicle's "
                    f"{2 * self.radius:g} m, got {width:g} x {height:g} m"
                )
