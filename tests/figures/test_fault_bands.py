"""Faults in a run's figure: a band over the time of each, in every plot over time."""

import numpy as np
import pytest
from matplotlib.figure import Figure

import quadsim
from quadsim.figures.run_figure import draw_faults
from tests.small import SHORT


def bands(run):
    """Return beginning and end of each band [s]."""
    axes = Figure().subplots()
    axes.plot(run.telemetry["t"], run.telemetry["a"])
    draw_faults(axes, run)
    extents = [patch.get_extents().transformed(axes.transData.inverted()) for patch in axes.patches]
    return [(extent.x0, extent.x1) for extent in extents]


@pytest.mark.compiled
def test_bands_lie_over_the_faults_that_the_flight_reached():
    faults = ["rotor2=.8@.1", "commands=lost@.2-.3", "rotor1=.5@9"]
    flight = {**SHORT, "timeout": 0.4}
    run = quadsim.fly(fault=faults, **flight)
    assert np.array(bands(run)) == pytest.approx(np.array([[0.1, run.duration], [0.2, 0.3]]))
    assert bands(quadsim.fly(**flight)) == []
