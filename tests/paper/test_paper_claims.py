"""The claims of the paper, on few runs: each sentence a test.

Most are part of `make regression`; here are one cell of Table II for each sampler, by a quarter of
the samples, and how far samples spread. The full tables are made by `race paper all`, see
docs/paper.md.
"""

from dataclasses import replace
from functools import cache

import pytest

from quadsim.config.build import flight_frames
from quadsim.config.spec import Spec
from quadsim.controllers.samplers import Colored, Gaussian
from quadsim.paper import noise, offroad, table2
from quadsim.paper.car import CarState
from quadsim.paper.double_integrator import psd
from quadsim.paper.exploration import SAMPLES, paths
from quadsim.paper.noise import perturbations
from quadsim.paper.offroad import DriveTask
from quadsim.paper.table2 import TABLE2, Motion, MotionTask, accumulated_cost, move, samplings
from quadsim.record.run import RecordedRun
from quadsim.report.metrics import chatter
from tests.small import SMALL


@cache
def motion(name, sigma) -> Motion:
    return move(MotionTask(samplings(sigma)[name], seed=0))


@cache
def cost(name, sigma) -> float:
    return accumulated_cost(motion(name, sigma))


def position(name):
    """Return the position of one axis at sigma 1.5 [m]."""
    return motion(name, 1.5).x[:, 0]


def control(name):
    """Return the control of one axis at sigma 1.5 [m/s^2]."""
    return motion(name, 1.5).u[:, 0]


@cache
def ends(sampling):
    """Return where sampled paths of the off-road vehicle end [m].  (samples, 2)"""
    return paths(perturbations(sampling, SAMPLES))[:, -1]


COLORED = Colored((0.4, 0.4), (4.0, 4.0))
GAUSSIAN = Gaussian((0.4, 0.4))
RAISED = Gaussian((2.0, 2.0))
CELLS = [
    ("gaussian", 0.5),
    ("colored_1", 1.5),
    ("colored_2", 0.5),
    ("smooth_star", 1.5),
    ("log_normal", 0.5),
]


