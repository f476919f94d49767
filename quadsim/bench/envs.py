"""Env steps a second: step of the model, gate tests, obstacles, reward, observation and restart,
all counted as one.

Each size is timed in lanes, as `race train` steps it, and through Gymnasium's arrays, one after the
other in each repetition; the shortest time of each is what it takes when nothing else disturbs the
machine.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from functools import partial
from time import perf_counter
from typing import Any

import numpy as np
from rich.table import Table

from controllers.lanes.environment import SAME_STEP
from controllers.lanes.threads import use_threads
from quadsim.console import UsageError, plain_table
from quadsim.course import load_course
from quadsim.learn.lanes import LaneEnvironments
from quadsim.learn.task import task
from quadsim.physics.actuators import HOVER
from quadsim.physics.plant import PLANTS
from quadsim.vehicle import load_vehicle

VEHICLES = (64, 512, 4096, 65536)
PIECE = 0.02  # [s] that one timed piece takes, about
# by their authors, on their machines, with models of their own: no measurement of ours
PUBLISHED = (
    ("Flightmare (Song et al. 2020), its physics alone", 200_000),
    ("QuadSwarm (Huang et al. 2023), 16 cores, eight vehicles", 62_000),
)


def measure_envs(seconds: float) -> list[dict]:
    """{vehicles, threads, lanes, arrays}: env steps a second, on one thread and on all. About
    `seconds` a row."""
    try:
        from quadsim.learn.vector_env import RacingVectorEnv
    except ImportError:
        raise UsageError("--envs: expected Gymnasium: pip install 'quadsim[rl]'") from None
    most, rows = use_threads(None), []
    for threads in sorted({1, most}):
        use_threads(threads)
        for n in VEHICLES:
            envs = RacingVectorEnv(n, start="anywhere", autoreset_mode="SameStep")
            envs.reset(seed=0)
            best = shortest({"lanes": lane_steps(n), "arrays": array_steps(envs)}, seconds)
            rows.append({"vehicles": n, "threads": threads} | {k: n / t for k, t in best.items()})
    use_threads(None)
    return rows


def lane_steps(n: int) -> Callable[[], None]:
    """One step of n environments in lanes, with actions around hover."""
    envs = LaneEnvironments(task(start="anywhere"), n, 0, SAME_STEP)
    envs.begin(0)
    actions = np.random.default_rng(0).normal(0, 0.1, envs.last.shape).astype(np.float32)
    actions[:, 3] -= 0.5
    return lambda: envs.step(actions)


def array_steps(envs: Any) -> Callable[[], None]:
    """The same through Gymnasium's arrays."""
    actions = np.random.default_rng(0).normal(0, 0.1, (envs.num_envs, 4)).astype(np.float32)
    actions[:, 3] -= 0.5

    def step() -> None:
        envs.step(actions)

    return step


def measure_plants(seconds: float) -> dict[str, float]:
    """Steps of 10 ms a second of one vehicle in hover, in each simulator that is installed; about
    `seconds` for all."""
    course, vehicle, steps = load_course("split_s_swift"), load_vehicle("swift"), {}
    for name, kind in PLANTS.items():
        with suppress(ValueError):  # it is not installed
            steps[name] = partial(kind(course, vehicle, dt=0.01).step, HOVER)
    return {name: 1 / t for name, t in shortest(steps, seconds).items()}


def shortest(steps: dict[str, Callable[[], None]], seconds: float) -> dict[str, float]:
    """Of each, the least time of a call [s], over pieces in turn."""
    calls = {
        name: max(1, round(PIECE / max(_timed(step, 3), 1e-7))) for name, step in steps.items()
    }
    best = dict.fromkeys(steps, np.inf)
    until = perf_counter() + seconds
    while perf_counter() < until or np.inf in best.values():
        for name, step in steps.items():
            best[name] = min(best[name], _timed(step, calls[name]))
    return best


def _timed(step: Callable[[], None], calls: int) -> float:
    began = perf_counter()
    for _ in range(calls):
        step()
    return (perf_counter() - began) / calls


def envs_table(rows: list[dict]) -> Table:
    """Million steps a second, and core-nanoseconds a step."""
    heads = (
        "vehicles",
        "threads",
        "in lanes\n[million/s]",
        "core-ns\na step",
        "in arrays\n[million/s]",
        "core-ns\na step",
    )
    table = plain_table(*heads, no_wrap=True)
    for row in rows:
        cells = [
            text
            for key in ("lanes", "arrays")
            for text in (f"{row[key] / 1e6:.1f}", f"{1e9 * row['threads'] / row[key]:.0f}")
        ]
        table.add_row(str(row["vehicles"]), str(row["threads"]), *cells)
    return table


def others(plants: dict[str, float]) -> list[str]:
    """A line for each simulator of one vehicle in this run, and for each figure that others
    give."""
    measured = [
        f"one vehicle, no gates, reward or observation: {name}: {n / 1e6:.2g} million/s"
        for name, n in plants.items()
    ]
    return measured + [
        f"published, not measured here: {who}: {steps / 1e6:g} million/s"
        for who, steps in PUBLISHED
    ]
