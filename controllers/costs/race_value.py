"""The term `time_to_go`: the time that a point mass takes from a sample's state to the finish.

It ends a few metres behind the finish, see `value_of_rows`.

    V(p, v) = min over T and the crossing z of  (1 - a) T + a E / f^2 + V_gate(z)

T is the time to the gate's exit, E the least integral of the squared thrust in that time (see
quadsim.value.leg), and V_gate the time to go behind the gate, a quadratic form of the place in the
opening and of the velocity there (quadsim.value.course_value). For given T both parts are sums over
the three axes of the gate, so that the best crossing has a closed form for each axis. The time T
comes from the quartic equation of a leg that ends anyhow, improved by two steps of Newton's method.

With it a plan knows what comes behind its horizon, in which direction and how fast a gate is to be
left. The term is smooth, also where a sample passes a gate. It knows no attitude, frames, ground or
obstacles, so it stands beside the term `progress` and the crash.
"""

from __future__ import annotations

from collections import namedtuple
from dataclasses import replace
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy import maximum, minimum, sqrt, where

from quadsim.controllers.costs.cost import Cost, StateTerm
from quadsim.controllers.costs.race_step import in_gate
from quadsim.controllers.costs.race_targets import RUN_OUT, GateTarget, cross
from quadsim.course import in_frame
from quadsim.dynamics.named_tuples import columns
from quadsim.rotation import Vec3
from quadsim.value import CourseValue, Passages, PointMass, value_of_passages
from quadsim.value.leg import THRUST_SHARE
from quadsim.value.passages import SMALLEST
from quadsim.vehicle import GRAVITY

# Distance to the exit from which a sample that is nearer counts as this far away [m]
NEAREST = 0.01
# Cost of crossing a gate beside its opening [s/m]: a sample near it cannot change where it crosses
OUTSIDE = 1.0
# Distance from the finish to a passage behind it, up to which the time to go is counted [m]. It is
# also half of the width and of the height of this passage.
RUN_ON = 5.0
# Index of the finish among the passages of a value: the last one lies RUN_ON behind it.
FINISH = -2
# Ways that a metre to the outer edge of the frame costs straight behind a gate
ROUND = 8.0
# Steps of Newton's method for the time of a leg that ends anyhow, and for the time to the crossing
FIRST_STEPS = 3
STEPS = 2
# Least speed in the denominator of a time [m/s]
SLOW = 0.1


class Behind(NamedTuple):
    """The time to go behind a gate: later + sum of (slope z + curve z^2 / 2) over the crossing."""

    later: float  # [s]
    slope_left: float  # by the offset in the opening [s/m]
    slope_up: float
    slope_v_along: float  # by the velocity [s/(m/s)]
    slope_v_left: float
    slope_v_up: float
    curve_left: float
    curve_up: float
    curve_v_along: float
    curve_v_left: float
    curve_v_up: float


class Axis(NamedTuple):
    """A leg along one axis of a gate."""

    v: Any  # velocity at its begin [m/s]
    gravity: Any  # acceleration against which the thrust acts [m/s^2]
    slope: Any  # derivatives of the time to go behind the gate by the velocity there
    curve: Any


class Aside(NamedTuple):
    """A leg along one of the two axes of an opening."""

    axis: Axis
    offset: Any  # from the middle of the opening at the begin [m]
    half: Any  # half size of the opening [m]
    slope: Any  # derivatives of the time to go behind the gate by the offset there
    curve: Any


class Approach(NamedTuple):
    """The leg from a sample to the exit of its gate, in the frame of the gate."""

    distance: Any  # to the exit plane, negative behind it [m]
    along: Axis
    left: Aside
    up: Aside


class Quartic(NamedTuple):
    """The equation for the time of a leg that ends anyhow, see `time_to_exit`."""

    dd: Any  # square of the distance [m^2]
    dv: Any  # scalar product of distance and velocity [m^2/s]
    vv: Any  # square of the velocity [m^2/s^2]


