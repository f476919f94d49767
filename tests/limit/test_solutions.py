"""The solutions that come with the project hold: read back, integrated finely and judged."""

import numpy as np
import pytest

from quadsim.course import load_course
from quadsim.course.opening import free_half_sizes, margin_inside
from quadsim.dynamics.quadrotor import ATTITUDE
from quadsim.limit.dynamics import dynamics
from quadsim.limit.limits import SOLUTIONS, LimitProblem, dump, load
from quadsim.limit.replay import referee_of
from quadsim.limit.route import MARGIN
from quadsim.limit.verify import verify
from quadsim.racing.events import flown_laps
from quadsim.vehicle import load_vehicle, with_thrust_to_weight

FILES = sorted(SOLUTIONS.glob("*.npz"))
SHORT_ONES = [
    path
    for path in FILES
    if path.stem.startswith(("paper_flat_swift_1_rotors", "lsy_level2_crazyflie_1_rates"))
]


@pytest.mark.regression
@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_every_solution_of_the_project_holds(path):
    check(path)


@pytest.mark.slow
@pytest.mark.parametrize("path", SHORT_ONES, ids=lambda path: path.stem)
def test_a_short_solution_of_each_model_holds(path):
    """All of them, which take seconds to integrate: make regression."""
    check(path)


def check(path):
    """Check a stored solution by fine integration and by the referee."""
    stored = load(path)
    solution = stored.solution
    problem = problem_of(stored)
    model = dynamics(problem.vehicle, problem.model, problem.reserve)
    found = verify(solution, model, referee_of(problem))
    assert found.broken == []
    assert flown_laps(found.events, stored.laps) == pytest.approx(stored.lap_times, abs=1e-4)
    passes = [event for event in found.events if event.kind == "pass"]
    for gate, passed in zip(problem.course.gates * stored.laps, passes, strict=True):
        free = free_half_sizes(gate.opening, problem.vehicle.radius)
        room = np.subtract(free, np.abs(passed.offset))
        assert room.min() >= margin_inside(free, problem.margin) - MARGIN
    assert np.abs(np.linalg.norm(solution.x[:, ATTITUDE], axis=1) - 1.0).max() < 2e-5


def test_a_solution_knows_its_file_and_its_problem():
    for path in FILES:
        stored = load(path)
        problem = problem_of(stored)
        assert path.name == problem.file_name, "the course or the vehicle has changed"
        assert stored.key == problem.key, path.stem
        assert path.stat().st_size <= 100_000, path.stem


def test_a_solution_keeps_its_key_under_another_name(tmp_path):
    stored = load(FILES[0])
    path = tmp_path / "mine.npz"
    path.write_bytes(dump(stored))
    assert load(path).key == stored.key


def problem_of(stored):
    """The problem by the names in its solution."""
    name, _, ratio = stored.vehicle.partition("-twr")
    vehicle = load_vehicle(name)
    if ratio:
        vehicle = with_thrust_to_weight(vehicle, float(ratio))
    return LimitProblem(
        course=load_course(stored.course),
        vehicle=vehicle,
        laps=stored.laps,
        model=stored.solution.model,
        closed=stored.closed,
        margin=stored.margin,
        reserve=stored.reserve,
    )
