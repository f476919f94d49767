"""Each term of the racing cost, eq. (8), by its name and its weight. Its gates are in
test_race_gates."""

from dataclasses import replace
from math import cos, radians, sin

import numpy as np
import pytest
from race_cases import ALL, EXIT, GAP, ONLY, RADIUS, ROW, course, fly, gate, state, term

from quadsim.controllers.costs import evaluate
from quadsim.controllers.costs.race import TERMS, race_cost


@pytest.mark.parametrize("name", TERMS)
def test_weight_scales_its_term_alone(name):
    base, double = (
        race_cost(ROW, RADIUS, w, 1) for w in (ALL, replace(ALL, **{name: 2 * getattr(ALL, name)}))
    )
    tilted = (cos(0.2), sin(0.2), 0.0, 0.0)
    at = {"waypoint": (4.8, 0.1, 20.1), "clearance": (5.0, 0.7, 20.1)}.get(name, (2.0, 0.7, 20.5))
    x, x_next = state(at, (3.0, 1.0, 0.5), tilted), state(np.add(at, 0.01), (3.0, 1.0, 0.5), tilted)
    plain, scaled = (
        np.array(
            [
                float(t)
                for t in evaluate(
                    c, x, x_next, (0.0,) * 4, c.targets[0], crashed=1.0
                ).terms.values()
            ]
        )
        for c in (base, double)
    )
    k = TERMS.index(name)
    assert plain[k] != 0.0
    weighs = np.arange(len(TERMS)) == k
    np.testing.assert_allclose(
        scaled / np.where(plain, plain, 1.0), np.where(weighs, 2.0, plain != 0.0)
    )


def test_cost_does_not_depend_on_where_the_course_lies_or_points():
    turn, shift = radians(70.0), np.array([30.0, -40.0, 15.0])
    R = np.array([[cos(turn), -sin(turn), 0.0], [sin(turn), cos(turn), 0.0], [0.0, 0.0, 1.0]])

    def moved(g):
        return replace(g, position=tuple(R @ g.position + shift), yaw=g.yaw + turn)

    here = course(gate(5.0, 0.5, 21.0, 10, 5, 20), gate(9.0, -1.0, 19.5, -30, 0, 0))
    there = course(*map(moved, here.gates), start=tuple(R @ here.start.position + shift))
    idle = np.ones(len(TERMS), bool)
    for seed in (0, 6, 16):
        steps = np.random.default_rng(seed).normal((0.1, 0.0, 0.01), 0.05, (120, 3))
        points = np.cumsum([(0.0, 0.0, 20.0), *steps], axis=0)
        a, b = (
            fly(race_cost(here, RADIUS, ALL, 1), points),
            fly(race_cost(there, RADIUS, ALL, 1), points @ R.T + shift),
        )
        np.testing.assert_allclose(a[0], b[0], atol=1e-9)
        assert a[1:] == b[1:]
        idle &= ~a[0].any(axis=0)
    # these flights are level
    assert [name for name, i in zip(TERMS, idle, strict=True) if i] == ["stabilize"]


def test_heading_is_least_towards_the_gate():
    cost = race_cost(ROW, RADIUS, ONLY["heading"], 1)
    bearings = {0: 0.0, 60: 0.5, -90: 1.0, 180: 2.0}
    for degrees, expected in bearings.items():
        v = (8 * cos(radians(degrees)), 8 * sin(radians(degrees)), 3.0)
        assert term("heading", cost, (0, 0, 20), v) == pytest.approx(expected, abs=1e-6)
    away = [term("heading", cost, (5 + EXIT - d, 0, 20), (-8.0, 0.0, 0.0)) for d in (0.51, 0.49)]
    # half a metre before the exit it counts no more
    assert away == pytest.approx([2.0, 0.0], abs=1e-5)


