"""Direct multiple shooting: transcribe a route and a model to a program (Bock and Plitt 1984).

    minimise    sum over segments of n_s h_s
    such that   x_{k+1} = Phi(x_k, u_k, h_s)

where a segment s consists of n_s intervals of length h_s, and the continuity constraint equates the
state at each node with the end of the previous interval. Further constraints are the limits of
state, control and thrust, the gates' openings, and the states at the start and the end.

Phi is the classical Runge-Kutta method with the attitude normalised. Without the normalisation the
optimiser exploits the method's error of |q|, whose square scales the thrust: laps become 15 % too
fast, although they satisfy the equations to 1e-8.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import casadi
import numpy as np

from quadsim.course import Box, Cylinder, Gate
from quadsim.dynamics.quadrotor import ATTITUDE, BODY_RATES, POSITION, VELOCITY
from quadsim.limit.detours import Detour
from quadsim.limit.dynamics import Dynamics, runge_kutta
from quadsim.limit.guess import Guess
from quadsim.limit.route import MARGIN, PAST, Route, Segment, segments
from quadsim.physics.plant_state import start_state

# Limit of the velocity, beyond the reach of any vehicle [m/s]
SPEED_MAX = 100.0
# Limits of a quaternion's components; the equations keep its length
UNIT_MAX = 1.1
# Shortest and longest interval relative to the guess
SLOWEST = 2.0
FASTEST = 0.1
# Scale of the length of an interval [s]
INTERVAL = 0.02
# Least speed through a gate [m/s]
FORWARD = 0.1
# Runge-Kutta steps in one interval
STEPS = 2
# Parts of a state: position and velocity; body rates and rotor states
BEFORE_ATTITUDE = slice(0, ATTITUDE.start)
AFTER_ATTITUDE = slice(ATTITUDE.stop, None)


@dataclass
class Program:
    """The program min f(z) such that low <= z <= high, g_low <= g(z) <= g_high, in time order."""

    z: list = field(default_factory=list)
    start: list = field(default_factory=list)
    low: list = field(default_factory=list)
    high: list = field(default_factory=list)
    g: list = field(default_factory=list)
    g_low: list = field(default_factory=list)
    g_high: list = field(default_factory=list)

    def variable(self, name: str, start: np.ndarray, low: Any, high: Any, scale: Any = 1.0) -> Any:
        """Add a variable to the program, and return it in its physical unit.

        Args:
            name: name of the symbol.
            start: initial guess  (n,).
            low: lower limits, a number or (n,).
            high: upper limits, a number or (n,).
            scale: factor by which the optimiser's variable is multiplied, a number or (n,).
        """
        n = len(start)
        scales = np.broadcast_to(scale, n).astype(float)
        z = casadi.MX.sym(name, n)
        self.z.append(z)
        self.start.extend(np.clip(start, low, high) / scales)
        self.low.extend(np.broadcast_to(low, n) / scales)
        self.high.extend(np.broadcast_to(high, n) / scales)
        return z * casadi.DM(scales)

    def hold(self, g: Any, low: Any, high: Any) -> slice:
        """Add low <= g <= high and return its slice among all constraints."""
        first = len(self.g_low)
        n = g.shape[0]
        self.g.append(g)
        self.g_low.extend(np.broadcast_to(low, n))
        self.g_high.extend(np.broadcast_to(high, n))
        return slice(first, first + n)


@dataclass
class Shooting:
    """The program of a route, and the symbols with which a solution is read."""

    route: Route
    model: Dynamics
    plan: list[Segment]
    program: Program = field(default_factory=Program)
    # States  (nodes)
    x: list = field(default_factory=list)
    # Controls  (nodes - 1)
    u: list = field(default_factory=list)
    # Lengths of the intervals of each segment [s]  (segments)
    lengths: list = field(default_factory=list)
    # Slices of the continuity constraints  (nodes - 1)
    defects: list[slice] = field(default_factory=list)


class StateLimits(NamedTuple):
    """Ranges of the state."""

    low: np.ndarray
    high: np.ndarray


class ProgramInterval(NamedTuple):
    """An interval in a program."""

    # Slice of its continuity constraint
    defect: slice
    # Position in its middle
    middle: Any


class Interval:
    """One interval of a model as CasADi functions."""

    def __init__(self, model: Dynamics):
        """Make the CasADi functions of a model."""
        self._model = model
        self._scale = state_scale(model)
        x = casadi.SX.sym("x", len(model.low))
        u = casadi.SX.sym("u", len(model.u_low))
        h = casadi.SX.sym("h")
        states = tuple(casadi.vertsplit(x))
        controls = tuple(casadi.vertsplit(u))
        after: Any = states
        rates: list = []
        middle: Any = []
        for k in range(1, STEPS + 1):
            after = runge_kutta(model.rate, after, controls, h / STEPS)
            if k < STEPS:
                rates += after[BODY_RATES]
            if 2 * k == STEPS:
                middle = after[POSITION]
        q = casadi.vertcat(*after[ATTITUDE])
        normalised = casadi.vertcat(
            *after[BEFORE_ATTITUDE], q / casadi.norm_2(q), *after[AFTER_ATTITUDE]
        )
        outputs = [normalised, casadi.vertcat(*rates), casadi.vertcat(*middle)]
        self._advance = casadi.Function("interval", [x, u, h], outputs)
        spare = model.spare(states, controls)
        self._spare = None
        if spare:
            self._spare = casadi.Function("spare", [x, u], [casadi.vertcat(*spare)])

    def connect(self, program: Program, x: Any, u: Any, h: Any, after: Any) -> ProgramInterval:
        """Constrain an interval of h [s] to lead from one state to the next, and return it.

        Args:
            program: program to add the constraints to.
            x: the state at the beginning of the interval.
            u: the control.
            h: length of the interval [s].
            after: the state at the end of the interval.
        """
        reached, rates, middle = self._advance(x, u, h)
        defect = program.hold((reached - after) / casadi.DM(self._scale), 0.0, 0.0)
        # Limit the body rates between the inner steps
        low = np.tile(self._model.low[BODY_RATES], STEPS - 1)
        high = np.tile(self._model.high[BODY_RATES], STEPS - 1)
        program.hold(rates, low, high)
        if self._spare:
            for end in (x, after):
                program.hold(self._spare(end, u), 0.0, np.inf)
        return ProgramInterval(defect, middle)


def shooting(
    route: Route,
    model: Dynamics,
    intervals: Sequence[int],
    guess: Guess,
    around: Sequence[Detour] = (),
) -> Shooting:
    """Return the program of a route.

    Args:
        route: the gates.
        model: model of the vehicle.
        intervals: number of intervals on each of the route's legs.
        guess: initial guess.
        around: detours around frames and boxes beside the route.
    """
    s = Shooting(route, model, segments(route, intervals))
    scale = state_scale(model)
    limits = state_limits(route.bounds, model)
    interval = Interval(model)

    # The first state is fixed, at rest; a closed lap begins in a free state
    first = guess.states(np.zeros(1))[0]
    first_limits = limits
    if route.start:
        first = model.of_flight(start_state(route.start, route.radius))[0]
        first_limits = StateLimits(first, first)
    x = s.program.variable("x0", first, first_limits.low, first_limits.high, scale)
    s.x.append(x)

    began = 0.0
    for i, duration in enumerate(guess.durations(s.plan, route)):
        segment = s.plan[i]
        h_guess = duration / segment.intervals
        h = s.program.variable(
            "h", np.array([h_guess]), FASTEST * h_guess, SLOWEST * h_guess, INTERVAL
        )
        s.lengths.append(h)
        # A start on the ground has to rise from there
        low = limits.low if i else np.minimum(limits.low, first_limits.low)
        ends = began + h_guess * np.arange(1, segment.intervals + 1)
        x_guesses = guess.states(ends)
        u_guesses = guess.controls(ends - 0.5 * h_guess)
        for k in range(1, segment.intervals + 1):
            x_guess = x_guesses[k - 1]
            u = s.program.variable("u", u_guesses[k - 1], model.u_low, model.u_high, model.u_high)
            after = s.program.variable("x", x_guess, low, limits.high, scale)

            link = interval.connect(s.program, x, u, h, after)
            s.defects.append(link.defect)
            _hold_clear(s, (link.middle, after[POSITION]), x_guess, h_guess)
            x = after
            s.x.append(x)
            s.u.append(u)
            _hold_at(s, segment, x, at_end=k == segment.intervals)
            for detour in around:
                if k < segment.intervals and detour.holds_at(i, k, segment.intervals):
                    s.program.hold(detour.spare(_local(detour.gate, x)), 0.0, np.inf)
        began += duration
    if not route.start:
        close(s.program, s.x[0], x)
    return s


def state_limits(bounds: Sequence[tuple[float, float]], model: Dynamics) -> StateLimits:
    """Return the ranges of a model's state, given the ranges of x, y and z [m]."""
    low = model.low.copy()
    high = model.high.copy()
    low[POSITION] = [least for least, _ in bounds]
    high[POSITION] = [most for _, most in bounds]
    low[VELOCITY] = -SPEED_MAX
    high[VELOCITY] = SPEED_MAX
    low[ATTITUDE] = -UNIT_MAX
    high[ATTITUDE] = UNIT_MAX
    return StateLimits(low, high)


