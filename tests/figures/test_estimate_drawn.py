"""The estimate in a run's figure: its path beside the true one, and how far it is off."""

import numpy as np
import pytest

import quadsim
from quadsim.figures.run_figure import draw
from quadsim.report.estimate_metrics import estimate_errors


class Climb:
    def control(self, x):
        return 0.0, 0.0, 0.0, 9.81 + 4.0 * (2.5 - x[2]) - 3.0 * x[5]


def flown(**settings):
    return quadsim.fly("figure8", controller=Climb(), laps=1, timeout=0.3, **settings)


def lines(figure):
    """Return {label: [lines]} of all axes of a figure."""
    found = {}
    for axes in dict.fromkeys(figure.axes):
        for line in axes.get_lines():
            found.setdefault(line.get_label(), []).append(line)
    return found


def test_the_estimate_is_drawn_beside_the_truth_with_its_error():
    run = flown(sensing="vio", record_sensing=True)
    drawn = lines(draw(run))
    above, from_side = drawn["estimate"]
    np.testing.assert_array_equal(above.get_ydata(), run.telemetry["est_py"])
    np.testing.assert_array_equal(from_side.get_ydata(), run.telemetry["est_pz"])
    (error,) = drawn["off the true position"]
    expected = np.linalg.norm(estimate_errors(run), axis=1)
    np.testing.assert_allclose(error.get_ydata(), expected)
    assert len(drawn["measured poses"][0].get_xdata()) == len(run.measurements["pose.t"])


@pytest.mark.parametrize("settings", [{}, {"sensing": "vio"}])
def test_nothing_is_drawn_that_a_flight_does_not_have(settings):
    drawn = lines(draw(flown(**settings)))
    assert ("estimate" in drawn) == bool(settings)
    assert "measured poses" not in drawn
