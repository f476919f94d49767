"""The loop of a flight, in which the controller plans, the plant steps and the referee checks.

`simulate` is a generator of Frames, one for each control step, and its consumer sets the pace: the
command line collects the frames; the web page draws each frame and pauses by not requesting the
next one.

The loop itself is `flight`, which neither plans nor steps its plant but yields a request for each
plan and each physics step. The same loop thus serves a single flight, for which `simulate` fulfils
the requests, and a race, for which quadsim.heat.loop plans several flights in parallel and steps
one shared world.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterator, Sequence
from dataclasses import dataclass
from itertools import count
from time import perf_counter
from typing import NamedTuple, Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike

from quadsim.controllers.plan import PlannerSnapshot, PlanStats
from quadsim.dynamics.estimate import Estimate
from quadsim.physics.link import FaultyCommands
from quadsim.physics.plant import Plant, PlantState
from quadsim.racing.clock import Clock
from quadsim.racing.events import Event, Frame
from quadsim.rotation import Vec3
from quadsim.sensing.estimation.prediction import Commands
from quadsim.sensing.navigation import Navigation, RefereeCount, TrueState


@runtime_checkable
class Controller(Protocol):
    """Computes the next control from an estimate of the vehicle; MPPI is a controller.

    Examples:
        >>> import numpy as np
        >>> import quadsim
        >>> from quadsim import PlanStats
        >>> class Hover:
        ...     rest = np.array([0.0, 0.0, 0.0, 9.81])
        ...     def control(self, estimate):
        ...         height, climb = estimate.x[2], estimate.x[5]
        ...         thrust = 9.81 + 4.0 * (2.0 - height) - 3.0 * climb
        ...         return np.array([0.0, 0.0, 0.0, thrust]), PlanStats(0.0, 0.0, 0.0)
        >>> run = quadsim.fly("figure8", controller=Hover(), timeout=2.0)
        >>> run.outcome
        'timeout'
    """

    @property
    def rest(self) -> np.ndarray:
        """The control at rest, e.g. hover, which acts until the first plan is ready.  (n_u,)"""
        ...

    def control(self, estimate: Estimate, /) -> tuple[np.ndarray, PlanStats]:
        """Return the control to apply from now on, and statistics of the plan.

        Args:
            estimate: time, state (n_x,) and gates passed; the model and the course if they are
                estimated in flight; the other vehicles of a race.

        Returns:
            The control u (n_u,), for a quadrotor the body rates [rad/s] and the thrust [m/s^2],
            and PlanStats.
        """
        ...


class ControlLaw(Protocol):
    """The simplest interface of a user's own controller: a control for a state."""

    def control(self, x: np.ndarray, /) -> ArrayLike:
        """Return the control u (n_u,) at the state x (n_x,)."""
        ...


class RefereeProtocol(Protocol):
    """Checks every physics step, and ends the flight by setting an outcome.

    See quadsim.racing.referee.Referee.

    Examples:
        >>> import quadsim
        >>> from quadsim.racing.referee import Referee
        >>> class TwoGates(Referee):
        ...     def observe(self, *step):
        ...         events = super().observe(*step)
        ...         if self.passed == 2:
        ...             self.outcome = "finished"
        ...         return events
        >>> def referee(spec):
        ...     return TwoGates(spec.flown_course, spec.vehicle.radius, spec.laps, timeout=10.0)
        >>> run = quadsim.fly("figure8", referee=referee, samples=256)
        >>> run.outcome, len(run.gates)
        ('finished', 2)
    """

    @property
    def outcome(self) -> str | None:
        """The outcome of the flight; None until it has ended."""
        ...

    @property
    def passed(self) -> int:
        """The number of gates passed since the start."""
        ...

    @property
    def lap(self) -> int:
        """The number of the current lap, from 1."""
        ...

    @property
    def next_gate(self) -> int:
        """The index of the next gate, from 0."""
        ...

    def observe(
        self, t0: float, p0: Vec3, t1: float, p1: Vec3, contacts: Sequence[str] = ()
    ) -> list[Event]:
        """Return the events of one physics step in the order of their instants.

        Args:
            t0, p0: time [s] and position [m] before the step.
            t1, p1: time [s] and position [m] after the step.
            contacts: objects that the plant reports as touched, e.g. "gate 3".
        """
        ...


# Number of control periods from one PlannerSnapshot to the next.
SNAPSHOT_EVERY = 10