# The transform of colored noise is of the paper's horizon, as the table is.
@pytest.mark.compiled
def test_table2_is_reproduced_with_a_quarter_of_the_samples():
    """One run; the spread of a run is about 1 % at most in these cells."""
    quarter = replace(table2.CONFIG, samples=table2.CONFIG.samples // 4)
    for name, sigma in CELLS:
        found = accumulated_cost(move(MotionTask(samplings(sigma)[name], seed=0, config=quarter)))
        assert found == pytest.approx(TABLE2[name, sigma][0], rel=0.03), (name, sigma)


@pytest.mark.compiled
def test_colored_explores_farther_within_a_second_already(monkeypatch):
    monkeypatch.setattr(noise, "HORIZON", SMALL["horizon"])
    colored, gaussian = (paths(perturbations(s, SAMPLES))[:, -1] for s in (COLORED, GAUSSIAN))
    assert colored[:, 0].var() > 10 * gaussian[:, 0].var()
    assert abs(colored[:, 1]).max() > 2 * abs(gaussian[:, 1]).max()


@pytest.mark.regression
@pytest.mark.parametrize(("name", "sigma"), [*CELLS, ("gaussian", 3.0)])
def test_table2_is_reproduced(name, sigma):
    """One run; the spread of a run is about 1 % at most in these cells."""
    assert cost(name, sigma) == pytest.approx(TABLE2[name, sigma][0], rel=0.03)


@pytest.mark.regression
def test_table2_rests_on_the_librarys_law_and_slip():
    """The published formula to the letter, and a momentum that moves with time, give other
    numbers."""
    assert cost("colored_1_paper", 0.5) > 1.15 * TABLE2["colored_1", 0.5][0]
    assert cost("smooth_star_corrected", 1.5) < 0.9 * TABLE2["smooth_star", 1.5][0]


@pytest.mark.regression
def test_colored_costs_less_than_gaussian_at_the_same_sigma():
    assert cost("colored_1", 0.5) < 0.6 * cost("gaussian", 0.5)


@pytest.mark.regression
def test_log_mppi_needs_far_larger_controls_and_colored_reaches_the_goal_without():
    """At sigma 1.5; the goal counts as reached within 1 m of it after 1.5 s."""
    colored = ("colored_1", "colored_2")
    largest = {name: abs(control(name)).max() for name in ("log_normal", "gaussian", *colored)}
    assert largest["log_normal"] > 3 * max(largest[name] for name in colored)
    assert largest["gaussian"] < min(largest[name] for name in colored)
    for name in ("log_normal", *colored):
        assert abs(position(name)[100] + 4.0) < 1.0


@pytest.mark.regression
def test_gaussian_overshoots_and_colored_does_not():
    assert position("gaussian").max() > -3.9
    assert position("colored_1").max() < -3.9
    assert position("colored_2").max() < -3.9


@pytest.mark.regression
def test_smooth_mppi_barely_reaches_the_goal_in_the_time():
    assert position("smooth")[200] < -5.0
    assert abs(control("smooth")).max() < 2.0 < abs(control("gaussian")).max()


@pytest.mark.regression
def test_smooth_star_oscillates_at_rest_more_than_colored():
    def resting(name):
        return control(name)[-67:].std()

    others = ("colored_1", "colored_2", "gaussian")
    assert resting("smooth_star") > 5 * max(resting(name) for name in others)


@pytest.mark.regression
def test_colored_has_less_power_above_20_hz_than_gaussian():
    def high(name):
        f, power = psd(motion(name, 1.5).t, control(name))
        return power[f > 20.0].sum()

    assert high("colored_2") < 0.5 * high("gaussian") < high("log_normal")
    assert high("colored_1") < 0.5 * high("gaussian")


@pytest.mark.regression
def test_colored_explores_farther_at_the_same_sigma():
    colored = ends(COLORED)
    gaussian = ends(GAUSSIAN)
    assert colored[:, 0].var() > 10 * gaussian[:, 0].var()
    assert abs(colored[:, 1]).max() > 3 * abs(gaussian[:, 1]).max()


@pytest.mark.regression
def test_raising_sigma_does_not_make_gaussian_reach_as_far():
    colored = ends(COLORED)
    raised = ends(RAISED)
    assert raised[:, 0].var() > 2 * ends(GAUSSIAN)[:, 0].var(), "it does reach farther"
    assert colored[:, 0].var() > 3 * raised[:, 0].var()
    assert abs(colored[:, 1]).max() > 2 * abs(raised[:, 1]).max()


@pytest.mark.regression
def test_colored_thrust_varies_less_than_gaussian():
    """The quadrotor with the paper's settings, a quarter of the samples, for 1.5 s."""

    def variation(sampler):
        spec = Spec.of("paper_flat", preset="paper", sampler=sampler, samples=1024, timeout=1.5)
        run = RecordedRun.from_frames(spec.record(), flight_frames(spec))
        return chatter(run)["commanded"]["thrust_tv"]

    assert variation("colored") < 0.3 * variation("gaussian")


@pytest.mark.regression
def test_colored_turns_where_gaussian_cannot():
    """The off-road stand-in for 8 s, with a sixth of the samples and one iteration."""
    reduced = replace(offroad.CONFIG, samples=1024, iterations=1)
    colored = offroad.drive(DriveTask(offroad.COLORED, reduced, seed=0, timeout=8.0))
    gaussian = offroad.drive(DriveTask(offroad.GAUSSIAN, reduced, seed=0, timeout=8.0))
    y = CarState._fields.index("py")
    steer = CarState._fields.index("steer")
    assert colored.legs >= 1
    assert colored.x[-1, y] > 8.0, "up the second leg [m]"
    assert gaussian.x[-1, y] < 4.0
    assert abs(gaussian.x[:, steer]).max() < 0.5 < abs(colored.x[:, steer]).max()
