"""A line through the steps of each edge, and the corners where the lines of two edges meet."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from quadsim.sensing.pixels.edges import EDGES, POINTS, Points
from quadsim.sensing.pixels.signal import Steps

# [px] A step this near to a line belongs to it.
NEAR = 1.2
# fewest steps of a line, and least share of an edge's visible points that have one
FEWEST = 4
SHARE = 0.5
# [px] standard deviation of a step; largest standard deviation of a corner that is used
STEP_STD = 0.5
LARGEST_STD = 1.5
# Edges that meet in each corner of an opening, in the order of Gate.corners: side, then top or
# bottom
MEETING = ((0, 2), (0, 3), (1, 2), (1, 3))
# Pairs of points through which lines are tried, by the share of the points at which they stand
PAIRS = tuple((one / 8, other / 8) for one in range(9) for other in range(9) if other - one >= 3)


class Lines(NamedTuple):
    """The line of each edge: its shift along the edge's normal, a + b along.  (G, EDGES)"""

    # [px] in the middle of the edge
    shift: np.ndarray
    # [px/px]
    slope: np.ndarray
    # mean of `along` over its steps [px]
    mean: np.ndarray
    # variance of `along` over its steps, times their number [px^2]
    spread: np.ndarray
    # number of its steps; 0: there is no line
    count: np.ndarray


class Found(NamedTuple):
    """Corners that were found."""

    gate: np.ndarray
    corner: np.ndarray
    # from where they were expected [px]  (n, 2)
    shift: np.ndarray


def lines(points: Points, steps: Steps, gates: int) -> tuple[Lines, np.ndarray]:
    """Return a line for each edge, and which steps belong to theirs.

    Of lines through pairs of an edge's steps, the one with the most steps near it is taken, then
    fitted to these by least squares.

    Args:
        points: points on the edges.
        steps: what was found at each point.
        gates: number of gates.
    """
    key = points.gate * EDGES + points.edge
    n = gates * EDGES
    # Points by edge, in columns.
    order = np.argsort(key, kind="stable")
    first = np.searchsorted(key[order], np.arange(n))
    column = np.empty(len(key), int)
    column[order] = np.arange(len(key)) - first[key[order]]
    along = np.zeros((n, POINTS))
    shift = np.full((n, POINTS), np.nan)
    along[key, column] = points.along
    shift[key[steps.found], column[steps.found]] = steps.shift[steps.found]
    expected = np.bincount(key, minlength=n)

    # The found steps of each edge to the front.
    have = ~np.isnan(shift)
    front = np.argsort(~have, axis=1, kind="stable")
    s = np.take_along_axis(along, front, axis=1)
    d = np.take_along_axis(shift, front, axis=1)
    there = np.take_along_axis(have, front, axis=1)
    number = there.sum(axis=1)

    # The line through two steps that has the most others near it.
    row = np.arange(n)
    most = np.zeros(n, int)
    inliers = np.zeros((n, POINTS), bool)
    with np.errstate(invalid="ignore", divide="ignore"):
        for one, other in PAIRS:
            i = (one * np.maximum(number - 1, 0)).astype(int)
            j = (other * np.maximum(number - 1, 0)).astype(int)
            slope = (d[row, j] - d[row, i]) / (s[row, j] - s[row, i])
            line = d[row, i][:, None] + slope[:, None] * (s - s[row, i][:, None])
            near = (abs(d - line) < NEAR) & there
            better = near.sum(axis=1) > most
            inliers[better] = near[better]
            most = np.maximum(most, near.sum(axis=1))

        # Least squares.
        weight = inliers.astype(float)
        count = weight.sum(axis=1)
        d = np.where(there, d, 0.0)
        mean = (weight * s).sum(axis=1) / count
        level = (weight * d).sum(axis=1) / count
        away = s - mean[:, None]
        spread = (weight * away**2).sum(axis=1)
        slope = (weight * away * (d - level[:, None])).sum(axis=1) / spread
    good = (count >= FEWEST) & (count >= SHARE * expected)
    shape = (gates, EDGES)
    found = Lines(
        shift=np.where(good, level - slope * mean, 0.0).reshape(shape),
        slope=np.where(good, slope, 0.0).reshape(shape),
        mean=np.where(good, mean, 0.0).reshape(shape),
        spread=np.where(good, spread, 1.0).reshape(shape),
        count=np.where(good, count, 0).astype(int).reshape(shape),
    )
    of_line = np.zeros((n, POINTS), bool)
    np.put_along_axis(of_line, front, inliers, axis=1)
    return found, of_line[key, column] & good[key]


def corners(found: Lines, points: Points, ends: np.ndarray) -> Found:
    """Return the corners of the openings whose adjacent edges have lines.

    The inner edges and the outer edges of a gate both tell where a corner has moved; where both
    do, the mean counts, weighted by their variances.

    Args:
        found: the lines.
        points: points on the edges, for their normals.
        ends: distance of each edge's ends from its middle along the edge [px], where its corners
            are  (G, EDGES, 2).
    """
    gates = len(found.shift)
    normal = np.zeros((gates, EDGES, 2))
    normal[points.gate, points.edge] = points.normal
    total = np.zeros((gates, 4, 2))
    weight = np.zeros((gates, 4))
    for corner, (side, level) in enumerate(MEETING):
        # The end of a side is at the top or at the bottom, that of the other at the left or right.
        at_side = level - 2
        at_level = side
        for ring in (0, 4):
            k = side + ring
            m = level + ring
            good = (found.count[:, k] > 0) & (found.count[:, m] > 0)
            moves = []
            variances = []
            for e, end in ((k, at_side), (m, at_level)):
                along = ends[:, e, end]
                moves.append(found.shift[:, e] + found.slope[:, e] * along)
                part = 1.0 / np.maximum(found.count[:, e], 1)
                away = (along - found.mean[:, e]) ** 2 / np.maximum(found.spread[:, e], 1e-9)
                variances.append(STEP_STD**2 * (part + away))
            n1, n2 = normal[:, k], normal[:, m]
            across = n1[:, 0] * n2[:, 1] - n1[:, 1] * n2[:, 0]
            good &= abs(across) > 0.25
            across = np.where(good, across, 1.0)
            x = (moves[0] * n2[:, 1] - moves[1] * n1[:, 1]) / across
            y = (moves[1] * n1[:, 0] - moves[0] * n2[:, 0]) / across
            variance = np.maximum(*variances) / across**2
            good &= variance < LARGEST_STD**2
            w = np.where(good, 1.0 / variance, 0.0)
            # Shifts of edges without a line, or without an end, are not numbers.
            shift = np.where(good[:, None], np.column_stack([x, y]), 0.0)
            total[:, corner] += w[:, None] * shift
            weight[:, corner] += w
    gate, corner = np.nonzero(weight > 0.0)
    return Found(gate, corner, total[gate, corner] / weight[gate, corner][:, None])
