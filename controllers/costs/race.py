"""The racing cost: eq. (8) of Vlahov et al. 2024, and the distance still to fly.

    q = a_0 Progress + a_1 Heading + a_2 Height + a_3 Speed + a_4 Stabilize
        + a_5 Crash - a_6 Waypoint + a_7 Path + a_8 Clearance

a_1 to a_7 weigh the paper's terms. a_0 and a_8 weigh additional terms: the remaining distance to
fly, and the margin within a gate.

A gate from above; the vehicle's centre flies from left to right, along the passage:

    entry plane          exit plane: the target's position, x = 0 of the gate's frame here
        |    ####  frame     |
        |    ####            |   bar: the frame's width, grown by radius and margins
        |                    |
    ----|--------------------|-> free: half the opening, less radius and margin, to either side
        |                    |
        |    ####            |
        |    ####            |
        <------- depth ------>

Unlike the paper's implementation, the target advances inside the rollout: once a sample has flown
through a gate, its progress is measured to the next one. A gate counts as passed when the segment x
-> x_next crosses its exit plane inside the free opening, which is the opening less the vehicle's
radius and a safety margin; the frame in all of its depth, the ground and the bounds crash the
sample for the rest of its rollout. The exit plane lies where the vehicle is clear of the frame
behind it, the entry plane as far in front of the gate.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache, partial
from typing import Annotated

from msgspec import Meta
from numpy import maximum, minimum, sqrt, where

from quadsim.controllers.costs import AmountTerm, Cost, StepFunction, Term, crash
from quadsim.controllers.costs.frames import course_obstacles, obstacle_rows
from quadsim.controllers.costs.race_caution import Sight, with_caution
from quadsim.controllers.costs.race_step import RaceParams, at_gate, in_gate, is_beside, off_exit
from quadsim.controllers.costs.race_targets import (
    RUN_OUT,
    GateTarget,
    Margin,
    clear_of_frame,
    is_inside,
    row_ahead,
    targets,
)
from quadsim.controllers.costs.race_value import value_of_rows, with_time_to_go
from quadsim.controllers.costs.room import leaves_room, room_to_fly
from quadsim.controllers.costs.round_frame import leads_beside_frames, with_ways_round_frames
from quadsim.course import Course
from quadsim.files.strict_yaml import setting
from quadsim.files.values import check_fields
from quadsim.value import CourseValue, PointMass

AT_TARGET = 0.5  # distance to the target below which the bearing to it is not used [m]

Weight = Annotated[float, Meta(ge=0, le=1e6)]


@dataclass(frozen=True)
class RaceWeights:
    """Weights a_0..a_8 and parameters of the terms.

    Examples:
        >>> from dataclasses import replace
        >>> import quadsim
        >>> from quadsim.controllers.costs.race import RaceWeights
        >>> spec = quadsim.Spec.of("figure8")
        >>> isinstance(spec.planner.cost, RaceWeights)
        True
        >>> near = replace(spec.planner.cost, margin=0.1)  # [m]
        >>> fast = spec.but(planner=replace(spec.planner, cost=near))
    """

    progress: Annotated[Weight, setting("weight per metre still to fly")] = 1.0
    heading: Annotated[
        Weight,
        setting("weight of 1 - cos of the angle between horizontal velocity and gate bearing"),
    ] = 0.0
    height: Annotated[Weight, setting("weight per m^2 of squared height error to the leg")] = 0.0
    speed: Annotated[
        Weight, setting("weight per (m/s)^2 of squared error of horizontal speed to desired_speed")
    ] = 0.0
    stabilize: Annotated[Weight, setting("weight of 1 - cos of the tilt")] = 0.0
    crash: Annotated[Weight, setting("weight per step after a crash")] = 1000.0
    waypoint: Annotated[
        Weight, setting("reward per step within waypoint_radius of the gate's exit")
    ] = 0.0
    path: Annotated[Weight, setting("weight per m^2 of squared distance to the straight leg")] = 0.0
    clearance: Annotated[
        Weight,
        setting("weight per metre short of the margin, per metre flown within a gate"),
    ] = 2000.0
    caution: Annotated[
        Weight,
        setting(
            "weight of the probability that a gate known only from nearby turns out to be out of"
            " reach, as a share of crash, see known_from"
        ),
    ] = 0.0
    time_to_go: Annotated[
        Weight,
        setting(
            "weight per metre that a point mass flies, on average, in the time that it still takes"
            " to the finish"
        ),
    ] = 0.0
    desired_speed: Annotated[
        float,
        setting("desired horizontal speed of the speed term", unit="m/s", ge=0, le=100),
    ] = 9.0
    waypoint_radius: Annotated[
        float,
        setting(
            "distance to a gate's exit within which samples are rewarded", unit="m", gt=0, le=100
        ),
    ] = 0.5
    margin: Annotated[
        float,
        setting("desired distance to the frame within a gate", unit="m", ge=0, le=10),
    ] = 0.25
    margin_share: Annotated[
        float,
        setting("upper limit of the margin, as a share of half the free opening", ge=0, le=1),
    ] = 0.5
    opening: Annotated[
        float,
        setting("share of the opening to whose nearest point progress is measured", ge=0, le=1),
    ] = 0.0

    def __post_init__(self) -> None:
        check_fields(self)


def off_leg(x_next, gate):
    """Return the vector from the nearest point of the straight leg to the sample.  (3,)

    The leg ends at the gate's exit and leads along (ex, ey, ez).
    """
    dx, dy, dz = off_exit(x_next.position, gate)
    along = minimum(maximum(dx * gate.ex + dy * gate.ey + dz * gate.ez, -gate.leg), 0.0)
    return dx - along * gate.ex, dy - along * gate.ey, dz - along * gate.ez


def to_exit(x_next, gate):
    """Return the square of the distance to the gate's exit [m^2]."""
    dx, dy, dz = off_exit(x_next.position, gate)
    return dx * dx + dy * dy + dz * dz


