"""Measure how planning time depends on the number of gates, on straight lines of gates.

The flights take their control steps in alternation. Flights of one seed repeat each other exactly,
so the work of a control step is the same in each repetition; the shortest time of each step is the
least disturbed by other programs.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import ExitStack, closing
from itertools import count
from time import perf_counter
from typing import Any, NamedTuple

import numpy as np

from quadsim.config.build import build, with_threads
from quadsim.config.spec import Spec
from quadsim.course import Course, parse_course
from quadsim.racing.events import Frame
from quadsim.racing.flight import simulate

GATES = (10, 200)
APART = 12.0  # distance between gates [m]
FLOWN = 2.4  # simulated time [s]; 10 gates take 3.3 s
REPEATED = 3  # number of flights along each line
HEAD = "opening: [1.5, 1.5]\nstart: {position: [0, 0, 2], yaw_deg: 0}\ngates:\n"


class GatesTime(NamedTuple):
    """The measured times of a flight along a line of gates."""

    gates: int
    flown: float  # simulated time [s]
    plan_ms: float  # median over the control steps
    plan_ms_least: float
    rest_ms: float  # mean time of plant, referee and frame in a control step
    wall_per_s: float  # total wall-clock time for a second of flight [s]


class StepTime(NamedTuple):
    """The measured times of one control step [ms]."""

    whole: float
    plan: float


def line_of_gates(gates: int) -> Course:
    """Return a straight course with this number of gates."""
    rows = (f"  - {{position: [{APART * k:g}, 0, 2], yaw_deg: 0}}\n" for k in range(1, gates + 1))
    return parse_course(HEAD + "".join(rows), f"line_of_{gates}_gates.yaml")


def measure_gates(flown: float = FLOWN, **settings: Any) -> list[GatesTime]:
    """Return the times of flights along each number of gates in GATES.

    Args:
        flown: simulated time of each flight [s].
        settings: settings of the flights, e.g. samples.
    """
    specs = [with_threads(Spec.of(line_of_gates(n), timeout=flown, **settings)) for n in GATES]
    # (repetitions, control steps, courses, numbers of StepTime)
    every = np.array([list(_in_turn(specs, repetition)) for repetition in range(REPEATED)])
    least = every.min(axis=0)
    return [_gates_time(spec, *least[:, i].T) for i, spec in enumerate(specs)]


def _in_turn(specs: Sequence[Spec], repetition: int) -> Iterator[list[StepTime]]:
    """Yield the times of one control step of each flight, until one of them is over.

    The order of the flights is reversed every other time.
    """
    with ExitStack() as stack:
        flights = []
        for spec in specs:
            parts = build(spec)
            stack.enter_context(closing(parts.plant))
            flights.append(simulate(parts))
        for step in count(repetition):
            order = range(len(flights)) if step % 2 else reversed(range(len(flights)))
            times = {i: _timed(flights[i]) for i in order}
            in_order = [times[i] for i in range(len(flights))]
            if None in in_order:
                return
            yield [time for time in in_order if time is not None]


def _timed(flight: Iterator[Frame]) -> StepTime | None:
    """Run the next control step and return its time, None if the flight is over."""
    began = perf_counter()
    frame = next(flight)
    whole = 1e3 * (perf_counter() - began)
    return None if frame.outcome else StepTime(whole, frame.plan_ms)


def _gates_time(spec: Spec, whole: np.ndarray, plan: np.ndarray) -> GatesTime:
    """Return the times of one flight from the times of its control steps and plans [ms]."""
    flown = len(whole) * spec.planner.mppi.dt
    return GatesTime(
        gates=len(spec.course.gates),
        flown=flown,
        plan_ms=float(np.median(plan)),
        plan_ms_least=float(plan.min()),
        rest_ms=float((whole - plan).mean()),
        wall_per_s=1e-3 * float(whole.sum()) / flown,
    )
