"""The cost of following a reference: what is searched, what is paid for, and that a flight keeps to
its path."""

from contextlib import closing
from dataclasses import replace

import numpy as np
import pytest

from quadsim.config.build import build
from quadsim.config.reference import reference_of, stored_reference
from quadsim.config.spec import Spec
from quadsim.controllers.costs import evaluate
from quadsim.controllers.costs.reference import (
    GATE_TIME,
    TERMS,
    Reference,
    ReferenceWeights,
    reference_cost,
)
from quadsim.course import load_course
from quadsim.dynamics.quadrotor import State
from quadsim.files.strict_yaml import FileError
from quadsim.racing.flight import simulate
from quadsim.vehicle import load_vehicle
from tests.small import SMALL

COURSE, SWIFT, DT = load_course("split_s_swift"), load_vehicle("swift"), 0.01
WEIGHTS = ReferenceWeights()
LIMIT = stored_reference(COURSE, SWIFT, 3, WEIGHTS, "runs")
ROWS = 100
LEVEL = (1.0, 0.0, 0.0, 0.0)


def straight(speed=10.0):
    """Along x at this speed, a gate after half a second and at the end."""
    t = DT * np.arange(ROWS)[:, None]
    x = np.hstack([speed * t, 0 * t, 0 * t + 2.0, 0 * t + speed, 0 * t, 0 * t])
    return Reference.of(x, np.tile([0.0, 0.0, 0.0, 9.81], (ROWS, 1)), (50, 99), DT)


def paid(offset, velocity=(0.0, 0.0, 0.0), row=20):
    """Return {term: cost} of a state that is off the straight reference by an offset [m]."""
    reference = straight()
    cost = reference_cost(COURSE, 0.14, WEIGHTS, reference)
    target = cost.targets[row]
    x = State.of(
        target[:3] + offset, target[3:6] + velocity, LEVEL, (0.0, 0.0, 0.0), 9.81, (0.0, 0.0, 0.0)
    )
    found = evaluate(cost, x, x, (0.0,) * 4, target)
    assert found.reached, "every step leads to the next row"
    return {name: float(value) for name, value in found.terms.items()}


def test_a_state_on_the_reference_costs_nothing():
    assert paid((0.0, 0.0, 0.0)) == dict.fromkeys(TERMS, 0.0)


def test_across_the_path_is_paid_for_and_ahead_on_it_is_rewarded():
    aside, ahead, late = paid((0.0, 0.3, 0.0)), paid((0.3, 0.0, 0.0)), paid((-0.3, 0.0, 0.0))
    assert aside["off_path"] == pytest.approx(WEIGHTS.off_path * 0.09, rel=1e-3)
    assert aside["ahead"] == 0.0
    assert ahead["ahead"] == pytest.approx(-WEIGHTS.ahead * 0.03, rel=0.02)  # 0.3 m at 10 m/s
    assert late["ahead"] == pytest.approx(-ahead["ahead"])
    assert ahead["off_path"] < 1e-3 * aside["off_path"]
    assert paid((0.0, 0.0, 0.0), (0.0, 2.0, 0.0))["velocity"] == pytest.approx(
        4.0 * WEIGHTS.velocity
    )


def test_across_the_path_costs_more_at_a_gate():
    far, near, at = (
        paid((0.0, 0.3, 0.0), row=row)["off_path"] for row in (20, 50 - round(GATE_TIME / DT), 50)
    )
    assert at == pytest.approx((1 + WEIGHTS.at_gates) * far, rel=1e-3)
    assert near == pytest.approx((1 + WEIGHTS.at_gates * np.exp(-0.5)) * far, rel=1e-3)


def test_ground_and_bounds_are_a_crash_and_going_up_from_the_ground_is_none():
    assert paid((0.0, 0.0, -5.0))["crash"] == 0.0  # x is x_next here: not coming down
    assert paid((1000.0, 0.0, 0.0))["crash"] == WEIGHTS.crash


def test_a_plan_begins_at_the_nearest_state_on_the_way_to_the_target():
    reference = straight()
    late = np.array([2.0, 0.1, 2.0, 10.0, 0.0, 0.0])  # where the reference was after 0.2 s
    assert reference.nearest(0, late) == 20
    # one that has passed the first gate is not taken back before it
    assert reference.nearest(1, late) >= 50 - 15
    np.testing.assert_array_equal(reference.controls(0, late, 7), reference.u[20:27])
    assert reference.controls(0, late, 5000).shape == (5000, 4), "longer than the reference"


def test_the_way_goes_on_behind_the_finish():
    reference = straight()
    assert len(reference.x) > ROWS + 500
    np.testing.assert_allclose(np.diff(reference.x[:, 0]), 0.1, atol=1e-9)


def test_a_stored_solution_passes_its_gates_in_the_rows_that_are_noted():
    reference = reference_of(LIMIT, SWIFT, DT)
    assert len(reference.passes) == 21
    for row, gate in zip(reference.passes, COURSE.gates * 3, strict=True):
        ahead = (reference.x[row, :3] - gate.position) @ gate.rotation[:, 0]
        assert abs(ahead) < 0.4, "within the depth of a frame, and one row"


@pytest.mark.compiled
@pytest.mark.parametrize(
    "sampler", ["colored", pytest.param("gaussian", marks=pytest.mark.regression)]
)
def test_a_flight_keeps_to_the_path_and_the_planner_without_it_does_not(sampler):
    def off(**settings):
        spec = Spec.of(COURSE, sampler=sampler, **SMALL, timeout=0.8, **settings)
        # Without snapshots, whose loop would be compiled for this flight alone
        parts = build(spec)
        with closing(parts.plant):
            frames = list(simulate(replace(parts, snapshot=None)))
        path = reference_of(LIMIT, SWIFT, DT).x[:, :3]
        return max(np.linalg.norm(path[:200] - frame.x[:3], axis=1).min() for frame in frames)

    assert off(preset="race_informed") < 0.15
    assert off(preset="race") > 0.35


@pytest.mark.parametrize(
    "changed", [{"laps": 2}, {"vehicle": "kingfisher"}, {"margin": 0.2}, {"course": "paper_flat"}]
)
def test_a_race_without_a_stored_solution_is_refused_with_the_command_that_finds_one(
    changed, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    settings = {"course": "split_s_swift", "preset": "race_informed"} | changed
    with pytest.raises(
        FileError, match=r"race limit \S+ --vehicle \S+ --laps \d --model rates --margin"
    ):
        Spec.of(settings.pop("course"), **settings)


@pytest.mark.parametrize("name", ["displace_gates", "view_weight"])
def test_what_the_reference_does_not_know_is_refused(name):
    with pytest.raises(ValueError, match=name):
        Spec.of("split_s_swift", preset="race_informed", sensing="gates", **{name: 0.1})


def test_the_reserve_is_part_of_which_solution_is_followed():
    with pytest.raises(FileError):
        stored_reference(COURSE, SWIFT, 3, replace(WEIGHTS, reserve=0.05), "runs")
