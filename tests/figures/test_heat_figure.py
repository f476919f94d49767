"""The figure of a race shows at least the gap of the second vehicle."""

import numpy as np
import pytest
from matplotlib.figure import Figure

from quadsim.figures.heat_figure import draw_gaps
from quadsim.palette import styles


@pytest.mark.parametrize(
    ("behind", "shown"),
    [([10.2], 10.2), ([3.0], 3.0), ([2.0, 30.0], 4.0), ([10.2, 30.0], 10.2)],
)
def test_the_axis_of_gaps_reaches_the_second_vehicle(behind, shown):
    """It ended at 4 s where the second was 10.2 s behind."""
    times = np.arange(1.0, 9.0)
    passes = [times.tolist()] + [(times + gap * times / times[-1]).tolist() for gap in behind]
    axes = Figure().subplots()
    draw_gaps(axes, passes, styles([str(k) for k in range(len(passes))]), gates=4)
    bottom, top = axes.get_ylim()
    assert top < 0.0
    assert shown <= bottom < 1.2 * shown
