"""The text of a generated module: a system's step and a cost's terms, inlined into two loops over lanes of samples.

`rollout` computes the costs of every block of samples; `paths` computes the positions of one block.
No gather and no data-dependent branch stands in the lane loop: when some sample reaches its target,
a flag is set and a rare second loop moves those lanes to their next row of targets. Everything in the lane loop
is as wide as a float: one 64-bit integer among the lanes would halve the width of all vectors.
"""

from __future__ import annotations

from collections.abc import Callable
from textwrap import indent

import numpy as np

from controllers.rollout import FAST
from controllers.rollout.inline import lane_source
from controllers.rollout.obstacles import obstacle_words

HEADER = """
import math
import numpy as np
from numba import njit, prange
from controllers.rollout.compiled import kept

F = np.{dtype}
FAST = set({fast})
L = {lanes}
inline = njit(fastmath=FAST, error_model="numpy", inline="always")

@inline
def select(c, a, b):
    return a if c else b

@inline
def lower(a, b):
    return a if a < b else b

@inline
def higher(a, b):
    return a if a > b else b
"""

START = """
X = np.empty(({n_x}, L), F)
A = np.empty(({n_target}, L), F)
crashed = np.zeros(L, F)
hit = np.zeros(L, np.int32)
row = np.zeros(L, np.int32)
for k in range({n_x}):
    X[k, :] = x0[k]
{begin_marks}
for k in range({n_target}):
    A[k, :] = targets[0, k]
"""

STEP = """
x = ({x},)
u = ({u},)
x_next = step(x, u, ({P}), dt)
q = terms(x, x_next, u, ({a},), crashed[l], ({Q}))
crashed[l] = q[{n_terms} + 1]
{store}
hit[l] = np.int32(1) if q[{n_terms}] else np.int32(0)
"""

NEXT_TARGETS = """
hits = np.int32(0)
for l in range(L):
    hits |= hit[l]
if hits > 0:
    for l in range(L):
        if hit[l] > 0 and row[l] < last:
            row[l] += 1
            for k in range({n_target}):
                A[k, l] = targets[row[l], k]
"""

ROLLOUT = """
@kept
@njit(fastmath=FAST, error_model="numpy", parallel=True)
def rollout(x0, U, noise, J, ramp, stage, low, high, dt, targets, p_system, p_cost{arguments}):
    T = U.shape[0]
    halves = noise.shape[2] // T
    last = np.int32(targets.shape[0] - 1)
    {read_P}
    {read_Q}
    {read_limits}
    for b in prange(J.shape[0]):
{start_8}
        cost = np.zeros(L, F)
        E = noise[b // halves]
        t0 = (b % halves) * T
        for t in range(T):
            {read_U}
            n_t, s_t = ramp[b % 2, t], stage[t]
            for l in range(L):
{step_16}
                cost[l] += s_t * ({q})
{next_targets_12}
{keep_rollout_12}
        for l in range(L):
            J[b, l] = cost[l] / F(T)
"""

PATHS = """
@kept
@njit(fastmath=FAST, error_model="numpy")
def paths(x0, U, E, path, means, ramp, stage, low, high, dt, targets, p_system, p_cost{arguments}):
    T = U.shape[0]
    t0 = 0
    b = 0
    last = np.int32(targets.shape[0] - 1)
    {read_P}
    {read_Q}
    {read_limits}
{start_4}
    means[:, :] = F(0)
    for t in range(T):
        {read_U}
        n_t, s_t = ramp[b % 2, t], stage[t]
        for l in range(L):
{step_12}
            {keep_path}
            {add_terms}
{next_targets_8}
{keep_paths_8}
    for k in range({n_terms}):
        for l in range(L):
            means[k, l] /= F(T)
"""


def module_source(
    step: Callable,
    terms: Callable,
    touches: Callable | None,
    sizes: tuple[int, ...],
    unweighted: tuple[int, ...],
    dtype: type,
    lanes: int,
) -> str:
    """sizes: numbers of states, controls, targets, terms, parameters of the system and of the cost, of an obstacle.

    unweighted: terms that are not added up; the compiler then leaves out what only they need.
    """
    source = HEADER.format(dtype=np.dtype(dtype).name, lanes=lanes, fast=sorted(FAST))
    for name, function in {"step": step, "terms": terms}.items():
        source += "\n" + "\n\n".join(lane_source(function, name).values()) + "\n"
    obstacles = obstacle_words(touches, sizes[-1], lanes)
    source += obstacles.pop("tests")
    words = _words(*sizes[:-1]) | obstacles
    words["q"] = " + ".join(f"q[{k}]" for k in range(sizes[3]) if k not in unweighted) or "F(0)"
    parts = {name: obstacles[name] for name in ("keep_rollout", "keep_paths")}
    for name, text in {"start": START, "step": STEP, "next_targets": NEXT_TARGETS, **parts}.items():
        body = text.strip("\n").format(**words)
        words |= {f"{name}_{depth}": indent(body, " " * depth) for depth in (4, 8, 12, 16)}
    return source + ROLLOUT.format(**words) + PATHS.format(**words)


def _words(n_x: int, n_u: int, n_target: int, n_terms: int, n_p: int, n_q: int) -> dict[str, object]:
    """What depends on the sizes."""

    def row(text: str, n: int, between: str = ", ") -> str:
        return between.join(text.format(k=k) for k in range(n))

    return {
        "n_x": n_x,
        "n_target": n_target,
        "n_terms": n_terms,
        "P": row("p{k}", n_p) + "," * (n_p > 0),
        "Q": row("q{k}", n_q) + "," * (n_q > 0),
        "read_P": f"{row('p{k}', n_p)}, = {row('p_system[{k}]', n_p)}," if n_p else "pass",
        "read_Q": f"{row('q{k}', n_q)}, = {row('p_cost[{k}]', n_q)}," if n_q else "pass",
        "read_limits": f"{row('low{k}', n_u)}, {row('high{k}', n_u)} = {row('low[{k}]', n_u)}, {row('high[{k}]', n_u)}",
        "read_U": f"{row('U{k}', n_u)}, = {row('U[t, {k}]', n_u)},",
        "x": row("X[{k}, l]", n_x),
        "u": row("lower(higher(U{k} + n_t * E[{k}, t0 + t, l], low{k}), high{k})", n_u),
        "a": row("A[{k}, l]", n_target),
        "store": row("X[{k}, l] = x_next[{k}]", n_x, "; "),
        "keep_path": row("path[t, {k}, l] = x_next[{k}]", min(n_x, 3), "; "),
        "add_terms": row("means[{k}, l] += s_t * q[{k}]", n_terms, "; "),
    }
