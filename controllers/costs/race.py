"""The racing cost: eq. (8) of Vlahov et al. 2024, and the distance still to fly.

    q = a_0 Progress + a_1 Heading + a_2 Height + a_3 Speed + a_4 Stabilize + a_5 Crash + a_6 Waypoint + a_7 Path
      + a_8 Clearance

Unlike the paper's implementation, the target advances inside the rollout: once a sample has flown through a gate, its
progress is measured to the next one. A gate counts as passed when the segment x -> x_next crosses its exit plane inside
the free opening, which is the opening less the vehicle's radius and a safety margin; the frame in all of its depth, the
ground and the bounds crash the sample for the rest of its rollout. The exit plane lies where the vehicle is clear of
the frame behind it, the entry plane as far in front of the gate.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from msgspec import Meta
from numpy import maximum, minimum, sqrt, where

from controllers.costs import Cost
from quadsim.course import FRAME_DEPTH, Course, in_frame
from quadsim.files.strict_yaml import unit

TERMS = ("progress", "heading", "height", "speed", "stabilize", "crash", "waypoint", "path", "clearance")
TO_GO = 12  # column of the target rows
SAFETY_MARGIN = 0.02  # [m] kept between vehicle and frame; where a gate is narrow, at most half of the room there is
RUN_OUT = 100.0  # [m] from the last gate to a last target behind it, so that plans do not end at the finish

Weight = Annotated[float, Meta(ge=0, le=1e6)]


@dataclass(frozen=True)
class RaceWeights:
    """Weights a_0..a_8 of the terms, and the numbers they refer to."""

    progress: Weight = 1.0  # per metre still to fly
    heading: Weight = 0.0  # 1 - cos of the angle between velocity and bearing to the gate, per unit
    height: Weight = 0.0  # per m^2 off the height of the leg
    speed: Weight = 0.0  # per (m/s)^2 off desired_speed, horizontal
    stabilize: Weight = 0.0  # 1 - cos of the tilt
    crash: Weight = 1000.0  # per step after a crash
    waypoint: Weight = 0.0  # reward per step within waypoint_radius of the gate's exit
    path: Weight = 0.0  # per m^2 off the straight leg
    clearance: Weight = 200.0  # per metre by which the margin is not kept, per step within a gate's depth
    desired_speed: Annotated[float, unit("m/s", ge=0, le=100)] = 9.0  # horizontal, of the speed term [m/s]
    waypoint_radius: Annotated[float, unit("m", gt=0, le=100)] = 0.5  # around a gate's exit [m]
    margin: Annotated[float, unit("m", ge=0, le=10)] = 0.25  # wanted between vehicle and frame, within a gate [m]


def cross(a, b):
    """a x b of three numbers each."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def step_at_gate(before, after, free_y, free_z, bar, depth):
    """A step whose ends are given in the frame of a gate's exit: (reached, clipped, within, at_end).

    at_end is how far outside the free opening it ends, negative inside [m]; within: between entry and exit, not
    outside the frame. It is free of the frame if it is free at the exit, the entry and its end, as the free shaft is
    convex. At the two planes the distances are times |s1 - s0|, which saves a division.
    """
    (s0, y0, z0), (s1, y1, z1) = before, after
    forward = (s0 < 0.0) & (s1 >= 0.0)
    backward = (s0 >= 0.0) & (s1 < 0.0)
    through = (s0 <= -depth) != (s1 <= -depth)
    span, e0, e1 = abs(s1 - s0), s0 + depth, s1 + depth
    at_exit = maximum(abs(y0 * s1 - y1 * s0) - free_y * span, abs(z0 * s1 - z1 * s0) - free_z * span)
    at_entry = maximum(abs(y0 * e1 - y1 * e0) - free_y * span, abs(z0 * e1 - z1 * e0) - free_z * span)
    at_end = maximum(abs(y1) - free_y, abs(z1) - free_z)
    within = (s1 > -depth) & (s1 < 0.0) & (at_end < bar)
    reached = forward & (at_exit < 0.0)
    clipped = (forward & (at_exit >= 0.0) & (at_exit < bar * span)) | (backward & (at_exit < bar * span))
    clipped = clipped | (through & (at_entry >= 0.0) & (at_entry < bar * span)) | (within & (at_end >= 0.0))
    return reached, clipped, within, at_end


def off_leg(dx, dy, dz, ex, ey, ez, leg):
    """From the nearest point of the straight leg, which is -leg .. 0 along e, to (dx, dy, dz).  (3,)"""
    along = minimum(maximum(dx * ex + dy * ey + dz * ez, -leg), 0.0)
    return dx - along * ex, dy - along * ey, dz - along * ez


