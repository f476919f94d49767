"""The referee: every physics step against every gate -> pass, hit, miss, wrong_way; the end of the
flight.

pass       the next gate's plane crossed forward, free of the frame
hit        first contact with a frame, of any gate and from any direction, or with an obstacle,
before a bounce wrong_way  any gate's opening crossed backward
miss       the next gate's plane crossed forward beyond the frame, within three half sizes and 2 m:
fly back and pass it stuck      no nearer to the next gate than before for NO_PROGRESS seconds, on
the way round it where it faces away A vehicle that has not taken off passes no gate. A gate that
comes twice in a row, or another in its place, is passed by a crossing of its own: only once the
vehicle has been clear of the frame behind the first. A hit, the ground and the bounds end the
flight. In the timed mode a hit costs PENALTY seconds instead, and a gate counts as passed when the
centre crosses inside opening and frame, hit or not.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import dist, inf, isfinite

from quadsim.course import Course
from quadsim.course.swept import Incident, SweptGate, SweptGates, clip, lerp
from quadsim.course.swept_obstacles import SweptObstacles
from quadsim.race.events import NO_PROGRESS, Event
from quadsim.race.gate_rules import TAKE_OFF, check, crossed_at_once, way_left
from quadsim.rotation import Vec3

GROUND_MARGIN = 1e-3  # [m] a sphere this close to the ground is on it
CLEAR = 0.5  # [s] without contact, after which touching the same gate again is a new hit
NEARER = 0.1  # [m] towards the next gate that count as progress
# [s] between the referee's contact and the plant's, at most, for one to confirm the other
CONFIRMS = 0.02


class Referee:
    """Watches one flight. Raises ValueError for laps on an open course and for a gate too small for
    the vehicle."""

    def __init__(
        self, course: Course, radius: float, laps: int, timeout: float, penalties: bool = False
    ):
        self.course, self.radius, self.laps, self.timeout, self.timed = (
            course,
            radius,
            laps,
            timeout,
            penalties,
        )
        self.passed = 0  # gates since the start
        self.outcome: str | None = None  # None while flying; finished, crashed, stuck, timeout
        self.events: list[Event] = []
        self._swept, self._obstacles = (
            SweptGates(course.gates, radius),
            SweptObstacles(course.obstacles, radius),
        )
        self._gates = self._swept.of
        check(course, laps, self._swept.all, radius)
        # when the referee last saw contact with each gate and obstacle [s]
        self._touched: dict[str, float] = {}
        self._reported: dict[str, float] = {}  # when the plant last reported contact [s]
        self._airborne = False
        # the next gate, where it can be crossed along with the one just passed
        self._leaving: SweptGate | None = None
        # when, and how near the next gate was since the last pass [s, m]
        self._nearest = (0.0, inf)

    @property
    def next_gate(self) -> int:
        """Index of the gate to pass next."""
        return self.passed % len(self._gates)

    @property
    def lap(self) -> int:
        return min(self.passed // len(self._gates) + 1, self.laps)

    def observe(
        self, t0: float, p0: Vec3, t1: float, p1: Vec3, contacts: Sequence[str] = ()
    ) -> list[Event]:
        """The events of one physics step in the order of their instants; none once the flight has
        ended."""
        if self.outcome is not None:
            return []
        before, speed = len(self.events), dist(p0, p1) / (t1 - t0)
        if isfinite(speed):
            self._apply_rules(t0, p0, t1, p1, speed)
            self._compare(t1, p1, speed, contacts)
        else:  # a plant that has diverged has no position
            self._call("bounds", t1, p0, 0.0, Incident(1.0, "bounds"))
        return self.events[before:]

    def _apply_rules(self, t0: float, p0: Vec3, t1: float, p1: Vec3, speed: float) -> None:
        target = self.next_gate
        for incident in sorted(self._incidents(t0, p0, t1, p1), key=lambda i: i.s):
            t = t0 + incident.s * (t1 - t0)
            verdict = self._verdict(incident, target, t, t1) if self.outcome is None else None
            if verdict is not None:
                self._call(verdict, t, lerp(p0, p1, incident.s), speed, incident)

    def _incidents(self, t0: float, p0: Vec3, t1: float, p1: Vec3) -> list[Incident]:
        found = [
            incident for gate in self._swept.near(p0, p1) for incident in gate.incidents(p0, p1)
        ]
        found += self._obstacles.incidents(p0, p1)
        floor = self.radius + GROUND_MARGIN
        self._airborne |= max(p0[2], p1[2]) > self.radius + TAKE_OFF
        if self._airborne and p1[2] <= floor:
            found.append(
                Incident((p0[2] - floor) / (p0[2] - p1[2]) if p0[2] > floor else 0.0, "ground")
            )
        low, high = zip(*self.course.bounds, strict=True)
        inside = clip(p0, p1, low, high)  # None for a start outside, which may still come in
        if inside and not clip(p1, p1, low, high):
            found.append(Incident(inside[1], "bounds"))
        if self._leaving and self._leaving.gate.to_local(p0).along > self._leaving.half_depth:
            self._leaving = None
        if (left := way_left(self._gates[self.next_gate].gate, p1)) < self._nearest[1] - NEARER:
            self._nearest = t1, left
        elif t1 - self._nearest[0] >= NO_PROGRESS:
            found.append(Incident(1.0, "stuck"))
        if t1 >= self.timeout:
            found.append(Incident((self.timeout - t0) / (t1 - t0), "timeout"))
        return found

    def _verdict(self, incident: Incident, target: int, t: float, t1: float) -> str | None:
        """The kind of event that an incident is by the rules, None if it is none.

        `target` was next when the step began: the plane of a gate that only became next within the
        step is no miss, or coplanar gates would be missed whenever one is passed.
        """
        kind = incident.kind
        if kind == "touch":
            fresh = t - self._touched.get(incident.touched, -inf) >= CLEAR
            self._touched[incident.touched] = t1
            return "hit" if fresh else None
        if incident.gate < 0:
            return kind
        gate = self._gates[incident.gate]
        # Without penalties a touch of the frame has ended the flight before
        through = gate.on_passage(incident.offset)
        if kind == "backward":
            return "wrong_way" if through else None
        if gate is self._gates[self.next_gate] and through and self._airborne:
            return None if self._leaving else "pass"
        missed = (
            gate is self._gates[target]
            and target == self.next_gate
            and gate.is_near(incident.offset)
        )
        return "miss" if missed else None

    def _call(self, kind: str, t: float, position: Vec3, speed: float, incident: Incident) -> None:
        is_next = kind == "stuck" or (
            incident.gate >= 0 and self._gates[incident.gate] is self._gates[self.next_gate]
        )
        number = 1 + (self.next_gate if is_next else incident.gate)
        obstacle = incident.obstacle + 1
        self.events.append(
            Event(float(t), kind, number, self.lap, incident.offset, speed, position, obstacle)
        )
        if kind == "pass":
            before = self._gates[self.next_gate].gate
            self.passed += 1
            following = self._gates[self.next_gate]
            self._leaving = following if crossed_at_once(before, following.gate) else None
            self._nearest = (t, inf)
            self.outcome = "finished" if self.passed == self.laps * len(self._gates) else None
        elif kind in ("ground", "bounds") or (kind == "hit" and not self.timed):
            self.outcome = "crashed"
        elif kind in ("stuck", "timeout"):
            self.outcome = kind

    def _compare(self, t: float, position: Vec3, speed: float, contacts: Sequence[str]) -> None:
        """Record once a contact that the plant reports and the swept test did not find: one of the
        two is wrong."""
        touched = sorted({name for name in contacts if name.startswith(("gate ", "obstacle "))})
        for name in touched if self.outcome is None else ():
            if (
                t - self._touched.get(name, -inf) > CONFIRMS
                and t - self._reported.get(name, -inf) >= CLEAR
            ):
                self._call("unseen_contact", t, position, speed, self._contact(name, position))
            self._reported[name] = t

    def _contact(self, name: str, position: Vec3) -> Incident:
        """name: "gate 3", "obstacle 2"."""
        what, _, number = name.partition(" ")
        k = int(number) - 1
        if what == "obstacle":
            return Incident(1.0, "contact", obstacle=k)
        return Incident(1.0, "contact", k, self._gates[k].gate.to_local(position).offset)
