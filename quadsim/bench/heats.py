"""Time races of several vehicles: control steps, steps of the world, whole races."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import closing
from time import perf_counter
from typing import NamedTuple

import numpy as np

from quadsim.bench.cases import QUADROTOR, WARM_UP, median_ms, paper_case, starting
from quadsim.config.build import in_flight, planner_of
from quadsim.config.spec import Spec
from quadsim.dynamics.estimate import Estimate
from quadsim.dynamics.expected_path import ExpectedPath
from quadsim.dynamics.quadrotor import State
from quadsim.heat.aware_planner import AwarePlanner, Perception
from quadsim.heat.launch import expectation_of, heat_frames, keep_clear_terms, with_terms
from quadsim.heat.loop import HeatFrame
from quadsim.heat.settings import Expect, HeatSettings
from quadsim.heat.spec import Entrant, HeatSpec
from quadsim.heat.traffic import Traffic
from quadsim.physics.plant import SharedPlant, has_bullet, new_arena
from quadsim.physics.plant_state import start_state
from quadsim.streams import sighting_stream

OTHERS = (0, 1, 3, 7)
EXPECTED: tuple[Expect, ...] = ("velocity", "plans", "own")
VEHICLES = (1, 8)
SPEED = 10.0  # of all vehicles [m/s]
STEPS = 60  # control steps timed of each case
RACERS = (1, 2, 4)  # numbers of vehicles in the races that are timed
RACE_SAMPLES = 1024  # number of samples of each planner in these races
RACE_TIME = 1.0  # race time during which each of them is timed [s]
HOVER = (0.0, 0.0, 0.0, 9.81)


class OthersTime(NamedTuple):
    """The time of a control step in a race with other vehicles."""

    expect: str
    others: int
    ms_p50: float
    ms_least: float
    # p50 over the p50 without others, measured in turn with it
    ratio: float


class WorldTime(NamedTuple):
    """The time of a physics step of the world, with the actuators of all vehicles."""

    world: str
    vehicles: int
    us: float


class HeatTime(NamedTuple):
    """The measured time of a race in one world: plans, physics and rules, without a page."""

    vehicles: int
    # samples of each planner
    samples: int
    # wall-clock time for one control period of all vehicles [ms]
    ms: float
    # race time over wall-clock time
    real_time: float
    # ms over the time of a control step at the paper's budget, measured just before
    full_steps: float


class HeatTimes(NamedTuple):
    """The times of control steps, of the world and of whole races with several vehicles."""

    beside: list[OthersTime]
    worlds: list[WorldTime]
    races: list[HeatTime]


def measure_heats(seconds: float) -> HeatTimes:
    """Return the times of control steps, of the world and of whole races.

    Args:
        seconds: approximate time for each case of the world, and for each series of control steps
            in a race [s].
    """
    return HeatTimes(list(others_times()), list(world_times(seconds)), list(heat_times(seconds)))


def others_times() -> Iterator[OthersTime]:
    """Yield the times of control steps for kinds of prediction and numbers of other vehicles."""
    alone = PlannerInLine("nothing", 0)
    alone.step_ms()
    for expect in EXPECTED:
        for others in OTHERS[1:]:
            case = PlannerInLine(expect, others)
            for _ in range(WARM_UP + others):
                case.step_ms()
            # Timed in alternation, so that other programs slow both down alike.
            times = np.array([(alone.step_ms(), case.step_ms()) for _ in range(STEPS)])
            base, own = np.median(times, axis=0)
            yield OthersTime(expect, others, float(own), float(times[:, 1].min()), own / base)


class PlannerInLine:
    """The planner of a vehicle that flies in line with others."""

    def __init__(self, expect: Expect, others: int):
        """Make the planner of a vehicle."""
        spec = Spec.of()
        entrants = tuple(Entrant(str(k), spec) for k in range(others + 1))
        heat = HeatSpec(entrants, HeatSettings(expect=expect))
        self._dt = spec.planner.mppi.dt
        self._radius = spec.vehicle.radius
        self._start = start_state(spec.course.start, self._radius)
        self._traffic = Traffic(
            others + 1,
            heat.settings.sight,
            [sighting_stream(0, k) for k in range(others + 1)],
        )
        terms = keep_clear_terms(heat, 0)
        flown = with_terms(spec, terms)
        self._planner = AwarePlanner(
            in_flight(flown, planner_of(flown)),
            Perception(0, self._traffic, 0.0, spec.course),
            expectation_of(heat, 0, self._traffic),
            terms,
        )
        self._others = others
        self._steps = 0

    def step_ms(self) -> float:
        """Return the time of the next control step [ms]."""
        t = self._steps * self._dt
        self._steps += 1
        for m in range(1, self._others + 1):
            ahead = (1.0 * m, 0.5 * m, 0.0)
            x = self._moved(ahead, t)
            self._traffic.note(m, t, x, 0)
            away = np.outer(self._dt * np.arange(151), x.velocity)  # (T + 1, 3)
            self._traffic.announce(m, ExpectedPath(t, self._dt, np.array(x.position) + away))
        self._traffic.publish()
        estimate = Estimate(t, np.array(self._moved((0.0, 0.0, 0.0), t)))
        began = perf_counter()
        self._planner.control(estimate)
        return 1e3 * (perf_counter() - began)

    def _moved(self, offset: tuple[float, float, float], t: float) -> State:
        """Return the state at t [s] of a vehicle that moves to and fro in front of the start."""
        way = SPEED * (t % 0.5)
        start = self._start
        return start._replace(
            px=start.px + offset[0] + way,
            py=start.py + offset[1],
            pz=start.pz + 1.0,
            vx=SPEED,
        )


def world_times(seconds: float) -> Iterator[WorldTime]:
    """Yield the times of physics steps, by world and number of vehicles."""
    spec = Spec.of()
    for world in ("rigid", "bullet") if has_bullet() else ("rigid",):
        for vehicles in VEHICLES:
            entrants = tuple(Entrant(str(k), spec) for k in range(vehicles))
            starts = HeatSpec(entrants).starts
            with closing(new_arena(world, spec.course, spec.plant_dt, collide=True)) as arena:
                plants = [
                    SharedPlant(arena, spec.course, spec.vehicle, spec.plant_dt, start=start)
                    for start in starts
                ]

                def step() -> None:
                    for plant in plants:  # noqa: B023 (it is called in this iteration alone)
                        plant.push(HOVER)
                    arena.step()
                    for plant in plants:  # noqa: B023
                        plant.arrive()

                yield WorldTime(world, vehicles, 1e3 * median_ms(step, seconds))


def heat_times(seconds: float) -> Iterator[HeatTime]:
    """Yield the time of a race for each number of vehicles, which plan each other's flights.

    Args:
        seconds: approximate time for each series of control steps [s].
    """
    spec = Spec.of(samples=RACE_SAMPLES)
    period = spec.planner.mppi.dt
    whole = starting(paper_case(QUADROTOR, "colored"))
    for vehicles in RACERS:
        step_ms = median_ms(lambda: whole.mppi.control(whole.x), seconds)
        entrants = tuple(Entrant(str(k), spec) for k in range(vehicles))
        with closing(heat_frames(HeatSpec(entrants))) as frames:
            # Not timed: the first plans take longer, and may compile loops.
            t = run_until(frames, WARM_UP * period)
            began = perf_counter()
            raced = run_until(frames, t + RACE_TIME) - t
            spent = perf_counter() - began
        ms = 1e3 * spent * period / raced
        yield HeatTime(
            vehicles=vehicles,
            samples=RACE_SAMPLES,
            ms=ms,
            real_time=raced / spent,
            full_steps=ms / step_ms,
        )


def run_until(frames: Iterator[HeatFrame], t: float) -> float:
    """Fly a race until t [s] or its earlier end, and return the reached race time [s]."""
    last = 0.0
    for frame in frames:
        last = frame.t
        if last >= t:
            break
    return last
