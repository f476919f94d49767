"""The cases of `race bench`, which time whole control steps."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from time import perf_counter
from typing import Any, NamedTuple

import numpy as np

from quadsim.config.build import planner_of
from quadsim.config.spec import Spec
from quadsim.controllers.config import MPPIConfig
from quadsim.controllers.lanes.planner_loops import operations
from quadsim.controllers.lanes.threads import use_threads
from quadsim.controllers.mppi import MPPI
from quadsim.controllers.presets import preset
from quadsim.controllers.samplers import SAMPLERS, Colored, Gaussian, Sampling
from quadsim.paper import offroad, table2
from quadsim.physics.plant_state import start_state

SAMPLES = (256, 1024, 4096, 16384, 65536)
HORIZONS = (25, 75, 150, 300)
# Samplers for the cases other than the quadrotor at the paper's budget.
SWEPT = ("gaussian", "colored")
WARM_UP = 3  # number of calls before the timing
LEAST = 15  # smallest number of timed calls
QUADROTOR = "quadrotor"
RACER = "racer"  # the quadrotor of `race fly` without an argument
PRESETS = {QUADROTOR: "paper", RACER: "race"}
COURSES = {QUADROTOR: "paper_flat", RACER: "split_s_swift"}


class PaperSystem(NamedTuple):
    """One of the paper's other systems, with the paper's numbers."""

    planner: Callable[[Sampling, MPPIConfig], MPPI]
    config: MPPIConfig
    start: tuple[float, ...]
    samplings: Mapping[str, Sampling]  # name of SWEPT -> sampler


PAPER_SYSTEMS = {
    "offroad": PaperSystem(
        planner=offroad.planner,
        config=offroad.CONFIG,
        start=offroad.START,
        samplings={"gaussian": offroad.GAUSSIAN, "colored": offroad.COLORED},
    ),
    "double_integrator": PaperSystem(
        planner=table2.planner,
        config=table2.CONFIG,
        start=table2.START,
        samplings={
            "gaussian": Gaussian(sigma=(1.5, 1.5)),
            "colored": Colored(sigma=(1.5, 1.5), gamma=(1.0, 1.0)),
        },
    ),
}
TIMED = (QUADROTOR, RACER, *PAPER_SYSTEMS)


@dataclass(frozen=True)
class Case:
    """A benchmark of a control step: system, sampler and budget."""

    system: str  # one of TIMED
    sampler: str
    samples: int
    horizon: int
    iterations: int
    threads: int | None = None  # None: all threads

    @property
    def size(self) -> str:
        """The budget as text: samples x horizon x iterations."""
        return f"{self.samples} x {self.horizon} x {self.iterations}"

    @property
    def name(self) -> str:
        """The system and the budget as text."""
        return f"{self.system} {self.size}"

    @property
    def steps(self) -> int:
        """The number of model steps of all samples in all iterations, M T I."""
        return self.samples * self.horizon * self.iterations


class CaseTime(NamedTuple):
    """The measured time of a case."""

    name: str
    system: str
    sampler: str
    samples: int
    horizon: int
    iterations: int
    threads: int
    ms_p50: float  # median of the control steps
    ms_p95: float  # 95th percentile
    steps_per_s: float  # model steps per second, by the median
    # operations of model and cost in these steps, over the peak of these threads
    of_peak: float

    @classmethod
    def of(
        cls, case: Case, threads: int, *, ms_p50: float, ms_p95: float, operations: int, peak: float
    ) -> CaseTime:
        """Return the time of a case.

        Args:
            case: the case.
            threads: number of threads.
            ms_p50, ms_p95: percentiles of the times of a control step [ms].
            operations: arithmetic operations of one step of one sample.
            peak: of one thread, see `peak_operations` [1/s].
        """
        steps_per_s = 1e3 * case.steps / ms_p50
        return cls(
            name=case.name,
            system=case.system,
            sampler=case.sampler,
            samples=case.samples,
            horizon=case.horizon,
            iterations=case.iterations,
            threads=threads,
            ms_p50=ms_p50,
            ms_p95=ms_p95,
            steps_per_s=steps_per_s,
            of_peak=steps_per_s * operations / (threads * peak),
        )


class Start(NamedTuple):
    """A planner and its initial state."""

    mppi: MPPI
    x: np.ndarray  # (n_x,)


def paper_case(system: str, sampler: str) -> Case:
    """Return the case with the paper's budget, or the racer's own budget, on all threads."""
    if system in PRESETS:
        config = preset(PRESETS[system], "gaussian").mppi
    else:
        config = PAPER_SYSTEMS[system].config
    return Case(system, sampler, config.samples, config.horizon, config.iterations)


def cases(most: int) -> Iterator[Case]:
    """Yield the paper's budgets, then sweeps over samples and horizon.

    Each case is timed on one thread, then on `most` threads.
    """
    for case in _sizes():
        for threads in sorted({1, most}):
            yield replace(case, threads=threads)


def _sizes() -> Iterator[Case]:
    for sampler in SAMPLERS:
        yield paper_case(QUADROTOR, sampler)
    for system in (RACER, *PAPER_SYSTEMS):
        for sampler in SWEPT:
            yield paper_case(system, sampler)
    for sampler in SWEPT:
        paper = paper_case(QUADROTOR, sampler)
        for samples in SAMPLES:
            if samples != paper.samples:
                yield replace(paper, samples=samples)
        for horizon in HORIZONS:
            if horizon != paper.horizon:
                yield replace(paper, horizon=horizon)


def starting(case: Case) -> Start:
    """Return the planner of a case, with the settings of its preset, and the initial state."""
    budget: dict[str, Any] = {
        "samples": case.samples,
        "horizon": case.horizon,
        "iterations": case.iterations,
    }
    if case.system in PRESETS:
        course, preset_name = COURSES[case.system], PRESETS[case.system]
        spec = Spec.of(course, preset=preset_name, sampler=case.sampler, **budget)
        x = start_state(spec.course.start, spec.vehicle.radius)
        return Start(planner_of(spec), np.array(x))
    system = PAPER_SYSTEMS[case.system]
    config = replace(system.config, **budget)
    return Start(system.planner(system.samplings[case.sampler], config), np.array(system.start))


def measure(case: Case, seconds: float, peak: float) -> CaseTime:
    """Return the times of the control steps of a case.

    Args:
        case: the case.
        seconds: approximate duration of the timing.
        peak: of one thread, see `peak_operations` [1/s].
    """
    threads = use_threads(case.threads)
    start = starting(case)
    times = times_ms(lambda: start.mppi.control(start.x), seconds)
    p50, p95 = np.percentile(times, [50, 95]).tolist()
    per_step = operations(start.mppi.system, start.mppi.cost)
    return CaseTime.of(case, threads, ms_p50=p50, ms_p95=p95, operations=per_step, peak=peak)


def times_ms(call: Callable[[], object], seconds: float) -> np.ndarray:
    """Return the wall-clock times of repeated calls, warm-up excluded [ms].

    Args:
        call: the function to time.
        seconds: approximate duration of the timing.

    Returns:
        Times  (calls,).
    """
    for _ in range(WARM_UP):
        call()
    times: list[float] = []
    until = perf_counter() + seconds
    while len(times) < LEAST or perf_counter() < until:
        began = perf_counter()
        call()
        times.append(1e3 * (perf_counter() - began))
    return np.array(times)


def median_ms(call: Callable[[], object], seconds: float) -> float:
    """Return the median time of a call, repeated for about the given number of seconds [ms]."""
    return float(np.median(times_ms(call, seconds)))