@dataclass(frozen=True)
class FlightParts:
    """The parts of one flight, which must not be used again. Their owner closes the plant."""

    plant: Plant
    controller: Controller
    referee: RefereeProtocol
    # control period, a whole multiple of the plant's step [s]
    period: float
    # source of the controller's estimates; None: the true state and the referee's count of gates
    navigation: Navigation | None = None
    # returns when a plan is ready; None: the simulated clock, on which it is at once
    clock: Clock | None = None
    # called every SNAPSHOT_EVERY periods; the result is stored in the frame
    snapshot: Callable[[], PlannerSnapshot | None] | None = None
    # faults of commands on their way to the plant; None: all of them arrive at once
    faulty_commands: FaultyCommands | None = None
    # longest flight, for a referee without a time limit of its own; the outcome is "timeout" [s]
    time_limit: float | None = None


class Plan(NamedTuple):
    """A control, with the statistics and the duration of its planning."""

    # control to apply  (n_u,)
    u: tuple[float, ...]
    stats: PlanStats
    # planning time on the wall clock [s]
    spent: float


class Planning:
    """A request of a flight that its controller makes a plan.

    The plans of several flights at one instant are independent: they may be made in any order, and
    on several threads.

    Attributes:
        is_first: whether this is the first plan of the flight, for which loops may be compiled.
        error: exception that the controller has raised; None if there is none.
        ends_flight: whether the error ends the flight as crashed. The caller that runs the plan
            may set it; otherwise the flight raises the error.
    """

    def __init__(
        self,
        controller: Controller,
        navigation: Navigation,
        t: float,
        is_first: bool = False,
    ):
        """Prepare a request.

        Args:
            controller: the controller.
            navigation: source of the estimate.
            t: time now [s].
            is_first: whether this is the first plan of the flight.
        """
        self.is_first = is_first
        self._controller = controller
        self._navigation = navigation
        self._t = t
        self.ends_flight = False
        self.error: Exception | None = None
        self._plan: Plan | None = None

    def run(self) -> None:
        """Make the plan, and measure its duration.

        An exception of the controller is stored as `error`, so that it is raised by the flight
        that requested the plan rather than by the thread or race that runs it.
        """
        before = perf_counter()
        try:
            u, stats = self._controller.control(self._navigation.estimate(self._t))
            spent = perf_counter() - before
        except Exception as error:
            # A controller of the user's own may raise anything.
            self.error = error
        else:
            self._plan = Plan(tuple(u.tolist()), stats, spent)

    @property
    def plan(self) -> Plan:
        """The finished plan.

        Raises:
            Exception: the exception that the controller has raised.
            RuntimeError: the plan has not been made.
        """
        if self.error is not None:
            raise self.error
        if self._plan is None:
            raise RuntimeError("the flight goes on before its plan has been made: call run()")
        return self._plan


class PhysicsStep(NamedTuple):
    """A request of a flight that its plant makes one physics step."""

    # command during the step  (n_u,)
    u: tuple[float, ...]


def simulate(parts: FlightParts) -> Iterator[Frame]:
    """Simulate until the referee ends the flight, and yield a Frame for each control step.

    The last frame has the outcome and the last control applied.

    With the wall clock, the previous control is applied until the new plan is ready; the next
    planning starts one period after the start of the previous one, or when the plan is ready if
    that is later. With the default clock, planning takes no simulated time.

    Raises:
        ValueError: the period is not a whole multiple of the plant's step.
        Exception: an exception of a user's own part.
    """
    for step in flight(parts):
        if isinstance(step, Planning):
            step.run()
        elif isinstance(step, PhysicsStep):
            parts.plant.step(step.u)
        else:
            yield step


