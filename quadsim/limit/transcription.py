"""Direct multiple shooting: a task and a model become a nonlinear program (Bock and Plitt 1984).

    minimise    sum over segments of n_s h_s
    such that   x_{k+1} = Phi(x_k, u_k, h_s)    the state at each node is where the interval before
                it leads limits of state, control and thrust; the gates' openings; start and end

Phi is the classical Runge-Kutta method with the attitude normalised. Without that the optimiser
exploits what the method does to |q|, whose square scales the thrust: laps 15 % too fast that solve
the equations to 1e-8.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import casadi
import numpy as np

from quadsim.course import Box, Cylinder, Gate
from quadsim.dynamics.quadrotor import ATTITUDE, BODY_RATES, POSITION, VELOCITY
from quadsim.limit.detours import Detour
from quadsim.limit.dynamics import Dynamics, runge_kutta
from quadsim.limit.guess import Guess
from quadsim.limit.task import MARGIN, PAST, Segment, Task, Waypoint, reach, room, segments
from quadsim.physics.plant_state import start_state

SPEED_MAX = 100.0  # [m/s] beyond what any vehicle reaches
SLOWEST, FASTEST = 2.0, 0.1  # length of a segment over that of the guess
FORWARD = 0.1  # least speed through a gate [m/s]
STEPS = 2  # of Runge-Kutta in one interval
BEFORE_ATTITUDE = slice(0, ATTITUDE.start)  # of a state: position and velocity
AFTER_ATTITUDE = slice(ATTITUDE.stop, None)  # body rates and what the rotors do


@dataclass
class Program:
    """min f(z) such that low <= z <= high, g_low <= g(z) <= g_high; collected node by node, in the
    order of time."""

    z: list = field(default_factory=list)
    start: list = field(default_factory=list)
    low: list = field(default_factory=list)
    high: list = field(default_factory=list)
    g: list = field(default_factory=list)
    g_low: list = field(default_factory=list)
    g_high: list = field(default_factory=list)

    def variable(self, name: str, start: np.ndarray, low: Any, high: Any, scale: Any = 1.0) -> Any:
        """In its own unit; the optimiser sees it divided by its scale."""
        scale = np.broadcast_to(scale, len(start)).astype(float)
        z = casadi.MX.sym(name, len(start))
        self.z.append(z)
        for kept, values in (
            (self.start, np.clip(start, low, high)),
            (self.low, low),
            (self.high, high),
        ):
            kept.extend(np.broadcast_to(values, len(start)) / scale)
        return z * casadi.DM(scale)

    def hold(self, g: Any, low: Any, high: Any) -> slice:
        """low <= g <= high; where among all constraints it stands."""
        first, n = len(self.g_low), g.shape[0]
        self.g.append(g)
        self.g_low.extend(np.broadcast_to(low, n))
        self.g_high.extend(np.broadcast_to(high, n))
        return slice(first, first + n)


@dataclass
class Shooting:
    """The program of a task with its symbols, by which a solution is read."""

    task: Task
    model: Dynamics
    plan: list[Segment]
    program: Program
    x: list  # (nodes) states
    u: list  # (nodes - 1) controls
    h: list  # (segments) lengths of the intervals [s]
    defects: list[slice]  # (nodes - 1) of the continuity constraints


def shooting(
    task: Task, model: Dynamics, nodes: list[int], guess: Guess, around: Sequence[Detour] = ()
) -> Shooting:
    """nodes: intervals on the way to each of `task.points` but the first."""
    plan = segments(task, nodes)
    s = Shooting(task, model, plan, Program(), [], [], [], [])
    scale = state_scale(model)
    low, high = _limits(task, model)
    x0, low0, high0 = guess.at(np.zeros(1))[0][0], low, high
    if task.start:
        x0 = low0 = high0 = model.of_flight(start_state(task.start, task.radius))[0]
    x = s.program.variable("x0", x0, low0, high0, scale)
    s.x.append(x)
    advance, spare, began = _interval(model), _spare(model), 0.0
    for i, (segment, length) in enumerate(zip(plan, guess.durations(plan, task), strict=True)):
        h0 = length / segment.intervals
        h = s.program.variable("h", np.array([h0]), FASTEST * h0, SLOWEST * h0, 0.02)
        s.h.append(h)
        ends = began + h0 * np.arange(1, segment.intervals + 1)
        states, controls = guess.at(ends)[0], guess.at(ends - 0.5 * h0)[1]
        for k, (x_guess, u_guess) in enumerate(zip(states, controls, strict=True), start=1):
            u = s.program.variable("u", u_guess, model.u_low, model.u_high, model.u_high)
            lowest = low if i else np.minimum(low, low0)  # a start on the ground rises from there
            after = s.program.variable("x", x_guess, lowest, high, scale)
            reached, between, middle = advance(x, u, h)
            s.defects.append(s.program.hold((reached - after) / casadi.DM(scale), 0.0, 0.0))
            s.program.hold(
                between, np.tile(low[BODY_RATES], STEPS - 1), np.tile(high[BODY_RATES], STEPS - 1)
            )
            for end in (x, after) if spare else ():
                s.program.hold(spare(end, u), 0.0, np.inf)  # pyright: ignore
            _hold_clear(s, (middle, after[POSITION]), x_guess, h0)
            x = after
            s.x.append(x)
            s.u.append(u)
            _hold_at(s, segment, x, k == segment.intervals)
            for detour in around:
                if k < segment.intervals and detour.holds_at(i, k, segment.intervals):
                    s.program.hold(detour.spare(_local(detour.gate, x)), 0.0, np.inf)
        began += length
    if not task.start:
        _close(s.program, s.x[0], x)
    return s


def _limits(task: Task, model: Dynamics) -> tuple[np.ndarray, np.ndarray]:
    low, high = model.low.copy(), model.high.copy()
    low[POSITION] = [least for least, _ in task.bounds]
    high[POSITION] = [most for _, most in task.bounds]
    low[VELOCITY] = -SPEED_MAX
    high[VELOCITY] = SPEED_MAX
    low[ATTITUDE] = -1.1  # unit length by the equations, not by these
    high[ATTITUDE] = 1.1
    return low, high


def state_scale(model: Dynamics) -> np.ndarray:
    """Of the state, so that the program's numbers are of order one.  (n_x,)"""
    scale = 0.1 * model.high
    scale[POSITION] = 10.0  # [m]
    scale[VELOCITY] = 10.0  # [m/s]
    scale[ATTITUDE] = 1.0
    scale[BODY_RATES] = 10.0  # [rad/s]
    return scale


