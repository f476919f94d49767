"""Compiled functions of the learning environments that depend on no model and no cost.

The loops of quadsim.controllers.lanes.environment call them for one block of environments, whose
numbers lie side by side in arrays (numbers, LANES).
"""

from __future__ import annotations

import numpy as np
from numba import njit

from quadsim.controllers.lanes.compiled import inner, kept
from quadsim.controllers.lanes.layout import LANES
from quadsim.controllers.lanes.normals import normal_rows
from quadsim.controllers.lanes.sharing import share

F = np.float32
I4 = np.int32
U8 = np.uint64
L = LANES


@njit(inline="always")
def drawn(seed, environment, episode, of):
    """Return a pseudo-random number below `of` from the other arguments.

    The hash is the finaliser of splitmix64 (Steele, Lea and Flood 2014).
    """
    h = U8(seed) * U8(0x9E3779B97F4A7C15)
    h += U8(environment) * U8(0xD1B54A32D192ED03)
    h += U8(episode) * U8(0x8CB92BA72F3D8DD7)
    h = (h ^ (h >> U8(30))) * U8(0xBF58476D1CE4E5B9)
    h = (h ^ (h >> U8(27))) * U8(0x94D049BB133111EB)
    return np.int64((h ^ (h >> U8(31))) % U8(of))


@njit
def move(source, to):
    """Copy the first rows of `source` to all rows of `to`."""
    for k in range(to.shape[0]):
        for i in range(L):
            to[k, i] = source[k, i]


@inner
def hold(over, state, after, moved, way_before, way_now, crashed, reached):
    """Keep the states and results of vehicles whose episode has ended.

    Args:
        over: whether an episode has ended  (L,).
        state, after: states before and after a step  (n_x, L).
        moved: distances flown in the step [m]  (L,).
        way_before, way_now: remaining ways through the gates before and after the step [m]  (L,).
        crashed, reached: see `judge`  (L,).
    """
    waits = I4(0)
    for i in range(L):
        waits |= I4(1) if over[i] else I4(0)
    if waits == 0:
        return
    for k in range(after.shape[0]):
        for i in range(L):
            after[k, i] = state[k, i] if over[i] else after[k, i]
    for i in range(L):
        if over[i]:
            moved[i] = F(0)
            way_now[i] = way_before[i]
            crashed[i] = F(0)
            reached[i] = I4(0)


@inner
def add_noise(obs, noise, lane, key, call):
    """Add noise to the observations of a block.

    Args:
        obs: observations  (n, L).
        noise: standard deviations  (n,).
        lane: number of the block's first environment.
        key, call: see quadsim.controllers.lanes.normals.normal_rows.
    """
    drawn_noise = np.empty((obs.shape[0], L), F)
    normal_rows(drawn_noise, noise, lane, 0, key, call)
    for k in range(obs.shape[0]):
        for i in range(L):
            obs[k, i] += drawn_noise[k, i]


@inner
def judge(b, crashed, reached, episodes, outcome, last_row, limit):
    """Count a step, and mark the environments of a block whose episode has ended.

    Args:
        b: number of the block.
        crashed: 1 for a vehicle that has crashed in this step  (L,).
        reached: number of targets that were reached in this step  (L,).
        episodes: the running episodes, see quadsim.learn.lanes.Episodes.
        outcome: arrays to fill, see quadsim.learn.lanes.Outcome.
        last_row: index of the target row at which a race is finished.
        limit: number of steps of the longest episode.

    Returns:
        Whether any episode of the block has ended, in this step or before.
    """
    row = episodes.row[b]
    steps = episodes.steps[b]
    over = episodes.over[b]
    ended = outcome.ended[b]
    cut = outcome.cut[b]
    passed = outcome.passed[b]
    crashed_now = outcome.crashed_now[b]
    rare = False
    for i in range(L):
        steps[i] += I4(1)
        ended[i] = (crashed[i] > F(0)) | (row[i] >= last_row)
        cut[i] = (steps[i] >= limit) & (not ended[i])
        passed[i] = reached[i] > 0
        crashed_now[i] = crashed[i] > F(0)
        rare |= ended[i] | cut[i] | over[i]
    return rare


@kept
@njit(nogil=True)
def to_rows(desk, first, last, lanes, rows):
    """Copy lanes (blocks, n, LANES) to rows, one for each environment (environments, n)."""
    if desk:
        share(desk, last)  # pyright: ignore[reportCallIssue]
        return
    for b in range(first, last):
        for i in range(min(L, rows.shape[0] - b * L)):
            for k in range(rows.shape[1]):
                rows[b * L + i, k] = lanes[b, k, i]


@kept
@njit(nogil=True)
def to_lanes(desk, first, last, rows, lanes):
    """Copy rows, one for each environment (environments, n), to lanes (blocks, n, LANES)."""
    if desk:
        share(desk, last)  # pyright: ignore[reportCallIssue]
        return
    for b in range(first, last):
        for i in range(min(L, rows.shape[0] - b * L)):
            for k in range(rows.shape[1]):
                lanes[b, k, i] = rows[b * L + i, k]
