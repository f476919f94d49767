"""The solutions that come with the project hold: each is read back, integrated finely and judged by
the referee."""

import numpy as np
import pytest

from quadsim.course import load_course
from quadsim.limit.dynamics import dynamics
from quadsim.limit.verify import verify
from quadsim.race.events import flown_laps
from quadsim.race.referee import Referee
from quadsim.record.limits import SOLUTIONS, Race, load
from quadsim.vehicle import load_vehicle, with_thrust_to_weight

FILES = sorted(SOLUTIONS.glob("*.npz"))


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_a_solution_of_the_project_holds(path):
    limit = load(path)
    name, _, ratio = limit.vehicle.partition("-twr")
    course, vehicle = load_course(limit.course), load_vehicle(name)
    if ratio:
        vehicle = with_thrust_to_weight(vehicle, float(ratio))
    race = Race(
        course, vehicle, limit.laps, limit.solution.model, limit.closed, limit.margin, limit.reserve
    )
    assert path.name == race.file_name, (
        "the course or the vehicle has changed: race limit finds the new limit"
    )
    assert path.stat().st_size <= 100_000
    referee = Referee(course, vehicle.radius, limit.laps, 1e3, penalties=True)
    found = verify(limit.solution, dynamics(vehicle, race.model, race.reserve), referee)
    assert found.broken == []
    assert flown_laps(found.events, limit.laps) == pytest.approx(limit.lap_times, abs=1e-4)
    passes = [e for e in found.events if e.kind == "pass"]
    for gate, passed in zip(course.gates * limit.laps, passes, strict=True):
        free = np.array(gate.opening) / 2 - vehicle.radius
        assert (free - np.abs(passed.offset)).min() >= min(race.margin, *free / 2 - 2e-3)
    assert np.abs(np.linalg.norm(limit.solution.x[:, 6:10], axis=1) - 1.0).max() < 2e-5
