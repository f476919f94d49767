"""Laws of the time-optimal race: closed forms, the costate, and checks that find what is wrong."""

from dataclasses import replace
from itertools import pairwise
from math import pi, sqrt

import numpy as np
import pytest

from quadsim.course import Course, Gate, Start
from quadsim.course.swept import SweptGate
from quadsim.dynamics.quadrotor import ATTITUDE, VELOCITY
from quadsim.limit.detours import Hit, detours
from quadsim.limit.dynamics import YAW_MAX, dynamics
from quadsim.limit.guess import solved, straight
from quadsim.limit.limits import LimitProblem, StoredSolution
from quadsim.limit.replay import referee_of
from quadsim.limit.route import PAST, Route, segments
from quadsim.limit.solve import solve
from quadsim.limit.verify import Verified, verify
from quadsim.vehicle import GRAVITY, load_vehicle
from tests.limit.limit_cases import HALL, without_lag

# The optimiser takes a second or more for each solution.
optimised = pytest.mark.compiled
SWIFT = load_vehicle("swift")
OPENING = {"opening": (1.5, 1.5), "frame_width": 0.275}
COURSE = Course(
    name="two",
    source="",
    gates=(
        Gate((5.0, 0.0, 1.5), 0.0, 0.0, 0.0, **OPENING),
        Gate((11.0, 0.0, 2.5), 0.0, 0.0, 0.0, **OPENING),
    ),
    start=Start((0.0, 0.0, 1.5), 0.0),
    bounds=((-5.0, 20.0), (-5.0, 5.0), (0.0, 6.0)),
    loop=False,
    laps=1,
    published=(),
    text="",
)


# Intervals on the way to each of two gates
MESH = [10, 10]


def problem(vehicle=SWIFT, model="rotors"):
    return LimitProblem(COURSE, vehicle, 1, model)


def raced(vehicle=SWIFT, model="rotors"):
    """(solution, model) of the two gates."""
    route, flown = Route.of(problem(vehicle)), dynamics(vehicle, model)
    return solve(route, flown, MESH, straight(route.points, flown, 6.0)), flown


@pytest.fixture(scope="module")
def race():
    return raced()


@pytest.fixture(scope="module")
def race_by_rates():
    return raced(model="rates")


def broken(solution, model):
    """The subjects of the lines that say what is wrong with a changed solution."""
    lines = verify(solution, model, referee_of(problem())).broken
    return {line.partition(":")[0] for line in lines}


@optimised
def test_straight_up_takes_what_full_thrust_takes():
    """h = (T / m - g) t^2 / 2 for rotors without lag."""
    model = without_lag(0.8, (1e-3, 1e-3, 2e-3), 0.2, 0.02, 5.0, (10.0, 10.0, 4.0), (0.0, 0.0, 0.0))
    upward = Gate((0.0, 0.0, 6.0), 0.0, -pi / 2, 0.0, (1.0, 1.0), 0.1)
    route = Route((upward,), Start((0.0, 0.0, 1.0), 0.0), HALL)
    solution = solve(route, model, [10], straight(route.points, model, 5.0))
    height = 5.0 + PAST
    assert solution.time == pytest.approx(sqrt(2 * height / (4 * 5.0 / 0.8 - GRAVITY)), rel=1e-4)


def test_a_margin_narrows_openings_and_in_small_ones_takes_half_of_the_room():
    def room(margin):
        return Route.of(replace(problem(), margin=margin)).room(COURSE.gates[0])

    np.testing.assert_allclose(np.subtract(room(0.0), room(0.1)), 0.1)
    np.testing.assert_allclose(room(10.0), np.array(room(0.0)) / 2)


def test_a_reserve_is_left_of_the_thrust_and_of_yaw_and_only_the_rate_model_has_one():
    all_of_it, some = dynamics(SWIFT, "rates"), dynamics(SWIFT, "rates", reserve=0.1)
    np.testing.assert_allclose(some.u_high[3], 0.9 * all_of_it.u_high[3])
    np.testing.assert_array_equal(some.u_high[:2], all_of_it.u_high[:2])
    assert some.u_high[2] == -some.u_low[2] == YAW_MAX < all_of_it.u_high[2]
    with pytest.raises(ValueError, match="--reserve"):
        dynamics(SWIFT, "rotors", reserve=0.1)


