"""The cases of `race bench`: whole control steps, noise to updated plan."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict, dataclass, replace

import numpy as np

from controllers.mppi import MPPI
from controllers.presets import PRESETS
from controllers.rollout.threads import use_threads
from controllers.samplers import SAMPLERS
from quadsim.app.bench.timing import times_ms
from quadsim.app.spec import Spec, controller_of, streams
from quadsim.course import load_course
from quadsim.plant import start_state
from quadsim.systems.quadrotor import Belief
from quadsim.vehicle import load_vehicle

SAMPLES = (256, 1024, 4096, 16384, 65536)
HORIZONS = (25, 75, 150, 300)


@dataclass(frozen=True)
class Case:
    """One control step of the quadrotor on paper_flat, gates and all."""

    sampler: str
    samples: int = 4096
    horizon: int = 150
    iterations: int = 2
    threads: int = 0  # 0: all

    @property
    def name(self) -> str:
        return f"{self.samples} x {self.horizon} x {self.iterations}"


def cases(most: int) -> Iterator[Case]:
    """The paper's budget with every sampler, one thread and all; then sweeps over samples and horizon."""
    for sampler in SAMPLERS:
        for threads in sorted({1, most}):
            yield Case(sampler, threads=threads)
    yield from (Case("gaussian", samples=m, threads=most) for m in SAMPLES if m != Case.samples)
    yield from (Case("gaussian", horizon=t, threads=most) for t in HORIZONS if t != Case.horizon)


def controller(case: Case) -> tuple[MPPI, np.ndarray]:
    """The paper preset's MPPI at this budget, and the state it plans from."""
    preset = PRESETS["paper"][case.sampler]
    course, vehicle = load_course("paper_flat"), load_vehicle(preset.vehicle)
    mppi = replace(preset.mppi, samples=case.samples, horizon=case.horizon, iterations=case.iterations)
    planner = replace(preset, mppi=mppi)
    spec = Spec(course, vehicle, case.sampler, "paper", planner, Belief.of(vehicle), 0, 1, 60.0, False, 1 / 400)
    return controller_of(spec, streams(0)[0]), np.array(start_state(course.start, vehicle.radius))


def measure(case: Case, seconds: float) -> dict:
    """{name, sampler, samples, horizon, iterations, threads, ms_p50, ms_p95, steps_per_s}"""
    use_threads(case.threads or None)
    mppi, x = controller(case)
    p50, p95 = np.percentile(times_ms(lambda: mppi.control(x), seconds), [50, 95])
    steps = case.samples * case.horizon * case.iterations
    return {"name": case.name, **asdict(case), "ms_p50": p50, "ms_p95": p95, "steps_per_s": steps / p50 * 1e3}
