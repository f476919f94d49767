"""Model Predictive Path Integral control (MPPI): Algorithm 1 of Vlahov et al. 2024, with a few
extensions.

    for i in 1..I:
        z^m   <- the sampler                          m = 1..M
        v^m   <- clip(U + n z^m)                      sampled controls
        J^m   <- (1/T) sum_t s_t q(x_{t+1})           rollout through the model
        w^m   <- exp(-(J^m - min J) / lambda) / eta
        U     <- U + alpha sum_m w^m (v^m - U)

J is the mean over the horizon of the stage cost q, as in the authors' public library, so lambda
here is the textbook's lambda / T; the weights n_t and s_t are 1 unless configured. There is no
terminal cost, and no control-cost term lambda u^T Sigma^-1 z: that term stems from importance
sampling with a Gaussian, and samplers of other distributions are to be compared under the same
cost.

Extensions, most of them optional in MPPIConfig: the last samples perturb another sequence
(rest_fraction), the control limits are tightened, the plan may exceed them while what is applied
does not (overshoot), perturbations and cost are weighted along the horizon (controllers.schedule),
the first plan has more iterations (first_iterations), the temperature is adapted to an effective
sample size (ESS), the plan is filtered, and a sampler may have momentum
(controllers.samplers.smooth). What is estimated in flight, the model and the course, comes with the
state, as an Estimate (quadsim.dynamics.estimate). How samples lie in memory, and why they are drawn
in chunks, is said in controllers.lanes.layout.

Source: B. Vlahov, J. Gibson, D. D. Fan, P. Spieler, A. Agha-mohammadi and E. A. Theodorou, "Low
Frequency Sampling in Model Predictive Path Integral Control", IEEE Robotics and Automation Letters
9(5), 2024, 4543-4550; doi:10.48550/arXiv.2404.03094.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from controllers.config import MPPIConfig
from controllers.costs import Cost
from controllers.lanes import layout
from controllers.lanes.compiled import is_cached
from controllers.lanes.lanes import Rollout
from controllers.lanes.reduce import weighted_mean
from controllers.plan import PlanStats
from controllers.samplers import PlainSampler, Sampling, build_lanes
from controllers.samplers.lane_sampler import stream_key
from controllers.schedule import Schedule
from controllers.update import adapt_temperature, savitzky_golay, softmax_weights, weights
from quadsim.course import Course
from quadsim.dynamics import System
from quadsim.dynamics.control_periods import ControlPeriods
from quadsim.dynamics.estimate import Estimate


@dataclass(frozen=True, eq=False, slots=True)
class Iteration:
    """Inputs of the last iteration, enough to draw its samples again; see
    controllers.sampled_trajectories."""

    x: np.ndarray  # state from which the rollouts started  (n_x,)
    target: int  # row of the cost's targets
    call: int  # index of the sampler call
    nominal: np.ndarray  # control sequence that the samples perturb  (T, n_u)
    # from it to what the last rest_fraction * M samples perturb, over the ramp  (2, T, n_u)
    rest_offset: np.ndarray
    J: np.ndarray  # cost of each sample  (M,)


class MPPI:
    """Receding-horizon controller. Keeps the plan, the control sequence U (T, n_u), between calls.

    >>> import numpy as np
    >>> from quadsim import MPPI, Gaussian, MPPIConfig
    >>> from quadsim.paper.integrator import double_integrator, quadratic_cost
    >>> system, cost = double_integrator(dt=0.05), quadratic_cost(goal=(0.0, 0.0))
    >>> mppi = MPPI(system, cost, Gaussian(sigma=(1.0, 1.0)), MPPIConfig(samples=512, horizon=40,
    dt=0.05)) >>> x = np.array([2.0, -1.0, 0.0, 0.0])
    >>> for _ in range(100):
    ...     u, stats = mppi.control(x)
    ...     x = np.array(system.next(x, u))
    >>> bool(np.hypot(x[0], x[1]) < 0.1)  # at the goal [m]
    True

    Args:
        system: the model that is planned with.
        cost: stage cost; the rollout loop is compiled at the first call.
        sampler: one of controllers.samplers, or any object with `sample`, see PlainSampler.
        config: sampling budget and update; its dt must be the system's.
        seed: of the random perturbations. They depend on it and the index of the call alone, never
            on threads.
        cost_of: makes the cost of a course, as it is estimated in flight; None: the cost stays as
            it is.

    Raises:
        ValueError: sampler, system and configuration differ in the number of controls or in dt.
    """

    def __init__(
        self,
        system: System,
        cost: Cost,
        sampler: Sampling | PlainSampler,
        config: MPPIConfig = MPPIConfig(),  # noqa: B008 (frozen)
        seed: int | np.random.SeedSequence = 0,
        cost_of: Callable[[Course], Cost] | None = None,
    ):
        if config.dt != system.dt:
            raise ValueError(f"dt: expected the system's {system.dt:g} s, got {config.dt:g}")
        n_u = len(system.controls)
        self.config = config
        self.cost = cost
        self.cost_of = cost_of
        # as it was estimated last; None: the map that `cost` was made for
        self.course: Course | None = None
        self.periods = ControlPeriods(config.dt)
        self.schedule = Schedule(config.first_noise, config.cost_rise)
        self.ramp = self.schedule.noise(config.horizon)  # factors on the perturbations  (2, T)
        chunk_size = min(config.samples, layout.CHUNK)
        self.sampler = build_lanes(
            sampler, n_u, chunk_size, config.horizon, stream_key(seed), config.dt
        )
        self.beyond = np.zeros(n_u)  # by which the plan may exceed the limits  (n_u,)
        if config.overshoot:  # in standard deviations of what is drawn before the first call
            self.beyond = config.overshoot * self.sampler.sample(0).std(axis=(0, 2, 3), dtype=float)
        self.set_model(system)
        # the control at rest; of a quadrotor hover: no rates, thrust g  (n_u,)
        self.rest = np.array(system.rest)
        self.plan = np.tile(self.rest, (config.horizon, 1))  # U (T, n_u)
        self.guide = self.plan
        # the last two controls, left padding of the smoothing filter
        self.executed = np.tile(self.rest, (2, 1))
        self.temperature = config.temperature
        self.samples = config.samples  # M, which a deadline may change
        self.last: Iteration | None = None
        self._calls = 0

    def control(self, known: Estimate | np.ndarray) -> tuple[np.ndarray, PlanStats]:
        """Return the control to apply.

        The plan is shifted by as many steps as control periods have passed since the last call.

        Args:
            known: what is known of the vehicle, or its state x (n_x,) alone. A state alone is taken
                to be one control period after the last one, with the first row of the cost's
                targets as the target.

        Returns:
            The control (n_u,) and statistics of the plan.

        Raises:
            ValueError: x has another length or is not finite, as when the plant has diverged.
            FloatingPointError: no sample has a finite cost.
        """
        estimate = known if isinstance(known, Estimate) else Estimate(self.periods.next, known)
        self.system.check(estimate.x)
        self.use_estimates(estimate)
        iterations = self.warm_start(estimate)
        for _ in range(iterations):
            stats = self.iterate(estimate.x, estimate.target)
        return self.command(estimate.x), stats

    def iterate(self, x: np.ndarray, target: int) -> PlanStats:
        """Improve the plan U by one iteration of Algorithm 1.

        Args:
            x: state that the rollouts start from (n_x,).
            target: row of the cost's targets.
        """
        # Perturb the plan, and for the last samples an alternative to it.
        self._calls += 1
        U, alternative = self.nominals()  # (T, n_u) each
        rest_offset = (alternative - U) / self.ramp[:, :, None]  # (2, T, n_u)
        J = np.empty(self.samples)  # (M,)
        self.last = it = Iteration(x, target, self._calls, U, rest_offset, J)

        # Sample the controls v = clip(U + n z) and roll them out. Samples come in chunks that fit
        # the processor's caches: the perturbations of a chunk are overwritten by the next one's, so
        # each chunk is averaged at once.
        means = []  # of each chunk, with weights normalised within it  (T, n_u)
        for chunk in layout.chunks(self.samples):
            z = self.perturbations(it, chunk)  # (series, n_u, halves * T, LANES)
            J[chunk] = self.costs(it, z, chunk)
            share = softmax_weights(J[chunk], self.temperature)
            means.append(weighted_mean(z, self.ramp, U, self.plan_low, self.plan_high, share))

        # Weigh the samples by their costs.
        w = weights(J, self.temperature)  # (M,)

        # Update the plan by the weighted mean of v - U, each chunk by its part of the total weight.
        self.update(U + self.config.step_size * layout.mean_of_chunks(means, w))

        stats = PlanStats(
            cost=float(J[0]), ess=float(1 / np.sum(w * w)), temperature=self.temperature
        )
        self.temperature = adapt_temperature(self.temperature, stats.ess, self.config.target_ess)
        return stats

    def nominals(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the control sequences to perturb.

        Returns:
            The main one, and the alternative for the last rest_fraction of the samples. Without
            momentum: the plan and the guide. With momentum: plan + momentum, and the plan. (T, n_u)
                each.
        """
        momentum = self.sampler.momentum
        if momentum:
            return self.plan + momentum.change, self.plan
        return self.plan, self.guide

    def perturbations(self, it: Iteration, chunk: slice) -> np.ndarray:
        """Return z of the chunk's samples, relative to it.nominal; z of sample 0 is zero.

        Returns:
            (series, n_u, halves * T, LANES), a layout described in controllers.lanes.layout.
        """
        count = chunk.stop - chunk.start
        T = self.config.horizon
        M = len(it.J)
        z = self.sampler.sample(it.call, chunk.start, count)
        first_alternative = M - int(self.config.rest_fraction * M)
        layout.add_from(z, max(first_alternative - chunk.start, 0), count, it.rest_offset)
        if self.config.freeze_first:
            layout.first_steps(z, T)[:] = 0
        if chunk.start == 0:
            layout.sample(z, 0, T)[:] = 0
        return z

    def costs(self, it: Iteration, z: np.ndarray, chunk: slice) -> np.ndarray:
        """Return J of the chunk's samples, with the perturbations z, rolled out from it.x.
        (samples,)"""
        count = chunk.stop - chunk.start
        J = np.empty((layout.blocks(count), layout.LANES), z.dtype)
        self.rollout(it.x, it.nominal, z, it.target, J)
        return J.ravel()[:count]

    def update(self, plan: np.ndarray) -> None:
        """Set the plan, clipped to its limits and filtered if configured, and the momentum, if the
        sampler has one."""
        plan = np.clip(plan, self.plan_low, self.plan_high)
        if self.sampler.momentum:
            self.sampler.momentum.change = plan - self.plan
        self.plan = plan
        if self.config.smooth:
            self.plan = np.clip(
                savitzky_golay(self.plan, self.executed), self.plan_low, self.plan_high
            )

    def use_estimates(self, estimate: Estimate) -> None:
        """Plan with the estimated course and model from now on, where they are given and have
        changed."""
        course, model = estimate.course, estimate.model
        if self.cost_of and course is not None and course is not self.course:
            self.course = course
            self.set_cost(self.cost_of(course))
        if model is not None and model != self.model:
            self.set_model(model)

    def warm_start(self, estimate: Estimate) -> int:
        """Shift the plan to the present. Return the number of iterations to improve it by."""
        self.guide = self.guided(estimate.target, estimate.x)
        steps = self.periods.advance(estimate.t)
        is_first = self._calls == 0
        if is_first and self.cost.guide:
            self.plan = self.guide.copy()
        elif not is_first and steps:
            self.shift(steps)
        if is_first and self.config.first_iterations:
            return self.config.first_iterations
        return self.config.iterations

    def shift(self, steps: int) -> None:
        """Drop the controls of the plan that lie in the past, append the guide's."""
        self.executed = np.vstack([self.executed, self.clipped(self.plan[:steps])])[-2:]
        self.plan = np.vstack([self.plan[steps:], self.guide[-steps:]])
        if self.sampler.momentum:
            self.sampler.momentum.shift(steps)

    def guided(self, target: int, x: np.ndarray) -> np.ndarray:
        """Return the controls that the last samples perturb: the cost's guide, else rest.  (T,
        n_u)"""
        T = self.config.horizon
        if self.cost.guide:
            return self.cost.guide(target, x, T)
        return np.tile(self.rest, (T, 1))

    def command(self, x: np.ndarray) -> np.ndarray:
        """Return the plan's first control, as far as the vehicle can follow it.  (n_u,)"""
        u = self.clipped(self.plan[0])
        attainable = self.system.attainable
        if attainable is None:
            return u
        return np.array(
            attainable(self.system.state(*x), self.system.control(*u), self.system.params)
        )

    def clipped(self, u: np.ndarray) -> np.ndarray:
        """Return controls within the limits, which the plan may exceed.  (..., n_u) -> (...,
        n_u)"""
        return np.clip(u, self.low, self.high)

    def set_model(self, system: System) -> None:
        """Plan with this system from now on: the same states and controls, other parameters."""
        self.model = system
        self.system = system.tightened(self.config.tighten)
        self.rollout = Rollout(self.system, self.cost, schedule=self.schedule)
        self.low = np.array(self.system.low)
        self.high = np.array(self.system.high)
        self.plan_low = self.low - self.beyond
        self.plan_high = self.high + self.beyond

    def set_cost(self, cost: Cost) -> None:
        """Plan with this cost from now on: the same terms compile nothing anew, whatever their
        numbers."""
        self.cost = cost
        self.rollout = Rollout(self.system, cost, schedule=self.schedule)

    def continue_from(self, planner: MPPI) -> None:
        """Start from another planner's plan, momentum and time. It must have the same system and
        horizon."""
        self.plan = planner.plan
        self.executed = planner.executed
        self.periods = planner.periods
        self._calls = planner._calls
        if self.sampler.momentum and planner.sampler.momentum:
            self.sampler.momentum.change = planner.sampler.momentum.change

    @property
    def is_cached(self) -> bool:
        """Whether the loops were compiled on this machine before; otherwise the first plan takes
        some 20 s."""
        return self.rollout.is_cached and (
            self.sampler.loop is None or is_cached(self.sampler.loop)
        )
