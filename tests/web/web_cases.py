"""Flights without physics for the page's tests: from gate to gate at constant speed, as fast as
they are asked for."""

import socket
import time
from itertools import count

import numpy as np

from controllers.plan import PlannerSnapshot
from quadsim.course import load_course
from quadsim.race.events import Event, Frame
from quadsim.spec.spec import Spec
from web.flight_factory import Choices, FlightFactory, numbers_of

PERIOD = 0.01  # [s]
COURSE = "figure8"
MPPI = {"samples": 1024, "target_ess": 10.0}
PRESET = numbers_of({"mppi": MPPI, "sampling": {"sigma": [1.0], "gamma": [2.0]}})
VEHICLE = Spec.of(COURSE).record()["vehicle"]
SPEED = {"colored": 40.0, "gaussian": 36.0}  # [m/s], so that tests are short


class Glider:
    """A flight: straight from gate to gate."""

    def __init__(self, choices: Choices, outcome: str = "finished"):
        self.choices, self.course, self.period = choices, load_course(choices.course), PERIOD
        self.laps = choices.laps or 1
        self.spec = {
            "course": self.course.name,
            "course_text": self.course.text,
            "sampler": choices.sampler,
            "preset": choices.preset,
            "seed": choices.seed,
            "laps": self.laps,
            "vehicle": VEHICLE,
            "planner": {"mppi": MPPI},
            "host": {},
        }
        self.numbers = {**PRESET, **choices.numbers}
        self.closed, self.is_cached = False, True
        self._speed, self._outcome = SPEED[choices.sampler], outcome
        self.frames = self._fly()

    def tune(self, name, value):
        before, self.numbers = (
            self.numbers,
            {**self.numbers, name: PRESET[name] if value is None else value},
        )
        return (
            [{"name": name, "from": before[name], "to": self.numbers[name]}]
            if self.numbers != before
            else []
        )

    def sampled_trajectories(self):
        return None

    def corners(self):
        return None

    def close(self) -> None:
        self.closed = True

    def _fly(self):
        gates = self.course.gates * self.laps
        points = np.array([self.course.start.position, *(g.position for g in gates)])
        # [s]
        ends = (
            np.append(0.0, np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))) / self._speed
        )
        passed, began = 0, time.perf_counter()
        for k in count():
            t, events = k * PERIOD, []
            while passed < len(gates) and ends[passed + 1] <= t:
                passed += 1
                lap, gate = divmod(passed - 1, len(self.course.gates))
                spot = tuple(points[passed].tolist())
                events.append(
                    Event(
                        float(ends[passed]),
                        "pass",
                        gate + 1,
                        lap + 1,
                        (0.0, 0.0),
                        self._speed,
                        spot,
                    )
                )
            over = self._outcome if passed == len(gates) else None
            p = [float(np.interp(t, ends, points[:, c])) for c in range(3)]
            x = (*p, self._speed, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 9.81, 0.0, 0.0, 0.0)
            u = (0.0, 0.0, 0.0, 9.81 + np.sin(20.0 * t))
            lap = min(passed // len(self.course.gates) + 1, self.laps)
            gate = passed % len(self.course.gates) + 1
            now = time.perf_counter() - began
            seen = None if over or k % 10 else _snapshot(k)
            yield Frame(
                t, x, u, passed, lap, gate, 10.0, 0.5, 1.0, 0.1, now, tuple(events), over, seen
            )
            if over:
                return


def _snapshot(k: int) -> PlannerSnapshot:
    """Its numbers are those of the frame it was taken at."""
    return PlannerSnapshot(
        np.full((8, 16, 3), float(k)), {"progress": float(k), "crash": 0.0, "waypoint": -0.5}
    )


class Gliders(FlightFactory):
    """A flight factory of gliders."""

    def __init__(self):
        self.built: list[Glider] = []

    def numbers(self, preset, sampler):
        return dict(PRESET)

    def flight(self, choices: Choices) -> Glider:
        if choices.laps > 50:
            raise ValueError("figure8: expected at most 50 laps, got more")
        self.built.append(Glider(choices))
        return self.built[-1]


def choices(sampler="colored", laps=1, **more):
    return Choices(course=COURSE, sampler=sampler, laps=laps, **more)


def until(claim, seconds=10.0):
    """Whether it comes true in time."""
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        if claim():
            return True
        time.sleep(0.01)
    return False


def free_port():
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]
