"""Claims about the sampled trajectories and snapshots of a planner."""

import numpy as np
import pytest

from quadsim.config.build import build
from quadsim.config.spec import Spec
from quadsim.controllers.costs.race import TERMS
from quadsim.controllers.sampled_trajectories import controls, sampled_trajectories, take_snapshot
from quadsim.racing.flight import SNAPSHOT_EVERY, FlightParts, simulate
from tests.small import SMALL


@pytest.fixture
def flight():
    """A flight of few samples over a few frames, closed afterwards."""
    # Nothing is drawn before the first plan, and no model is learned, as `simulate` has none.
    spec = Spec.of(sampler="colored", overshoot=0.0, adapt=False, first_iterations=2, **SMALL)
    parts = build(spec)
    yield spec, parts, parts.controller.planner
    parts.plant.close()


def flown(flight, frames=3):
    _, parts, mppi = flight
    stream = simulate(parts)
    return [next(stream) for _ in range(frames)], mppi


def test_nothing_is_seen_before_the_first_plan(flight):
    assert sampled_trajectories(flight[2]) is None


@pytest.mark.compiled
def test_the_terms_of_the_plan_sum_to_what_the_rollout_says(flight):
    _, mppi = flown(flight)
    last = mppi.last
    J = np.empty((1, 64), np.float32)
    plan = mppi.steps.mean(mppi.plan)
    mppi.rollout(last.x, plan, np.zeros((1, 4, len(plan), 64), np.float32), last.target, J)
    assert sum(sampled_trajectories(mppi).terms.values()) == pytest.approx(float(J[0, 0]), rel=1e-4)


@pytest.mark.compiled
def test_the_terms_have_the_numbers_that_were_set_in_flight(flight):
    _, mppi = flown(flight)
    before = sampled_trajectories(mppi).terms
    name = max(before, key=lambda name: abs(before[name]))
    weight = {term.name: term.weight for term in mppi.cost.terms}[name]
    mppi.set_numbers(name, weight=3.0 * weight)
    after = sampled_trajectories(mppi).terms
    assert after[name] == pytest.approx(3.0 * before[name], rel=1e-5)
    assert {n: v for n, v in after.items() if n != name} == pytest.approx(
        {n: v for n, v in before.items() if n != name}
    )


@pytest.mark.compiled
def test_samples_are_ranked_and_begin_where_the_vehicle_is(flight):
    frames, mppi = flown(flight)
    seen = sampled_trajectories(mppi)
    assert seen.costs.tolist() == np.sort(mppi.last.J)[:63].tolist()
    assert np.allclose(seen.paths[:, 0], frames[-1].x[:3], atol=0.2)  # one step on
    assert not np.allclose(seen.paths[:, -1], seen.paths[0, -1], atol=0.05)


@pytest.mark.compiled
def test_a_cheapest_sample_flown_again_costs_what_it_cost(flight):
    """The shown paths are flown by the sampled controls themselves."""
    _, mppi = flown(flight)
    last = mppi.last
    best = np.argsort(last.J)[:5]
    found = mppi.rollout.trajectories(last.x, controls(mppi, last, best), last.target)
    np.testing.assert_allclose(found.J, last.J[best], rtol=1e-3)


@pytest.mark.compiled
def test_samples_of_an_earlier_iteration_are_drawn_again(flight):
    _, parts, mppi = flight
    stream = simulate(parts)
    next(stream)
    earlier = mppi.last
    some = np.array([0, 63, 64, 127])
    at_once = controls(mppi, earlier, some)
    next(stream)
    later = controls(mppi, mppi.last, some)
    assert np.array_equal(controls(mppi, earlier, some), at_once)
    assert np.array_equal(controls(mppi, mppi.last, some), later)
    assert not np.array_equal(at_once, later)


@pytest.mark.compiled
def test_looking_changes_nothing(flight):
    _, mppi = flown(flight)
    plan, temperature = mppi.plan.copy(), mppi.temperature
    sampled_trajectories(mppi)
    assert np.array_equal(plan, mppi.plan)
    assert temperature == mppi.temperature


@pytest.mark.compiled
def test_a_flight_with_snapshots_is_the_flight_without(flight):
    spec, parts, _ = flight
    seen = flown(flight, 12)[0]
    parts.plant.close()
    again = build(spec)
    blind = simulate(FlightParts(again.plant, again.controller, again.referee, again.period))
    for a, b in zip(seen, (next(blind) for _ in range(12)), strict=True):
        assert (a.x, a.u, a.cost) == (b.x, b.u, b.cost)


@pytest.mark.compiled
def test_a_snapshot_is_kept_now_and_then(flight):
    frames, _ = flown(flight, 2 * SNAPSHOT_EVERY + 1)
    kept = [k for k, frame in enumerate(frames) if frame.snapshot is not None]
    assert kept == [0, SNAPSHOT_EVERY, 2 * SNAPSHOT_EVERY]
    assert frames[0].snapshot.best.shape == (8, 16, 3)
    assert list(frames[0].snapshot.terms) == [*TERMS, "time_to_go"]


@pytest.mark.compiled
def test_a_snapshot_is_the_sampled_trajectories_and_the_terms_of_the_plan(flight):
    _, mppi = flown(flight)
    seen = take_snapshot(mppi)
    assert np.allclose(seen.best, sampled_trajectories(mppi, 8, 16).paths, atol=0.006)
    assert seen.terms == sampled_trajectories(mppi).terms


def test_there_is_no_snapshot_before_the_first_plan(flight):
    assert take_snapshot(flight[2]) is None
