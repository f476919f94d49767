"""Laws of the time-optimal race: closed forms, the costate, and checks that find what is wrong."""

from dataclasses import replace
from math import sqrt

import numpy as np
import pytest
from limit_cases import HALL, without_lag

from quadsim.course import Course, Gate, Start
from quadsim.course.swept import SweptGate
from quadsim.dynamics.quadrotor import ATTITUDE
from quadsim.limit.detours import detours
from quadsim.limit.dynamics import YAW_MAX, dynamics
from quadsim.limit.guess import solved, straight
from quadsim.limit.solve import solve
from quadsim.limit.task import Task, Waypoint, race_task, room, segments
from quadsim.limit.verify import verify
from quadsim.race.referee import Referee
from quadsim.record.limits import Limit
from quadsim.vehicle import GRAVITY, load_vehicle

SWIFT = load_vehicle("swift")
GATES = tuple(
    Gate((x, 0.0, z), 0.0, 0.0, 0.0, (1.5, 1.5), 0.275) for x, z in ((5.0, 1.5), (11.0, 2.5))
)
COURSE = Course(
    "two",
    "",
    GATES,
    Start((0.0, 0.0, 1.5), 0.0),
    ((-5.0, 20.0), (-5.0, 5.0), (0.0, 6.0)),
    False,
    1,
    (),
    "",
)


def raced(vehicle=SWIFT, model="rotors", intervals=16):
    """(solution, model, referee) of the two gates."""
    task, flown = race_task(COURSE, vehicle.radius, 1), dynamics(vehicle, model)
    found = solve(task, flown, [intervals] * 2, straight(task, flown, 6.0))
    return found, flown, Referee(COURSE, vehicle.radius, 1, 100.0)


@pytest.fixture(scope="module")
def race():
    return raced()[:2]


def referee():
    return Referee(COURSE, SWIFT.radius, 1, 100.0)


def test_straight_up_takes_what_full_thrust_takes():
    """h = (T / m - g) t^2 / 2 for rotors without lag."""
    model = without_lag(0.8, (1e-3, 1e-3, 2e-3), 0.2, 0.02, 5.0, (10.0, 10.0, 4.0), (0.0, 0.0, 0.0))
    task = Task((Waypoint((0.0, 0.0, 6.0), 1e-4),), Start((0.0, 0.0, 1.0), 0.0), HALL)
    solution = solve(task, model, [10], straight(task, model, 5.0))
    assert solution.time == pytest.approx(sqrt(2 * 5.0 / (4 * 5.0 / 0.8 - GRAVITY)), rel=1e-4)


def test_a_margin_narrows_openings_and_in_small_ones_takes_half_of_the_room():
    def of(margin):
        return room(GATES[0], race_task(COURSE, SWIFT.radius, 1, margin=margin))

    np.testing.assert_allclose(np.subtract(of(0.0), of(0.1)), 0.1)
    np.testing.assert_allclose(of(10.0), np.array(of(0.0)) / 2)


def test_a_reserve_is_left_of_the_thrust_and_of_yaw_and_only_the_rate_model_has_one():
    all_of_it, some = dynamics(SWIFT, "rates"), dynamics(SWIFT, "rates", reserve=0.1)
    np.testing.assert_allclose(some.u_high[3], 0.9 * all_of_it.u_high[3])
    np.testing.assert_array_equal(some.u_high[:2], all_of_it.u_high[:2])
    assert some.u_high[2] == -some.u_low[2] == YAW_MAX < all_of_it.u_high[2]
    with pytest.raises(ValueError, match="--model rates"):
        dynamics(SWIFT, "rotors", reserve=0.1)


@pytest.mark.parametrize("model", ["rotors", "rates"])
def test_a_race_holds_to_the_referee(model):
    solution, flown, judge = raced(model=model)
    found = verify(solution, flown, judge)
    assert found.broken == []
    assert [e.kind for e in found.events] == ["pass", "pass"]
    assert found.events[-1].t == pytest.approx(solution.time, abs=1e-4)


def test_the_time_left_falls_by_one_second_a_second_along_the_solution(race):
    """costate . x' = -1: the Hamiltonian of a problem of least time is constant."""
    solution, model = race
    slopes = [
        c @ np.array(model.rate(x, u))
        for c, x, u in zip(solution.costate, solution.x[1:], solution.u, strict=False)
    ]
    assert np.median(slopes) == pytest.approx(-1.0, abs=0.03)


def test_a_solution_that_is_played_too_fast_is_found_out(race):
    solution, model = race
    fast = replace(solution, t=0.97 * solution.t)
    assert any("finely integrated" in line for line in verify(fast, model, referee()).broken)


def test_an_attitude_that_is_not_of_unit_length_is_found_out(race):
    solution, model = race
    x = solution.x.copy()
    x[:, ATTITUDE] *= 1.02
    assert any(
        "attitude" in line for line in verify(replace(solution, x=x), model, referee()).broken
    )


def test_controls_beyond_the_rotors_are_found_out(race):
    solution, model = race
    assert any(
        "controls" in line for line in verify(replace(solution, u=1.05 * solution.u), model).broken
    )


def test_a_path_through_a_frame_is_found_out(race):
    solution, model = race
    x = solution.x.copy()
    x[:, 1] += 0.8
    assert any(
        "hit at gate 1" in line for line in verify(replace(solution, x=x), model, referee()).broken
    )


def test_more_thrust_is_faster_and_lag_slower(race):
    weak = raced(replace(SWIFT, rotors=replace(SWIFT.rotors, omega_max=2200.0)))[0]
    slow = raced(replace(SWIFT, rotors=replace(SWIFT.rotors, tau=0.08)))[0]
    assert weak.time > race[0].time + 0.01
    assert slow.time > race[0].time + 0.01


def test_a_vehicle_without_rotors_flies_by_its_rates():
    with pytest.raises(ValueError, match="--model: paper has no rotors: take rates"):
        dynamics(load_vehicle("paper"), "rotors")


def test_a_u_turn_behind_a_gate_goes_around_its_frame():
    """The straight way back leads through the gate's upper bar; the race around it is slower, and
    free of it."""
    low = Gate((3.0, 0.0, 1.5), 0.0, 0.0, 0.0, (1.5, 1.5), 0.275)
    back = Gate((-1.0, 0.0, 3.2), np.pi, 0.0, 0.0, (1.5, 1.5), 0.275)
    end, model = Task((low, back), COURSE.start, HALL, SWIFT.radius), dynamics(SWIFT, "rotors")
    solution = solve(end, model, [20, 20], straight(end, model, 4.0))
    plan, hits = segments(end, [20, 20]), touched(solution, low)
    assert hits
    around = tuple(detours(solution, plan, end, [(hits[0], low)]))
    freed = solve(end, model, [20, 20], solved("again", solution, end), around=around)
    assert touched(freed, low) == []
    assert freed.time > solution.time


def touched(solution, gate):
    """When the path between nodes touches the frame [s]."""
    swept = SweptGate(gate, 0, SWIFT.radius)
    limit = Limit("", "", 1, False, [], {}, solution).path(1000.0)
    local = [gate.to_local(tuple(p)) for p in limit[:, 1:]]
    return [
        t
        for t, a, b in zip(limit[:, 0], local, local[1:], strict=False)
        if swept.touch(a, b) is not None
    ]
