"""Published time-optimal races are found again, from straight lines."""

import numpy as np
import pytest
from limit_cases import cpc, fast_fly_n7

from quadsim.limit.guess import straight
from quadsim.limit.solve import solve
from quadsim.limit.verify import verify

WITHIN = 0.005  # of the published time


def solved(case, intervals):
    task, model = case
    solution = solve(task, model, [intervals] * (len(task.points) - 1), straight(task, model, 8.0))
    assert verify(solution, model).broken == []
    return task, solution


def test_the_closed_lap_of_fast_fly_is_found_again():
    task, s = solved(fast_fly_n7(), 20)
    assert s.time == pytest.approx(8.901, rel=WITHIN)
    ends = s.x[np.append(np.flatnonzero(np.diff(s.target)) + 1, -1), :3]
    assert np.linalg.norm(ends - [w.position for w in task.targets], axis=1).max() <= 0.0101
    assert np.allclose(s.x[0, :6], s.x[-1, :6], atol=1e-3)
    assert abs(s.x[0, 6:10] @ s.x[-1, 6:10]) == pytest.approx(1.0, abs=1e-6)


def test_the_19_way_points_of_cpc_and_its_steady_lap_are_found_again():
    task, s = solved(cpc(), 16)
    assert s.time == pytest.approx(17.56, rel=WITHIN)
    passes = s.t[1:][np.append(np.flatnonzero(np.diff(s.target)), -1)]
    assert passes[14] - passes[7] == pytest.approx(6.13, rel=WITHIN)
    assert np.allclose(s.x[-1, :3], task.end, atol=1e-6)
    assert np.allclose(s.x[-1, 3:6], 0.0, atol=1e-6)
