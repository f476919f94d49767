"""The rollout of Algorithm 1 as a generated, vectorised loop over lanes of samples.

A block of LANES samples (see quadsim.controllers.lanes.layout) advances together. Every number of
the state and of the targets has its own array, so that LLVM vectorises the step and the cost, which
are inlined from their plain functions.
"""

from __future__ import annotations

import hashlib
import os
import sys
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from pathlib import Path
from types import FunctionType, ModuleType
from typing import NamedTuple

import numpy as np

from quadsim.controllers.costs import Cost, Weight, number_name
from quadsim.controllers.lanes.compiled import is_cached, load_module
from quadsim.controllers.lanes.layout import LANES
from quadsim.controllers.lanes.planner_loops import module_source, steps_between, term_steps
from quadsim.controllers.lanes.sharing import on_threads
from quadsim.controllers.schedule import Schedule, marks_at
from quadsim.dynamics import System


class Trajectories(NamedTuple):
    """Samples after a rollout, with their states, crashes and target rows at each step."""

    states: np.ndarray  # after each step  (samples, T, n_x)
    # the crash flag: at least 1.0 from the step of a crash on, before that the risks so far
    crashed: np.ndarray  # (samples, T)
    rows: np.ndarray  # the target row of each step, counted from the first  (samples, T)
    J: np.ndarray  # (samples,)

    def sample(self, m: int) -> Trajectories:
        """Return sample m, without the axis of samples."""
        return Trajectories(*(each[m] for each in self))


class NumbersAlong(NamedTuple):
    """The numbers of a rollout that depend on the horizon alone, see RolloutNumbers."""

    periods: int  # number of control periods
    noise_factor: np.ndarray
    cost_factor: np.ndarray
    mark_factor: np.ndarray
    line_marks: np.ndarray


class RolloutNumbers(NamedTuple):
    """The numbers that the compiled rollout reads, in the lanes' precision."""

    noise_factor: np.ndarray  # factors on the noise of even and of odd blocks  (2, T)
    cost_factor: np.ndarray  # factors on the cost of each step  (T,)
    mark_factor: np.ndarray  # factors on the terms at marks, 0 at other steps  (T,)
    low: np.ndarray  # limits of the controls  (n_u,)
    high: np.ndarray
    dt: np.ndarray  # length of each step, or of all steps [s]  (T or 1,)
    targets: np.ndarray  # the rows from the present target on  (rows, n_row)
    system: np.ndarray  # parameters of the model, for each step or for all  (T or 1, n_p)
    cost: np.ndarray  # parameters and weights of the cost  (1 or T, numbers)
    obstacles: np.ndarray  # the obstacles in reach  (obstacles, n_obstacle)
    stride: int  # control periods between two tests against obstacles
    line_marks: np.ndarray  # whether a line that is tested ends with this step  (T,)
    crash_weight: np.floating


# Cached, as each control step has a new Rollout if the model is learned in flight
@lru_cache(maxsize=64)
def _numbers_along(schedule: Schedule, horizon: int, dt: float, dtype: type) -> NumbersAlong:
    """Return the numbers that depend on the horizon alone.

    Args:
        schedule: the steps, and the factors along them.
        horizon: number of steps.
        dt: control period [s].
        dtype: the lanes' precision.
    """
    periods = schedule.periods(horizon)
    line_marks = np.zeros(horizon, np.bool_)
    line_marks[marks_at(periods.tolist(), steps_between(dt))] = True
    return NumbersAlong(
        periods=int(periods.sum()),
        noise_factor=schedule.noise(horizon).astype(dtype),
        cost_factor=schedule.cost(horizon).astype(dtype),
        mark_factor=schedule.marks(horizon, term_steps(dt)).astype(dtype),
        line_marks=line_marks,
    )