def terms(x, x_next, u, target, crashed, p):
    """The weighted terms of eq. (8) for one step of one sample, with reached and crashed."""
    gx, gy, gz, nx, ny, nz, lx, ly, lz, free_y, free_z, bar, to_go, approach, ex, ey, ez, leg = target
    a_0, a_1, a_2, a_3, a_4, a_5, a_6, a_7, a_8, v_des, near, margin, depth, floor, x_lo, x_hi, y_lo, y_hi, z_hi = p
    px, py, pz, vx, vy, qx, qy = x_next[0], x_next[1], x_next[2], x_next[3], x_next[4], x_next[7], x_next[8]
    # position relative to the gate's exit, before and after: along the passage, left, up
    dx, dy, dz = px - gx, py - gy, pz - gz
    n, left = (nx, ny, nz), (lx, ly, lz)
    before = in_frame((x[0] - gx, x[1] - gy, x[2] - gz), n, left, cross(n, left))
    after = in_frame((dx, dy, dz), n, left, cross(n, left))
    reached, clipped, within, at_end = step_at_gate(before, after, free_y, free_z, bar, depth)
    tight = where(within, maximum(at_end + margin, 0.0), 0.0)
    below_floor = (pz < floor) & (pz < x[2])  # a start on the ground is no crash, coming down is
    out_of_bounds = (px < x_lo) | (px > x_hi) | (py < y_lo) | (py > y_hi) | (pz > z_hi)
    crashed = where(clipped | below_floor | out_of_bounds, 1.0, crashed)

    # for a sample behind the exit that has not passed, the way leads round to a point in front of the gate
    rx, ry, rz = dx + approach * nx, dy + approach * ny, dz + approach * nz
    d2 = dx * dx + dy * dy + dz * dz
    past_exit = after[0] > 0.0
    way = sqrt(where(past_exit, rx * rx + ry * ry + rz * rz, d2) + 1e-6) + where(past_exit, approach, 0.0)

    v_xy = sqrt(vx * vx + vy * vy + 1e-6)
    d_xy = sqrt(dx * dx + dy * dy + 1e-6)
    heading_error = where(d2 > 0.25, 1.0 + (vx * dx + vy * dy) / (v_xy * d_xy), 0.0)
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
    (x_lo, x_hi), (y_lo, y_hi), (z_lo, z_hi) = course.bounds
    gap = radius + SAFETY_MARGIN
    box = (max(gap + min(w.margin, 0.1), z_lo), x_lo + gap, x_hi - gap, y_lo + gap, y_hi - gap, z_hi - gap)
    params = (w.progress, w.heading, w.height, w.speed, w.stabilize, w.crash, w.waypoint, w.path, w.clearance)
    params += (w.desired_speed, w.waypoint_radius, w.margin, 2.0 * clear_of_frame(radius), *box)
    return Cost("race", TERMS, terms, params, targets(course, radius, laps), TO_GO, is_inside)


def clear_of_frame(radius: float) -> float:
    """From the gate's plane to the exit plane, where the vehicle is clear of the frame [m]."""
    return FRAME_DEPTH / 2 + radius + SAFETY_MARGIN


def is_inside(x: np.ndarray, row: np.ndarray, params: tuple[float, ...]) -> bool:
    """Whether x is past the gate's plane, within its outline, but not yet clear of its frame."""
    depth = params[len(TERMS) + 3]
    passage, left = row[3:6], row[6:9]
    s, y, z = in_frame(x[:3] - row[:3], passage, left, cross(passage, left))
    free_y, free_z, bar = row[9:12]
    return bool(-depth / 2 <= s < 0.0 and max(abs(y) - free_y, abs(z) - free_z) < bar)


def targets(course: Course, radius: float, laps: int) -> np.ndarray:
    """Target rows: one for each gate of every lap, at its exit, and one behind the finish.  (laps * gates + 1, 18)

    Exit, passage, left axis, half the free opening, thickness of the bars around it, distance to go from there, length
    of the approach, direction and length of the leg to the exit.
    """
    gates = (*course.gates * laps, course.gates[-1])
    passage, left = (np.array([g.rotation[:, k] for g in gates]) for k in (0, 1))
    opening = np.array([g.opening for g in gates])
    behind = np.array([clear_of_frame(radius)] * (len(gates) - 1) + [RUN_OUT])
    exits = np.array([g.position for g in gates]) + behind[:, None] * passage
    inner = np.minimum(SAFETY_MARGIN, (opening.min(axis=1) / 2 - radius) / 2)  # the safety margin inside the opening
    free = opening / 2 - radius - inner[:, None]
    free[-1] = RUN_OUT  # no frame stands there
    bar = np.array([g.frame_width for g in gates]) + 2 * radius + SAFETY_MARGIN + inner
    legs = np.diff([course.start.position, *exits], axis=0)
    lengths = np.maximum(np.linalg.norm(legs, axis=1), 1e-6)
    approach = opening.max(axis=1)
    # the way from gate to gate as terms() measures it, round a gate that faces away: no jump of the cost at a gate
    faces_away = (legs * passage).sum(axis=1) < 0
    ways_round = np.linalg.norm(approach[:, None] * passage - legs, axis=1) + approach
    ways = np.where(faces_away, ways_round, lengths)
    to_go = np.append(np.cumsum(ways[:0:-1])[::-1], 0.0)
    return np.column_stack([exits, passage, left, free, bar, to_go, approach, legs / lengths[:, None], lengths])
