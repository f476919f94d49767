"""What a log does not show between its rows: the errors of the numbers by commands that are held.

A flight controller moves the motors hundreds of times a second. A log with fewer rows has some of
these commands only, and the fit holds each until the next row. Of every second row another fit is
made: the more the motors move between the rows, the further it is from the fit of all rows.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from quadsim.identify.geometry import Geometry
from quadsim.identify.intervals import TWO_SIDED
from quadsim.identify.numbers import Prior
from quadsim.identify.prepared import Prepared, every_second
from quadsim.identify.search import solve
from quadsim.identify.stages import Search


def between_rows(
    parts: Sequence[Prepared], geometry: Geometry, prior: Mapping[str, Prior], search: Search
) -> np.ndarray:
    """Return the covariance of the errors by commands between the rows  (k, k).

    The error of the first order in the time between two rows is as large as the change from all
    rows to every second one. The 95 % interval reaches as far.

    Args:
        parts: what is fitted.
        geometry: what is not fitted.
        prior: of each number.
        search: the best numbers, of all rows.
    """
    names = search.solution.searched
    if all(part.stretch.has_all_commands for part in parts):
        return np.zeros((len(names), len(names)))
    fewer = [every_second(part) for part in parts]
    numbers = search.solution.numbers
    found = solve(fewer, geometry, prior, names, [numbers], search.turning).numbers
    change = np.array([getattr(found, name) - getattr(numbers, name) for name in names])
    return np.outer(change, change) / TWO_SIDED**2
