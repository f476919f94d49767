"""The way to a gate: it leads on from every free place around the frames of a course."""

from __future__ import annotations

from dataclasses import replace
from itertools import product
from typing import Any

import numpy as np
import pytest
from race_cases import ALL, ONLY, RADIUS, WIDTH, course, gate, term

from quadsim.controllers.costs.frames import ObstacleRow, course_obstacles
from quadsim.controllers.costs.race import race_cost
from quadsim.controllers.costs.race_step import in_gate
from quadsim.controllers.costs.race_targets import GateTarget
from quadsim.controllers.costs.round_frame import (
    BLOCKED,
    PASSABLE,
    leads_beside_frames,
    way_to_gate,
)
from quadsim.course import course_names, load_course
from quadsim.course.opening import InGate

SPACING = 0.1  # [m] of the places that are looked at
OPENING = (1.6, 1.6)


def ladder(gap, z=10.0):
    """Return two gates, one above the other, with a gap between their frames [m]."""
    above = z + OPENING[1] + 2 * WIDTH + gap
    return course(gate(5.0, z=z, opening=OPENING), gate(5.0, z=above, opening=OPENING))


def rows_of(flown) -> list[Any]:
    """Return the target rows of a course, as records."""
    cost = race_cost(flown, RADIUS, ALL, 1)
    return [cost.row(*row) for row in cost.targets]


def are_free(flown, places):
    """Return whether a vehicle at each of these places touches no frame."""
    obstacles = course_obstacles(flown, RADIUS)
    free = np.ones(places[0].shape, bool)
    for row in obstacles.rows:
        free &= ~obstacles.touches(places, places, ObstacleRow(*row))
    return free


def dive():
    """Return a gate that is flown straight down, and a level one some metres ahead."""
    steep = gate(-3.0, z=16.0, pitch=90, opening=OPENING)
    return course(steep, gate(5.0, z=12.0, opening=OPENING))


@pytest.mark.parametrize("flown", [ladder(0.1), ladder(0.4), ladder(0.9), dive()])
def test_no_place_around_a_ladder_or_behind_a_steep_gate_is_a_trap(flown):
    """A place beside each free place is nearer to the second gate, except in its opening."""
    _, target, _ = rows_of(flown)
    axes = [np.arange(low, high, SPACING) for low, high in ((3.03, 7.0), (-2.6, 2.5), (8.07, 14.5))]
    places = tuple(np.meshgrid(*axes, indexing="ij"))
    way = way_to_gate(in_gate(places, target), target, ALL.opening)
    way = np.where(are_free(flown, places), way, np.inf)

    nearest = np.full_like(way[1:-1, 1:-1, 1:-1], np.inf)
    for ahead in product(range(3), repeat=3):
        shifted = zip(ahead, way.shape, strict=True)
        beside = way[tuple(slice(n, n + size - 2) for n, size in shifted)]
        nearest = np.minimum(nearest, beside)
    ends = np.argwhere(np.isfinite(nearest) & (nearest >= way[1:-1, 1:-1, 1:-1])) + 1
    assert len(ends)
    for end in ends:
        place = in_gate([axis[n] for axis, n in zip(axes, end, strict=True)], target)
        assert abs(place.along) < SPACING
        assert abs(place.left) < target.free_y
        assert abs(place.up) < target.free_z


def test_frames_without_room_between_them_are_one_for_the_way_round():
    half = OPENING[1] / 2 + WIDTH + RADIUS + 0.02
    room = PASSABLE * (RADIUS + 0.02)
    below, above, _ = rows_of(ladder(room - 0.01))
    both = 2 * OPENING[1] + 4 * WIDTH + room - 0.01
    assert below.round_up == pytest.approx(both - half + 2 * (RADIUS + 0.02))
    assert (below.round_up, below.round_down) == pytest.approx((above.round_down, above.round_up))
    assert below.round_down == below.round_left == pytest.approx(half)
    below, above, _ = rows_of(ladder(room + 0.01))
    assert below.round_up == above.round_down == pytest.approx(half)


def test_from_behind_a_ladder_the_way_leads_back_through_the_gate_before():
    _, above, _ = rows_of(ladder(0.1))
    apart = OPENING[1] + 2 * WIDTH + 0.1
    assert (above.last_left, above.last_up) == pytest.approx((0.0, -apart))
    assert (above.last_y, above.last_z) == pytest.approx((0.68, 0.68))  # less radius and margin

    def way(along, left, up):
        return way_to_gate(InGate(along, left, up), above, 1.0)

    back = [way(along, 0.0, -apart) for along in np.linspace(-0.3, 2.0, 8)]
    assert np.all(np.diff(back) > 0)
    beside = above.last_y + 0.01  # behind the bars
    assert way(1.0, beside + 0.3, -apart) < way(1.0, beside, -apart)


def test_only_courses_with_ladders_or_steep_gates_count_the_way_round_frames():
    turned = course(gate(5.0, z=10.0), gate(5.0, z=12.7, yaw=90))
    again = course(gate(5.0, z=10.0), gate(5.0, z=10.0))
    split_s = course(gate(5.0, z=12.7), gate(5.0, z=10.0, yaw=180))
    apart = course(gate(5.0, z=12.7), gate(7.0, z=10.0))
    for flown in (turned, again, split_s, apart):
        assert not leads_beside_frames(flown)
        assert race_cost(flown, RADIUS, ALL, 1).row is GateTarget
    assert leads_beside_frames(ladder(0.1))
    assert leads_beside_frames(dive())
    assert not leads_beside_frames(course(gate(5.0, pitch=30), gate(15.0)))
    lower, upper = ladder(0.1).gates
    round_the_end = course(upper, gate(50.0), lower)
    assert not leads_beside_frames(round_the_end)
    assert leads_beside_frames(replace(round_the_end, loop=True))
    for name in course_names():
        assert not leads_beside_frames(load_course(name)), name


@pytest.mark.parametrize("opening", [0.5, 1.6])
def test_a_plan_gains_by_passing_the_first_gate_of_a_ladder(opening):
    """From all places behind its opening less is left than at its exit."""
    apart = opening + 2 * WIDTH + 0.1
    low = gate(5.0, z=10.0, opening=(opening, opening))
    flown = course(low, replace(low, position=(5.0, 0.0, 10.0 + apart)))
    cost = race_cost(flown, RADIUS, ONLY["progress"], 2)
    end = GateTarget(*cost.targets[0][: len(GateTarget._fields)])
    for y in np.linspace(-opening, opening, 9) / 2.0:
        assert term("progress", cost, (end.x + 0.02, y, end.z), row=1) < end.to_go + 0.03


def test_no_way_leads_between_a_frame_and_the_ground():
    for z, is_blocked in ((1.2, True), (1.7, False)):
        below, above, _ = rows_of(ladder(0.1, z))
        assert (below.round_down > BLOCKED) == (above.round_down > BLOCKED) == is_blocked
