"""The risk of gates that are known only from nearby, as a part of the racing cost.

A gate that stands off the map becomes known at a distance r. What matters is the state in which the
vehicle is then: from it, the gate has to be within reach wherever it may stand. With the time t to
the frame, the vehicle crosses the gate's plane at c if it keeps its acceleration. From there it can
move aside by

    a_y = f w (t - tau_w)^3 / 6    by rolling or pitching at the rate w, with the thrust f
    a_z = a (t - tau_f)^2 / 2      up or down by thrust, of which a is left above or below

behind the lags tau_w of the rate loop and tau_f of the rotors. A gate that stands up to d off the
map is missed with the probability

    p = max(d + c - free - a, 0) / 2d + max(d - c - free - a, 0) / 2d

in either direction, where `free` is half of the free opening, less what a slanting path needs of
it. So the law prefers slower flight to faster, straight approaches to slanting ones, the middle of
the opening to its sides, and thrust that can still be changed.

A gate may become known somewhat earlier or later than on the map. Each step near the distance r
therefore adds its share of p to the crash flag of the sample, a number from 0 to 1 that is paid in
all later steps: the weight of a crash times the flag is the expected cost of a crash.

Where a gate turns out to be out of reach, all samples hit it, and the plan ought to lead as near to
the opening as possible. So a crash counts more, the further outside the opening it happens.
"""

from __future__ import annotations

from collections import namedtuple
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy import maximum, minimum, sqrt, where

from quadsim.controllers.costs import Cost
from quadsim.controllers.costs.race_step import RaceParams, at_gate, in_gate
from quadsim.controllers.costs.race_targets import GateTarget, cross
from quadsim.course import Course, Gate, in_frame
from quadsim.dynamics.named_tuples import as_rows
from quadsim.dynamics.quadrotor import ModelParams, thrust_axis
from quadsim.vehicle import GRAVITY

# Half width of the distances at which a gate may become known, as a share of its displacement
BAND = 2.0 / 3.0
# [m] what the controller's errors add to the displacement of a gate
ERROR = 0.01
# Share of the way to full thrust that the thrust makes while the vehicle moves aside
RISE = 0.25
# [s] the time for which the acceleration towards the gate is taken to last
LASTS = 0.3
# [m/s] least speed towards the gate in the law
SLOW = 0.3
# [1/m^2] crash flag for each metre outside the opening, per metre flown within the gate
DEEP = 20.0


class Sight(NamedTuple):
    """From where gates are known that stand off the map, and how a vehicle reaches them then."""

    # whether the gate is still to be seen, of each gate of the course
    unseen: tuple[bool, ...]
    # horizontal distance within which a gate is known [m]
    known_from: float
    # half widths of the displacement, along x and y, and along z [m]
    aside: float
    height: float
    # the planner's model of the vehicle
    model: ModelParams
    # control period [s]
    period: float


class Caution(NamedTuple):
    """The numbers of one target row for the risk."""

    # Place of the gate [m]
    gate_x: float
    gate_y: float
    # Weight of the risk, 0 for a gate that is known
    caution: float


class Reach(NamedTuple):
    """The properties of vehicle, sight and displaced gates that determine the risk."""

    # distances within which a gate may become known [m]
    nearest: float
    furthest: float
    known_from: float
    # half widths of the displacement, with the controller's errors [m]
    half_y: float
    half_z: float
    # f_max and f_min, mass-normalised [m/s^2]
    most_thrust: float
    least_thrust: float
    # w, the largest rate of roll and pitch [rad/s]
    tilt_rate: float
    # tau_w and tau_f [s]
    tilt_lag: float
    thrust_lag: float


# A row of the racing cost with the risk: GateTarget, then Caution
CautiousTarget: Any = namedtuple("CautiousTarget", GateTarget._fields + Caution._fields)
# Its parameters: RaceParams, then Reach
CautiousParams: Any = namedtuple("CautiousParams", RaceParams._fields + Reach._fields)


def unseen_gates(mapped: Course, known: Course) -> tuple[bool, ...]:
    """Return whether each gate still stands where the map has it, as nobody has seen it yet.

    Args:
        mapped: the course of the map.
        known: the same course as it is known now: gates that were seen stand elsewhere.
    """
    return tuple(gate == on_map for gate, on_map in zip(known.gates, mapped.gates, strict=True))


def reach_of(sight: Sight) -> Reach:
    """Return what the risk knows of a vehicle and of the displacement of gates."""
    model = sight.model
    # A new plan acts half a control period after the gate is near enough, on average.
    wait = sight.period / 2
    band = BAND * sight.aside
    return Reach(
        nearest=sight.known_from - band,
        furthest=sight.known_from + band,
        known_from=sight.known_from,
        half_y=sight.aside + ERROR,
        half_z=sight.height + ERROR,
        most_thrust=model.thrust_max,
        least_thrust=model.thrust_min,
        tilt_rate=min(model.rate_max[:2]),
        tilt_lag=wait + max(model.rate_tau[:2]) + max(model.rate_lags[:2]),
        thrust_lag=wait + model.motor_tau,
    )


