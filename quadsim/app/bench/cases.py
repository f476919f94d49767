"""The cases of `race bench`: whole control steps, noise to updated plan."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict, dataclass, replace

import numpy as np

from controllers.rollout.threads import use_threads
from controllers.samplers import SAMPLERS
from quadsim.app.bench.systems import SYSTEMS, Built
from quadsim.app.bench.timing import times_ms
from quadsim.app.bench.work import Machine, floor_ns, work

SAMPLES = (256, 1024, 4096, 16384, 65536)
HORIZONS = (25, 75, 150, 300)
SWEPT = ("gaussian", "colored")  # samplers beyond the quadrotor at the paper's budget


@dataclass(frozen=True)
class Case:
    """One control step."""

    system: str
    sampler: str
    samples: int
    horizon: int
    iterations: int
    threads: int = 0  # 0: all

    @property
    def size(self) -> str:
        return f"{self.samples} x {self.horizon} x {self.iterations}"

    @property
    def steps(self) -> int:
        """Sample steps, M T I."""
        return self.samples * self.horizon * self.iterations


def paper_case(system: str, sampler: str) -> Case:
    """At the paper's budget, on all threads."""
    c = SYSTEMS[system][0]
    return Case(system, sampler, c.samples, c.horizon, c.iterations)


def cases(most: int) -> Iterator[Case]:
    """The paper's budgets, then sweeps over samples and horizon; one thread right before all."""
    for case in _sizes():
        for threads in sorted({1, most}):
            yield replace(case, threads=threads)


def _sizes() -> Iterator[Case]:
    yield from (paper_case("quadrotor", sampler) for sampler in SAMPLERS)
    yield from (paper_case(system, sampler) for system in SYSTEMS if system != "quadrotor" for sampler in SWEPT)
    for sampler in SWEPT:
        paper = paper_case("quadrotor", sampler)
        yield from (replace(paper, samples=m) for m in SAMPLES if m != paper.samples)
        yield from (replace(paper, horizon=t) for t in HORIZONS if t != paper.horizon)


def controller(case: Case) -> Built:
    """MPPI at this budget, and the state that it plans from."""
    budget = {"samples": case.samples, "horizon": case.horizon, "iterations": case.iterations}
    return SYSTEMS[case.system][1](case.sampler, budget)


def measure(case: Case, seconds: float, machine: Machine) -> dict:
    """{name, system, sampler, samples, horizon, iterations, threads, ms_p50, ms_p95, steps_per_s, roofline}

    roofline: share of the time that this machine's arithmetic and memory need at least, on so many of its threads.
    """
    threads = use_threads(case.threads or None)
    mppi, x = controller(case)
    p50, p95 = (float(ms) for ms in np.percentile(times_ms(lambda: mppi.control(x), seconds), [50, 95]))
    floor_ms = 1e-6 * case.steps * sum(floor_ns(part, machine) for part in work(mppi, case.sampler).values())
    row = {"name": f"{case.system} {case.size}", **asdict(case), "threads": threads, "ms_p50": p50, "ms_p95": p95}
    return row | {"steps_per_s": 1e3 * case.steps / p50, "roofline": floor_ms * machine.threads / threads / p50}
