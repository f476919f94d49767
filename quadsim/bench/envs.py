"""Time learning environments in steps per second.

A step consists of the model's step, gate tests, obstacles, reward, observation and restart. Each
number of vehicles is timed in the compiled lanes, as used by `race train`, and through Gymnasium's
arrays. Races of several vehicles are timed in the same ways. Both interfaces are timed in
alternation in short pieces, and the shortest time of each is reported, as it is the least disturbed
by other programs on the machine.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import suppress
from functools import partial
from time import perf_counter
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from quadsim.console import UsageError
from quadsim.controllers.lanes.environment import SAME_STEP
from quadsim.controllers.lanes.threads import use_threads
from quadsim.course import load_course
from quadsim.files.extras import needs_extra
from quadsim.learn.lanes import LaneEnvironments
from quadsim.learn.race_lanes import RaceLanes
from quadsim.learn.task import task
from quadsim.physics.link import HOVER
from quadsim.physics.plant import PLANTS
from quadsim.vehicle import load_vehicle

if TYPE_CHECKING:
    from quadsim.learn.races import Races  # needs Gymnasium
    from quadsim.learn.vector_env import RacingVectorEnv  # needs Gymnasium

VEHICLES = (64, 512, 4096, 65536)
RACES = ((1024, 2), (1024, 4), (512, 8))  # (number of races, racers per race)
PIECE = 0.02  # approximate duration of one timed piece [s]


class PublishedSpeed(NamedTuple):
    """A published speed of another project, on its own machine and with its own model."""

    who: str
    steps_per_s: float


PUBLISHED = (
    PublishedSpeed("Flightmare (Song et al. 2020), its physics alone", 200_000),
    PublishedSpeed("QuadSwarm (Huang et al. 2023), 16 cores, eight vehicles", 62_000),
)


class EnvsSpeed(NamedTuple):
    """The speed of environments with a number of vehicles."""

    vehicles: int
    threads: int
    lanes: float  # through the compiled lanes [1/s]
    arrays: float  # through Gymnasium's arrays [1/s]


class RacesSpeed(NamedTuple):
    """The speed of races, in steps of single racers."""

    races: int
    racers: int  # in a race
    threads: int
    lanes: float  # through the compiled lanes [1/s]
    arrays: float  # through arrays of (races, racers, ...) [1/s]


def measure_races(seconds: float) -> list[RacesSpeed]:
    """Return the speeds of races of each size in RACES, on one thread and on all.

    Args:
        seconds: approximate duration of the timing for each row.

    Raises:
        UsageError: Gymnasium is not installed.
    """
    try:
        from quadsim.learn.races import Races
    except ImportError:
        raise UsageError(f"--envs: {needs_extra('gymnasium', 'rl')}") from None
    most = use_threads(None)
    rows = []
    for threads in sorted({1, most}):
        use_threads(threads)
        for number, racers in RACES:
            races = Races(number, racers=racers, start="anywhere")
            races.reset(seed=0)
            functions = {"lanes": race_lane_steps(races), "arrays": race_array_steps(races)}
            best = shortest(functions, seconds)
            steps = number * racers
            speed = RacesSpeed(
                number, racers, threads, steps / best["lanes"], steps / best["arrays"]
            )
            rows.append(speed)
    use_threads(None)
    return rows


def race_lane_steps(races: Races) -> Callable[[], None]:
    """Return a function that steps races in lanes, with actions around hover."""
    lanes = RaceLanes(races.task, races.races, 0, restart=True)
    lanes.begin(0)
    actions = around_hover(lanes.last.shape)
    return lambda: lanes.step(actions)


def race_array_steps(races: Races) -> Callable[[], None]:
    """Return a function that steps races through arrays, with actions around hover."""
    rows = around_hover((races.races * races.racers, 4))
    actions = rows.reshape(races.races, races.racers, 4)

    def step() -> None:
        races.step(actions)

    return step


def measure_envs(seconds: float) -> list[EnvsSpeed]:
    """Return the speeds of environments with each number in VEHICLES, on one thread and on all.

    Args:
        seconds: approximate duration of the timing for each row.

    Raises:
        UsageError: Gymnasium is not installed.
    """
    try:
        from quadsim.learn.vector_env import RacingVectorEnv
    except ImportError:
        raise UsageError(f"--envs: {needs_extra('gymnasium', 'rl')}") from None
    most = use_threads(None)
    rows = []
    for threads in sorted({1, most}):
        use_threads(threads)
        for n in VEHICLES:
            envs = RacingVectorEnv(n, start="anywhere", autoreset_mode="SameStep")
            envs.reset(seed=0)
            best = shortest({"lanes": lane_steps(n), "arrays": array_steps(envs)}, seconds)
            rows.append(EnvsSpeed(n, threads, n / best["lanes"], n / best["arrays"]))
    use_threads(None)
    return rows


def lane_steps(n: int) -> Callable[[], None]:
    """Return a function that steps n environments in lanes, with actions around hover."""
    envs = LaneEnvironments(task(start="anywhere"), n, 0, SAME_STEP)
    envs.begin(0)
    actions = around_hover(envs.last.shape)
    return lambda: envs.step(actions)


def array_steps(envs: RacingVectorEnv) -> Callable[[], None]:
    """Return a function that steps environments through Gymnasium's arrays, around hover."""
    actions = around_hover((envs.num_envs, 4))

    def step() -> None:
        envs.step(actions)

    return step


def around_hover(shape: tuple[int, ...]) -> np.ndarray:
    """Return random actions near hover in this shape, whose second axis has the controls."""
    actions = np.random.default_rng(0).normal(0, 0.1, shape).astype(np.float32)
    actions[:, 3] -= 0.5  # about hover: a quarter of the thrust range
    return actions


def measure_plants(seconds: float) -> dict[str, float]:
    """Return the speed of each simulator with one vehicle in hover [steps of 10 ms per second].

    Args:
        seconds: approximate duration of the timing, for all installed simulators together.
    """
    course = load_course("split_s_swift")
    vehicle = load_vehicle("swift")
    steps = {}
    for name, kind in PLANTS.items():
        with suppress(ValueError):  # the simulator is not installed
            steps[name] = partial(kind(course, vehicle, dt=0.01).step, HOVER)
    return {name: 1 / time for name, time in shortest(steps, seconds).items()}


def shortest(steps: Mapping[str, Callable[[], object]], seconds: float) -> dict[str, float]:
    """Return the shortest time per call of each function [s], timed in alternation.

    Args:
        steps: functions to call, by name.
        seconds: approximate duration of the timing, for all functions together.
    """
    calls = {
        name: max(1, round(PIECE / max(_timed(step, 3), 1e-7))) for name, step in steps.items()
    }
    best = dict.fromkeys(steps, np.inf)
    until = perf_counter() + seconds
    while perf_counter() < until or np.inf in best.values():
        for name, step in steps.items():
            best[name] = min(best[name], _timed(step, calls[name]))
    return best


def _timed(step: Callable[[], object], calls: int) -> float:
    """Return the mean time of a number of calls [s]."""
    began = perf_counter()
    for _ in range(calls):
        step()
    return (perf_counter() - began) / calls
