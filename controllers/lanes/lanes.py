"""The rollout of Algorithm 1 as a generated, vectorised loop over lanes of samples.

A block of LANES samples (see controllers.lanes.layout) advances together, every state and every
number of its targets in an array of its own, so that LLVM vectorises the step and the cost, inlined
from their plain functions.
"""

from __future__ import annotations

import hashlib
import sys
from dataclasses import dataclass, field
from functools import cached_property
from types import ModuleType

import numpy as np

from controllers.costs import Cost
from controllers.lanes.compiled import is_cached, load_module
from controllers.lanes.layout import LANES
from controllers.lanes.planner_loops import module_source, steps_between
from controllers.schedule import Schedule
from quadsim.dynamics import System


@dataclass(frozen=True)
class Rollout:
    """J^m of M samples for one system and one cost. float32 unless asked otherwise."""

    system: System
    cost: Cost
    dtype: type = np.float32
    schedule: Schedule = field(default_factory=Schedule)
    # the numbers for the last state
    _found: dict = field(default_factory=dict, repr=False, compare=False)

    def __call__(
        self, x0: np.ndarray, U: np.ndarray, noise: np.ndarray, target: int, J: np.ndarray
    ) -> None:
        """Fill J (blocks, LANES) with the horizon mean of the cost of v = clip(U + n_t noise), see
        schedule.

        x0 (n_x,), U (T, n_u), noise (series, n_u, halves * T, LANES).
        """
        d = self.dtype
        self._module.rollout(
            np.asarray(x0, d), U.astype(d), noise, J, *self._numbers(x0, target, len(U))
        )

    def paths(self, x0: np.ndarray, v: np.ndarray, target: int) -> tuple[np.ndarray, np.ndarray]:
        """The positions under at most LANES sampled controls, and the horizon mean of each term of
        their cost.

        x0 (n_x,), v (samples, n_u, T) -> the first three states (samples, T, 3), terms (samples,
        n_terms). One block on one thread.
        """
        d, (samples, n_u, T) = self.dtype, v.shape
        E = np.zeros((n_u, T, LANES), d)
        E[:, :, :samples] = v.transpose(1, 2, 0)
        path = np.empty((T, min(3, len(self.system.states)), LANES), d)
        means = np.empty((len(self.cost.term_names), LANES), d)
        n, *numbers = self._numbers(x0, target, T)
        self._module.paths(
            np.asarray(x0, d), np.zeros((T, n_u), d), E, path, means, np.ones_like(n), *numbers
        )
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
        numbers = (
            self.schedule.noise(horizon).astype(d),
            self.schedule.cost(horizon).astype(d),
            np.asarray(s.low, d),
            np.asarray(s.high, d),
            d(s.dt),
            self.cost.targets_from(target, x0, d),
            np.asarray(s.params, d),
            self.cost.numbers(horizon).astype(d),
        )
        if obstacles is None:
            return numbers
        near = obstacles.near(np.asarray(x0, float), horizon * s.dt).astype(d)
        term = self.cost.crash_term
        weight = self.cost.terms[term].weight
        if np.ndim(weight):
            raise ValueError(
                f"cost {self.cost.name}: weight_{self.cost.terms[term].name}: expected one number, as there are "
                f"obstacles, got shape {np.shape(weight)}"
            )
        return *numbers, near, steps_between(s.dt), term, d(weight)

    @cached_property
    def _module(self) -> ModuleType:  # a control step runs it several times
        return compiled_module(self.system, self.cost, self.dtype)


_modules: dict[tuple, ModuleType] = {}


def compiled_module(system: System, cost: Cost, dtype: type) -> ModuleType:
    """Return the compiled loops for this model and this cost, from the disk's cache where they were
    built before.

    Only what the text of the loops depends on counts, not the numbers: parameters and weights may
    change.
    """
    obstacles = cost.obstacles
    shape = (
        system.step,
        system.state,
        system.control,
        type(system.params),
        cost.row,
        type(cost.params),
        cost.reached,
        cost.crash,
        tuple(term.shape for term in cost.terms),
        (obstacles.touches, obstacles.row) if obstacles else None,
        dtype,
    )
    if shape not in _modules:
        source = module_source(system, cost, dtype)
        digest = hashlib.sha256(source.encode()).hexdigest()[:16]
        name = f"rollout_{system.step.__module__.split('.')[-1]}_{digest}"
        _modules[shape] = sys.modules.get(name) or load_module(name, source)
    return _modules[shape]
