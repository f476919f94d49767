"""The rollout of Algorithm 1 as a generated, vectorised loop over lanes of samples.

A block is LANES samples that advance together, every state and every number of their targets in an
array of its own, so that LLVM vectorises the step and the cost, inlined from their plain functions.
No gather and no data-dependent branch stands in the lane loop: when some sample reaches its target,
a flag is set and a rare second loop moves those lanes to their next row of aims.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np

from controllers.costs import Cost
from controllers.rollout.compiled import is_cached, load_module
from controllers.rollout.inline import lane_source
from quadsim.systems import System

LANES = 64

HEADER = """
import math
import numpy as np
from numba import njit, prange

F = np.{dtype}
L = {lanes}
inline = njit(fastmath=True, error_model="numpy", inline="always")

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

LOOP = """
@njit(fastmath=True, error_model="numpy", parallel=True, cache=True)
def rollout(x0, U, noise, J, low, high, dt, aims, p_system, p_cost):
    T = U.shape[0]
    halves = noise.shape[2] // T
    last = aims.shape[0] - 1
    {P} = {p_system}
    {Q} = {p_cost}
    for b in prange(J.shape[0]):
        X = np.empty(({n_x}, L), F)
        A = np.empty(({n_aim}, L), F)
        cost = np.zeros(L, F)
        crashed = np.zeros(L, F)
        hit = np.zeros(L, np.int32)
        row = np.zeros(L, np.int32)
        for k in range({n_x}):
            X[k, :] = x0[k]
        for k in range({n_aim}):
            A[k, :] = aims[0, k]
        E = noise[b // halves]
        t0 = (b % halves) * T
        for t in range(T):
            hits = np.int32(0)
            for l in range(L):
                x = ({x},)
                u = ({u},)
                x_next = step(x, u, ({P}), dt)
                q = terms(x, x_next, u, ({a},), crashed[l], ({Q}))
                cost[l] += {q}
                crashed[l] = q[{n_terms} + 1]
                {store}
                h = np.int32(1) if q[{n_terms}] else np.int32(0)
                hit[l] = h
                hits += h
            if hits > 0:
                for l in range(L):
                    if hit[l] > 0 and row[l] < last:
                        row[l] += 1
                        for k in range({n_aim}):
                            A[k, l] = aims[row[l], k]
        for l in range(L):
            J[b, l] = cost[l] / F(T)
"""


@dataclass(frozen=True)
class Rollout:
    """J^m of M samples for one system and one cost. float32 unless asked otherwise."""

    system: System
    cost: Cost
    dtype: type = np.float32

    def __call__(self, x0: np.ndarray, U: np.ndarray, noise: np.ndarray, target: int, J: np.ndarray) -> None:
        """Fill J (blocks, LANES) with the horizon mean of the cost of v = clip(U + noise).

        x0 (n_x,), U (T, n_u), noise (series, n_u, halves * T, LANES): a series holds `halves` samples.
        """
        s, d = self.system, self.dtype
        rollout = self._function
        low, high, p_system, p_cost = (np.asarray(a, d) for a in (s.low, s.high, s.params, self.cost.params))
        aims = self.cost.aims_from(target, d)
        rollout(np.asarray(x0, d), U.astype(d), noise, J, low, high, d(s.dt), aims, p_system, p_cost)

    @property
    def is_cached(self) -> bool:
        """Whether the loop was compiled on this machine before; else the first call takes some 10 s."""
        return is_cached(self._function)

    @property
    def _function(self) -> Callable:
        return compiled_rollout(self.system.step, self.cost.terms, self._sizes, self.dtype)

    @property
    def _sizes(self) -> tuple[int, ...]:
        s, c = self.system, self.cost
        return len(s.states), len(s.controls), c.aims.shape[1], len(c.term_names), len(s.params), len(c.params)


@cache
def compiled_rollout(step: Callable, terms: Callable, sizes: tuple[int, ...], dtype: type) -> Callable:
    """The compiled loop for these two functions, from the disk's cache where it was built before."""
    functions = {"step": step, "terms": terms}
    source = HEADER.format(dtype=np.dtype(dtype).name, lanes=LANES)
    for name, function in functions.items():
        parts = lane_source(function)
        source += "\n" + "\n\n".join(parts.values()) + "\n"
        if function.__name__ != name:
            source += f"\n{name} = {function.__name__}\n"
    source += LOOP.format(**_loop_text(*sizes))
    digest = hashlib.sha256(source.encode()).hexdigest()[:16]
    return load_module(f"rollout_{step.__module__.split('.')[-1]}_{digest}", source).rollout


def _loop_text(n_x: int, n_u: int, n_aim: int, n_terms: int, n_p: int, n_q: int) -> dict[str, object]:
    """The parts of LOOP that depend on the numbers of states, controls, aims, terms and parameters."""

    def row(text: str, n: int) -> str:
        return ", ".join(text.format(k=k) for k in range(n))

    return {
        "n_x": n_x,
        "n_aim": n_aim,
        "n_terms": n_terms,
        "P": row("p{k}", n_p) + ",",
        "Q": row("q{k}", n_q) + ",",
        "p_system": row("p_system[{k}]", n_p) + ",",
        "p_cost": row("p_cost[{k}]", n_q) + ",",
        "x": row("X[{k}, l]", n_x),
        "u": row("lower(higher(U[t, {k}] + E[{k}, t0 + t, l], low[{k}]), high[{k}])", n_u),
        "a": row("A[{k}, l]", n_aim),
        "q": " + ".join(f"q[{k}]" for k in range(n_terms)),
        "store": "; ".join(f"X[{k}, l] = x_next[{k}]" for k in range(n_x)),
    }
