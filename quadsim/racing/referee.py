"""The referee, which checks every physics step against every gate and ends the flight.

    pass        The vehicle crosses the next gate's plane forward, free of the frame.
    hit         The vehicle touches an obstacle, or a frame of any gate from any direction; the
                first contact counts, before a bounce.
    wrong_way   The vehicle crosses any gate's opening backward.
    miss        The vehicle crosses the next gate's plane forward beyond the frame, within three
                half sizes and 2 m: it has to fly back and pass the gate.
    stuck       For NO_PROGRESS seconds the vehicle has not come nearer to the next gate than
                before; if the gate faces away, the distance is measured around the gate.

A vehicle that has not taken off passes no gate. A gate that follows itself, or a gate at the same
place, needs a second crossing, after the vehicle has been clear of the frame behind the
first. A hit, the ground and the bounds end the flight. In the timed mode a hit costs PENALTY
seconds instead, and a gate counts as passed when the centre crosses inside opening and frame, hit
or not.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import cos, dist, hypot, inf, isfinite, radians
from typing import NamedTuple

from quadsim.course import Course, Gate
from quadsim.course.opening import approach_length
from quadsim.course.swept import Incident, SweptGate, SweptGates, clip, lerp
from quadsim.course.swept_obstacles import SweptObstacles
from quadsim.files.values import SettingError
from quadsim.files.yaml_errors import shown_value
from quadsim.racing.events import NO_PROGRESS, Event
from quadsim.rotation import Vec3

# [m] A sphere this close to the ground is on it.
GROUND_MARGIN = 1e-3
# [m] clearance between sphere and ground at which the vehicle has taken off. Only then is the
# ground a crash, as a flight may start on it.
TAKE_OFF = 0.1
# [s] without contact, after which touching the same gate again is a new hit
CLEAR = 0.5
# [m] smallest progress towards the next gate
NEARER = 0.1
# [s] largest time between matching contacts of the referee and of the plant
CONFIRMS = 0.02
# largest distance [m] and difference of passages [cosine] of two gates with a common crossing
SAME_PLACE = 0.1
SAME_WAY = cos(radians(45.0))


class Nearest(NamedTuple):
    """The nearest approach to the next gate since the last pass."""

    # time of the nearest approach [s]
    t: float
    # remaining length of the way to the gate's centre [m]
    way: float


class Referee:
    """Applies the rules of a race to one flight.

    `passed` is the number of gates passed since the start, and `events` has all events so far.
    `outcome` is None while the vehicle flies, then "finished", "crashed", "stuck" or "timeout".
    """

    def __init__(
        self,
        course: Course,
        radius: float,
        laps: int,
        timeout: float,
        penalties: bool = False,
        stuck_after: float = NO_PROGRESS,
    ):
        """Begin with the first gate as the next gate.

        Args:
            course: course with the true positions of its gates.
            radius: radius of the vehicle [m].
            laps: number of laps to fly.
            timeout: time limit of the flight [s].
            penalties: whether a hit adds time instead of ending the flight (timed mode).
            stuck_after: time without progress after which the vehicle is stuck [s].

        Raises:
            ValueError: more than one lap of an open course, or a gate too small for the vehicle.
        """
        self.course = course
        self.radius = radius
        self.laps = laps
        self.timeout = timeout
        self.timed = penalties
        self.stuck_after = stuck_after
        self.passed = 0
        self.outcome: str | None = None
        self.events: list[Event] = []
        self._swept = SweptGates(course.gates, radius)
        self._obstacles = SweptObstacles(course.obstacles, radius)
        self._gates = self._swept.of
        check(course, laps, self._swept.all, radius)
        # time of the referee's last contact with each gate and obstacle [s]
        self._touched: dict[str, float] = {}
        # time of the plant's last reported contact with each [s]
        self._reported: dict[str, float] = {}
        self._airborne = False
        # the next gate, if it shares a crossing with the gate just passed
        self._leaving: SweptGate | None = None
        self._nearest = Nearest(0.0, inf)

    @property
    def next_gate(self) -> int:
        """The index of the gate to pass next."""
        return self.passed % len(self._gates)

    @property
    def lap(self) -> int:
        """The number of the current lap, from 1."""
        return min(self.passed // len(self._gates) + 1, self.laps)

    def observe(
        self, t0: float, p0: Vec3, t1: float, p1: Vec3, contacts: Sequence[str] = ()
    ) -> list[Event]:
        """Return the events of one physics step in the order of their instants.

        Args:
            t0, p0: time [s] and position [m] before the step.
            t1, p1: time [s] and position [m] after the step.
            contacts: objects that the plant reports as touched: "ground", "gate 3", "obstacle 2".

        Returns:
            The events; none once the flight has ended.
        """
        if self.outcome is not None:
            return []
        known = len(self.events)
        speed = dist(p0, p1) / (t1 - t0)
        if isfinite(speed):
            self._apply_rules(t0, p0, t1, p1, speed)
            self._compare(t1, p1, speed, contacts)
        else:
            # A plant that has diverged has no position.
            self._call("bounds", t1, p0, 0.0, Incident(1.0, "bounds"))
        return self.events[known:]

    def _apply_rules(self, t0: float, p0: Vec3, t1: float, p1: Vec3, speed: float) -> None:
        """Record the events of a step in order, until one ends the flight."""
        target = self.next_gate
        for incident in sorted(self._incidents(t0, p0, t1, p1), key=lambda i: i.s):
            if self.outcome is not None:
                return
            t = t0 + incident.s * (t1 - t0)
            kind = self._judge(incident, target, t, t1)
            if kind is not None:
                self._call(kind, t, lerp(p0, p1, incident.s), speed, incident)

    def _incidents(self, t0: float, p0: Vec3, t1: float, p1: Vec3) -> list[Incident]:
        """Return all incidents within a step, unordered."""
        found = []
        following = self._gates[self.next_gate]
        for frame in self._swept.near(p0, p1):
            incidents = frame.incidents(p0, p1)
            # The next gate may be another side of a frame.
            if following is not frame and following.frame == frame.frame:
                incidents = [following.in_own_axes(each, frame, p0, p1) for each in incidents]
            found += incidents
        found += self._obstacles.incidents(p0, p1)

        # The ground, once the vehicle has taken off.
        floor = self.radius + GROUND_MARGIN
        self._airborne |= max(p0[2], p1[2]) > self.radius + TAKE_OFF
        if self._airborne and p1[2] <= floor:
            fraction = (p0[2] - floor) / (p0[2] - p1[2]) if p0[2] > floor else 0.0
            found.append(Incident(fraction, "ground"))

        # The bounds. A vehicle that starts outside, so that `inside` is None, may still come in.
        low, high = zip(*self.course.bounds, strict=True)
        inside = clip(p0, p1, low, high)
        if inside and not clip(p1, p1, low, high):
            found.append(Incident(inside[1], "bounds"))

        if self._leaving and self._leaving.gate.to_local(p0).along > self._leaving.half_depth:
            self._leaving = None

        # Progress towards the next gate, and time.
        way = way_left(self._gates[self.next_gate].gate, p1)
        if way < self._nearest.way - NEARER:
            self._nearest = Nearest(t1, way)
        elif t1 - self._nearest.t >= self.stuck_after:
            found.append(Incident(1.0, "stuck"))
        if t1 >= self.timeout:
            found.append(Incident((self.timeout - t0) / (t1 - t0), "timeout"))
        return found

    def _judge(self, incident: Incident, target: int, t: float, t1: float) -> str | None:
        """Return the kind of event of an incident by the rules, None if it does not count.

        Args:
            incident: incident within the step.
            target: index of the gate that was next when the step began. Crossing the plane of a
                gate that becomes the next gate within the step is no miss; otherwise coplanar gates
                would be missed whenever one is passed.
            t: time of the incident [s].
            t1: end of the step [s].
        """
        kind = incident.kind
        if kind == "touch":
            fresh = t - self._touched.get(incident.touched, -inf) >= CLEAR
            self._touched[incident.touched] = t1
            return "hit" if fresh else None
        if incident.gate < 0:
            return kind

        # A crossing of a gate's plane. Without penalties a touch of the frame has ended the flight
        # before.
        gate = self._gates[incident.gate]
        through = gate.on_passage(incident.offset)
        if kind == "backward":
            is_wrong = gate is self._gates[self.next_gate] or not self._goes_both_ways(gate)
            return "wrong_way" if through and is_wrong else None
        if gate is self._gates[self.next_gate] and through and self._airborne:
            return None if self._leaving else "pass"
        missed = (
            gate is self._gates[target]
            and target == self.next_gate
            and gate.is_near(incident.offset)
        )
        return "miss" if missed else None

    def _goes_both_ways(self, gate: SweptGate) -> bool:
        """Return whether the course leads through the frame of a gate from both sides."""
        ways = [other.gate.axes[0] for other in self._gates if other.frame == gate.frame]
        along = gate.gate.axes[0]
        return any(sum(a * b for a, b in zip(way, along, strict=True)) < 0.0 for way in ways)

    def _call(self, kind: str, t: float, position: Vec3, speed: float, incident: Incident) -> None:
        """Record an event, and update count and outcome."""
        is_next = kind == "stuck" or (
            incident.gate >= 0 and self._gates[incident.gate] is self._gates[self.next_gate]
        )
        index = self.next_gate if is_next else incident.gate
        event = Event(
            t=float(t),
            kind=kind,
            gate=index + 1,
            lap=self.lap,
            offset=incident.offset,
            speed=speed,
            position=position,
            obstacle=incident.obstacle + 1,
        )
        self.events.append(event)
        if kind == "pass":
            self._advance(t)
        elif kind in ("ground", "bounds") or (kind == "hit" and not self.timed):
            self.outcome = "crashed"
        elif kind in ("stuck", "timeout"):
            self.outcome = kind

    def _advance(self, t: float) -> None:
        """Count the next gate as passed at t [s]."""
        before = self._gates[self.next_gate].gate
        self.passed += 1
        following = self._gates[self.next_gate]
        self._leaving = following if crossed_at_once(before, following.gate) else None
        self._nearest = Nearest(t, inf)
        if self.passed == self.laps * len(self._gates):
            self.outcome = "finished"

    def _compare(self, t: float, position: Vec3, speed: float, contacts: Sequence[str]) -> None:
        """Record, once, each contact that the plant reports and the swept test has not found.

        Such a contact shows an error of the plant or of the swept test.
        """
        touched = sorted({name for name in contacts if name.startswith(("gate ", "obstacle "))})
        for name in touched:
            if self.outcome is not None:
                return
            unconfirmed = t - self._touched.get(name, -inf) > CONFIRMS
            fresh = t - self._reported.get(name, -inf) >= CLEAR
            if unconfirmed and fresh:
                self._call("unseen_contact", t, position, speed, self._contact(name, position))
            self._reported[name] = t

    def _contact(self, name: str, position: Vec3) -> Incident:
        """Return the incident of a contact with the named object: "gate 3", "obstacle 2"."""
        kind, _, number = name.partition(" ")
        most = len(self.course.obstacles if kind == "obstacle" else self._gates)
        if not (number.isdecimal() and 1 <= int(number) <= most):
            problem = f"expected a contact with {kind} 1 to {most}, got {shown_value(name)}"
            raise SettingError("plant", problem)
        index = int(number) - 1
        if kind == "obstacle":
            return Incident(1.0, "contact", obstacle=index)
        offset = self._gates[index].gate.to_local(position).offset
        frame = self._gates[index].frame
        return Incident(1.0, "contact", gate=index, offset=offset, frame=frame)


def check(course: Course, laps: int, gates: Sequence[SweptGate], radius: float) -> None:
    """Raise ValueError unless a vehicle can fly these laps through these gates.

    Args:
        course: course of the race.
        laps: number of laps; more than one needs a closed course.
        gates: the distinct gates of the course.
        radius: radius of the vehicle [m].
    """
    most = laps if course.loop else 1
    if not 1 <= laps <= most:
        expected = "at least 1 lap" if course.loop else "1 lap, as the course is open"
        raise ValueError(f"{course.name}: expected {expected}, got {laps}")
    for swept in gates:
        where = f"{course.name}: gates[{swept.index}]"
        free = swept.free
        if min(free) <= 0.0:
            width, height = swept.gate.opening
            raise ValueError(
                f"{where}: expected an opening wider than the vehicle's {2 * radius:g} m, "
                f"got {width:g} x {height:g} m"
            )
        _, left, up = swept.gate.axes
        highest = swept.gate.position[2] + abs(left[2]) * free.left + abs(up[2]) * free.up
        lowest = radius + TAKE_OFF
        if highest < lowest:
            raise ValueError(
                f"{where}: expected an opening that is free {lowest:g} m above the ground, "
                f"for the vehicle, got {highest:.2f} m"
            )


def way_left(gate: Gate, p: Vec3) -> float:
    """Return the length of the way from a position p to the gate's centre [m].

    From behind the gate the way leads around it, through the beginning of the gate's approach.
    """
    here = gate.to_local(p)
    if here.along <= 0.0:
        return hypot(*here)
    approach = approach_length(gate.opening)
    return hypot(here.along + approach, here.left, here.up) + approach


def crossed_at_once(gate: Gate, following: Gate) -> bool:
    """Return whether one crossing passes both gates, which have the same place and passage."""
    cosine = sum(a * b for a, b in zip(gate.axes[0], following.axes[0], strict=True))
    return cosine > SAME_WAY and dist(gate.position, following.position) < SAME_PLACE
