"""Model Predictive Path Integral control (MPPI): Algorithm 1 of Vlahov et al. 2024.

    for i in 1..I:
        z^m   <- the sampler                          m = 1..M
        v^m   <- clip(U + z^m)                        sampled controls
        J^m   <- (1/T) sum_t q(x_{t+1})               rollout through the model
        w^m   <- exp(-(J^m - min J) / lambda) / eta
        U     <- U + alpha sum_m w^m (v^m - U)

The temperature acts on the horizon's mean cost, as in the authors' public library. How samples lie in memory, and why
they are drawn in chunks, is said in controllers.rollout.layout.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from controllers.config import MPPIConfig
from controllers.costs import Cost
from controllers.plan import PlanStats
from controllers.rollout import layout
from controllers.rollout.compiled import is_cached
from controllers.rollout.lanes import Rollout
from controllers.rollout.reduce import weighted_mean
from controllers.samplers import PlainSampler, Sampling, build_lanes
from controllers.samplers.lane_sampler import stream_key
from controllers.update import savitzky_golay, shares, steer, weights
from quadsim.systems import System


@dataclass(frozen=True, eq=False, slots=True)
class Iteration:
    """All that decided the last iteration: its samples can be drawn again, see controllers.sampled_trajectories."""

    x: np.ndarray  # (n_x,)
    target: int
    call: int  # of the sampler
    centre: np.ndarray  # (T, n_u) what the samples perturbed
    rest_offset: np.ndarray  # (T, n_u) from the centre to what the last ones perturbed, the share `rest_fraction`
    J: np.ndarray  # (M,)


class Adaptation(Protocol):
    """Learns the system from its states; see controllers.adaptation."""

    def observe(self, x: np.ndarray, u: np.ndarray, elapsed: int) -> System:
        """The system as estimated at x (n_x,), `elapsed` control periods of u (n_u,) after the last state."""
        ...


class MPPI:
    """Receding-horizon controller. Keeps the plan U (T, n_u) between calls.

    >>> system, cost = double_integrator(dt=0.05), quadratic_cost(goal=(0.0, 0.0))
    >>> mppi = MPPI(system, cost, Gaussian(sigma=(1.0, 1.0)), MPPIConfig(samples=512, horizon=40, dt=0.05))
    >>> x = np.array([2.0, -1.0, 0.0, 0.0])
    >>> for _ in range(100):
    ...     u, stats = mppi.control(x)
    ...     x = np.array(system.step(x, u, system.params, system.dt))

    Args:
        system: the model that is planned with.
        cost: of a step; its rollouts are compiled when the planner is made.
        sampler: one of controllers.samplers, or any object with `sample`, see PlainSampler.
        config: budget and update; its dt is the system's.
        seed: of the perturbations. What is drawn depends on it and the number of the call alone, never on threads.
        adaptation: estimates the system in flight; None: the model stays as it is.

    Raises:
        ValueError: the numbers of sampler, system and configuration do not go together.
    """

    def __init__(
        self,
        system: System,
        cost: Cost,
        sampler: Sampling | PlainSampler,
        config: MPPIConfig = MPPIConfig(),  # noqa: B008 (frozen)
        seed: int | np.random.SeedSequence = 0,
        adaptation: Adaptation | None = None,
    ):
        if config.dt != system.dt:
            raise ValueError(f"dt: expected the system's {system.dt:g} s, got {config.dt:g}")
        self.cost, self.config, self.adaptation = cost, config, adaptation
        self.use_model(system)
        held, n_u = min(config.samples, layout.CHUNK), len(system.controls)
        self.sampler = build_lanes(sampler, n_u, held, config.horizon, stream_key(seed), config.dt)
        self.rest = np.array(system.rest)
        self.plan = np.tile(self.rest, (config.horizon, 1))  # U (T, n_u)
        self.executed = np.tile(self.rest, (2, 1))  # the last two controls, left padding of the filter
        self.temperature = config.temperature
        self.samples = config.samples  # M, which a deadline may change
        self.last: Iteration | None = None
        self._calls = 0

    @property
    def is_cached(self) -> bool:
        """Whether its loops were compiled on this machine before; else the first plan takes some 20 s."""
        return self.rollout.is_cached and (self.sampler.loop is None or is_cached(self.sampler.loop))

    def use_model(self, system: System) -> None:
        """Plan with this system from now on: the same states and controls, other numbers."""
        self.system = system.tightened(self.config.tighten)
        self.rollout = Rollout(self.system, self.cost)
        self.low, self.high = np.array(self.system.low), np.array(self.system.high)

    def take_over(self, other: MPPI) -> None:
        """Go on with another planner's plan: new numbers act from the next plan on. Same system, same horizon."""
        self.plan, self.executed, self._calls = other.plan, other.executed, other._calls
        self.adaptation = other.adaptation
        if self.sampler.momentum and other.sampler.momentum:
            self.sampler.momentum.change = other.sampler.momentum.change

    def control(self, x: np.ndarray, target: int = 0, elapsed: int = 1) -> tuple[np.ndarray, PlanStats]:
        """The control to apply at state x.

        Args:
            x: (n_x,)
            target: row of the cost's targets that is flown to.
            elapsed: control periods since the last call; the plan is shifted by them.

        Returns:
            The control (n_u,) and what is to be reported of the plan.

        Raises:
            ValueError: x is no state, for example of a plant that has diverged.
            FloatingPointError: no sample has a finite cost.
        """
        self.system.check(x)
        if self.adaptation:
            self.use_model(self.adaptation.observe(x, self.plan[0], elapsed))
        if self._calls and elapsed:
            self.shift(elapsed)
        for _ in range(self.config.iterations):
            stats = self.improve(x, target)
        return self.plan[0].copy(), stats

    def shift(self, steps: int) -> None:
        """Warm start: drop the controls of the past, append rest controls."""
        self.executed = np.vstack([self.executed, self.plan[:steps]])[-2:]
        tail = np.tile(self.rest, (min(steps, len(self.plan)), 1))
        self.plan = np.vstack([self.plan[steps:], tail])
        if self.sampler.momentum:
            self.sampler.momentum.shift(steps)

    def improve(self, x: np.ndarray, target: int) -> PlanStats:
        """One iteration of Algorithm 1 on the plan."""
        self._calls += 1
        U, other = self.centres()
        J = np.empty(self.samples)
        self.last = Iteration(x, target, self._calls, U, other - U, J)
        means = []
        for chunk in layout.chunks(self.samples):
            z = self.perturbations(self.last, chunk)
            J[chunk] = self.costs(self.last, z, len(J[chunk]))
            means.append(weighted_mean(z, U, self.low, self.high, shares(J[chunk], self.temperature)))
        w = weights(J, self.temperature)
        self.update(U + self.config.step_size * layout.mean_of_chunks(means, w))
        stats = PlanStats(float(J[0]), float(1 / np.sum(w * w)), self.temperature)
        self.temperature = steer(self.temperature, stats.ess, self.config.target_ess)
        return stats

    def centres(self) -> tuple[np.ndarray, np.ndarray]:
        """What samples perturb, and what the last ones do, the share `rest_fraction`.  (T, n_u) each

        The plan and the rest control; of a plan with momentum, where that leads and the plan without it.
        """
        momentum = self.sampler.momentum
        return (self.plan + momentum.change, self.plan) if momentum else (self.plan, self.rest)

    def perturbations(self, i: Iteration, chunk: slice) -> np.ndarray:
        """z of these samples, around the centre: sample 0 is the centre itself.  (series, n_u, halves * T, LANES)"""
        count, T, M = chunk.stop - chunk.start, self.config.horizon, len(i.J)
        z = self.sampler.sample(i.call, chunk.start, count)
        at_rest = M - int(self.config.rest_fraction * M)  # the first sample around the rest control
        layout.add_from(z, max(at_rest - chunk.start, 0), count, i.rest_offset)
        if self.config.freeze_first:
            layout.first_steps(z, T)[:] = 0
        if chunk.start == 0:
            layout.sample(z, 0, T)[:] = 0
        return z

    def costs(self, i: Iteration, z: np.ndarray, count: int) -> np.ndarray:
        """J of the first `count` samples of z, flown from x.  (count,)"""
        J = np.empty((layout.blocks(count), layout.LANES), z.dtype)
        self.rollout(i.x, i.centre, z, i.target, J)
        return J.ravel()[:count]

    def update(self, plan: np.ndarray) -> None:
        """The new plan within the limits, filtered where that is wanted, and the momentum that led to it."""
        plan = np.clip(plan, self.low, self.high)
        if self.sampler.momentum:
            self.sampler.momentum.change = plan - self.plan
        self.plan = plan
        if self.config.smooth:
            self.plan = np.clip(savitzky_golay(self.plan, self.executed), self.low, self.high)