def reached(x, x_next, u, gate, p):
    """Return whether the step passes the gate."""
    return at_gate(x, x_next, gate).reached


def crashes(x, x_next, u, gate, p):
    """Return whether the step touches the gate's frame, or leaves the room before the finish."""
    out_of_room = leaves_room(x, x_next, p)
    before_finish = gate.free_y < RUN_OUT
    return at_gate(x, x_next, gate).clipped | (out_of_room & before_finish)


def progress(x, x_next, u, gate, p):
    """Return the remaining distance to fly: to the gate, and from there to the finish [m].

    The distance is measured to the nearest point of the opening within the margin. For a sample
    that is beside the frame, or behind the exit and has not passed the gate, the way leads through
    a point in front of the gate.
    """
    place = in_gate(x_next.position, gate)
    has_missed = (place.along > 0.0) | is_beside(place, gate)
    along = where(has_missed, place.along + gate.approach, place.along)

    # In front of the gate, lateral offsets within this part of the opening do not count.
    off_left = maximum(abs(place.left) - p.opening * (gate.free_y - gate.margin), 0.0)
    off_up = maximum(abs(place.up) - p.opening * (gate.free_z - gate.margin), 0.0)
    left = where(has_missed, place.left, off_left)
    up = where(has_missed, place.up, off_up)

    way = sqrt(along * along + left * left + up * up + 1e-6) + where(has_missed, gate.approach, 0.0)
    return where(at_gate(x, x_next, gate).reached, 0.0, way) + gate.to_go


def heading(x, x_next, u, gate, p):
    """Return 1 - cos of the angle between the horizontal velocity and the bearing to the gate."""
    dx, dy, _ = off_exit(x_next.position, gate)
    v_xy = sqrt(x_next.vx * x_next.vx + x_next.vy * x_next.vy + 1e-6)
    d_xy = sqrt(dx * dx + dy * dy + 1e-6)
    far = to_exit(x_next, gate) > AT_TARGET * AT_TARGET
    return where(far, 1.0 + (x_next.vx * dx + x_next.vy * dy) / (v_xy * d_xy), 0.0)


def height(x, x_next, u, gate, p):
    """Return the squared height difference to the leg [m^2]."""
    _, _, off_z = off_leg(x_next, gate)
    return off_z * off_z


def speed(x, x_next, u, gate, p):
    """Return the squared difference of horizontal and desired speed [(m/s)^2]."""
    off_speed = sqrt(x_next.vx * x_next.vx + x_next.vy * x_next.vy + 1e-6) - p.desired_speed
    return off_speed * off_speed