class Place(NamedTuple):
    """The place at which a leg across the opening ends best."""

    offset: Any  # from the middle [m]
    outside: Any  # by how much that is beside the opening [m]


class Found(NamedTuple):
    """The best crossing along one axis, for a given time."""

    cost: Any  # price of the thrust, and time to go behind the gate [s]
    rate: Any  # its change with the time


def along_axis(axis, d, T, p, slowest=None):
    """Return the best crossing of a leg along one axis, a Found.

    Args:
        axis: Axis.
        d: distance [m].
        T: time of the leg [s].
        p: price and drag.
        slowest: least velocity at the end [m/s]; None: any.
    """
    mean = d / T
    # E = ((u - a)^2 + 12 (b - u / 2)^2) / T with the velocity u at the end
    a = axis.v - axis.gravity * T - p.drag * d
    b = mean - 0.5 * axis.v
    per = p.price / T
    u = (per * (2.0 * a + 12.0 * b) - axis.slope) / (8.0 * per + axis.curve)
    if slowest is not None:
        u = maximum(u, slowest)
    change = u - a
    off = b - 0.5 * u
    thrust = per * (change * change + 12.0 * off * off)
    behind = (axis.slope + 0.5 * axis.curve * u) * u
    rate = 2.0 * per * (change * axis.gravity - 12.0 * off * mean / T) - thrust / T
    return Found(thrust + behind, rate)


def best_place(leg, T, p):
    """Return where a leg along an axis of the opening ends best, a Place.

    Args:
        leg: Aside.
        T: time of the leg [s].
        p: price and drag.
    """
    # The price of the thrust and the time behind the gate are quadratic in the offset at the end,
    # with the best velocity for each offset.
    axis = leg.axis
    per = p.price / T
    a = axis.v - axis.gravity * T + p.drag * leg.offset
    b = -leg.offset / T - 0.5 * axis.v
    best = 1.0 / (8.0 * per + axis.curve)
    pull = per * (2.0 * a + 12.0 * b) - axis.slope
    pull_by_offset = per * (12.0 / T - 2.0 * p.drag)
    first = per * (24.0 * b / T - 2.0 * p.drag * a) - best * pull * pull_by_offset + leg.slope
    second = per * (24.0 / (T * T) + 2.0 * p.drag * p.drag)
    second = second - best * pull_by_offset * pull_by_offset + leg.curve
    free = -first / second
    inside = minimum(maximum(free, -leg.half), leg.half)
    # Beside the opening the slope of the cost is OUTSIDE, which draws the place nearer.
    drawn = OUTSIDE / second
    beyond = free - inside
    beyond = beyond - minimum(maximum(beyond, -drawn), drawn)
    return Place(inside + beyond, abs(beyond))


def across(leg, T, p):
    """Return the best crossing of a leg along an axis of the opening, a Found.

    Args:
        leg: Aside.
        T: time of the leg [s].
        p: price and drag.
    """
    place = best_place(leg, T, p)
    found = along_axis(leg.axis, place.offset - leg.offset, T, p)
    behind = (leg.slope + 0.5 * leg.curve * place.offset) * place.offset
    return Found(found.cost + behind + OUTSIDE * place.outside, found.rate)


def approach_of(x, gate):
    """Return the leg from the state x to the exit of the gate, an Approach."""
    passage = (gate.nx, gate.ny, gate.nz)
    left = (gate.lx, gate.ly, gate.lz)
    up = cross(passage, left)
    place = in_gate(x.position, gate)
    v_along, v_left, v_up = in_frame(x.velocity, passage, left, up)
    return Approach(
        distance=where(place.along > 0.0, -1.0, 1.0) * maximum(abs(place.along), NEAREST),
        along=Axis(v_along, GRAVITY * gate.nz, gate.slope_v_along, gate.curve_v_along),
        left=Aside(
            axis=Axis(v_left, GRAVITY * gate.lz, gate.slope_v_left, gate.curve_v_left),
            offset=place.left,
            half=maximum(gate.free_y - gate.margin, SMALLEST),
            slope=gate.slope_left,
            curve=gate.curve_left,
        ),
        up=Aside(
            axis=Axis(v_up, GRAVITY * up[2], gate.slope_v_up, gate.curve_v_up),
            offset=place.up,
            half=maximum(gate.free_z - gate.margin, SMALLEST),
            slope=gate.slope_up,
            curve=gate.curve_up,
        ),
    )


