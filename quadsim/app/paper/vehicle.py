"""The off-road experiment: the paper's settings, a stand-in for its vehicle, a corridor of ours.

Section IV-A: "I = 3 iterations, M = 6144 samples, lambda = 0.1, dt = 0.02 s, and T = 250"; "the control standard
deviations were both set to 0.8, the combined throttle and brake exponent was 10, and the steering exponent was 4".
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace

import numpy as np

from controllers.config import MPPIConfig
from controllers.costs.corridor import CorridorWeights, corridor_cost
from controllers.mppi import MPPI
from controllers.samplers import make_sampler
from quadsim.app.paper.store import run_key
from quadsim.course.corridor import load_corridor
from quadsim.physics.plant import ModelPlant, diffusion
from quadsim.race.corridor_referee import CorridorReferee
from quadsim.race.events import Frame
from quadsim.race.flight import fly
from quadsim.systems.offroad import DRIVEN, NOMINAL, STATES, offroad

CORRIDOR = "zigzag"
HALF_WIDTH = 0.8  # of the vehicle [m]
TIMEOUT = 40.0  # [s]
PLANT_DT = 0.005  # [s]
DISTURBANCE = {"hx": 0.01, "hy": 0.01, "v": 0.2, "r": 0.04}  # standard deviation after 1 s of it [1, m/s, rad/s]
MPPI_CONFIG = MPPIConfig(samples=6144, horizon=250, iterations=3, dt=0.02, temperature=0.1, smooth=True)
WEIGHTS = CorridorWeights()
SAMPLING = {"sigma": (0.8, 0.8), "gamma": (10.0, 4.0)}
COLUMNS = ("t", *STATES, "drive_cmd", "steer_cmd")


@dataclass(frozen=True)
class Drive:
    """One attempt."""

    sampler: str
    seed: int
    temperature: float = MPPI_CONFIG.temperature

    @property
    def key(self) -> str:
        fixed = {"vehicle": [asdict(NOMINAL), asdict(DRIVEN)], "sampling": SAMPLING, "disturbed": DISTURBANCE}
        corridor = load_corridor(CORRIDOR)
        fixed |= {"mppi": asdict(MPPI_CONFIG), "weights": asdict(WEIGHTS)}
        fixed |= {"points": corridor.points, "width": corridor.width, "timeout": TIMEOUT, "plant_dt": PLANT_DT}
        return run_key(asdict(self) | fixed)


def frames(drive: Drive) -> tuple[list[Frame], CorridorReferee]:
    """From standing at the corridor's start until the judge ends it."""
    c = replace(MPPI_CONFIG, temperature=drive.temperature)
    stream, world = np.random.SeedSequence(drive.seed).spawn(2)
    planner = controller(drive.sampler, c, stream)
    judge = CorridorReferee(load_corridor(CORRIDOR), HALF_WIDTH, TIMEOUT)
    return list(fly(plant(np.random.default_rng(world)), planner, judge, c.dt)), judge


def controller(sampler: str, config: MPPIConfig, seed: int | np.random.SeedSequence = 0) -> MPPI:
    """Along the corridor, by the estimated model."""
    cost = corridor_cost(load_corridor(CORRIDOR), HALF_WIDTH, WEIGHTS, config.dt)
    return MPPI(offroad(NOMINAL, config.dt), cost, make_sampler(sampler, **SAMPLING), config, seed)


def start() -> tuple[float, ...]:
    """LapTiming at the corridor's start, heading along its first leg.  STATES"""
    corridor = load_corridor(CORRIDOR)
    return (*corridor.points[0], *corridor.directions[0].tolist(), 0.0, 0.0, 0.0, 0.0)


def plant(rng: np.random.Generator) -> ModelPlant:
    """What is driven: finer than the model, with its own numbers, slip and disturbance."""
    system = offroad(DRIVEN, PLANT_DT)
    std = tuple(DISTURBANCE.get(name, 0.0) for name in STATES)
    return ModelPlant(system.step, system.params, start(), PLANT_DT, diffusion(std, PLANT_DT, rng))


def record(drive: Drive) -> dict:
    """Outcome, time [s], bends driven, and a row of COLUMNS for every control step."""
    flown, judge = frames(drive)
    rows = [[round(v, 5) for v in (f.t, *f.x, *f.u)] for f in flown]
    ms = float(np.median([f.plan_ms for f in flown]))
    return {"outcome": flown[-1].outcome, "time": flown[-1].t, "legs": judge.passed, "ms": ms, "rows": rows}
