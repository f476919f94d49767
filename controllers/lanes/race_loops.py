"""Compiled functions of races of several vehicles that depend on no model and no reward.

The loops of quadsim.controllers.lanes.races call them for a group of blocks, one for each racer, in
which LANES races lie side by side.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from quadsim.controllers.lanes.compiled import inner, kept
from quadsim.controllers.lanes.layout import LANES
from quadsim.controllers.lanes.sharing import share

F = np.float32
I4 = np.int32
L = LANES
ABSENT = F(1e30)  # squared distance of an opponent that is not in the race [m^2]


@inner
def order(a, b, finish, row, way, place):
    """Add one to the place of racer a or racer b, whichever is behind, in each race.

    The racer that finished first is ahead; otherwise the racer that has passed more gates;
    otherwise the racer with the shorter remaining way.

    Args:
        a, b: numbers of the racers.
        finish: step in which a racer has finished  (racers, L).
        row: index of a racer's target row  (racers, L).
        way: remaining way of a racer through the gates [m]  (racers, L).
        place: places of the racers, which are increased here  (racers, L).
    """
    for i in range(L):
        earlier = finish[a, i] < finish[b, i]
        same_time = finish[a, i] == finish[b, i]
        farther = row[a, i] > row[b, i]
        same_row = row[a, i] == row[b, i]
        nearer = way[a, i] <= way[b, i]
        ahead = earlier | (same_time & (farther | (same_row & nearer)))
        place[a, i] += I4(0) if ahead else I4(1)
        place[b, i] += I4(1) if ahead else I4(0)


@inner
def apart(mine, theirs, absent, near):
    """Compute the squared distance, relative position and relative velocity of an opponent.

    Args:
        mine, theirs: states of the vehicle and of the opponent  (n_x, L).
        absent: whether the opponent is out  (L,).
        near: array to fill; the squared distance is ABSENT for an opponent that is out  (7, L).
    """
    for i in range(L):
        dx = theirs[0, i] - mine[0, i]
        dy = theirs[1, i] - mine[1, i]
        dz = theirs[2, i] - mine[2, i]
        near[0, i] = ABSENT if absent[i] else dx * dx + dy * dy + dz * dz
        near[1, i] = dx
        near[2, i] = dy
        near[3, i] = dz
    for k in range(3, 6):
        for i in range(L):
            near[1 + k, i] = theirs[k, i] - mine[k, i]


@inner
def nearer_first(one, other, swaps):
    """Exchange two opponents in each race in which the second one is nearer.

    Args:
        one, other: results of `apart` for the opponents  (7, L).
        swaps: work space for the races in which they are exchanged  (L,).
    """
    for i in range(L):
        swaps[i] = I4(1) if other[0, i] < one[0, i] else I4(0)
    for k in range(7):
        for i in range(L):
            a = one[k, i]
            b = other[k, i]
            one[k, i] = b if swaps[i] > 0 else a
            other[k, i] = a if swaps[i] > 0 else b


@kept
@njit(nogil=True)
def observations_to_rows(desk, first, last, obs, others, rows):
    """Copy observations of vehicles and of opponents to rows.

    Args:
        desk, first, last: see quadsim.controllers.lanes.sharing; the blocks are groups of races.
        obs: observations of each vehicle without its opponents  (blocks, n, LANES).
        others: observations of each vehicle's opponents  (blocks, m, LANES).
        rows: array to fill  (races, racers, n + m).
    """
    if desk:
        share(desk, last)  # pyright: ignore[reportCallIssue]
        return
    races, racers, numbers = rows.shape
    own = obs.shape[1]
    for g in range(first, last):
        for i in range(min(L, races - g * L)):
            for a in range(racers):
                for k in range(own):
                    rows[g * L + i, a, k] = obs[g * racers + a, k, i]
                for k in range(own, numbers):
                    rows[g * L + i, a, k] = others[g * racers + a, k - own, i]


@kept
@njit(nogil=True)
def actions_to_lanes(desk, first, last, rows, lanes):
    """Copy actions (races, racers, n) to lanes (blocks, n, LANES)."""
    if desk:
        share(desk, last)  # pyright: ignore[reportCallIssue]
        return
    races, racers, numbers = rows.shape
    for g in range(first, last):
        for i in range(min(L, races - g * L)):
            for a in range(racers):
                for k in range(numbers):
                    lanes[g * racers + a, k, i] = rows[g * L + i, a, k]