def quartic_of(leg, p):
    """Return the equation for the time to the point of the exit to which the velocity leads.

    Args:
        leg: Approach.
        p: parameters of the term.
    """
    distance = abs(leg.distance)
    by_speed = distance / maximum(leg.along.v, SLOW)
    by_thrust = sqrt(p.root * distance)
    T = minimum(by_speed, by_thrust)
    falls = 0.5 * T * T
    dx = leg.distance + falls * leg.along.gravity
    dy, dz = (
        minimum(maximum(side.offset + side.axis.v * T, -side.half), side.half)
        - side.offset
        + falls * side.axis.gravity
        for side in (leg.left, leg.up)
    )
    v_along, v_left, v_up = leg.along.v, leg.left.axis.v, leg.up.axis.v
    return Quartic(
        dd=dx * dx + dy * dy + dz * dz,
        dv=dx * v_along + dy * v_left + dz * v_up,
        vv=v_along * v_along + v_left * v_left + v_up * v_up,
    )


def time_to_exit(equation, p):
    """Return the time of a leg that ends anyhow [s], the first root of the quartic equation

        T^4 = 3 a / ((1 - a) f^2) (3 d^2 - 4 d.v T + v^2 T^2)

    Args:
        equation: Quartic.
        p: parameters of the term.
    """
    dd, dv, vv = equation
    T = minimum(dd / maximum(dv, SLOW * sqrt(dd)), sqrt(p.root * sqrt(dd)))
    # A sample that flies away has to turn first.
    T = where(dv < 0.0, maximum(T, sqrt(p.unit * vv)), T)
    for _ in range(FIRST_STEPS):
        T2 = T * T
        excess = T2 * T2 - p.unit * (3.0 * dd - 4.0 * dv * T + vv * T2)
        T = minimum(maximum(T - excess / quartic_slope(equation, T, p), 0.3 * T), 2.0 * T)
    return T


def quartic_slope(equation, T, p):
    """Return the slope of the quartic equation at T, bounded from below."""
    _, dv, vv = equation
    T3 = T * T * T
    return maximum(4.0 * T3 + p.unit * (4.0 * dv - 2.0 * vv * T), 2.0 * T3)


def time_through(leg, p):
    """Return the least time to the exit and from there to the finish, without `later` [s].

    Args:
        leg: Approach.
        p: parameters of the term.
    """
    equation = quartic_of(leg, p)
    T = time_to_exit(equation, p)
    rest = 1.0 - THRUST_SHARE
    # Newton's method. The last step is not evaluated again, as the sum is a parabola near its least
    # value.
    for step in range(STEPS):
        along = along_axis(leg.along, leg.distance, T, p, slowest=0.0)
        aside = across(leg.left, T, p)
        upward = across(leg.up, T, p)
        rate = rest + along.rate + aside.rate + upward.rate
        T2 = T * T
        curve = rest * quartic_slope(equation, T, p) / (T2 * T2)
        change = minimum(maximum(-rate / curve, -0.3 * T), 0.4 * T)
        if step < STEPS - 1:
            T = T + change
    found = rest * T + along.cost + aside.cost + upward.cost
    return found + (rate + 0.5 * curve * change) * change


