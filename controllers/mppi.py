"""Model predictive path integral control: Algorithm 1 of Vlahov et al. 2024.

    for i in 1..I:
        z^m   <- the sampler                          m = 1..M
        v^m   <- clip(U + z^m)                        sampled controls
        J^m   <- (1/T) sum_t q(x_{t+1})               rollout through the model
        w^m   <- exp(-(J^m - min J) / lambda) / eta
        U     <- U + alpha sum_m w^m (v^m - U)

The temperature acts on the horizon's mean cost, as in the authors' public library.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from controllers.config import MPPIConfig
from controllers.costs import Cost
from controllers.plan import PlanStats
from controllers.rollout.compiled import is_cached
from controllers.rollout.lanes import CHUNK, LANES, Rollout
from controllers.rollout.reduce import weighted_mean
from controllers.samplers import SAMPLERS, Sampler, Sampling
from controllers.update import padded, savitzky_golay, shares, steer, weights
from quadsim.systems import System


@dataclass(frozen=True, eq=False, slots=True)
class Iteration:
    """All that decided the last iteration: its samples can be drawn again, see controllers.sampled_trajectories."""

    x: np.ndarray  # (n_x,)
    target: int
    call: int  # of the sampler
    centre: np.ndarray  # (T, n_u) what the samples perturbed
    aside: np.ndarray  # (T, n_u) from the centre to what the last ones perturbed, the share `rest_fraction`
    J: np.ndarray  # (M,)


class Adaptation(Protocol):
    """Learns the system from its states; see controllers.adaptation."""

    def observe(self, x: np.ndarray, u: np.ndarray, elapsed: int) -> System:
        """The system as it is believed now, at x (n_x,), `elapsed` control periods of u (n_u,) after the last state."""
        ...


class MPPI:
    """Receding-horizon controller. Keeps the plan U (T, n_u) between calls."""

    def __init__(
        self, system: System, cost: Cost, sampler: Sampler, config: MPPIConfig, adaptation: Adaptation | None = None
    ):
        self.cost, self.sampler, self.config, self.adaptation = cost, sampler, config, adaptation
        self.use_model(system)
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
        return self.rollout.is_cached and is_cached(self.sampler.loop)

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
        """The control to apply at state x (n_x,) on the way to row `target` of the targets.  -> (n_u,)

        `elapsed` control periods have passed since the last call: the plan is shifted by them.
        Raises ValueError for a state that is no state, e.g. of a plant that has diverged.
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
        centre, other = self.centres()
        self.last = i = Iteration(x, target, self._calls, centre, other - centre, np.empty(self.samples))
        starts = range(0, self.samples, CHUNK)
        means = [self._chunk(i, first) for first in starts]
        w = weights(i.J, self.temperature)
        mean = np.tensordot(np.add.reduceat(w, starts), means, axes=1)
        plan = np.clip(centre + self.config.step_size * mean, self.low, self.high)
        if self.sampler.momentum:
            self.sampler.momentum.change = plan - self.plan
        self.plan = plan
        if self.config.smooth:
            self.plan = np.clip(savitzky_golay(self.plan, self.executed), self.low, self.high)
        stats = PlanStats(float(i.J[0]), float(1 / np.sum(w * w)), self.temperature)
        self.temperature = steer(self.temperature, stats.ess, self.config.ess)
        return stats

    def _chunk(self, i: Iteration, first: int) -> np.ndarray:
        """Roll out the samples of one chunk into i.J and return the weighted mean of v - U among them.  (T, n_u)

        Their shares of all the weight put the chunks together: the mean of means, so weighted, is the mean.
        """
        J = i.J[first : first + CHUNK]
        z = self.perturbations(i, first, len(J))
        costs = np.empty((-(-len(J) // LANES), LANES), z.dtype)  # padded to whole blocks
        self.rollout(i.x, i.centre, z, i.target, costs)
        J[:] = costs.ravel()[: len(J)]
        return weighted_mean(z, i.centre, self.low, self.high, padded(shares(J, self.temperature)))

    def centres(self) -> tuple[np.ndarray, np.ndarray]:
        """What samples perturb, and what the last ones do, the share `rest_fraction`.  (T, n_u) each

        The plan and the rest control; of a plan with momentum, where that leads and the plan without it.
        """
        momentum = self.sampler.momentum
        return (self.plan + momentum.change, self.plan) if momentum else (self.plan, self.rest)

    def perturbations(self, i: Iteration, first: int, count: int) -> np.ndarray:
        """z of the samples from `first` on, around the centre: sample 0 is the centre itself."""
        z = self.sampler.sample(i.call, first, count)
        T, M = self.config.horizon, len(i.J)
        rest = max(M - int(self.config.rest_fraction * M) - first, 0)
        for b in range(rest // LANES, -(-count // LANES)):
            block_of(z, b, T)[:, :, max(rest - b * LANES, 0) :] += i.aside.T[:, :, None]
        if self.config.freeze_first:
            z[:, :, ::T] = 0
        if first == 0:
            block_of(z, 0, T)[:, :, 0] = 0
        return z


def build_mppi(
    system: System,
    cost: Cost,
    sampler: str,
    sampling: Sampling,
    config: MPPIConfig,
    key: np.ndarray,
    adaptation: Adaptation | None = None,
) -> MPPI:
    """MPPI with the sampler of this name, whose perturbations are a function of the key (2,) uint32."""
    held = min(config.samples, CHUNK)
    return MPPI(system, cost, SAMPLERS[sampler](sampling, held, config.horizon, key, config.dt), config, adaptation)


def block_of(z: np.ndarray, b: int, horizon: int) -> np.ndarray:
    """The perturbations of block b, a view.  (series, n_u, halves * T, LANES) -> (n_u, T, LANES)"""
    halves = z.shape[2] // horizon
    t0 = (b % halves) * horizon
    return z[b // halves, :, t0 : t0 + horizon]
