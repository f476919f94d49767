"""Vehicles that plan at one instant do so at the same time, on a share of the threads each."""

from __future__ import annotations

import threading

import numpy as np
import pytest

import quadsim
from quadsim.controllers.lanes.threads import most_threads, threads
from quadsim.controllers.plan import PlanStats
from quadsim.dynamics.estimate import Estimate
from quadsim.heat.launch import heat_frames
from quadsim.heat.side_by_side import SideBySide
from quadsim.heat.spec import Entrant, HeatSpec
from quadsim.racing.flight import Planning
from quadsim.sensing.navigation import Navigation
from tests.small import SMALL

HOVER = np.array([0.0, 0.0, 0.0, 9.81])
LONGEST = 20.0  # that two plans wait for each other [s]
FEW = {**SMALL, "first_iterations": 1}

# Each lets a loop run, which starts its threads.
pytestmark = [
    pytest.mark.compiled,
    pytest.mark.skipif(most_threads() < 2, reason="needs two cores"),
]


class Still(Navigation):
    """A navigation of a vehicle that stands still."""

    def __init__(self) -> None:
        pass

    def estimate(self, t: float) -> Estimate:
        return Estimate(t, np.zeros(17))


class Meets:
    """A controller that plans when another one plans too."""

    rest = HOVER

    def __init__(self, meeting: threading.Barrier):
        self._meeting = meeting
        self.threads = 0

    def control(self, estimate: Estimate, /) -> tuple[np.ndarray, PlanStats]:
        self.threads = threads()
        self._meeting.wait(LONGEST)
        return HOVER, PlanStats(0.0, 0.0, 0.0)


class Notes:
    """A controller that notes on which thread it plans."""

    rest = HOVER

    def __init__(self, error: Exception | None = None):
        self.planned_on: threading.Thread | None = None
        self._error = error

    def control(self, estimate: Estimate, /) -> tuple[np.ndarray, PlanStats]:
        self.planned_on = threading.current_thread()
        if self._error:
            raise self._error
        return HOVER, PlanStats(0.0, 0.0, 0.0)


@pytest.fixture(autouse=True)
def threads_of_loops(on_threads):
    """Let the loops start their threads, of which two are used."""
    on_threads(2, lambda: quadsim.fly("figure8", **FEW, timeout=0.02, threads=2))


def planning(controller, is_first=False) -> Planning:
    return Planning(controller, Still(), 0.0, is_first)


def test_two_plan_at_the_same_time_on_a_thread_each():
    meeting = threading.Barrier(2)
    controllers = [Meets(meeting), Meets(meeting)]
    plannings = [planning(controller) for controller in controllers]
    with SideBySide() as make_plans:
        make_plans(plannings)
    assert [one.threads for one in controllers] == [1, 1]
    assert [one.plan.u for one in plannings] == [tuple(HOVER)] * 2


@pytest.mark.parametrize("first", [0, 1])
def test_first_plans_are_made_in_turn(first):
    controllers = [Notes(), Notes()]
    plannings = [planning(one, k == first) for k, one in enumerate(controllers)]
    with SideBySide() as make_plans:
        make_plans(plannings)
    assert [one.planned_on for one in controllers] == [threading.current_thread()] * 2


def test_one_alone_plans_on_all_threads():
    one = Meets(threading.Barrier(1))
    with SideBySide() as make_plans:
        make_plans([planning(one)])
    assert one.threads == 2


def test_an_error_comes_when_all_have_planned():
    fails, plans = Notes(ArithmeticError("no plan")), Notes()
    plannings = [planning(fails), planning(plans)]
    with SideBySide() as make_plans:
        make_plans(plannings)
    assert plans.planned_on is not None
    with pytest.raises(ArithmeticError, match="no plan"):
        _ = plannings[0].plan


def test_its_threads_end_with_it():
    before = set(threading.enumerate())
    with SideBySide() as make_plans:
        make_plans([planning(Notes()), planning(Notes())])
        assert set(threading.enumerate()) > before
    assert set(threading.enumerate()) == before


def test_a_flight_does_not_go_on_without_its_plan():
    with pytest.raises(RuntimeError, match="call run"):
        _ = planning(Notes()).plan


class Mine:
    """A user's own sampler."""

    def sample(self, rng, samples, horizon, controls):
        return 0.1 * rng.standard_normal((samples, horizon, controls))


@pytest.mark.parametrize(
    ("settings", "side_by_side"),
    [
        ({}, True),
        # Each vehicle has the machine to itself while it plans.
        ({"clock": "wall"}, False),
        # A user's part may rely on being called on one thread.
        ({"sampler": Mine()}, False),
    ],
    ids=["planners", "wall clock", "own sampler"],
)
def test_which_races_plan_side_by_side(settings, side_by_side, monkeypatch):
    called = []
    monkeypatch.setattr(SideBySide, "__call__", lambda self, plannings: called.append(plannings))
    spec = quadsim.Spec.of("figure8", **FEW, **settings)
    frames = heat_frames(HeatSpec((Entrant("a", spec), Entrant("b", spec))))
    if side_by_side:
        # Nobody has planned, so no flight can go on.
        with pytest.raises(RuntimeError, match="call run"):
            next(frames)
    else:
        next(frames)
    frames.close()
    assert bool(called) == side_by_side