def _interval(model: Dynamics) -> casadi.Function:
    """(x, u, h) -> x after one interval of h [s], the body rates inside it, and the position in its
    middle."""
    x, u, h = (
        casadi.SX.sym("x", len(model.low)),
        casadi.SX.sym("u", len(model.u_low)),
        casadi.SX.sym("h"),
    )
    after, between, middle = tuple(casadi.vertsplit(x)), [], []
    for k in range(1, STEPS + 1):
        after = runge_kutta(model.rate, after, tuple(casadi.vertsplit(u)), h / STEPS)
        if k < STEPS:
            between += after[BODY_RATES]
        if 2 * k == STEPS:
            middle = after[POSITION]
    q = casadi.vertcat(*after[ATTITUDE])
    after = casadi.vertcat(*after[BEFORE_ATTITUDE], q / casadi.norm_2(q), *after[AFTER_ATTITUDE])
    return casadi.Function(
        "interval", [x, u, h], [after, casadi.vertcat(*between), casadi.vertcat(*middle)]
    )


def _spare(model: Dynamics) -> casadi.Function | None:
    x, u = casadi.SX.sym("x", len(model.low)), casadi.SX.sym("u", len(model.u_low))
    found = model.spare(tuple(casadi.vertsplit(x)), tuple(casadi.vertsplit(u)))
    return casadi.Function("spare", [x, u], [casadi.vertcat(*found)]) if found else None


def _hold_at(s: Shooting, segment: Segment, x: Any, at_end: bool) -> None:
    """What a segment asks of one of its nodes."""
    task, hold = s.task, s.program.hold
    if task.end and segment.kind == "rest" and at_end:
        hold(x[POSITION] - casadi.DM(task.end), 0.0, 0.0)
        hold(x[VELOCITY], 0.0, 0.0)
    target = task.targets[min(segment.target, len(task.targets) - 1)]
    if isinstance(target, Waypoint):
        if segment.kind == "waypoint" and at_end:
            hold(casadi.sumsqr(x[POSITION] - casadi.DM(target.position)), 0.0, target.tolerance**2)
        return
    if segment.kind == "rest" or (segment.kind == "approach" and not at_end):
        return
    along, left, up = casadi.vertsplit(_local(target, x))
    y, z = room(target, task)
    hold(left, -y, y)
    hold(up, -z, z)
    if at_end:
        plane = {"approach": -reach(task), "inside": reach(task), "finish": PAST}[segment.kind]
        hold(along, plane, plane)
        hold(casadi.DM(target.axes[0]).T @ x[VELOCITY], FORWARD, SPEED_MAX)


def _hold_clear(s: Shooting, points: Sequence[Any], guess: np.ndarray, h: float) -> None:
    """Beside the cylinders that the guess does not fly over, by what the line between two points
    cuts off them."""
    _, _, height = guess[POSITION]
    for o in s.task.obstacles:
        clear = s.task.radius + MARGIN
        if isinstance(o, Cylinder) and o.base[2] - clear < height < o.top + clear:
            clear += o.radius
            apart = 0.5 * h * float(np.linalg.norm(guess[VELOCITY]))
            clear += apart**2 / (8.0 * clear)
            for point in points:
                s.program.hold(casadi.sumsqr(point[0:2] - casadi.DM(o.base[:2])), clear**2, np.inf)


def _local(gate: Gate | Box, x: Any) -> Any:
    """The position of a state in the gate's frame, or a box's [m]."""
    return casadi.DM(np.array(gate.axes)) @ (x[POSITION] - casadi.DM(gate.position))


def _close(program: Program, first: Any, last: Any) -> None:
    """The lap ends as it begins. Attitudes q and -q are the same: the vector part of q0^-1 q1 is
    zero."""
    for part in (BEFORE_ATTITUDE, AFTER_ATTITUDE):
        program.hold(last[part] - first[part], 0.0, 0.0)
    q0, q1 = first[ATTITUDE], last[ATTITUDE]
    w0, v0 = q0[0], q0[1:]  # scalar and vector part
    w1, v1 = q1[0], q1[1:]
    program.hold(casadi.sumsqr(q0), 1.0, 1.0)
    program.hold(w0 * v1 - w1 * v0 - casadi.cross(v0, v1), 0.0, 0.0)