def beyond_opening(x, x_next, gate):
    """Return what a crash into the gate's frame adds to the crash flag: more, further outside."""
    step = at_gate(x, x_next, gate)
    outside = maximum(maximum(step.outside, step.outside_entry), 0.0)
    return where(step.clipped, DEEP * outside, 0.0)


def share_of_sight(x, x_next, gate, p):
    """Return the probability that the gate becomes known in this step, if it was not before.

    The distance at which that happens is uniform from p.nearest to p.furthest. The share is 1 where
    the step ends nearer than that.
    """
    before = distance(x, gate)
    after = distance(x_next, gate)
    left_before = minimum(maximum(before, p.nearest), p.furthest) - p.nearest
    left_after = minimum(maximum(after, p.nearest), p.furthest) - p.nearest
    return maximum(left_before - left_after, 0.0) / maximum(left_before, 0.01)


def distance(x, gate):
    """Return the horizontal distance to the gate's place on the map [m]."""
    dx = x.px - gate.gate_x
    dy = x.py - gate.gate_y
    return sqrt(dx * dx + dy * dy + 1e-6)


def out_of_reach(x, gate, p):
    """Return the probability that a gate that becomes known in the state x is out of reach.

    It is 0 beside the gate and behind it, as such a vehicle comes back another way.
    """
    # Position, velocity and acceleration along the passage, to the left and up
    passage = (gate.nx, gate.ny, gate.nz)
    left = (gate.lx, gate.ly, gate.lz)
    up = cross(passage, left)
    place = in_gate(x.position, gate)
    v_along, v_left, v_up = in_frame(x.velocity, passage, left, up)
    zx, zy, zz = thrust_axis(*x.attitude)
    lift = (zx * x.thrust, zy * x.thrust, zz * x.thrust - GRAVITY)
    a_along, a_left, a_up = in_frame(lift, passage, left, up)

    # Time until the frame begins. A gate that becomes known earlier or later than on the map stands
    # further back or nearer than there.
    ahead = -place.along - gate.depth
    way = maximum(ahead + p.known_from - distance(x, gate), 0.02)
    coasting = minimum(way / maximum(v_along, SLOW), LASTS)
    t = way / maximum(v_along + 0.5 * a_along * coasting, SLOW)

    # Where the vehicle crosses the frame's plane if it keeps its acceleration
    c_left = place.left + v_left * t + 0.5 * a_left * t * t
    c_up = place.up + v_up * t + 0.5 * a_up * t * t

    # How far it can move to the sides, up and down from there
    tilting = maximum(t - p.tilt_lag, 0.0)
    thrust = x.thrust + RISE * (p.most_thrust - x.thrust)
    to_side = thrust * p.tilt_rate * tilting * tilting * tilting / 6.0
    thrusting = maximum(t - p.thrust_lag, 0.0)
    upright = maximum(zx * up[0] + zy * up[1] + zz * up[2], 0.2)
    per_thrust = 0.5 * upright * thrusting * thrusting
    to_up = maximum(p.most_thrust - x.thrust, 0.0) * per_thrust
    to_down = maximum(x.thrust - p.least_thrust, 0.0) * per_thrust

    # A slanting path needs a part of the opening, half of what it drifts within the frame.
    slant = 0.5 * gate.depth / maximum(v_along, 0.5)
    free_left = gate.free_y - slant * abs(v_left)
    free_up = gate.free_z - slant * abs(v_up)

    missing_left = p.half_y - free_left - to_side
    beside = maximum(missing_left + c_left, 0.0) + maximum(missing_left - c_left, 0.0)
    missing_up = p.half_z - free_up
    above = maximum(missing_up - c_up - to_up, 0.0)
    below = maximum(missing_up + c_up - to_down, 0.0)
    missed = beside / (2.0 * p.half_y) + (above + below) / (2.0 * p.half_z)
    return where(ahead > 0.0, minimum(missed, 1.0), 0.0)


def risk(x, x_next, u, gate, p):
    """Return what a step adds to the crash flag: the risk of an unseen gate, the depth of a hit."""
    expected = share_of_sight(x, x_next, gate, p) * out_of_reach(x_next, gate, p)
    return beyond_opening(x, x_next, gate) + gate.caution * expected


def with_caution(
    cost: Cost, gates: Sequence[Gate], first: Sequence[int], sight: Sight, weight: float
) -> Cost:
    """Return the racing cost with the risk of gates that nobody has seen yet.

    Args:
        cost: the racing cost.
        gates: the gates of all laps.
        first: index at which the rows of each gate begin, and those of the finish.
        sight: from where gates are known, and the vehicle.
        weight: weight of the risk, as a share of the weight of a crash.
    """
    rows = []
    for k, gate in enumerate(gates):
        x, y, _ = gate.position
        is_unseen = sight.unseen[k % len(sight.unseen)]
        rows += [Caution(x, y, weight if is_unseen else 0.0)] * (first[k + 1] - first[k])
    rows += [Caution(0.0, 0.0, 0.0)] * (first[-1] - first[-2])
    return replace(
        cost,
        name="race_caution",
        row=CautiousTarget,
        targets=np.hstack([cost.targets, as_rows(rows, Caution)]),
        params=CautiousParams(*cost.params, *reach_of(sight)),
        risk=risk,
    )
