"""Claims about the solutions of the exercises; docs/exercises.md tells how they fly."""

import runpy
import sys
from pathlib import Path

import numpy as np
import pytest

import quadsim

FOLDER = Path(__file__).parents[1] / "examples" / "exercises"


@pytest.fixture(scope="module")
def solutions():
    sys.path.insert(0, str(FOLDER))
    try:
        return runpy.run_path(str(FOLDER / "solutions.py"))
    finally:
        sys.path.remove(str(FOLDER))
        sys.modules.pop("racer", None)


@pytest.fixture(scope="module")
def spec():
    return quadsim.Spec.of("figure8", laps=1)


def test_weights_are_a_softmax_at_any_size_of_the_costs(solutions, spec):
    racer = solutions["First"](spec)
    costs = np.array([1e6, 1e6 + 1.0, 1e6 + 2.0])
    w = racer.weights(costs, 0.5)
    assert w.sum() == pytest.approx(1.0)
    assert w[1] / w[0] == pytest.approx(np.exp(-2.0))


def test_the_second_noise_has_low_frequencies_and_the_first_has_all(solutions, spec):
    shape = (400, 24, 4)

    def share_of_low(name):
        noise = solutions[name](spec).noise(np.random.default_rng(0), shape)
        assert noise.shape == shape
        assert noise.std() == pytest.approx(1.0, abs=0.02)
        power = (np.abs(np.fft.rfft(noise, axis=1)) ** 2).mean(axis=(0, 2))
        return power[:4].sum() / power.sum()

    assert share_of_low("Second") > 0.8
    assert share_of_low("First") < 0.4


def test_a_sample_that_passes_a_gate_outside_of_its_opening_has_crashed(solutions, spec):
    racer = solutions["First"](spec)
    centre, along = racer.centres[0], racer.along[0]
    left = np.array((-along[1], along[0], 0.0))
    behind = np.array([centre - along, centre - along + 0.7 * left, centre - along + 9.0 * left])
    gate, crashed = racer._through_gates(np.zeros(3, int), behind, behind + 2.0 * along)
    assert gate.tolist() == [1, 0, 0]
    assert crashed.tolist() == [False, True, False]


@pytest.mark.slow
@pytest.mark.parametrize("name", ["First", "Third"])
def test_a_solution_flies_towards_the_first_gate(solutions, name):
    run = quadsim.fly("figure8", controller=solutions[name], laps=1, timeout=0.8)
    moved = run.telemetry["px"][-1] - run.telemetry["px"][0]
    assert run.outcome == "timeout"
    assert moved > 0.5
