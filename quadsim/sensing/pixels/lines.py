"""Fit a line to the steps of each edge, and find the corners where two lines meet."""

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
# [px] standard deviation of a step; largest standard deviation of a corner, along any direction,
# that is used
STEP_STD = 0.5
LARGEST_STD = 2.5
# Edges that meet in each corner of an opening, in the order of Gate.corners: side, then top or
# bottom
MEETING = ((0, 2), (0, 3), (1, 2), (1, 3))
# Pairs of points through which lines are tried, by the share of the points at which they stand
PAIRS = np.array([(i / 8, j / 8) for i in range(9) for j in range(9) if j - i >= 3])


class Lines(NamedTuple):
    """The fitted lines of all edges, as shifts along the edges' normals.  (G, EDGES)"""

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
    # displacement from the predicted corner [px]  (n, 2)
    shift: np.ndarray
    # variance along the direction in which each is known worst [px^2]  (n,)
    variance: np.ndarray


def lines(points: Points, steps: Steps, gates: int) -> tuple[Lines, np.ndarray]:
    """Return a line for each edge, and which steps belong to the line of their edge.

    Among the lines through pairs of an edge's steps, the line with the most steps near it is
    chosen, and fitted to these steps by least squares.

    Args:
        points: points on the edges.
        steps: step of the signal that was found at each point.
        gates: number of gates.
    """
    # Edges with points, and their points in columns.
    key, row = np.unique(points.gate * EDGES + points.edge, return_inverse=True)
    n = len(key)
    order = np.argsort(row, kind="stable")
    first = np.searchsorted(row[order], np.arange(n))
    column = np.empty(len(row), int)
    column[order] = np.arange(len(row)) - first[row[order]]
    along = np.zeros((n, POINTS))
    shift = np.zeros((n, POINTS))
    have = np.zeros((n, POINTS), bool)
    along[row, column] = points.along
    shift[row, column] = steps.shift
    have[row, column] = steps.found
    expected = np.bincount(row, minlength=n)

    # The found steps of each edge to the front.
    front = np.argsort(~have, axis=1, kind="stable")
    s = np.take_along_axis(along, front, axis=1)
    d = np.take_along_axis(shift, front, axis=1)
    there = np.take_along_axis(have, front, axis=1)
    last = np.maximum(there.sum(axis=1) - 1, 0)

    # The line through two steps that has the most others near it.  (pairs, n)
    edges = np.arange(n)
    i, j = (PAIRS.T[..., None] * last).astype(int)
    with np.errstate(invalid="ignore", divide="ignore"):
        slope = (d[edges, j] - d[edges, i]) / (s[edges, j] - s[edges, i])
        level = d[edges, i] - slope * s[edges, i]
        near = (abs(d - level[..., None] - slope[..., None] * s) < NEAR) & there
        inliers = near[np.argmax(near.sum(axis=2), axis=0), edges]

        # Least squares.
        weight = inliers.astype(float)
        count = weight.sum(axis=1)
        mean = (weight * s).sum(axis=1) / count
        level = (weight * d).sum(axis=1) / count
        away = s - mean[:, None]
        spread = (weight * away**2).sum(axis=1)
        slope = (weight * away * (d - level[:, None])).sum(axis=1) / spread
    good = (count >= FEWEST) & (count >= SHARE * expected)

    def of_all(values: np.ndarray, without: float) -> np.ndarray:
        """Return a value for every edge, with `without` for edges that have no line."""
        table = np.full(gates * EDGES, without)
        table[key[good]] = values[good]
        return table.reshape(gates, EDGES)

    found = Lines(
        shift=of_all(level - slope * mean, 0.0),
        slope=of_all(slope, 0.0),
        mean=of_all(mean, 0.0),
        spread=of_all(spread, 1.0),
        count=of_all(count, 0.0).astype(int),
    )
    of_line = np.zeros((n, POINTS), bool)
    np.put_along_axis(of_line, front, inliers, axis=1)
    return found, of_line[row, column] & good[row]


def without(found: Lines, gate: np.ndarray, edge: np.ndarray) -> Lines:
    """Return the lines with the lines of some edges removed."""
    count = found.count.copy()
    count[gate, edge] = 0
    return found._replace(count=count)


def corners(found: Lines, points: Points, ends: np.ndarray) -> Found:
    """Return the corners of the openings whose adjacent edges have lines.

    Each of the two inner and two outer edges at a corner measures the corner's shift along the
    edge's normal. These shifts are combined by least squares, weighted by their variances.

    Args:
        found: the lines.
        points: points on the edges, for their normals.
        ends: distance of each edge's ends from its middle along the edge [px], where its corners
            are  (G, EDGES, 2).
    """
    gates = len(found.shift)
    normal = np.zeros((gates, EDGES, 2))
    normal[points.gate, points.edge] = points.normal
    # The sums of the normal equations
    A = np.zeros((gates, 4, 2, 2))
    b = np.zeros((gates, 4, 2))
    for corner, (side, level) in enumerate(MEETING):
        # One side ends at the top or the bottom, the other side at the left or the right.
        for edge, end in ((side, level - 2), (level, side)):
            for e in (edge, edge + 4):
                along = ends[:, e, end]
                # Edges that reach behind the camera have no ends.
                good = (found.count[:, e] > 0) & np.isfinite(along)
                move = found.shift[:, e] + found.slope[:, e] * along
                away = (along - found.mean[:, e]) ** 2 / found.spread[:, e]
                variance = STEP_STD**2 * (1.0 / np.maximum(found.count[:, e], 1) + away)
                weight = np.where(good, 1.0 / variance, 0.0)
                n = normal[:, e]
                A[:, corner] += weight[:, None, None] * n[:, :, None] * n[:, None, :]
                b[:, corner] += (weight * np.where(good, move, 0.0))[:, None] * n
    least = np.linalg.eigvalsh(A)[..., 0]
    gate, corner = np.nonzero(least > 1.0 / LARGEST_STD**2)
    shift = np.linalg.solve(A[gate, corner], b[gate, corner][..., None])[..., 0]
    return Found(gate, corner, shift, 1.0 / least[gate, corner])
