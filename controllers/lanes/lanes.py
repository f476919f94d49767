"""The rollout of Algorithm 1 as a generated, vectorised loop over lanes of samples.

A block of LANES samples (see controllers.lanes.layout) advances together. Every number of the state
and of the targets is an array of its own, so that LLVM vectorises the step and the cost, which are
inlined from their plain functions.
"""

from __future__ import annotations

import hashlib
import sys
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from types import ModuleType

import numpy as np

from controllers.costs import Cost, Weight, number_name
from controllers.lanes.compiled import is_cached, load_module
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
    # Weights and parameters in place of the cost's own, see Cost.numbers
    given: Mapping[str, Weight] = field(default_factory=dict, repr=False, compare=False)
    # The numbers for the last state, see `_numbers`
    _found: dict = field(default_factory=dict, repr=False, compare=False)

    def __call__(
        self, x0: np.ndarray, U: np.ndarray, noise: np.ndarray, target: int, J: np.ndarray
    ) -> None:
        """Fill J with the horizon mean of the cost of v = clip(U + n_t noise), see schedule.

        Args:
            x0: state  (n_x,).
            U: plan  (T, n_u).
            noise: perturbations  (series, n_u, halves * T, LANES).
            target: number of targets reached.
            J: to fill  (blocks, LANES).
        """
        d = self.dtype
        numbers = self._numbers(x0, target, len(U))
        self._module.rollout(np.asarray(x0, d), U.astype(d), noise, J, *numbers)

    def paths(self, x0: np.ndarray, v: np.ndarray, target: int) -> tuple[np.ndarray, np.ndarray]:
        """Return the paths under some controls, rolled out as one block on one thread.

        Args:
            x0: state  (n_x,).
            v: controls of at most LANES samples  (samples, n_u, T).
            target: number of targets reached.

        Returns:
            The first three numbers of the state, which are the position of a vehicle
            (samples, T, 3), and the horizon mean of each term of the cost (samples, n_terms).
        """
        d = self.dtype
        samples, n_u, T = v.shape
        block = np.ascontiguousarray(v.transpose(1, 2, 0), d)
        path = np.empty((T, min(3, len(self.system.states)), samples), d)
        means = np.empty((len(self.cost.term_names), samples), d)

        # The controls are perturbations of a plan of zeros, in full.
        noise_factor, *numbers = self._numbers(x0, target, T)
        plan = np.zeros((T, n_u), d)
        full = np.ones_like(noise_factor)
        self._module.paths(np.asarray(x0, d), plan, block, path, means, full, *numbers)
        return path.transpose(2, 0, 1), means.T

    @property
    def is_cached(self) -> bool:
        """Whether the loop was compiled on this machine before."""
        return is_cached(self._module.rollout)

    def _numbers(self, x0: np.ndarray, target: int, horizon: int) -> tuple:
        """Return the further arguments of the loops, found once for a state.

        All iterations and chunks of a control step start from the same state.
        """
        key = x0.tobytes(), target, horizon
        if key not in self._found:
            self._found.clear()
            self._found[key] = self._find_numbers(x0, target, horizon)
        return self._found[key]

    def _find_numbers(self, x0: np.ndarray, target: int, horizon: int) -> tuple:
        """Return the further arguments of the loops, in the lanes' precision.

        Raises:
            ValueError: the weight of crashes depends on the step, and there are obstacles.
        """
        system, cost, d = self.system, self.cost, self.dtype
        numbers = (
            self.schedule.noise(horizon).astype(d),
            self.schedule.cost(horizon).astype(d),
            np.asarray(system.low, d),
            np.asarray(system.high, d),
            d(system.dt),
            cost.targets_from(target, x0, d),
            np.asarray(system.params, d),
            cost.numbers(horizon, self.given).astype(d),
        )
        if cost.obstacles is None:
            return numbers
        near = cost.obstacles.near(np.asarray(x0, float), horizon * system.dt).astype(d)
        crash_term = cost.crash_term
        term = cost.terms[crash_term]
        weight = self.given.get(number_name(term.name, "weight"), term.weight)
        if np.ndim(weight):
            raise ValueError(
                f"cost {cost.name}: weight_{term.name}: expected one number, as there are "
                f"obstacles, got shape {np.shape(weight)}"
            )
        return *numbers, near, steps_between(system.dt), crash_term, d(weight)

    @cached_property
    def _module(self) -> ModuleType:
        """The compiled loops. A control step runs them several times."""
        return compiled_module(self.system, self.cost, self.dtype)


_modules: dict[tuple, ModuleType] = {}
OWN_PACKAGES = ("controllers", "quadsim")


def compiled_module(system: System, cost: Cost, dtype: type) -> ModuleType:
    """Return the compiled loops for a model and a cost.

    They come from the disk's cache if they were built before. Only the inputs of their text
    matter, not the numbers: parameters and weights may change.

    Args:
        system: the model.
        cost: the cost.
        dtype: NumPy type of all numbers.
    """
    shape = _shape(system, cost, dtype)
    if shape not in _modules:
        _modules[shape] = _load(system, cost, dtype)
    return _modules[shape]


def trace_anew(system: System, cost: Cost, dtype: type = np.float32) -> None:
    """Let `compiled_module` use the user's functions as they are now.

    A number that a function takes from a global, a closure or an object is compiled as it was when
    the function was traced, and may be another one since. The same text is not compiled again.

    Args:
        system: the model.
        cost: the cost.
        dtype: NumPy type of all numbers.
    """
    functions = (system.step, cost.reached, cost.crash, *(term.function for term in cost.terms))
    if all(map(_is_of_project, functions)):
        return
    _modules[_shape(system, cost, dtype)] = _load(system, cost, dtype)


def _is_of_project(function: object) -> bool:
    """Return whether a function is of this project, which has none that takes a changing number."""
    module = getattr(function, "__module__", None) or ""
    return function is None or module.partition(".")[0] in OWN_PACKAGES


def _shape(system: System, cost: Cost, dtype: type) -> tuple:
    """Return the key of the compiled loops: the inputs of their text."""
    obstacles = cost.obstacles
    return (
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


def _load(system: System, cost: Cost, dtype: type) -> ModuleType:
    """Return the module of the compiled loops, the loaded one if their text is the same."""
    source = module_source(system, cost, dtype)
    digest = hashlib.sha256(source.encode()).hexdigest()[:16]
    name = f"rollout_{system.step.__module__.split('.')[-1]}_{digest}"
    return sys.modules.get(name) or load_module(name, source)
