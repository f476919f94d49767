"""Whether time grows with the number of gates: flights along lines of few and of many gates, in
turn step by step.

Flights of one seed repeat each other exactly, so the work of a control step is the same in each
repetition; the least time of each step is what it takes when nothing else disturbs the machine.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack, closing
from itertools import count
from time import perf_counter
from typing import Any

import numpy as np
from rich.table import Table

from quadsim.console import plain_table
from quadsim.course import Course, parse_course
from quadsim.race.events import Frame
from quadsim.spec.build import build, launch, with_threads
from quadsim.spec.spec import Spec

GATES = (10, 200)
APART = 12.0  # [m] from gate to gate
FLOWN = 2.4  # [s]; 10 gates take 3.3 s
TIMES = ("plan_ms", "plan_ms_least", "rest_ms", "wall_per_s")
REPEATED = 3  # flights along each line
HEAD = "opening: [1.5, 1.5]\nstart: {position: [0, 0, 2], yaw_deg: 0}\ngates:\n"


def line_of_gates(gates: int) -> Course:
    """A straight course."""
    rows = (f"  - {{position: [{APART * k:g}, 0, 2], yaw_deg: 0}}\n" for k in range(1, gates + 1))
    return parse_course(HEAD + "".join(rows), f"line_of_{gates}_gates.yaml")


def measure_gates(flown: float = FLOWN, **settings: Any) -> list[dict]:
    """For each number of gates {gates, flown, plan_ms, plan_ms_least, rest_ms, wall_per_s}

    flown: simulated [s]. plan_ms: median over the control steps, and plan_ms_least the shortest;
    rest_ms: mean of what plant, referee and frames take in a control step; wall_per_s: wall-clock
    time for a second of flight, all included.
    settings: of the flights, e.g. samples.
    """
    specs = [with_threads(Spec.of(line_of_gates(n), timeout=flown, **settings)) for n in GATES]
    # (repetitions, control steps, courses, 2): the whole step, its plan [ms]
    every = np.array([list(_in_turn(specs, repetition)) for repetition in range(REPEATED)])
    return [_row(spec, *every[:, :, i].min(axis=0).T) for i, spec in enumerate(specs)]


def _in_turn(specs: list[Spec], repetition: int) -> Iterator[list[tuple[float, float]]]:
    """One control step of each flight after the other: how long it took, and its plan [ms]. Every
    other time the last flight is first."""
    with ExitStack() as stack:
        flights = []
        for spec in specs:
            parts = build(spec)
            stack.enter_context(closing(parts[0]))
            flights.append(launch(spec, *parts))
        order = range(len(flights))
        for step in count(repetition):
            took = {i: _timed(flights[i]) for i in (order if step % 2 else reversed(order))}
            if not all(took.values()):
                return
            yield [time for _, time in sorted(took.items()) if time]


def _timed(flight: Iterator[Frame]) -> tuple[float, float] | None:
    """The next control step, None when the flight is over."""
    began = perf_counter()
    frame = next(flight)
    return None if frame.outcome else (1e3 * (perf_counter() - began), frame.plan_ms)


def _row(spec: Spec, whole: np.ndarray, plan: np.ndarray) -> dict:
    flown = len(whole) * spec.planner.mppi.dt
    return {
        "gates": len(spec.course.gates),
        "flown": flown,
        "plan_ms": float(np.median(plan)),
        "plan_ms_least": float(plan.min()),
        "rest_ms": float((whole - plan).mean()),
        "wall_per_s": 1e-3 * float(whole.sum()) / flown,
    }


def gates_table(rows: list[dict]) -> Table:
    """Every row beside the first."""
    heads = (
        "gates",
        "plan p50\n[ms]",
        "least\n[ms]",
        "rest of a\nstep [ms]",
        "wall clock for a\nsecond of flight [s]",
    )
    table, first = plain_table(*heads, no_wrap=True), rows[0]
    for row in rows:
        cells = [f"{row[key]:.2f} ({row[key] / first[key]:.3f})" for key in TIMES]
        table.add_row(str(row["gates"]), *cells)
    return table
