"""The figure of the value of a course: the gates' speeds and times, beside those of the limit."""

import numpy as np
import pytest

from quadsim.cli.cli import race
from quadsim.course import load_course
from quadsim.figures.value_figure import draw_value, limit_at_gates
from quadsim.limit.limits import LimitProblem
from quadsim.value import value_of_course
from quadsim.vehicle import load_vehicle

PROBLEM = LimitProblem.of(load_course("figure8"), load_vehicle("swift"), 3)
LIMIT = PROBLEM.best_known()


@pytest.fixture(scope="module")
def value():
    return value_of_course(PROBLEM.course, PROBLEM.vehicle, PROBLEM.laps)


@pytest.mark.slow
def test_the_limit_crosses_all_gates_in_turn_and_ends_at_the_last_one(value):
    times, speeds = limit_at_gates(LIMIT, value)
    assert np.all(np.diff(times) > 0.0)
    assert times[-1] == pytest.approx(LIMIT.time, abs=2e-3)
    laps = times.reshape(3, -1)[:, -1]
    np.testing.assert_allclose(np.diff(laps, prepend=0.0), LIMIT.lap_times, atol=2e-3)
    assert speeds.min() > 5.0


@pytest.mark.slow
def test_speeds_and_times_of_both_stand_over_the_gates(value):
    _, _, speeds, times = draw_value(PROBLEM, LIMIT).get_axes()[:4]
    for axes, numbers in ((speeds, value.speeds), (times, np.diff(value.splits, prepend=0.0))):
        drawn = {line.get_label(): line for line in axes.get_lines()}
        np.testing.assert_allclose(drawn["point mass"].get_ydata(), numbers)
        assert len(drawn["best known limit"].get_xdata()) == len(numbers)


@pytest.mark.slow
def test_a_run_is_plotted_with_the_value_of_its_race(tmp_path, capsys):
    golden = "tests/record/golden"
    out = tmp_path / "value.png"
    assert race(["plot", golden, "--value", "--out", str(out)]) == 0
    assert out.stat().st_size > 10_000
