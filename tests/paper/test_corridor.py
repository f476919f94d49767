"""The corridor: its walls, its cost, its referee."""

import numpy as np
import pytest

from quadsim.controllers.costs import evaluate
from quadsim.paper.car import CarControl, CarState
from quadsim.paper.corridor import STUCK, ZIGZAG, Corridor, DriveReferee
from quadsim.paper.corridor_cost import RUN_OUT, CorridorWeights, corridor_cost

# one bend, 90 degrees left
CORNER = Corridor(width=6.0, points=((0.0, 0.0), (20.0, 0.0), (20.0, 20.0)))
COST = corridor_cost(CORNER, half_width=0.8, dt=0.02, weights=CorridorWeights(margin=0.5))


def at(px, py, v=5.0, r=0.0):
    return CarState(px, py, hx=1.0, hy=0.0, v=v, r=r, steer=0.0, drive=0.0)


def terms(x, leg=0):
    found = evaluate(COST, x, x, CarControl(0.0, 0.0), COST.targets[leg])
    return found.terms | {"reached": found.reached}


def driven(*places, referee=None, dt=0.1):
    referee = referee or DriveReferee(CORNER, 0.8, 60.0)
    for i, place in enumerate(places, start=1):
        referee.observe(i * dt, np.array(place))
    return referee


def test_every_leg_of_the_zigzag_is_longer_than_its_bends_take():
    directions = ZIGZAG.directions
    turns = np.arccos((directions[1:] * directions[:-1]).sum(axis=1))
    np.testing.assert_allclose(np.degrees(turns), [112, 101, 101, 101], atol=0.6)
    mitre = 0.5 * ZIGZAG.width * np.tan(turns / 2)  # taken from both legs of a bend [m]
    assert np.all(ZIGZAG.lengths > np.append(mitre, 0) + np.insert(mitre, 0, 0))


def test_walls_run_beside_the_legs_and_meet_at_the_bend():
    left, right = CORNER.walls()
    np.testing.assert_allclose(left, [(0, 3), (17, 3), (17, 20)])
    np.testing.assert_allclose(right, [(0, -3), (23, -3), (23, 20)])


def test_the_way_left_falls_along_the_centre_line_and_a_leg_ends_where_the_walls_meet():
    legs = [(x, 0.0, 0) for x in range(0, 20, 2)] + [(20.0, y, 1) for y in range(1, 20, 2)]
    left = [terms(at(x, y), leg)["to_go"] for x, y, leg in legs]
    assert np.all(np.diff(left) < 0)
    assert left[0] - left[-1] == pytest.approx(CorridorWeights.to_go * 39.0, rel=1e-3)
    assert not terms(at(16.9, 2.9))["reached"]
    assert terms(at(17.1, 3.1))["reached"], "on the inside of the bend the leg ends earlier"
    assert COST.targets[-2, 6] == RUN_OUT


def test_crossing_into_the_next_leg_never_costs_more():
    for s in np.linspace(-4, 4, 9):
        x = at(20 + s, -s)  # on the line that halves the bend
        assert terms(x, 1)["to_go"] <= terms(x, 0)["to_go"] + 1e-6


def test_wall_costs_by_the_metre_travelled_from_the_margin_on():
    inside, margin, wall, beyond = (terms(at(5.0, y))["lethal"] for y in (1.69, 1.95, 2.2, 3.2))
    assert inside == 0.0 < margin < wall < beyond
    assert wall == pytest.approx(CorridorWeights.lethal * 5.0 * 0.02)
    assert beyond == pytest.approx(3 * wall)
    assert terms(at(5.0, 2.2, v=10.0))["lethal"] == pytest.approx(2 * wall)
    assert terms(at(5.0, 2.2, v=0.0))["lethal"] == 0.0, "standing still is safe"


def test_rollover_and_speed_count_only_what_is_above_their_limits():
    w = CorridorWeights()
    calm = terms(at(5, 0, v=w.speed_max, r=w.lateral_max / w.speed_max))
    assert calm["rollover"] == pytest.approx(0.0, abs=1e-12)
    assert calm["speed"] == 0.0
    wild = terms(at(5, 0, v=8.0, r=-0.75))  # 6 m/s^2
    assert wild["rollover"] == pytest.approx(w.rollover * 8 * 0.02 * (6 - w.lateral_max) ** 2)
    assert wild["speed"] == pytest.approx(w.speed * 8 * 0.02 * (8 - w.speed_max) ** 2)


def test_referee_sees_the_goal_the_wall_and_each_bend():
    along = [(x, 0.0) for x in range(2, 20, 2)]
    up = [(20.0, y) for y in range(1, 20, 2)]
    assert driven(*along).outcome is None
    assert driven(*along, *up).legs == 1
    assert driven(*along, *up, (20.0, 20.5)).outcome == "finished"
    assert driven((5.0, 2.1)).outcome is None
    assert driven((5.0, 2.3)).outcome == "crashed", "the vehicle's side is .8 m from its middle"
    assert driven(*along, (20.0, 1.0), (17.7, 2.0)).outcome == "crashed", "the wall of the next leg"


def test_referee_ends_a_drive_that_stands_or_lasts():
    standing = [(2.0, 0.0)] * round(STUCK / 0.1 + 2)
    assert driven(*standing[:-4]).outcome is None
    assert driven(*standing).outcome == "stuck"
    creeping = [(0.05 * i, 0.0) for i in range(100)]
    assert driven(*creeping).outcome is None
    assert driven(*creeping, referee=DriveReferee(CORNER, 0.8, 9.0)).outcome == "timeout"
