"""The rollout of Algorithm 1 as a generated, vectorised loop over lanes of samples.

A block of LANES samples (see controllers.rollout.layout) advances together, every state and every number of its targets
in an array of its own, so that LLVM vectorises the step and the cost, inlined from their plain functions.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cache
from types import ModuleType

import numpy as np

from controllers.costs import Cost
from controllers.rollout.compiled import is_cached, load_module
from controllers.rollout.layout import LANES
from controllers.rollout.obstacles import steps_between
from controllers.rollout.templates import module_source
from controllers.schedule import Schedule
from quadsim.systems import System


@dataclass(frozen=True)
class Rollout:
    """J^m of M samples for one system and one cost. float32 unless asked otherwise."""

    system: System
    cost: Cost
    dtype: type = np.float32
    schedule: Schedule = field(default_factory=Schedule)
    _found: dict = field(default_factory=dict, repr=False, compare=False)  # the numbers for the last state

    def __call__(self, x0: np.ndarray, U: np.ndarray, noise: np.ndarray, target: int, J: np.ndarray) -> None:
        """Fill J (blocks, LANES) with the horizon mean of the cost of v = clip(U + n_t noise), see schedule.

        x0 (n_x,), U (T, n_u), noise (series, n_u, halves * T, LANES).
        """
        d = self.dtype
        self._module.rollout(np.asarray(x0, d), U.astype(d), noise, J, *self._numbers(x0, target, len(U)))

    def paths(self, x0: np.ndarray, v: np.ndarray, target: int) -> tuple[np.ndarray, np.ndarray]:
        """The positions under at most LANES sampled controls, and the horizon mean of each term of their cost.

        x0 (n_x,), v (samples, n_u, T) -> the first three states (samples, T, 3), terms (samples, n_terms).
        One block on one thread.
        """
        d, (samples, n_u, T) = self.dtype, v.shape
        E = np.zeros((n_u, T, LANES), d)
        E[:, :, :samples] = v.transpose(1, 2, 0)
        path = np.empty((T, min(3, len(self.system.states)), LANES), d)
        means = np.empty((len(self.cost.term_names), LANES), d)
        n, *numbers = self._numbers(x0, target, T)
        self._module.paths(np.asarray(x0, d), np.zeros((T, n_u), d), E, path, means, np.ones_like(n), *numbers)
        return path[:, :, :samples].transpose(2, 0, 1), means[:, :samples].T

    @property
    def is_cached(self) -> bool:
        """Whether the loop was compiled on this machine before."""
        return is_cached(self._module.rollout)

    def _numbers(self, x0: np.ndarray, target: int, horizon: int) -> tuple[object, ...]:
        """What the loops are given besides, of the lanes' precision; found once for a state."""
        key = x0.tobytes(), target, horizon
        if key not in self._found:
            self._found.clear()
            self._found[key] = self._find_numbers(x0, target, horizon)
        return self._found[key]

    def _find_numbers(self, x0: np.ndarray, target: int, horizon: int) -> tuple[object, ...]:
        s, d, obstacles = self.system, self.dtype, self.cost.obstacles
        low, high, p_system, p_cost = (np.asarray(a, d) for a in (s.low, s.high, s.params, self.cost.params))
        along = self.schedule.noise(horizon).astype(d), self.schedule.cost(horizon).astype(d)
        numbers = *along, low, high, d(s.dt), self.cost.targets_from(target, x0, d), p_system, p_cost
        if obstacles is None:
            return numbers
        near = obstacles.near(np.asarray(x0, float), horizon * s.dt).astype(d)
        return *numbers, near, steps_between(s.dt), obstacles.term, d(obstacles.weight)

    @property
    def _module(self) -> ModuleType:
        s, c = self.system, self.cost
        sizes = len(s.states), len(s.controls), c.targets.shape[1], len(c.term_names), len(s.params), len(c.params)
        o = c.obstacles
        touches, numbers = (o.touches, o.rows.shape[1]) if o else (None, 0)
        return compiled_module(s.step, c.terms, touches, (*sizes, numbers), c.unweighted, self.dtype)


@cache
def compiled_module(
    step: Callable,
    terms: Callable,
    touches: Callable | None,
    sizes: tuple[int, ...],
    unweighted: tuple[int, ...],
    dtype: type,
) -> ModuleType:
    """The compiled loops for these two functions, from the disk's cache where they were built before."""
    source = module_source(step, terms, touches, sizes, unweighted, dtype, LANES)
    digest = hashlib.sha256(source.encode()).hexdigest()[:16]
    return load_module(f"rollout_{step.__module__.split('.')[-1]}_{digest}", source)
