"""Published time-optimal races are found again, from straight lines."""

import numpy as np
import pytest

from quadsim.dynamics.quadrotor import ATTITUDE, POSITION, VELOCITY
from quadsim.limit.verify import verify
from tests.limit.limit_cases import cpc, fast_fly_n7, solved

pytestmark = pytest.mark.regression
# Share of the published time
WITHIN = 0.005


def test_the_closed_lap_of_fast_fly_is_found_again():
    case = fast_fly_n7()
    s = solved(case, 8)
    assert verify(s, case.vehicle).broken == []
    assert s.time == pytest.approx(8.901, rel=WITHIN)
    ends = s.x[np.append(np.flatnonzero(np.diff(s.target)) + 1, -1), POSITION]
    assert np.linalg.norm(ends - case.points, axis=1).max() <= case.tolerance + 1e-4
    before_attitude = slice(0, ATTITUDE.start)
    assert np.allclose(s.x[0, before_attitude], s.x[-1, before_attitude], atol=1e-3)
    assert abs(s.x[0, ATTITUDE] @ s.x[-1, ATTITUDE]) == pytest.approx(1.0, abs=1e-6)


def test_the_19_way_points_of_cpc_and_its_steady_lap_are_found_again():
    case = cpc()
    s = solved(case, 6)
    assert verify(s, case.vehicle).broken == []
    assert s.time == pytest.approx(17.56, rel=WITHIN)
    passes = s.t[1:][np.append(np.flatnonzero(np.diff(s.target)), -1)]
    assert passes[14] - passes[7] == pytest.approx(6.13, rel=WITHIN)
    assert np.allclose(s.x[-1, POSITION], case.points[-1], atol=1e-6)
    assert np.allclose(s.x[-1, VELOCITY], 0.0, atol=1e-6)
