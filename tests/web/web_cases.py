"""Flights without physics for the page's tests, from gate to gate at constant speed, and pages."""

import socket
import threading
import time
from collections.abc import Callable
from contextlib import contextmanager
from dataclasses import replace
from itertools import count
from typing import NamedTuple

import numpy as np

from quadsim.controllers.plan import PlannerSnapshot
from quadsim.racing.events import Event, Frame
from quadsim.record.archive import RunFolder
from quadsim.record.run import RecordedRun
from quadsim.web.page.dashboard import Dashboard
from quadsim.web.page.server.page_server import PageServer, serve
from quadsim.web.race.live_flight import LiveFlight
from quadsim.web.race.session import Session
from quadsim.web.race.stored_competitor import run_competitor
from quadsim.web.state.choices import Choices
from quadsim.web.state.menu import Menu

PERIOD = 0.01  # of every preset [s]
PHYSICS = 0.0025  # a flight ends at one of these steps [s]
COURSE = "figure8"
MENU = Menu((COURSE, "paper_flat"), ("swift",), ("race",), ("colored", "gaussian"))
SPEED = {"colored": 40.0, "gaussian": 36.0}  # [m/s], so that tests are short


class Glider(LiveFlight):
    """A flight that is straight from gate to gate, as fast as it is asked for.

    Its planner is not compiled until the event `compiled`, if there is one.
    """

    def __init__(self, choices, compiled=None):
        self.choices = choices
        self.compiled = compiled
        self.closed = False
        super().__init__(choices)

    def _take_off(self):
        self._planner = None
        self.is_cached = self.compiled is None
        return self.frames()

    def _replan(self, numbers):
        pass

    def sampled_trajectories(self):
        return None

    def _corners(self):
        return None

    @property
    def flown(self):
        """The flight with its numbers."""
        return self._spec

    def close(self):
        self.closed = True

    def frames(self):
        speed = SPEED[self._spec.sampler]
        course, laps = self._spec.course, self._spec.laps
        gates = course.gates * laps
        points = np.array([course.start.position, *(gate.position for gate in gates)])
        lengths = np.linalg.norm(np.diff(points, axis=0), axis=1)
        ends = np.append(0.0, np.cumsum(lengths)) / speed  # [s]
        if self.compiled:
            self.compiled.wait(60)
        passed = 0
        began = time.perf_counter()
        end = float(np.ceil(ends[-1] / PHYSICS)) * PHYSICS
        for k in count():
            t = min(k * PERIOD, end)
            events = []
            while passed < len(gates) and ends[passed + 1] <= t:
                passed += 1
                lap, gate = divmod(passed - 1, len(course.gates))
                spot = tuple(points[passed].tolist())
                at = float(ends[passed])
                events.append(Event(at, "pass", gate + 1, lap + 1, (0.0, 0.0), speed, spot))
            over = "finished" if passed == len(gates) else None
            p = [float(np.interp(t, ends, points[:, axis])) for axis in range(3)]
            yield Frame(
                t=t,
                x=(*p, speed, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 9.81, 0.0, 0.0, 0.0),
                u=(0.0, 0.0, 0.0, 9.81 + np.sin(20.0 * t)),
                passed=passed,
                lap=min(passed // len(course.gates) + 1, laps),
                gate=passed % len(course.gates) + 1,
                ess=10.0,
                temperature=0.5,
                cost=1.0,
                plan_ms=0.1,
                elapsed=time.perf_counter() - began,
                events=tuple(events),
                outcome=over,
                snapshot=None if over or k % 10 else snapshot(k),
            )
            if over:
                return


def snapshot(k):
    """A planner snapshot whose numbers are those of the frame it was taken at."""
    terms = {"progress": float(k), "crash": 0.0, "waypoint": -0.5}
    return PlannerSnapshot(np.full((8, 16, 3), float(k)), terms)


class Gliders:
    """Makes gliders, and knows all that it made."""

    def __init__(self):
        self.built: list[Glider] = []
        self.compiled: threading.Event | None = None  # of the next one

    def __call__(self, choices):
        glider = Glider(choices, self.compiled)
        self.built.append(glider)
        return glider


def choices(sampler="colored", laps=1, **more):
    return Choices(course=COURSE, sampler=sampler, laps=laps, **more)


def run_of(glider):
    """The run of a whole flight."""
    return RecordedRun.from_frames(glider.now.record, list(glider.frames()))


def competitor(sampler="colored", laps=3, **more):
    """A whole flight as a competitor without a folder."""
    glider = Glider(choices(sampler, laps=laps, **more))
    return run_competitor(run_of(glider), glider.now.course, None)


def crashed_run(sampler="gaussian", laps=3, share=0.8):
    """The run of a flight that ends at a gate, a physics step after a share of its frames."""
    glider = Glider(choices(sampler, laps=laps))
    frames = list(glider.frames())
    frames = frames[: int(share * len(frames))]
    last = frames[-1]
    end = last.t + PHYSICS
    hit = Event(end - 0.0004, "hit", 4, 1, (0.0, 0.0), 9.0, (1.0, 2.0, 3.0))
    crash = replace(last, t=end, outcome="crashed", events=(hit,))
    return RecordedRun.from_frames(glider.now.record, [*frames, crash])


def stored(root, sampler="colored", laps=1):
    """The folder of a whole flight."""
    return store(root, run_of(Glider(choices(sampler, laps=laps))))


def store(root, run):
    with RunFolder.open(root, run.spec) as folder:
        return folder.save(run)


class Clock:
    """A clock that is set by hand."""

    began = 100.0  # [s]

    def __init__(self):
        self.now = self.began

    def __call__(self):
        return self.now


class Page(NamedTuple):
    """A page that is served, and the session behind it."""

    dashboard: Dashboard
    server: PageServer
    session: Session

    @property
    def port(self):
        return self.server.get_port()


@contextmanager
def served(root, take_off: Callable, menu: Menu, first: Choices, port: int = 0):
    """Serve a page over the runs in a folder, and close it."""
    server = serve("127.0.0.1", port, None, "race")
    session = Session(str(root), take_off)
    dashboard = Dashboard(server, session, menu, first)
    try:
        yield Page(dashboard, server, session)
    finally:
        dashboard.close()
        session.close()
        server.stop()


def until(claim, seconds=60.0):
    """Return whether the claim comes true in time, in which a planner may be compiled."""
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        if claim():
            return True
        time.sleep(0.005)
    return False


def free_port():
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]