@dataclass(frozen=True)
class Rollout:
    """The function that computes the costs J^m of M samples, for one system and one cost."""

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
        """Fill J with the mean cost of v = clip(U + n_t noise) over the horizon, see schedule.

        Args:
            x0: state  (n_x,).
            U: plan  (T, n_u).
            noise: perturbations  (series, n_u, halves * T, LANES).
            target: number of targets reached.
            J: array to fill  (blocks, LANES).
        """
        d = self.dtype
        numbers = self._numbers(x0, target, len(U))
        # An array with a different memory order would make numba compile the loop again.
        plan = U.astype(d, "C")
        keep_none = np.empty((0, 0, 0), d)
        loop = self._module.rollout
        on_threads(loop, len(J), np.asarray(x0, d), plan, noise, J, keep_none, numbers)

    def trajectories(self, x0: np.ndarray, v: np.ndarray, target: int) -> Trajectories:
        """Return the trajectories under given controls.

        They are computed as one block on the calling thread, independently of other threads.

        Args:
            x0: state  (n_x,).
            v: controls of at most LANES samples  (samples, n_u, T).
            target: number of targets reached.
        """
        d = self.dtype
        samples, n_u, T = v.shape
        # The controls are full perturbations of a zero plan. Lanes without a sample stay zero.
        plan = np.zeros((T, n_u), d)
        block = np.zeros((1, n_u, T, LANES), d)
        block[0, :, :, :samples] = v.transpose(1, 2, 0)
        numbers = self._numbers(x0, target, T)
        full = numbers._replace(noise_factor=np.ones_like(numbers.noise_factor))

        # Zero in the place of the desk: the loop runs on this thread, over one block.
        n_x = len(self.system.states)
        J = np.empty((1, LANES), d)
        kept = np.empty((T, n_x + 2, samples), d)
        self._module.rollout(0, 0, 1, np.asarray(x0, d), plan, block, J, kept, full)

        kept = kept.transpose(2, 0, 1)
        return Trajectories(
            states=kept[..., :n_x],
            crashed=kept[..., n_x],
            rows=kept[..., n_x + 1].astype(int),
            J=J[0, :samples],
        )

    @property
    def is_cached(self) -> bool:
        """Whether the compiled loop is in this machine's cache."""
        return is_cached(self._module.rollout)

    def _numbers(self, x0: np.ndarray, target: int, horizon: int) -> RolloutNumbers:
        """Return the inputs of the loops, which are computed once per state.

        All iterations and chunks of a control step start from the same state.
        """
        key = x0.tobytes(), target, horizon
        if key not in self._found:
            self._found.clear()
            self._found[key] = self._find_numbers(x0, target, horizon)
        return self._found[key]

    def _find_numbers(self, x0: np.ndarray, target: int, horizon: int) -> RolloutNumbers:
        """Return the inputs of the loops.

        Raises:
            ValueError: the weight of crashes depends on the step, and there are obstacles.
        """
        system, cost, d = self.system, self.cost, self.dtype
        along = _numbers_along(self.schedule, horizon, system.dt, d)
        near = np.empty((0, 0), d)
        crash_weight: Weight = 0.0
        if cost.obstacles:
            near = cost.obstacles.near(np.asarray(x0, float), along.periods * system.dt).astype(d)
            term = cost.terms[cost.crash_term]
            crash_weight = self.given.get(number_name(term.name, "weight"), term.weight)
            if np.ndim(crash_weight):
                raise ValueError(
                    f"cost {cost.name}: weight_{term.name}: expected one number, as there are "
                    f"obstacles, got shape {np.shape(crash_weight)}"
                )
        return RolloutNumbers(
            noise_factor=along.noise_factor,
            cost_factor=along.cost_factor,
            mark_factor=along.mark_factor,
            low=np.asarray(system.low, d),
            high=np.asarray(system.high, d),
            dt=self._lengths,
            targets=cost.targets_from(target, x0, d),
            system=self._step_numbers,
            cost=cost.numbers(horizon, self.given, self.schedule.lengths).astype(d),
            obstacles=near,
            stride=steps_between(system.dt),
            line_marks=along.line_marks,
            crash_weight=d(crash_weight * horizon / along.periods),
        )

    @cached_property
    def _systems(self) -> list[System]:
        """The system of each step, or one for all steps of equal length."""
        lengths = self.schedule.lengths or (1,)
        known = {length: self.system.over(length) for length in set(lengths)}
        return [known[length] for length in lengths]

    @cached_property
    def _lengths(self) -> np.ndarray:
        """The length of each step [s], see RolloutNumbers."""
        return np.array([system.dt for system in self._systems], self.dtype)

    @cached_property
    def _step_numbers(self) -> np.ndarray:
        """The parameters of the model in each step, see RolloutNumbers."""
        return np.array([system.params for system in self._systems], self.dtype)

    @cached_property
    def _module(self) -> ModuleType:
        """The compiled loops. A control step runs them several times."""
        return compiled_module(self.system, self.cost, self.dtype)


_modules: dict[tuple, ModuleType] = {}
OWN_FOLDER = f"{Path(__file__).parents[2]}{os.sep}"


def compiled_module(system: System, cost: Cost, dtype: type) -> ModuleType:
    """Return the compiled loops for a model and a cost.

    They are loaded from the cache if they were compiled before. They depend on the functions of
    model and cost, but not on numbers: parameters and weights may change.

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
    """Make `compiled_module` trace the user's functions again.

    A number that a function takes from a global, a closure or an object is compiled with its value
    at the time of the trace, and may have changed since. An equal text is not compiled again.

    Args:
        system: the model.
        cost: the cost.
        dtype: NumPy type of all numbers.
    """
    functions = (
        *(system.step, cost.reached, cost.crash, cost.risk),
        *(term.function for term in cost.terms),
    )
    if all(map(_is_of_project, functions)):
        return
    _modules[_shape(system, cost, dtype)] = _load(system, cost, dtype)


def _is_of_project(function: object) -> bool:
    """Return whether a function belongs to quadsim, or is None.

    No function of quadsim takes a number from a global or a closure that changes between traces.
    """
    if isinstance(function, FunctionType):
        # Not its module, which `functools.wraps` copies from another function
        return function.__code__.co_filename.startswith(OWN_FOLDER)
    module = getattr(function, "__module__", None) or ""
    return function is None or module.partition(".")[0] == "quadsim"


def _shape(system: System, cost: Cost, dtype: type) -> tuple:
    """Return the key of the compiled loops: the values that their text depends on."""
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
        cost.risk,
        tuple(term.shape for term in cost.terms),
        (obstacles.touches, obstacles.row) if obstacles else None,
        dtype,
    )


def _load(system: System, cost: Cost, dtype: type) -> ModuleType:
    """Return the module of the compiled loops, which is reused if their text is the same."""
    source = module_source(system, cost, dtype)
    digest = hashlib.sha256(source.encode()).hexdigest()[:16]
    name = f"rollout_{digest}"
    return sys.modules.get(name) or load_module(name, source)
