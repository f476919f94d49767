"""From the state that is known to the state in which a control that is planned now will act.

Between the two lie the planner's time and the vehicle's command latency. The commands of that time
are known, as they have been given already; the planner's own model moves the state under them.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Sequence

from quadsim.course import Course
from quadsim.course.opening import crossing, on_passage
from quadsim.dynamics.quadrotor import ModelParams, State, quadrotor
from quadsim.rotation import Vec3

Command = tuple[float, ...]  # (n_u,)

SAME = 1e-6  # [s] instants nearer than this are one


class Commands:
    """The commands given so far, each acting `latency` [s] after it was given."""

    def __init__(self, rest: Command, latency: float):
        """rest: acts until the first command does."""
        self.latency = latency
        self._given: deque[tuple[float, Command]] = deque([(float("-inf"), rest)])

    def give(self, t: float, u: Command) -> None:
        """Note that the command u (4,) is given at t [s], and forget what no longer matters."""
        self._given.append((t, u))
        while len(self._given) > 2 and self._given[1][0] + self.latency < t - 1.0:
            self._given.popleft()

    def acting(self, t: float) -> Command:
        """Return the command that acts from t [s] on, of those that are not forgotten."""
        for given, u in reversed(self._given):
            if given + self.latency <= t + SAME:
                return u
        return self._given[0][1]

    def pieces(self, t0: float, t1: float) -> Iterator[tuple[float, Command]]:
        """Yield (duration [s], command) from t0 to t1 [s], by what has been given until now."""
        switches = [given + self.latency for given, _ in self._given]
        ends = [t for t in switches if t0 + SAME < t < t1 - SAME]
        for end in (*ends, t1) if t1 > t0 + SAME else ():
            yield end - t0, self.acting(t0)
            t0 = end


def predict(
    x: State, commands: Commands, t0: float, t1: float, model: ModelParams, longest: float
) -> State:
    """Return the state at t1 [s] of a vehicle in the state x at t0 [s], in steps of at most
    `longest` [s]."""
    for duration, u in commands.pieces(t0, t1):
        number = max(1, -int(-(duration - SAME) // longest))
        system = quadrotor(model, duration / number)
        for _ in range(number):
            x = system.next(x, u)
    return State._make(map(float, x))


class GateCounter:
    """Counts the gates passed by the estimated path: it passes one where it crosses its plane
    within the frame."""

    def __init__(self, course: Course, laps: int):
        """course: the map."""
        self._map, self._laps = course, laps
        self._before: Vec3 | None = None  # position at the last call [m]
        self.passed = 0

    def at(self, x: Sequence[float], course: Course | None = None) -> int:
        """Return the gates passed when the vehicle is in the state x, on a straight line from where
        it was.

        Args:
            x: state, which begins with the position [m]  (n_x,).
            course: as it is estimated; None: the map.
        """
        position = x[0], x[1], x[2]
        before, self._before = self._before, position
        gates = (course or self._map).gates
        if before is None or self.passed >= self._laps * len(gates):
            return self.passed
        gate = gates[self.passed % len(gates)]
        crossed = crossing(gate.to_local(before), gate.to_local(position))
        if (
            crossed
            and crossed.forward
            and on_passage(crossed.offset, gate.opening, gate.frame_width)
        ):
            self.passed += 1
        return self.passed