def flight(parts: FlightParts) -> Iterator[Frame | Planning | PhysicsStep]:
    """Yield the frames of a flight, and between them a request for each plan and physics step.

    The caller runs the plan, or steps the plant once, before it asks for the next item. The same
    errors are raised as by `simulate`.
    """
    plant = parts.plant
    controller = parts.controller
    referee = parts.referee
    period = parts.period
    faulty = parts.faulty_commands
    time_limit = parts.time_limit
    whole_multiple(period, plant.dt)
    began = perf_counter()
    rest = rest_of(controller)
    clock = parts.clock or Clock()
    navigation = parts.navigation or exact_navigation(plant.state, referee, rest, period)
    plan = Plan(rest, PlanStats(cost=0.0, ess=0.0, temperature=0.0), 0.0)
    events: list[Event] = []

    for k in count():
        state = plant.state
        outcome = referee.outcome
        if outcome is None and time_limit is not None and state.t > time_limit - plant.dt / 2:
            outcome = "timeout"
        flying = outcome is None
        previous = plan

        # Plan from the present estimate.
        if flying:
            planning = Planning(controller, navigation, state.t, is_first=k == 0)
            yield planning
            if planning.ends_flight:
                outcome = "crashed"
                flying = False
            else:
                plan = planning.plan
        # The clock is read before the frame is yielded, as its consumer may take a while.
        ready = clock.ready(state.t, 0.0 if k == 0 else plan.spent)
        wants_snapshot = flying and k % SNAPSHOT_EVERY == 0
        taken = parts.snapshot() if parts.snapshot and wants_snapshot else None
        navigation.commanded(state.t, ready, plan.u)

        # Yield the events up to now, and the control that acts from now on.
        yield Frame(
            t=state.t,
            x=state.x,
            u=plan.u,
            passed=referee.passed,
            lap=referee.lap,
            gate=referee.next_gate + 1,
            ess=plan.stats.ess,
            temperature=plan.stats.temperature,
            cost=plan.stats.cost,
            plan_ms=1e3 * plan.spent,
            elapsed=perf_counter() - began,
            events=tuple(events),
            outcome=outcome,
            snapshot=taken,
            estimate=navigation.record(state),
            motors=state.motors or (),
            kept=navigation.kept(),
            rotor_shares=navigation.rotor_shares,
            learned_delay=navigation.learned_delay,
        )
        if not flying:
            return

        # Apply the previous control until the plan is ready, then the new one to the period's end,
        # or to when the plan is ready if that is later.
        events = yield from control_steps(plant, referee, previous.u, ready, navigation, faulty)
        next_time = max(state.t + period, plant.state.t)
        clock.wait(next_time)
        events += yield from control_steps(plant, referee, plan.u, next_time, navigation, faulty)


def rest_of(controller: Controller) -> tuple[float, ...]:
    """Return the control that a controller applies until its first plan is ready  (n_u,)."""
    return tuple(controller.rest.tolist())


def exact_navigation(
    state: PlantState, referee: RefereeProtocol, rest: tuple[float, ...], dt: float
) -> Navigation:
    """Return a navigation with the true state and the referee's count of gates.

    Neither the model nor the course is estimated.

    Args:
        state: state of the plant at the start.
        referee: referee that counts the gates.
        rest: the control that acts until the first one is given  (n_u,).
        dt: control period [s].
    """
    return Navigation(
        source=TrueState(state, dt),
        gates=RefereeCount(referee),
        commands=Commands(rest, latency=0.0),
        dt=dt,
        nominal=None,
    )


def apply_control(
    plant: Plant,
    referee: RefereeProtocol,
    u: tuple[float, ...],
    until: float,
) -> list[Event]:
    """Step the plant with a constant control, and return the events of the referee.

    Args:
        plant: plant to step.
        referee: referee that checks every step; its outcome ends the loop.
        u: control  (n_u,).
        until: end time [s]; the last physics step ends nearest to this time.

    Returns:
        The events of these steps, in order.
    """
    steps = control_steps(plant, referee, u, until)
    while True:
        try:
            step = next(steps)
        except StopIteration as end:
            return end.value
        plant.step(step.u)


def control_steps(
    plant: Plant,
    referee: RefereeProtocol,
    u: tuple[float, ...],
    until: float,
    navigation: Navigation | None = None,
    faulty: FaultyCommands | None = None,
) -> Generator[PhysicsStep, None, list[Event]]:
    """Yield requests for physics steps with a constant control; referee and sensors follow them.

    Args:
        plant: plant, which the caller steps.
        referee: referee that checks every step; its outcome ends the loop.
        u: control  (n_u,).
        until: end time [s]; the last physics step ends nearest to this time.
        navigation: navigation whose sensors sample every state; None: no sensors.
        faulty: faults of commands on their way to the plant; None: all arrive at once.

    Returns:
        The events of these steps, in order.
    """
    events: list[Event] = []
    dt = plant.dt
    before = plant.state
    while before.t < until - dt / 2 and referee.outcome is None:
        yield PhysicsStep(faulty.carried(before.t, u) if faulty else u)
        after = plant.state
        if navigation:
            navigation.watch(after)
        step = (before.t, before.position, after.t, after.position)
        events += referee.observe(*step, after.contacts)
        before = after
    return events


def whole_multiple(period: float, dt: float) -> int:
    """Return the number of physics steps in a control period.

    Args:
        period: control period [s].
        dt: physics step [s].

    Raises:
        ValueError: the number is not whole.
    """
    substeps = round(period / dt)
    if substeps < 1 or abs(substeps * dt - period) > 1e-9:
        raise ValueError(
            f"dt: expected a whole multiple of the plant's step {dt:g} [s], got {period:g}"
        )
    return substeps