def state_scale(model: Dynamics) -> np.ndarray:
    """Return the scale of each state, so that scaled variables are of order one.  (n_x,)"""
    scale = 0.1 * model.high
    # [m], [m/s], 1, [rad/s]
    scale[POSITION] = 10.0
    scale[VELOCITY] = 10.0
    scale[ATTITUDE] = 1.0
    scale[BODY_RATES] = 10.0
    return scale


def close(program: Program, first: Any, last: Any) -> None:
    """Constrain a lap to end in the state in which it begins.

    As q and -q are the same attitude, the vector part of q0^-1 q1 is constrained to zero.
    """
    for part in (BEFORE_ATTITUDE, AFTER_ATTITUDE):
        program.hold(last[part] - first[part], 0.0, 0.0)
    q0 = first[ATTITUDE]
    q1 = last[ATTITUDE]
    # Scalar and vector part
    w0, v0 = q0[0], q0[1:]
    w1, v1 = q1[0], q1[1:]
    program.hold(casadi.sumsqr(q0), 1.0, 1.0)
    program.hold(w0 * v1 - w1 * v0 - casadi.cross(v0, v1), 0.0, 0.0)


def _hold_at(s: Shooting, segment: Segment, x: Any, at_end: bool) -> None:
    """Constrain a node of a segment to the gate's opening, and at its end to the plane."""
    if segment.kind == "approach" and not at_end:
        return
    route = s.route
    gate = route.gates[segment.target]
    along, left, up = casadi.vertsplit(_local(gate, x))
    room = route.room(gate)
    s.program.hold(left, -room.left, room.left)
    s.program.hold(up, -room.up, room.up)
    if at_end:
        planes = {"approach": -route.reach, "inside": route.reach, "finish": PAST}
        plane = planes[segment.kind]
        s.program.hold(along, plane, plane)
        passage = casadi.DM(gate.axes[0])
        s.program.hold(passage.T @ x[VELOCITY], FORWARD, SPEED_MAX)


def _hold_clear(s: Shooting, points: Sequence[Any], guess: np.ndarray, h: float) -> None:
    """Constrain points to stay beside every cylinder that the guess does not fly over.

    Args:
        s: the program.
        points: positions at the end and in the middle of an interval.
        guess: the guessed state at the end of the interval.
        h: the guessed length of the interval [s].
    """
    _, _, height = guess[POSITION]
    # The chord between two points deviates from the path in proportion to the square of its length
    apart = 0.5 * h * float(np.linalg.norm(guess[VELOCITY]))
    for obstacle in s.route.obstacles:
        clear = s.route.radius + MARGIN
        if not isinstance(obstacle, Cylinder):
            continue
        if not obstacle.base[2] - clear < height < obstacle.top + clear:
            continue
        clear += obstacle.radius
        clear += apart**2 / (8.0 * clear)
        axis = casadi.DM(obstacle.base[:2])
        for point in points:
            s.program.hold(casadi.sumsqr(point[0:2] - axis), clear**2, np.inf)


def _local(place: Gate | Box, x: Any) -> Any:
    """Return the position of a state in the frame of a gate or a box [m]."""
    return casadi.DM(np.array(place.axes)) @ (x[POSITION] - casadi.DM(place.position))
