"""The double integrator as Table II of the paper runs it, by the conventions of the authors' public library.

M = 4096, T = 65, I = 1, dt = .015 s, lambda = 1 on the horizon's mean cost; from (-9, -9) m at (.1, .1) m/s to
(-4, -4) m; 300 steps. Every sample keeps the control that is about to be executed, the last 1 % of them
perturb the rest control, and a Savitzky-Golay filter smooths the plan (MPPI-Generic, ACDSLab).
"""

from __future__ import annotations

from dataclasses import asdict, dataclass

import numpy as np

from controllers.config import MPPIConfig
from controllers.costs.quadratic import quadratic_cost
from controllers.mppi import MPPI
from controllers.samplers import Sampling
from quadsim.app.paper.store import run_key
from quadsim.course import Vec3
from quadsim.physics.plant import ModelPlant
from quadsim.race.events import Event, Frame
from quadsim.race.flight import fly
from quadsim.systems.double_integrator import double_integrator

START = (-9.0, -9.0, 0.1, 0.1)
GOAL = (-4.0, -4.0)
STEPS = 300
MPPI_CONFIG = MPPIConfig(
    samples=4096,
    horizon=65,
    iterations=1,
    dt=0.015,
    temperature=1.0,
    rest_fraction=0.01,
    freeze_first=True,
    smooth=True,
)


@dataclass(frozen=True)
class Variant:
    """One cell of the table."""

    name: str
    sampler: str
    sampling: Sampling

    def key(self, seed: int) -> str:
        settings = {"sampler": self.sampler, "sampling": asdict(self.sampling), "mppi": asdict(MPPI_CONFIG)}
        return run_key(settings | {"start": START, "goal": GOAL, "steps": STEPS, "seed": seed})


class Stopwatch:
    """A judge that ends a run after so many seconds."""

    passed, lap, next_gate = 0, 1, 0

    def __init__(self, seconds: float):
        self.outcome: str | None = None
        self._seconds = seconds

    def observe(self, t0: float, p0: Vec3, t1: float, p1: Vec3, contacts: object = ()) -> list[Event]:
        self.outcome = "finished" if t1 > self._seconds else None
        return []


def frames(variant: Variant, seed: int) -> list[Frame]:
    """One run: STEPS + 1 states and the controls between them."""
    c = MPPI_CONFIG
    planner = controller(variant.sampling, c, seed)
    plant = ModelPlant(planner.system.step, planner.system.params, START, c.dt)
    return list(fly(plant, planner, Stopwatch((STEPS - 0.5) * c.dt), c.dt))


def controller(sampling: Sampling, config: MPPIConfig, seed: int = 0) -> MPPI:
    """To the goal."""
    return MPPI(double_integrator(config.dt), quadratic_cost(GOAL), sampling, config, seed)


def record(job: tuple[Variant, int]) -> dict:
    """Accumulated cost of the states reached, and the median wall clock of a control step [ms]."""
    flown = frames(*job)
    cost = quadratic_cost(GOAL)
    total = sum(sum(cost.terms(f.x, f.x, f.u, GOAL, 0.0, cost.params)[:2]) for f in flown[1:])
    return {"cost": total, "ms": float(np.median([f.plan_ms for f in flown[:-1]]))}