@optimised
@pytest.mark.parametrize("raced_by", ["race", "race_by_rates"])
def test_a_race_holds_to_the_referee(raced_by, request):
    solution, model = request.getfixturevalue(raced_by)
    found = verify(solution, model, referee_of(problem()))
    assert found.broken == []
    assert [e.kind for e in found.events] == ["pass", "pass"]
    assert found.events[-1].t == pytest.approx(solution.time, abs=1e-4)


@optimised
def test_the_time_left_falls_by_one_second_a_second_along_the_solution(race):
    """costate . x' = -1: the Hamiltonian of a problem of least time is constant."""
    solution, model = race
    slopes = [
        costate @ np.array(model.rate(x, u))
        for costate, x, u in zip(solution.costate, solution.x[1:], solution.u, strict=True)
    ]
    assert np.median(slopes) == pytest.approx(-1.0, abs=0.03)


@optimised
def test_a_solution_that_is_played_too_fast_is_found_out(race):
    solution, model = race
    assert "nodes" in broken(replace(solution, t=0.97 * solution.t), model)


@optimised
def test_an_attitude_that_is_not_of_unit_length_is_found_out(race):
    solution, model = race
    x = solution.x.copy()
    x[:, ATTITUDE] *= 1.02
    assert "attitude" in broken(replace(solution, x=x), model)


@optimised
def test_controls_beyond_the_rotors_are_found_out(race):
    solution, model = race
    assert "controls" in broken(replace(solution, u=1.05 * solution.u), model)


@optimised
def test_a_path_through_a_frame_is_found_out(race):
    solution, model = race
    x = solution.x.copy()
    x[:, 1] += 0.8
    found = verify(replace(solution, x=x), model, referee_of(problem()))
    assert ("hit", 1) in {(event.kind, event.gate) for event in found.events}
    assert any(line.startswith("referee: hit") for line in found.broken)


@pytest.mark.regression
def test_more_thrust_is_faster_and_lag_slower(race):
    weak, _ = raced(replace(SWIFT, rotors=replace(SWIFT.rotors, motor_omega_max=2200.0)))
    slow, _ = raced(replace(SWIFT, rotors=replace(SWIFT.rotors, motor_tau=0.08)))
    assert weak.time > race[0].time + 0.01
    assert slow.time > race[0].time + 0.01


def test_a_vehicle_without_rotors_flies_by_its_rates():
    with pytest.raises(ValueError, match="--model"):
        dynamics(load_vehicle("paper"), "rotors")


@pytest.mark.regression
def test_a_u_turn_behind_a_gate_goes_around_its_frame():
    """The straight way back leads through the gate's upper bar; the race around it is slower."""
    low = Gate((3.0, 0.0, 1.5), 0.0, 0.0, 0.0, **OPENING)
    back = Gate((-1.0, 0.0, 3.2), pi, 0.0, 0.0, **OPENING)
    route = Route((low, back), COURSE.start, HALL, SWIFT.radius)
    model = dynamics(SWIFT, "rotors")
    solution = solve(route, model, MESH, straight(route.points, model, 4.0))
    hits = touched(solution, low)
    assert hits
    plan = segments(route, MESH)
    around = tuple(detours(solution, plan, route, [Hit(hits[0], low)]))
    freed = solve(route, model, MESH, solved("again", solution, route), around=around)
    assert touched(freed, low) == []
    assert freed.time > solution.time


def touched(solution, gate):
    """Return when the path between nodes touches the frame [s]."""
    swept = SweptGate(gate, 0, SWIFT.radius)
    path = StoredSolution("", "", 1, False, (), Verified().summary(), solution).path(1000.0)
    local = [gate.to_local(tuple(p)) for p in path[:, 1:]]
    pairs = zip(path[:, 0], pairwise(local), strict=False)
    return [t for t, (a, b) in pairs if swept.touch(a, b) is not None]


def test_straight_lines_pass_their_points_at_the_speed_they_are_named_after():
    route = Route.of(problem())
    guess = straight(route.points, dynamics(SWIFT, "rotors"), 6.0)
    arrived = guess.states(guess.passes)
    np.testing.assert_allclose(arrived[:, :3], route.points[1:], atol=1e-6)
    np.testing.assert_allclose(np.linalg.norm(arrived[:, VELOCITY], axis=1), 6.0)
