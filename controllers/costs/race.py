"""The racing cost: eq. (8) of Vlahov et al. 2024, and the distance still to fly.

    q = a_0 Progress + a_1 Heading + a_2 Height + a_3 Speed + a_4 Stabilize + a_5 Crash - a_6 Waypoint + a_7 Path
      + a_8 Clearance

a_1 to a_7 are the paper's terms, a_0 and a_8 are ours: the distance still to fly, and the margin within a gate.

A gate from above; the vehicle's centre flies from left to right, along the passage:

    entry plane          exit plane: the target's position, x = 0 of the gate's frame here
        |    ####  frame     |
        |    ####            |   bar: the frame's width, grown by the vehicle's radius and the margins
        |                    |
    ----|--------------------|-> free: half the opening, less radius and margin, to either side
        |                    |
        |    ####            |
        |    ####            |
        <------- depth ------>
Unlike the paper's implementation, the target advances inside the rollout: once a sample has flown through a gate, its
progress is measured to the next one. A gate counts as passed when the segment x -> x_next crosses its exit plane inside
the free opening, which is the opening less the vehicle's radius and a safety margin; the frame in all of its depth, the
ground and the bounds crash the sample for the rest of its rollout. The exit plane lies where the vehicle is clear of
the frame behind it, the entry plane as far in front of the gate.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial
from typing import Annotated

from msgspec import Meta
from numpy import maximum, minimum, sqrt, where

from controllers.costs import Cost
from controllers.costs.frames import SAFETY_MARGIN, course_obstacles, obstacle_rows
from controllers.costs.race_targets import RUN_OUT, GateTarget, clear_of_frame, cross, is_inside, row_ahead, targets
from quadsim.course import Course, in_frame
from quadsim.files.strict_yaml import unit

TERMS = ("progress", "heading", "height", "speed", "stabilize", "crash", "waypoint", "path", "clearance")

FLOOR_MARGIN = 0.1  # [m]
AT_TARGET = 0.5  # [m] nearer than this the bearing to the target says nothing

Weight = Annotated[float, Meta(ge=0, le=1e6)]


@dataclass(frozen=True)
class RaceWeights:
    """Weights a_0..a_8 of the terms, and the numbers they refer to."""

    progress: Weight = 1.0  # per metre still to fly
    heading: Weight = 0.0  # of 1 - cos of the angle between horizontal velocity and bearing to the gate
    height: Weight = 0.0  # per m^2 off the height of the leg
    speed: Weight = 0.0  # per (m/s)^2 off desired_speed, horizontal
    stabilize: Weight = 0.0  # of 1 - cos of the tilt
    crash: Weight = 1000.0  # per step after a crash
    waypoint: Weight = 0.0  # reward per step within waypoint_radius of the gate's exit
    path: Weight = 0.0  # per m^2 off the straight leg
    clearance: Weight = 2000.0  # per metre by which the margin is not kept, per metre flown within a gate's depth
    desired_speed: Annotated[float, unit("m/s", ge=0, le=100)] = 9.0  # horizontal, of the speed term [m/s]
    waypoint_radius: Annotated[float, unit("m", gt=0, le=100)] = 0.5  # around a gate's exit [m]
    margin: Annotated[float, unit("m", ge=0, le=10)] = 0.25  # wanted between vehicle and frame, within a gate [m]
    margin_share: Annotated[float, Meta(ge=0, le=1)] = 0.5  # of half the free opening, which it takes at most
    opening: Annotated[float, Meta(ge=0, le=1)] = 0.0  # progress aims at the nearest point of this share of the opening


def step_at_gate(before, after, free_y, free_z, bar, depth):
    """A step whose ends are given in the frame of a gate's exit: (reached, clipped, within, outside, span).

    within: it ends between entry and exit, or crosses the exit, not outside the frame; outside is how far outside the
    free opening it does so, negative inside, times span = |s1 - s0| [m^2]. Checked where it crosses the two planes and
    at its end, which is enough as the free opening is convex. at_exit and at_entry are such products too: they need no
    division, and summed over the steps within a gate they do not depend on the speed. At 50 m/s a step is longer than
    a gate is deep.
    """
    (s0, y0, z0), (s1, y1, z1) = before, after
    forward = (s0 < 0.0) & (s1 >= 0.0)
    backward = (s0 >= 0.0) & (s1 < 0.0)
    through = (s0 <= -depth) != (s1 <= -depth)
    span, e0, e1 = abs(s1 - s0), s0 + depth, s1 + depth
    at_exit = maximum(abs(y0 * s1 - y1 * s0) - free_y * span, abs(z0 * s1 - z1 * s0) - free_z * span)
    at_entry = maximum(abs(y0 * e1 - y1 * e0) - free_y * span, abs(z0 * e1 - z1 * e0) - free_z * span)
    at_end = maximum(abs(y1) - free_y, abs(z1) - free_z)
    ends_in = (s1 > -depth) & (s1 < 0.0) & (at_end < bar)
    reached = forward & (at_exit < 0.0)
    clipped = (forward & (at_exit >= 0.0) & (at_exit < bar * span)) | (backward & (at_exit < bar * span))
    clipped = clipped | (through & (at_entry >= 0.0) & (at_entry < bar * span)) | (ends_in & (at_end >= 0.0))
    within = ends_in | (forward & (at_exit < bar * span))
    return reached, clipped, within, where(forward, at_exit, at_end * span), span


def off_leg(dx, dy, dz, ex, ey, ez, leg):
    """From the nearest point of the straight leg, which is -leg .. 0 along e, to (dx, dy, dz).  (3,)"""
    along = minimum(maximum(dx * ex + dy * ey + dz * ez, -leg), 0.0)
    return dx - along * ex, dy - along * ey, dz - along * ez


def terms(x, x_next, u, target, crashed, p):
    """The weighted terms of eq. (8) for one step of one sample, with reached and crashed."""
    gx, gy, gz, nx, ny, nz, lx, ly, lz, free_y, free_z, bar, to_go, approach, ex, ey, ez, leg, margin, depth = target
    a_0, a_1, a_2, a_3, a_4, a_5, a_6, a_7, a_8, v_des, near, share, floor, x_lo, x_hi, y_lo, y_hi, z_hi = p
    px, py, pz, vx, vy, qx, qy = x_next[0], x_next[1], x_next[2], x_next[3], x_next[4], x_next[7], x_next[8]
    # position relative to the gate's exit, before and after: along the passage, left, up
    dx, dy, dz = px - gx, py - gy, pz - gz
    n, left = (nx, ny, nz), (lx, ly, lz)
    before = in_frame((x[0] - gx, x[1] - gy, x[2] - gz), n, left, cross(n, left))
    after = in_frame((dx, dy, dz), n, left, cross(n, left))
    reached, clipped, within, outside, span = step_at_gate(before, after, free_y, free_z, bar, depth)
    tight = where(within, maximum(outside + margin * span, 0.0), 0.0)
    below_floor = (pz < floor) & (pz < x[2])  # a start on the ground is no crash, coming down is
    out_of_bounds = (px < x_lo) | (px > x_hi) | (py < y_lo) | (py > y_hi) | (pz > z_hi)
    before_finish = free_y < RUN_OUT
    crashed = where(clipped | ((below_floor | out_of_bounds) & before_finish), 1.0, crashed)

    # to the nearest point of the opening within the margin; for a sample behind the exit that has not passed, the way
    # leads round to a point in front of the gate
    s, y, z = after
    past_exit = s > 0.0
    s = where(past_exit, s + approach, s)
    y = where(past_exit, y, maximum(abs(y) - share * (free_y - margin), 0.0))
    z = where(past_exit, z, maximum(abs(z) - share * (free_z - margin), 0.0))
    way = sqrt(s * s + y * y + z * z + 1e-6) + where(past_exit, approach, 0.0)

    d2 = dx * dx + dy * dy + dz * dz
    v_xy = sqrt(vx * vx + vy * vy + 1e-6)
    d_xy = sqrt(dx * dx + dy * dy + 1e-6)
    heading_error = where(d2 > AT_TARGET * AT_TARGET, 1.0 + (vx * dx + vy * dy) / (v_xy * d_xy), 0.0)
    ox, oy, oz = off_leg(dx, dy, dz, ex, ey, ez, leg)
    off_speed = v_xy - v_des
    return (
        a_0 * (where(reached, 0.0, way) + to_go),
        a_1 * heading_error,
        a_2 * oz * oz,
        a_3 * off_speed * off_speed,
        a_4 * 2.0 * (qx * qx + qy * qy),
        a_5 * crashed,
        -a_6 * where(d2 < near * near, 1.0, 0.0),
        a_7 * (ox * ox + oy * oy + oz * oz),
        a_8 * tight,
        reached,
        crashed,
    )


def race_cost(course: Course, radius: float, weights: RaceWeights, laps: int) -> Cost:
    """The cost of a course for a vehicle of this radius [m]."""
    w = weights
    box = room_to_fly(course, radius, w.margin)
    params = (w.progress, w.heading, w.height, w.speed, w.stabilize, w.crash, w.waypoint, w.path, w.clearance)
    params += (w.desired_speed, w.waypoint_radius, w.opening, *box)
    frames = course_obstacles(course, radius, w.crash, TERMS.index("crash"))
    (rows, first), clear = targets(course, radius, (w.margin, w.margin_share), box, laps), clear_of_frame(radius)
    still_in_gate = partial(is_inside, clear)
    unweighted = tuple(k for k, weight in enumerate(params[: len(TERMS)]) if not weight)
    to_go = GateTarget._fields.index("to_go")
    cost = Cost("race", TERMS, terms, params, rows, to_go, frames, still_in_gate, unweighted=unweighted)
    if len(rows) == len(first) - 1:
        return cost
    return replace(
        cost, row_ahead=partial(row_ahead, still_in_gate, first, rows, obstacle_rows(course.obstacles, radius))
    )


def room_to_fly(course: Course, radius: float, margin: float) -> tuple[float, ...]:
    """Where samples may fly: floor, x_low, x_high, y_low, y_high, z_high [m].

    At most FLOOR_MARGIN of the margin is kept from the ground, and half of what the lowest gate leaves.
    """
    (x_low, x_high), (y_low, y_high), (z_low, z_high) = course.bounds
    gap = radius + SAFETY_MARGIN
    lowest = min(g.position[2] for g in course.gates)
    floor = gap + max(min(margin, FLOOR_MARGIN, (lowest - gap) / 2), 0.0)
    return max(floor, z_low), x_low + gap, x_high - gap, y_low + gap, y_high - gap, z_high - gap
