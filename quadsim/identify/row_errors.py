"""Estimate the errors of a fit that come from commands between the rows of a log.

A flight controller moves the motors hundreds of times a second. A log with fewer rows has some of
these commands only, and the fit holds each until the next row. A second fit reads every second row
only: the more the motors move between the rows, the more its numbers differ from those of the fit
that reads all rows.
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
        parts: the stretches that are fitted.
        geometry: arms and directions of the rotors, which are not fitted.
        prior: the prior of each number.
        search: the fit that reads all rows.
    """
    names = search.solution.searched
    if all(part.stretch.has_all_commands for part in parts):
        return np.zeros((len(names), len(names)))
    fewer = [every_second(part) for part in parts]
    numbers = search.solution.numbers
    found = solve(fewer, geometry, prior, names, [numbers], search.turning).numbers
    change = np.array([getattr(found, name) - getattr(numbers, name) for name in names])
    return np.outer(change, change) / TWO_SIDED**2
