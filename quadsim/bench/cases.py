"""The cases of `race bench`: whole control steps, from the noise to the updated plan, of every
system."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass, replace
from time import perf_counter

import numpy as np

from controllers.lanes.threads import use_threads
from controllers.mppi import MPPI
from controllers.samplers import SAMPLERS
from quadsim.bench.machine import Machine, floor_ns, work
from quadsim.spec.build import planner_of
from quadsim.spec.spec import Spec
from quadsim.spec.systems import SYSTEMS

SAMPLES = (256, 1024, 4096, 16384, 65536)
HORIZONS = (25, 75, 150, 300)
# samplers that are timed beyond the quadrotor at the paper's budget
SWEPT = ("gaussian", "colored")
WARM_UP = 3  # calls that are not timed
LEAST = 15  # calls that are timed, however long they take
PRESET = "paper"
TIMED = tuple(name for name, entry in SYSTEMS.items() if PRESET in entry.presets)  # systems
COURSES = {"quadrotor": "paper_flat"}  # where it is not the system's default


@dataclass(frozen=True)
class Case:
    """One control step."""

    system: str
    sampler: str
    samples: int
    horizon: int
    iterations: int
    threads: int | None = None  # None: all

    @property
    def size(self) -> str:
        return f"{self.samples} x {self.horizon} x {self.iterations}"

    @property
    def name(self) -> str:
        return f"{self.system} {self.size}"

    @property
    def steps(self) -> int:
        """Steps of all samples in all iterations, M T I."""
        return self.samples * self.horizon * self.iterations


def paper_case(system: str, sampler: str) -> Case:
    """At the paper's budget, on all threads."""
    c = SYSTEMS[system].presets[PRESET]["gaussian"].mppi
    return Case(system, sampler, c.samples, c.horizon, c.iterations)


def cases(most: int) -> Iterator[Case]:
    """The paper's budgets, then sweeps over samples and horizon; each on one thread, then on
    `most`."""
    for case in _sizes():
        for threads in sorted({1, most}):
            yield replace(case, threads=threads)


def _sizes() -> Iterator[Case]:
    yield from (paper_case("quadrotor", sampler) for sampler in SAMPLERS)
    yield from (
        paper_case(system, sampler)
        for system in TIMED
        if system != "quadrotor"
        for sampler in SWEPT
    )
    for sampler in SWEPT:
        paper = paper_case("quadrotor", sampler)
        yield from (replace(paper, samples=m) for m in SAMPLES if m != paper.samples)
        yield from (replace(paper, horizon=t) for t in HORIZONS if t != paper.horizon)


def controller(case: Case) -> tuple[MPPI, np.ndarray]:
    """At this budget with the paper's other settings, and the start state (n_x,) that it plans
    from."""
    course = COURSES.get(case.system, SYSTEMS[case.system].default_course)
    budget = {"samples": case.samples, "horizon": case.horizon, "iterations": case.iterations}
    spec = Spec.of(course, preset=PRESET, sampler=case.sampler, **budget)
    return planner_of(spec, spec.streams.planner), np.array(spec.entry.start(spec))


def measure(case: Case, seconds: float, machine: Machine) -> dict:
    """{name, system, sampler, samples, horizon, iterations, threads, ms_p50, ms_p95, steps_per_s,
    roofline}

    roofline: the least time that this machine's arithmetic and memory need on so many threads, as a
    share of ms_p50.
    """
    threads = use_threads(case.threads)
    mppi, x = controller(case)
    p50, p95 = (
        float(ms) for ms in np.percentile(times_ms(lambda: mppi.control(x), seconds), [50, 95])
    )
    floor_ms = (
        1e-6
        * case.steps
        * sum(floor_ns(part, machine) for part in work(mppi, case.sampler).values())
    )
    row = {"name": case.name, **asdict(case), "threads": threads, "ms_p50": p50, "ms_p95": p95}
    return row | {
        "steps_per_s": 1e3 * case.steps / p50,
        "roofline": floor_ms * machine.threads / threads / p50,
    }


def times_ms(call: Callable[[], object], seconds: float) -> np.ndarray:
    """Wall-clock time of each call, for about so many seconds after the warm-up [ms].  (calls,)"""
    for _ in range(WARM_UP):
        call()
    taken: list[float] = []
    until = perf_counter() + seconds
    while len(taken) < LEAST or perf_counter() < until:
        began = perf_counter()
        call()
        taken.append(1e3 * (perf_counter() - began))
    return np.array(taken)


def median_ms(call: Callable[[], object], seconds: float) -> float:
    return float(np.median(times_ms(call, seconds)))
