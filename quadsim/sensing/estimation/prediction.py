"""From the state that is known to the state in which a control that is planned now will act.

Between the two lie the planner's time and the vehicle's command latency. The commands of that time are known, as they
have been given already; the planner's own model moves the state under them.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator

from quadsim.course import Course
from quadsim.course.opening import crossing, on_passage
from quadsim.sensing.attitude import Vector
from quadsim.systems.quadrotor import ModelParams, quadrotor

SAME = 1e-6  # [s] instants nearer than this are one


class Commands:
    """The commands given so far, each acting `latency` [s] after it was given."""

    def __init__(self, rest: Vector, latency: float):
        """rest: acts until the first command does."""
        self.latency = latency
        self._given: deque[tuple[float, Vector]] = deque([(float("-inf"), rest)])

    def give(self, t: float, u: Vector) -> None:
        """The command u (4,) is given at t [s], and forgets what no longer matters."""
        self._given.append((t, u))
        while len(self._given) > 2 and self._given[1][0] + self.latency < t - 1.0:
            self._given.popleft()

    def acting(self, t: float) -> Vector:
        """The command that acts from t [s] on."""
        return next(u for given, u in reversed(self._given) if given + self.latency <= t + SAME)

    def pieces(self, t0: float, t1: float) -> Iterator[tuple[float, Vector]]:
        """(duration [s], command) from t0 to t1 [s], whatever has been given until now."""
        switches = [given + self.latency for given, _ in self._given]
        ends = [t for t in switches if t0 + SAME < t < t1 - SAME]
        for end in (*ends, t1) if t1 > t0 + SAME else ():
            yield end - t0, self.acting(t0)
            t0 = end


def predict(x: Vector, commands: Commands, t0: float, t1: float, model: ModelParams, longest: float) -> Vector:
    """The state (17,) at t1 [s] of a vehicle that is in the state x at t0, in steps of at most `longest` [s]."""
    for duration, u in commands.pieces(t0, t1):
        number = max(1, -int(-(duration - SAME) // longest))
        system = quadrotor(model, duration / number)
        for _ in range(number):
            x = system.next(x, u)
    return tuple(map(float, x))


class GateCounter:
    """Gates passed, by the state that is known: when its path crosses the next gate's plane within the frame."""

    def __init__(self, laps: int):
        self._laps, self._before = laps, None
        self.passed = 0

    def at(self, course: Course, p: Vector) -> int:
        """Gates passed when the vehicle is at p [m], on a straight line from where it was."""
        before, self._before = self._before, p
        if before is None or self.passed >= self._laps * len(course.gates):
            return self.passed
        gate = course.gates[self.passed % len(course.gates)]
        crossed = crossing(gate.to_local(before), gate.to_local(p))  # pyright: ignore
        if crossed and crossed.forward and on_passage(crossed.offset, gate.opening, gate.frame_width):
            self.passed += 1
        return self.passed
