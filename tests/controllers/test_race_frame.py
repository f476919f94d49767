"""A gate's frame inside a rollout: what it hits, held against the referee, and how long it is
minded."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from race_cases import ALL, DT, EXIT, GAP, RADIUS, ROW, WIDTH, at, course, fly, gate, through

from quadsim.controllers.costs.frames import SAFETY_MARGIN
from quadsim.controllers.costs.race import RUN_OUT, race_cost
from quadsim.course import course_names, load_course
from quadsim.racing.referee import Referee
from quadsim.vehicle import load_vehicle, vehicle_names

MM = 1e-3
TURNED = [(0.0, 0.0, 0.0), (130.0, 0.0, 0.0), (-40.0, 25.0, 30.0)]  # yaw, pitch, roll [deg]
STEP = 38.0 * DT  # [m]


def beside(axis, offset):
    """Left and up: an offset along one, a little along the other."""
    return np.roll((offset, 0.1), axis)


@pytest.mark.parametrize("angles", TURNED)
@pytest.mark.parametrize("side", [-1.0, 1.0])
@pytest.mark.parametrize("axis", [0, 1])
@pytest.mark.parametrize("margin", [0.0, 0.2])
def test_a_millimetre_decides_and_the_margin_does_not(angles, side, axis, margin):
    """Free opening: half - radius - safety margin. Frame: half + width + radius + safety margin."""
    g = gate(5.0, 1.0, 20.0, *angles)
    cost, half = race_cost(course(g), RADIUS, replace(ALL, margin=margin), 1), g.opening[axis] / 2
    forth, back = [], []
    for edge in (half - GAP, half + WIDTH + GAP):
        for offset in (edge - MM, edge + MM):
            y, z = beside(axis, side * offset)
            for outcomes, points in (
                (forth, through(g, y, z)),
                (back, through(g, y, z, back=True)),
            ):
                _, rows, crashed = fly(cost, points)
                outcomes.append((rows[0], crashed[0]))
    assert forth == [(1, 0.0), (0, 1.0), (0, 1.0), (0, 0.0)]
    assert back == [(0, 1.0), (0, 1.0), (0, 1.0), (0, 0.0)]


@pytest.mark.parametrize("angles", TURNED)
@pytest.mark.parametrize("side", [-1.0, 1.0])
@pytest.mark.parametrize("axis", [0, 1])
def test_frame_is_hit_anywhere_in_its_depth(angles, side, axis):
    """By a step of a tenth of a millimetre, from a millimetre before the entry to one behind the
    exit."""
    g = gate(5.0, 1.0, 20.0, *angles)
    cost, half = race_cost(course(g), RADIUS, ALL, 1), g.opening[axis] / 2
    for offset, hits in (
        (half - GAP - MM, [0, 0, 0, 0, 0]),
        (half - GAP + MM, [0, 1, 1, 1, 0]),
        (half + WIDTH + GAP - MM, [0, 1, 1, 1, 0]),
        (half + WIDTH + GAP + MM, [0, 0, 0, 0, 0]),
    ):
        y, z = beside(axis, side * offset)
        ends = (-EXIT - MM, MM - EXIT, 0.0, EXIT - MM, EXIT + MM)
        assert [fly(cost, [at(g, s - 1e-4, y, z), at(g, s, y, z)])[2][0] for s in ends] == hits


@pytest.mark.parametrize("axis", [0, 1])
@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_slanted_step_over_the_whole_frame_counts_at_its_entry_and_its_exit(axis, side):
    """Steps of .4 m along the passage, at either plane .1 or .2 m off the edge of the free
    opening."""
    cost, edge = race_cost(ROW, RADIUS, ALL, 1), ROW.gates[0].opening[axis] / 2 - GAP
    crashed = {}
    for name, entry, leave in (
        ("free", -0.1, -0.2),
        ("late", -0.1, 0.1),
        ("early", 0.1, -0.1),
        ("beside", 0.1, 0.2),
    ):
        slope, middle = (leave - entry) / (2 * EXIT), edge + (leave + entry) / 2
        step = [
            at(ROW.gates[0], s, *np.roll((side * (middle + s * slope), 0.0), axis))
            for s in (-0.2, 0.2)
        ]
        crashed[name] = fly(cost, step)[2][0]
    assert crashed == {"free": 0.0, "late": 1.0, "early": 1.0, "beside": 1.0}


def test_backing_out_in_front_of_the_gate_past_a_bar_is_a_crash():
    cost, edge = race_cost(ROW, RADIUS, ALL, 1), 1.0 - GAP
    # .05 m beyond at the entry
    step = [(5.0 - EXIT + 0.1, edge - 0.05, 20.0), (5.0 - EXIT - 0.1, edge + 0.15, 20.0)]
    beside = [(x, y - 0.1, z) for x, y, z in step]
    assert [fly(cost, points)[2][0] for points in (step, beside)] == [1.0, 0.0]


def verdicts(one, radius, points):
    """Return what the referee calls for a vehicle of this radius: "hit", "pass" or "neither"."""
    referee = Referee(one, radius, 1, 9.0)
    events = [
        e
        for k, (a, b) in enumerate(pairwise(points))
        for e in referee.observe(k * DT, a, (k + 1) * DT, b)
    ]
    kinds = {e.kind for e in events}
    return next((kind for kind in ("hit", "pass") if kind in kinds), "neither")


@pytest.mark.slow
@pytest.mark.parametrize("slant", [0.0, 1.0])
def test_rollout_is_never_laxer_than_the_referee_and_at_most_the_safety_margin_stricter(slant):
    """Straight flights at 38 m/s at a tilted gate, up to 45 degrees aslant either way, at random
    places and phases."""
    rng, g = np.random.default_rng(0), gate(5.0, 1.0, 20.0, 40, 20, 15)
    one, seen = course(g, gate(500.0)), {}
    cost = race_cost(one, RADIUS, ALL, 1)
    for _ in range(120):
        y, z, phase = rng.uniform((-2.0, -2.0, 0.0), (2.0, 2.0, 1.0))
        way = np.array((1.0, *slant * rng.uniform(-1.0, 1.0, 2)))
        along = STEP * (np.arange(-3, 4) + phase - 0.5) / np.linalg.norm(way)
        points = [at(g, *(s * way + (0.0, y, z))) for s in along]
        is_hit, with_margin = (verdicts(one, r, points) for r in (RADIUS, RADIUS + SAFETY_MARGIN))
        _, rows, crashed = fly(cost, points)
        rollout = "hit" if crashed[-1] else "pass" if rows[-1] else "neither"
        assert rollout in (is_hit, with_margin)
        if is_hit == "hit" or slant == 0.0:
            assert rollout == with_margin
        seen[is_hit, rollout] = seen.get((is_hit, rollout), 0) + 1
    assert set(seen) == {
        ("hit", "hit"),
        ("pass", "pass"),
        ("pass", "hit"),
        ("neither", "neither"),
        ("neither", "hit"),
    }


@pytest.mark.parametrize("room", [1e-3, 0.01, 0.03, 0.05, 0.3])
def test_gate_that_is_wide_enough_for_the_referee_has_a_free_opening(room):
    """The safety margin is given up to half of the room on either side, so that the vehicle fits in
    the rollout too."""
    g = gate(5.0, opening=(2 * (RADIUS + room), 2.0))
    cost, free = race_cost(course(g), RADIUS, ALL, 1), max(room - SAFETY_MARGIN, room / 2)
    assert Referee(course(g), RADIUS, 1, 9.0).outcome is None
    assert [fly(cost, through(g, y, 0.0))[1:] for y in (free - 1e-5, free + 1e-5)] == [
        ([1], [0.0]),
        ([0], [1.0]),
    ]
    outside = RADIUS + room + WIDTH + GAP
    assert [fly(cost, through(g, y, 0.0))[2] for y in (outside - MM, outside + MM)] == [
        [1.0],
        [0.0],
    ]


@pytest.mark.parametrize("name", course_names())
def test_every_vehicle_has_a_free_opening_at_every_gate(name):
    c = load_course(name)
    for vehicle in vehicle_names():
        radius = load_vehicle(vehicle).radius
        if name in ("lsy_level2", "lsy_track") and vehicle == "archer":
            continue  # 0.38 m wide, for openings of 0.4 m
        targets = race_cost(c, radius, ALL, 1).targets
        for g, row in zip(c.gates, targets, strict=False):
            free = row[9:11]
            assert np.all(free >= 0.01 - 1e-12), vehicle
            assert np.all(free < np.array(g.opening) / 2 - radius), vehicle


def rows_ahead(cost, target, g, along, left, up, speed=1.0):
    """Index of the row that a rollout from a place at a gate begins with, at a speed along it."""
    x = np.concatenate([at(g, along, left, up), speed * g.rotation[:, 0]])
    return len(cost.targets) - len(cost.targets_from(target, x))


@pytest.mark.parametrize("angles", TURNED)
def test_gate_is_minded_from_its_plane_until_the_vehicle_is_clear_of_the_frame(angles):
    loop = course(gate(5.0, 1.0, 20.0, *angles), gate(10.0, 4.0), loop=True)
    cost, g = race_cost(loop, RADIUS, ALL, 2), loop.gates[0]
    for lap in (0, 2):
        rows = [rows_ahead(cost, lap + 1, g, s, -0.6, 0.4) for s in (-MM, MM, EXIT - MM, EXIT + MM)]
        assert rows == [lap + 1, lap, lap, lap + 1]
    beside_it = 1.0 + WIDTH + GAP
    assert rows_ahead(cost, 1, g, 0.1, MM - beside_it, 0.0) == 0
    assert rows_ahead(cost, 1, g, 0.1, beside_it + MM, 0.0) == 1
    # flying back into it
    assert rows_ahead(cost, 1, g, 0.1, 0.0, 0.0, speed=-1.0) == 1
    # nothing was passed yet
    last = loop.gates[1]
    assert rows_ahead(cost, 0, g, 0.1, 0.0, 0.0) == 0
    assert rows_ahead(cost, 0, last, RUN_OUT - 0.1, 0.0, 0.0) == 0
    # over the finish
    assert [rows_ahead(cost, t, last, 0.1, 0.0, 0.0) for t in (4, 99)] == [3, 3]
    assert [rows_ahead(cost, t, last, 0.2, 0.0, 0.0) for t in (4, 99)] == [4, 4]


@pytest.mark.parametrize("name", course_names())
def test_gate_just_passed_is_not_minded_on_the_way_into_the_next(name):
    """Also where one stands below the other, so that the way through the second crosses the plane
    of the first."""
    c = load_course(name)
    cost = race_cost(c, 0.14, ALL, 1)
    for target, g in enumerate(c.gates):
        assert [rows_ahead(cost, target, g, s, 0.0, 0.0) for s in np.linspace(-0.5, 0.0, 26)] == [
            target
        ] * 26


def test_sinking_onto_the_lower_bar_of_a_gate_just_passed_is_a_crash():
    """The referee counts the pass at the plane; the bar still lies below the vehicle."""
    cost, bottom = race_cost(ROW, RADIUS, ALL, 1), 20.0 - 0.8 + GAP
    sink = [(5.01 + 0.03 * k, 0.0, bottom + 0.03 - 0.02 * k) for k in range(10)]
    fast = [(x, y, z + 0.1) for x, y, z in sink]  # clear of the frame before it is as low
    x = np.array([*sink[0], 1.0, 0.0, 0.0])
    ahead = replace(cost, targets=cost.targets_from(1, x, np.float64))
    assert [fly(ahead, points)[2][-1] for points in (sink, fast)] == [1.0, 0.0]
    assert [fly(ahead, points)[1][-1] for points in (sink, fast)] == [0, 1]
    blind = replace(cost, targets=cost.targets[1:])
    assert fly(blind, sink)[2][-1] == 0.0