def test_height_is_least_on_the_leg_and_path_is_the_distance_from_it():
    slope = race_cost(
        course(gate(3.0 - EXIT, 0.0, 24.0)), RADIUS, replace(ONLY["height"], path=1.0), 1
    )
    on_leg, above, aside, before = (1.5, 0, 22), (1.5, 0, 22.5), (1.5, 0.5, 22), (-3, 0, 20)
    assert [term("path", slope, p) for p in (on_leg, aside, before)] == pytest.approx(
        [0.0, 0.25, 9.0]
    )
    assert [term("height", slope, p) for p in (on_leg, aside, before)] == pytest.approx(
        [0.0, 0.0, 0.0]
    )
    assert 0.0 < term("height", slope, above) < 0.25
    level = race_cost(ROW, RADIUS, ONLY["height"], 1)
    assert term("height", level, (2.0, 1.0, 20.5)) == pytest.approx(0.25)


def test_speed_is_least_at_the_desired_horizontal_speed():
    cost = race_cost(ROW, RADIUS, ONLY["speed"], 1)
    speeds = [(9.0, 0.0, 0.0), (5.4, -7.2, 4.0), (6.0, 0.0, 0.0), (0.0, 0.0, 9.0)]
    assert [term("speed", cost, (0, 0, 20), v) for v in speeds] == pytest.approx(
        [0.0, 0.0, 9.0, 81.0], abs=0.02
    )


def test_stabilize_is_one_minus_the_cosine_of_the_tilt():
    cost = race_cost(ROW, RADIUS, ONLY["stabilize"], 1)
    c, s = cos(radians(30)), sin(radians(30))
    level, yawed, pitched, rolled = (1, 0, 0, 0), (c, 0, 0, s), (c, 0, s, 0), (c, s, 0, 0)
    terms = [term("stabilize", cost, (0, 0, 20), q=q) for q in (level, yawed, pitched, rolled)]
    assert terms == pytest.approx([0.0, 0.0, 0.5, 0.5])


def test_waypoint_rewards_each_step_near_the_centre():
    cost = race_cost(ROW, RADIUS, ONLY["waypoint"], 1)
    assert [term("waypoint", cost, (5 + EXIT - d, 0, 20)) for d in (0.0, 0.49, 0.51)] == [
        -1.0,
        -1.0,
        0.0,
    ]


STEP = 1e-3  # [m] along the passage


def paid(cost, points):
    """Return the cost of clearance of a flight along these points."""
    return fly(cost, points)[0][:, TERMS.index("clearance")]


def test_clearance_is_what_is_short_of_the_margin_at_the_nearest_bar_within_a_gate_alone():
    margin = 0.25
    cost = race_cost(ROW, RADIUS, replace(ONLY["clearance"], margin=margin), 1)
    free_y, free_z = 1.0 - GAP, 0.8 - GAP  # half the opening of 2 x 1.6 m
    wanted = {
        (0.0, free_y - margin, 0.0): 0.0,
        (0.0, free_y - 0.1, 0.0): margin - 0.1,
        (0.0, 0.0, 0.05 - free_z): margin - 0.05,
        (0.0, free_y - 0.1, free_z - 0.2): margin - 0.1,  # the nearer bar's, no sum
        (2 * STEP - EXIT, free_y - 0.1, 0.0): margin - 0.1,
        (EXIT - STEP, free_y - 0.1, 0.0): margin - 0.1,
        (-EXIT - STEP, free_y - 0.1, 0.0): 0.0,
        (EXIT + 2 * STEP, free_y - 0.1, 0.0): 0.0,
        (0.0, 3.0, 0.0): 0.0,  # beside the frame
    }
    at = {offset: np.add((5.0, 0.0, 20.0), offset) for offset in wanted}
    found = {offset: paid(cost, [p - (STEP, 0.0, 0.0), p])[0] / STEP for offset, p in at.items()}
    assert found == pytest.approx(wanted, abs=1e-9)


@pytest.mark.parametrize("step", [0.02, 0.1, 0.5])
def test_clearance_is_paid_per_metre_flown_at_any_speed(step):
    cost = race_cost(ROW, RADIUS, replace(ONLY["clearance"], margin=0.25), 1)
    whole = []
    for first in np.arange(0.0, step, 0.005):  # wherever steps begin
        points = [(x, 1.0 - GAP - 0.1, 20.0) for x in np.arange(4.0 + first, 6.5, step).tolist()]
        whole.append(paid(cost, points).sum())
    # the step that leaves counts whole
    assert np.mean(whole) == pytest.approx((2 * EXIT + step) * 0.15, rel=0.02)
    assert min(whole) > 0.0