def time_to_go(x, gate, p):
    """Return the time that a point mass takes from the state x to RUN_ON behind the finish [s].

    A sample behind the plane of its gate, which it has missed or which faces away, turns back and
    crosses it forward. Straight behind the gate the frame is in the way, so there the time is
    longer, the further it is to the outer edge of the frame. Behind the finish the time decreases
    with the distance flown, and with the speed along the passage as it does at the finish.
    """
    # On the way to a gate
    place = in_gate(x.position, gate)
    outside = maximum(abs(place.left) - gate.free_y, abs(place.up) - gate.free_z)
    to_edge = where(place.along > 0.0, maximum(gate.bar - outside, 0.0), 0.0)
    leg = approach_of(x, gate)
    ahead = time_through(leg, p) + ROUND * to_edge / p.speed

    # Behind the finish
    v = leg.along.v
    by_speed = (leg.along.slope + 0.5 * leg.along.curve * v) * v
    flown = RUN_OUT + place.along
    finished = by_speed - flown / p.speed
    return gate.later + where(gate.free_y < RUN_OUT, ahead, finished)


@lru_cache(maxsize=16)
def value_row(row: Any) -> Any:
    """Return the type of target rows with the numbers of Behind after these."""
    return namedtuple(f"Valued{row.__name__}", row._fields + Behind._fields)


def with_time_to_go(cost: Cost, value: CourseValue, weight: float) -> Cost:
    """Return the racing cost with the term `time_to_go`.

    Args:
        cost: the racing cost. Its rows are those for which the value was made, apart from places
            and directions: gates that turn out to stand elsewhere take their value with them.
        value: of the course, see `value_of_rows`.
        weight: per metre that is flown on average in the time to go.
    """
    z = value.crossings
    slope = value.slope - value.curvature * z
    later = value.to_go - (value.slope * z - 0.5 * value.curvature * z * z).sum(axis=1)
    # The numbers of each gate. The target behind the finish has those of the finish.
    behind = np.column_stack([later, slope, value.curvature])
    behind = np.vstack([behind[:-1], behind[FINISH]])
    f = value.mass.thrust
    unit = 3.0 * THRUST_SHARE / ((1.0 - THRUST_SHARE) * f * f)
    term = StateTerm(
        time_to_go,
        weight * value.mean_speed,
        price=THRUST_SHARE / (f * f),
        drag=value.mass.drag,
        unit=unit,
        root=float(np.sqrt(3.0 * unit)),
        speed=float(value.speeds[FINISH]),
    )
    return replace(
        cost,
        name=f"{cost.name}_value",
        row=value_row(cost.row),
        targets=np.hstack([cost.targets, behind]),
        terms=(*cost.terms, term),
    )


def value_of_rows(rows: np.ndarray, start: Vec3, mass: PointMass) -> CourseValue:
    """Return the time to go through the targets of the racing cost and to RUN_ON behind the finish.

    If the time ended at the finish, a short horizon that reaches beyond it would not reward speed
    there, and flights would coast on the last leg.

    Args:
        rows: rows of `GateTarget`, the last one behind the finish.
        start: position at the start [m]  (3,).
        mass: the vehicle as a point mass.

    Returns:
        The value, with the mean speed up to the finish.
    """
    gates = rows[:-1]
    forward = columns(gates, GateTarget, "nx", "nz")
    left = columns(gates, GateTarget, "lx", "lz")
    free = columns(gates, GateTarget, "free_y", "free_z")
    margin = columns(gates, GateTarget, "margin", "margin")
    position = columns(gates, GateTarget, "x", "z")
    rotation = np.stack([forward, left, np.cross(forward, left)], axis=2)
    # The gates, and the passage behind the finish
    passages = Passages(
        position=np.vstack([position, position[-1] + RUN_ON * forward[-1]]),
        rotation=np.concatenate([rotation, rotation[-1:]]),
        half=np.vstack([np.maximum(free - margin, SMALLEST), (RUN_ON, RUN_ON)]),
    )
    value = value_of_passages(passages, start, mass)

    # The weight of the term refers to the race alone.
    ways = np.diff(np.vstack([start, position]), axis=0)
    length = np.linalg.norm(ways, axis=1).sum()
    return replace(value, mean_speed=float(length / value.splits[FINISH]))