def stabilize(x, x_next, u, gate, p):
    """Return 1 - cos of the tilt."""
    return 2.0 * (x_next.qx * x_next.qx + x_next.qy * x_next.qy)


def waypoint(x, x_next, u, gate, p):
    """Return -1 near the gate's exit, else 0: a reward."""
    return -where(to_exit(x_next, gate) < p.waypoint_radius * p.waypoint_radius, 1.0, 0.0)


def path(x, x_next, u, gate, p):
    """Return the squared distance to the straight leg [m^2]."""
    off_x, off_y, off_z = off_leg(x_next, gate)
    return off_x * off_x + off_y * off_y + off_z * off_z


def clearance(x, x_next, u, gate, p):
    """Return the shortfall of the margin times the distance flown within the gate [m^2]."""
    step = at_gate(x, x_next, gate)
    missing = maximum(step.outside + gate.margin * step.span, 0.0)
    return where(step.within, missing, 0.0)


def kind_of(term: StepFunction) -> type[Term]:
    """Return the class of a term: the clearance counts the metres that a step flies."""
    return AmountTerm if term is clearance else Term


def margin_of(weights: RaceWeights) -> Margin:
    """Return the desired distance between vehicle and frame within a gate."""
    return Margin(wanted=weights.margin, share=weights.margin_share)


# Cached, as a race of several and a changed weight ask for the same value, which takes a second
@lru_cache(maxsize=32)
def map_value(
    course: Course, radius: float, margin: Margin, laps: int, mass: PointMass
) -> CourseValue:
    """Return the value of a course for the term `time_to_go`.

    Args:
        course: the course.
        radius: radius of the vehicle [m].
        margin: desired distance between vehicle and frame within a gate.
        laps: number of laps.
        mass: the vehicle as a point mass.
    """
    room = room_to_fly(course, radius, margin.wanted)
    rows, _ = targets(course, radius, margin, room, laps)
    return value_of_rows(rows, course.start.position, mass)


# The terms of a_0 to a_8; each has the name of its weight in RaceWeights.
RACE_TERMS = (progress, heading, height, speed, stabilize, crash, waypoint, path, clearance)
TERMS = tuple(term.__name__ for term in RACE_TERMS)


def race_cost(
    course: Course,
    radius: float,
    weights: RaceWeights,
    laps: int,
    sight: Sight | None = None,
    value: CourseValue | None = None,
) -> Cost:
    """Return the racing cost.

    Args:
        course: the course.
        radius: radius of the vehicle [m].
        weights: weights and parameters of the terms.
        laps: number of laps.
        sight: from where gates are known that stand off the map; None: they stand as mapped.
        value: of the map, see `map_value`; None: without the term `time_to_go`.
    """
    room = room_to_fly(course, radius, weights.margin)
    rows, first = targets(course, radius, margin_of(weights), room, laps)
    deepest = max(gate.frame_depth for gate in course.gates)
    still_in_gate = partial(is_inside, clear_of_frame(radius, deepest))
    cost = Cost(
        name="race",
        terms=tuple(kind_of(term)(term, getattr(weights, term.__name__)) for term in RACE_TERMS),
        row=GateTarget,
        targets=rows,
        params=RaceParams(
            desired_speed=weights.desired_speed,
            waypoint_radius=weights.waypoint_radius,
            opening=weights.opening,
            **room._asdict(),
        ),
        reached=reached,
        crash=crashes,
        obstacles=course_obstacles(course, radius),
        still_in_gate=still_in_gate,
    )

    if sight:
        cost = with_caution(cost, course.gates * laps, first, sight, weights.caution)
    if value:
        # Displaced gates may need other ways round the obstacles.
        if len(value.passages) != len(rows):
            value = value_of_rows(rows, course.start.position, value.mass)
        cost = with_time_to_go(cost, value, weights.time_to_go)

    if leads_beside_frames(course):
        cost = with_ways_round_frames(cost, course, radius, room, first)

    # A sample chooses among several rows only if obstacles add rows between gates.
    rows_between_gates = len(rows) > len(first) - 1
    if not rows_between_gates:
        return cost
    obstacles = obstacle_rows(course.obstacles, radius)
    return replace(cost, row_ahead=partial(row_ahead, still_in_gate, first, rows, obstacles))
