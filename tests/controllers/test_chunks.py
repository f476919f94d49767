"""Many samples are drawn and rolled out chunk by chunk: the plan is the one of all of them at
once."""

from dataclasses import replace

import numpy as np
import pytest
from point import START, White, make, naive_cost

from quadsim.controllers.lanes import layout
from quadsim.controllers.sampled_trajectories import controls
from quadsim.controllers.samplers import SAMPLERS


@pytest.mark.compiled
@pytest.mark.parametrize("sampler", SAMPLERS)
def test_samples_in_chunks_are_the_samples_at_once(sampler, monkeypatch):
    """The same costs, the same plan but for rounding, and the last samples perturb the rest control
    in both."""
    whole = make(sampler=sampler, samples=1100)
    stats = whole.iterate(START, 0)
    monkeypatch.setattr(layout, "CHUNK", 512)
    chunked = make(sampler=sampler, samples=1100)
    assert chunked.sampler.sample(1).shape[0] < whole.sampler.sample(1).shape[0]
    assert chunked.iterate(START, 0) == stats
    np.testing.assert_array_equal(chunked.last.J, whole.last.J)
    np.testing.assert_allclose(chunked.plan, whole.plan, atol=1e-6)


@pytest.mark.compiled
def test_a_chunk_whose_rollouts_all_overflow_weighs_nothing(monkeypatch):
    monkeypatch.setattr(layout, "CHUNK", 256)
    mppi = make(samples=512)
    rollout, chunk = mppi.rollout, []

    def second_overflows(x, U, z, target, J):
        rollout(x, U, z, target, J)
        chunk.append(J)
        J[:] = np.inf if len(chunk) == 2 else J

    mppi.rollout = second_overflows
    before = mppi.plan.copy()
    mppi.iterate(START, 0)
    half = make(samples=256)
    half.config = replace(half.config, rest_fraction=0.0)
    half.iterate(START, 0)
    assert abs(mppi.plan - before).max() > 0.01
    np.testing.assert_allclose(mppi.plan, half.plan, atol=1e-6)


@pytest.mark.compiled
def test_samplers_of_ones_own_are_drawn_again_chunk_by_chunk(monkeypatch):
    """The samples that are shown are those that were flown, in every chunk."""
    monkeypatch.setattr(layout, "CHUNK", 256)
    mppi = make(sampler=White((0.8, 0.5)), samples=700)
    mppi.iterate(START, 0)
    some = np.array([0, 1, 255, 256, 600, 699])
    v = controls(mppi, mppi.last, some)
    np.testing.assert_allclose(mppi.last.J[some], [naive_cost(u.T) for u in v], rtol=1e-4)
    assert len({u.tobytes() for u in v}) == len(some)
    assert mppi.is_cached, "it has no loop that would have to be compiled"
