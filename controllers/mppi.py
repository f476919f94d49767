"""Model Predictive Path Integral control (MPPI), Algorithm 1 of Vlahov et al. 2024.

    for i in 1..I:
        z^m   <- the sampler                          (1)  m = 1..M
        v^m   <- clip(U + n z^m)                      (2)  sampled controls
        J^m   <- (1/T) sum_t s_t q(x_{t+1})           (3)  rollout through the model
        w^m   <- exp(-(J^m - min J) / lambda) / eta   (4)  weights, whose sum is 1
        U     <- U + sum_m w^m (v^m - U)              (5)  update of the plan

J is the mean over the horizon of the stage cost q, as in the authors' public library, so lambda
here is the textbook's lambda / T. The weights n_t and s_t are 1 unless configured. There is no
terminal cost, and no control-cost term lambda u^T Sigma^-1 z: that term stems from importance
sampling with a Gaussian, and samplers of other distributions are to be compared under the same
cost.

There are extensions, most of them optional in MPPIConfig:

* A fraction of the samples perturbs a sequence other than the plan (rest_fraction).
* The control limits are tightened (tighten), and the plan may exceed them while the command does
  not (overshoot).
* Perturbations and cost are weighted along the horizon (quadsim.controllers.schedule).
* Later steps of the rollouts may be longer than a control period (longer_steps), while the plan
  keeps a control for each period.
* The first control of the plan may be left unperturbed (freeze_first).
* Only a fraction of the update in equation (5) may be applied (step_size).
* The first plan has more iterations (first_iterations), and so may a plan whose course has changed
  (news_iterations): samples near the last plan all hit a gate that stands elsewhere.
* The temperature of each iteration is solved for an effective sample size (target_ess).
* The plan is filtered (smooth), and a sampler may have momentum
(quadsim.controllers.samplers.smooth).

A model, a course and other vehicles that are estimated in flight come with the state, in an
Estimate (quadsim.dynamics.estimate). The memory layout of the samples, and the reason why they are
drawn in chunks, are described in quadsim.controllers.lanes.layout.

Source: B. Vlahov, J. Gibson, D. D. Fan, P. Spieler, A. Agha-mohammadi and E. A. Theodorou, "Low
Frequency Sampling in Model Predictive Path Integral Control", IEEE Robotics and Automation Letters
9(5), 2024, 4543-4550; doi:10.48550/arXiv.2404.03094.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from quadsim.controllers.config import MPPIConfig
from quadsim.controllers.costs import Cost, EstimatedTerm, Weight, is_weight, number_name
from quadsim.controllers.lanes import layout
from quadsim.controllers.lanes.compiled import is_cached
from quadsim.controllers.lanes.lanes import Rollout, trace_anew
from quadsim.controllers.lanes.reduce import weighted_mean
from quadsim.controllers.plan import PlanStats
from quadsim.controllers.samplers import PlainSampler, Sampling, build_lanes
from quadsim.controllers.samplers.lane_sampler import stream_key
from quadsim.controllers.schedule import Schedule
from quadsim.controllers.steps import Steps
from quadsim.controllers.update import (
    savitzky_golay,
    softmax_weights,
    solve_temperature,
    weights,
)
from quadsim.course import Course
from quadsim.dynamics import System
from quadsim.dynamics.control_periods import ControlPeriods
from quadsim.dynamics.estimate import Estimate
from quadsim.files.yaml_errors import shown_value


@dataclass(frozen=True, eq=False, slots=True)
class Iteration:
    """The inputs and costs of one iteration, enough to draw its samples again.

    See quadsim.controllers.sampled_trajectories.
    """

    x: np.ndarray  # state from which the rollouts start  (n_x,)
    target: int  # row of the cost's targets
    call: int  # index of the sampler call
    # control sequence U that the samples perturb, its mean over each step  (T, n_u)
    nominal: np.ndarray
    # (alternative - nominal) / ramp, added to the perturbations of the last samples  (2, T, n_u)
    rest_offset: np.ndarray
    J: np.ndarray  # cost of each sample  (M,)


class DrawnChunk(NamedTuple):
    """The perturbations drawn for one chunk of an iteration."""

    iteration: Iteration
    chunk: slice
    z: np.ndarray  # (series, n_u, halves * T, LANES)


def expect_kinds(**given: tuple[object, type]) -> None:
    """Raise ValueError unless each argument, by name, is of its type."""
    for name, (value, kind) in given.items():
        if not isinstance(value, kind):
            wanted = f"expected a {kind.__name__}"
            raise ValueError(f"MPPI: {name}: {wanted}, got {type(value).__name__}")


class MPPI:
    """A receding-horizon controller that keeps its plan U (T, n_u) between calls.

    Args:
        system: the model to plan with.
        cost: the stage cost; the rollout loop is compiled at the first call.
        sampler: one of quadsim.controllers.samplers, or any object with `sample`, see PlainSampler.
        config: the sampling budget and the update; its dt must be the system's.
        seed: seed of the random perturbations. They depend on it and on the index of the call
            alone, never on threads.
        cost_of: function that returns the cost on a course, for courses that are estimated in
            flight; None: the cost never changes.

    Raises:
        ValueError: sampler, system and configuration differ in the number of controls or in dt.

    Examples:
        >>> import numpy as np
        >>> from quadsim import MPPI, Gaussian, MPPIConfig
        >>> from quadsim.paper.integrator import double_integrator, quadratic_cost
        >>> system = double_integrator(dt=0.05)
        >>> cost = quadratic_cost(goal=(0.0, 0.0))
        >>> config = MPPIConfig(samples=512, horizon=40, dt=0.05)
        >>> mppi = MPPI(system, cost, Gaussian(sigma=(1.0, 1.0)), config)
        >>> x = np.array([2.0, -1.0, 0.0, 0.0])
        >>> for _ in range(100):
        ...     u, stats = mppi.control(x)
        ...     x = np.array(system.next(x, u))
        >>> bool(np.hypot(x[0], x[1]) < 0.1)  # at the goal [m]
        True
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
        expect_kinds(system=(system, System), cost=(cost, Cost), config=(config, MPPIConfig))
        if config.dt != system.dt:
            raise ValueError(f"dt: expected the system's {system.dt:g} s, got {config.dt:g}")
        n_u = len(system.controls)
        self.config = config
        self.cost = cost
        self.cost_of = cost_of
        # Weights and parameters in place of the cost's own, by the names of cost.number_names
        self.numbers: dict[str, Weight] = {}
        # The last estimated course; None: the course that `cost` was made for
        self.course: Course | None = None
        lengths = config.step_lengths
        self.steps = Steps(lengths)
        self.schedule = Schedule(
            config.first_noise, config.cost_rise, lengths if self.steps.are_longer else ()
        )
        self.sampler = build_lanes(
            sampler,
            controls=n_u,
            samples=min(config.samples, layout.CHUNK),
            lengths=lengths,
            key=stream_key(seed),
            dt=config.dt,
        )
        self.ramp = self.schedule.noise(len(lengths))  # n, factors on the perturbations  (2, T)
        # Amount by which the plan may exceed the control limits  (n_u,)
        self.beyond = np.zeros(n_u)
        if config.overshoot:
            # overshoot is in standard deviations of the perturbations of a control period, measured
            # on some draws.
            drawn = layout.of_steps(self.sampler.sample(0), self.steps.lengths == 1)
            self.beyond = config.overshoot * drawn.std(axis=(0, 2, 3), dtype=float)
        trace_anew(system, cost)
        self.set_model(system)
        self.samples = config.samples  # M, which a deadline may change
        self._has_news = False  # whether the course has changed since the last plan
        self.reset()

    def reset(self) -> None:
        """Forget the plan, so that the next one begins at rest, as that of a new planner does.

        This is for a state that has jumped, as after the reset of an environment: the old plan
        leads on from another place. Model, cost and the numbers of terms stay as they are.

        Examples:
            >>> import numpy as np
            >>> from quadsim import MPPI, Gaussian, MPPIConfig
            >>> from quadsim.paper.integrator import double_integrator, quadratic_cost
            >>> system, cost = double_integrator(dt=0.05), quadratic_cost(goal=(0.0, 0.0))
            >>> config = MPPIConfig(samples=512, horizon=40, dt=0.05)
            >>> mppi = MPPI(system, cost, Gaussian(sigma=(1.0, 1.0)), config)
            >>> first, _ = mppi.control(np.array([2.0, -1.0, 0.0, 0.0]))
            >>> mppi.reset()
            >>> again, _ = mppi.control(np.array([2.0, -1.0, 0.0, 0.0]))
            >>> bool(np.all(first == again))
            True
        """
        self.periods = ControlPeriods(self.config.dt)
        # U for each control period, and the sequence that the last samples perturb
        self.plan = np.tile(self.rest, (self.config.horizon, 1))  # (horizon, n_u)
        self.guide = self.plan  # (horizon, n_u)
        # The last two controls, which precede the plan in the smoothing filter  (2, n_u)
        self.executed = np.tile(self.rest, (2, 1))
        if self.sampler.momentum:
            self.sampler.momentum.change = np.zeros_like(self.plan)
        self.temperature = self.config.temperature
        self.last: Iteration | None = None
        self._calls = 0
        # The chunk in the sampler's memory, until the next draw overwrites it
        self._drawn: DrawnChunk | None = None

    def control(
        self, known: Estimate | Sequence[float] | np.ndarray
    ) -> tuple[np.ndarray, PlanStats]:
        """Plan, and return the control to apply.

        The plan is shifted by as many steps as control periods have passed since the last call.

        Args:
            known: an estimate of the vehicle, or only its state x (n_x,). A bare state counts as
                one control period after the last call, with row 0 of the cost's targets as the
                target.

        Returns:
            The control (n_u,) and statistics of the plan.

        Raises:
            ValueError: x has the wrong length or is not finite, as when the plant has diverged.
            FloatingPointError: no sample has a finite cost.
        """
        estimate = known
        if not isinstance(estimate, Estimate):
            estimate = Estimate(self.periods.next, self.system.checked_state(known))
        self.system.check(estimate.x)
        self.use_estimates(estimate)
        iterations = self.warm_start(estimate)
        for _ in range(iterations):
            stats = self.iterate(estimate.x, estimate.target)
        return self.command(estimate.x), stats

    # One iteration of Algorithm 1

    def iterate(self, x: np.ndarray, target: int) -> PlanStats:
        """Improve the plan U by one iteration of Algorithm 1.

        Args:
            x: state that the rollouts start from  (n_x,).
            target: row of the cost's targets.

        Returns:
            Statistics of this iteration's samples.
        """
        it = self.begin_iteration(x, target)
        self.last = it
        U = it.nominal  # (T, n_u)
        J = it.J  # (M,)

        # Samples come in chunks that fit the processor's caches. The perturbations of a chunk are
        # overwritten by the next chunk, so each chunk is averaged at once.
        means = []  # weighted mean of v - U of each chunk  (T, n_u)
        for chunk in layout.chunks(self.samples):
            # Draw the perturbations z, eq. (1).
            z = self.perturbations(it, chunk)  # (series, n_u, halves * T, LANES)

            # Roll out v = clip(U + n z), eq. (2) and (3).
            J[chunk] = self.costs(it, z, chunk)

            # Solve for the temperature on the first chunk, before anything is weighed.
            if chunk.start == 0:
                self.temperature = self.solved_temperature(J[chunk])

            # Average the chunk, with weights normalised within it.
            share = softmax_weights(J[chunk], self.temperature)
            means.append(weighted_mean(z, self.ramp, U, self.plan_low, self.plan_high, share))

        # Weigh all samples by their costs, eq. (4).
        w = weights(J, self.temperature)  # (M,)

        # Move the plan by a step along the weighted mean of v - U, eq. (5).
        change = self.steps.in_periods(layout.mean_of_chunks(means, w))
        nominal, _ = self.nominals()
        self.update(nominal + self.config.step_size * change)

        ess = float(1 / np.sum(w * w))
        return PlanStats(cost=float(J[0]), ess=ess, temperature=self.temperature)

    def begin_iteration(self, x: np.ndarray, target: int) -> Iteration:
        """Return the inputs of the next iteration, with costs still to be computed.

        Args:
            x: state that the rollouts start from  (n_x,).
            target: row of the cost's targets.
        """
        self._calls += 1
        nominal, alternative = map(self.steps.mean, self.nominals())  # (T, n_u) each
        rest_offset = (alternative - nominal) / self.ramp[:, :, None]  # (2, T, n_u)
        return Iteration(
            x=x,
            target=target,
            call=self._calls,
            nominal=nominal,
            rest_offset=rest_offset,
            J=np.empty(self.samples),
        )

    def nominals(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the control sequences to perturb.

        Returns:
            The nominal sequence, and the alternative that the last rest_fraction of the samples
            perturb: the plan and the guide, or plan + momentum and the plan if the sampler has
            momentum.  (horizon, n_u) each
        """
        momentum = self.sampler.momentum
        if momentum:
            return self.plan + momentum.change, self.plan
        return self.plan, self.guide

    def perturbations(self, it: Iteration, chunk: slice) -> np.ndarray:
        """Return the perturbations z of a chunk's samples, relative to the nominal sequence.

        The perturbations of sample 0 are zero, so that the nominal sequence itself is rolled out.
        The last drawn chunk is not drawn again.

        Args:
            it: the iteration.
            chunk: indices of the samples.

        Returns:
            Perturbations  (series, n_u, halves * T, LANES), see
            quadsim.controllers.lanes.layout.
        """
        # A display requests the samples of the last iteration, which are still in memory.
        drawn = self._drawn
        if drawn and drawn.iteration is it and drawn.chunk == chunk:
            return drawn.z

        count = chunk.stop - chunk.start
        M = len(it.J)
        z = self.sampler.sample(it.call, chunk.start, count)

        # The last samples perturb the alternative.
        first_alternative = M - int(self.config.rest_fraction * M)
        layout.add_from(z, max(first_alternative - chunk.start, 0), count, it.rest_offset)

        if self.config.freeze_first:
            layout.first_steps(z, self.steps.number)[:] = 0
        if chunk.start == 0:
            layout.sample(z, 0, self.steps.number)[:] = 0
        self._drawn = DrawnChunk(it, chunk, z)
        return z

    def costs(self, it: Iteration, z: np.ndarray, chunk: slice) -> np.ndarray:
        """Return the costs J of a chunk's samples, rolled out from the iteration's state.

        Args:
            it: the iteration.
            z: perturbations of these samples  (series, n_u, halves * T, LANES).
            chunk: indices of the samples.

        Returns:
            Costs  (samples,).
        """
        count = chunk.stop - chunk.start
        J = np.empty((layout.blocks(count), layout.LANES), z.dtype)
        self.rollout(it.x, it.nominal, z, it.target, J)
        return J.ravel()[:count]

    def solved_temperature(self, J: np.ndarray) -> float:
        """Return the temperature of an iteration, given the costs of its first chunk.

        The target of a chunk is its share of the target of all samples.

        Args:
            J: costs of the first chunk's samples  (n,).
        """
        of_all = self.config.ess_of(self.samples)
        if of_all is None:
            return self.temperature
        return solve_temperature(J, max(of_all * len(J) / self.samples, 1.0), self.temperature)

    def update(self, plan: np.ndarray) -> None:
        """Set the plan, clipped to its limits and filtered if configured, and the momentum.

        Args:
            plan: U after equation (5), for each control period  (horizon, n_u).
        """
        plan = np.clip(plan, self.plan_low, self.plan_high)
        if self.sampler.momentum:
            self.sampler.momentum.change = plan - self.plan
        if self.config.smooth:
            plan = savitzky_golay(plan, self.executed)
            plan = np.clip(plan, self.plan_low, self.plan_high)
        self.plan = plan

    # From one control step to the next

    def use_estimates(self, estimate: Estimate) -> None:
        """Use what is estimated: a new course or model, and the other vehicles."""
        course, model = estimate.course, estimate.model
        if self.cost_of and course is not None and course is not self.course:
            self.course = course
            self.set_cost(self.cost_of(course))
            self._has_news = True
        if model is not None and model != self.model:
            self.plan = self.adapted_plan(model)
            self.set_model(model)
        terms = [term for term in self.cost.terms if isinstance(term, EstimatedTerm)]
        if terms:
            times = estimate.begins + self.config.dt * self.steps.ends
            self._use_numbers({term.name: term.numbers_from(estimate, times) for term in terms})

    def warm_start(self, estimate: Estimate) -> int:
        """Shift the plan to the present time, and return the number of iterations to run."""
        self.guide = self.guided(estimate.target, estimate.x)
        steps = self.periods.advance(estimate.t)
        has_news, self._has_news = self._has_news, False
        is_first = self._calls == 0
        if is_first and self.cost.guide:
            self.plan = self.guide.copy()
        elif not is_first and steps:
            self.shift(steps)
        if is_first and self.config.first_iterations:
            return self.config.first_iterations
        if has_news and self.config.news_iterations:
            return self.config.news_iterations
        return self.config.iterations

    def adapted_plan(self, model: System) -> np.ndarray:
        """Return the plan with the same effect on another model as on the present one.  (T, n_u)

        Args:
            model: the model to be set.
        """
        if model.adapted is None:
            return self.plan
        plan = model.control(*self.plan.T)
        return np.stack(model.adapted(plan, self.model, model), axis=1)

    def shift(self, steps: int) -> None:
        """Drop the plan's first `steps` controls, and append the guide's last control."""
        self.executed = np.vstack([self.executed, self.clipped(self.plan[:steps])])[-2:]
        self.plan = np.vstack([self.plan[steps:], self.guide[-steps:]])
        if self.sampler.momentum:
            self.sampler.momentum.shift(steps)

    def guided(self, target: int, x: np.ndarray) -> np.ndarray:
        """Return the sequence that the last samples perturb: the cost's guide, else rest.  (T, n_u)

        Args:
            target: row of the cost's targets.
            x: state  (n_x,).
        """
        T = self.config.horizon
        if self.cost.guide:
            return self.cost.guide(target, x, T)
        return np.tile(self.rest, (T, 1))

    def command(self, x: np.ndarray) -> np.ndarray:
        """Return the plan's first control, limited to the attainable controls.  (n_u,)

        Args:
            x: state  (n_x,).
        """
        u = self.clipped(self.plan[0])
        attainable = self.system.attainable
        if attainable is None:
            return u
        state = self.system.state(*x)
        control = self.system.control(*u)
        return np.array(attainable(state, control, self.system.params))

    def clipped(self, u: np.ndarray) -> np.ndarray:
        """Return controls (..., n_u) clipped to the control limits, without overshoot."""
        return np.clip(u, self.low, self.high)

    # Model, cost and state of the planner

    def set_model(self, system: System) -> None:
        """Set the model: the same states and controls with changed parameters."""
        self.model = system
        self.system = system.tightened(self.config.tighten)
        self.rollout = self._new_rollout()
        self.low = np.array(self.system.low)
        self.high = np.array(self.system.high)
        # the control at rest; for a sound quadrotor it is hover: no rates, thrust g  (n_u,)
        self.rest = np.array(system.rest)
        self.plan_low = self.low - self.beyond
        self.plan_high = self.high + self.beyond

    def set_cost(self, cost: Cost) -> None:
        """Set the cost.

        Terms that were used before are not compiled again, even if their weights and parameters
        change. Numbers that a function holds itself stay as they were when the planner was made.

        Raises:
            ValueError: cost is no Cost.
        """
        expect_kinds(cost=(cost, Cost))
        self.cost = cost
        self.numbers = self._known_numbers(self.numbers)
        self.rollout = self._new_rollout()

    def set_numbers(self, term: str, **numbers: Weight) -> None:
        """Use other numbers of one term of the cost from the next plan on.

        They are copied, and nothing is compiled again. A term whose weight is zero in the cost is
        left out of the rollouts, whatever numbers it is given here.

        Args:
            term: name of the term.
            numbers: its weight, as `weight`, or its parameters by their names: one number, or one
                for each step of the horizon  (T,).

        Raises:
            ValueError: the term has no such number, or a number is not finite.

        Examples:
            >>> from quadsim import MPPI, Gaussian, MPPIConfig, Term
            >>> from quadsim.paper.integrator import double_integrator, quadratic_cost
            >>> system, cost = double_integrator(dt=0.05), quadratic_cost(goal=(0.0, 0.0))
            >>> config = MPPIConfig(samples=512, horizon=40, dt=0.05)
            >>> mppi = MPPI(system, cost, Gaussian(sigma=(1.0, 1.0)), config)
            >>> mppi.set_numbers(cost.term_names[0], weight=2.0)
        """
        for name, value in numbers.items():
            if number_name(term, name) not in self.cost.number_index:
                raise ValueError(f"cost {self.cost.name}: no number {name!r} of a term {term!r}")
            if not is_weight(value):
                wanted = "expected a finite number, or an array (T,) of them"
                raise ValueError(f"term {term}: {name}: {wanted}, got {shown_value(value)}")
        self._use_numbers({term: numbers})

    def _use_numbers(self, numbers: Mapping[str, Mapping[str, Weight]]) -> None:
        """Use copies of these numbers: name of a term -> name of a number -> its value."""
        copies = {
            number_name(term, name): np.array(value, float)
            for term, own in numbers.items()
            for name, value in own.items()
        }
        self.numbers = {**self.numbers, **copies}
        self.rollout = self._new_rollout()

    def _known_numbers(self, numbers: Mapping[str, Weight]) -> dict[str, Weight]:
        """Return these numbers, apart from any that the cost does not have."""
        index = self.cost.number_index
        return {name: value for name, value in numbers.items() if name in index}

    def _new_rollout(self) -> Rollout:
        """Return the rollout of the present model, cost and numbers."""
        return Rollout(self.system, self.cost, schedule=self.schedule, given=self.numbers)

    def continue_from(self, planner: MPPI) -> None:
        """Take over another planner's plan, momentum, time and numbers of terms.

        Args:
            planner: a planner with the same system and horizon.
        """
        self.numbers = self._known_numbers(planner.numbers)
        self.rollout = self._new_rollout()
        self.plan = planner.plan
        self.executed = planner.executed
        self.periods = planner.periods
        self._calls = planner._calls
        if self.sampler.momentum and planner.sampler.momentum:
            self.sampler.momentum.change = planner.sampler.momentum.change

    @property
    def is_cached(self) -> bool:
        """Whether the compiled loops are in this machine's cache.

        If they were not, the first plan takes some 15 s longer.
        """
        if not self.rollout.is_cached:
            return False
        return self.sampler.loop is None or is_cached(self.sampler.loop)
