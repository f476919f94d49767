"""What `race bench` compares with: work counted as it says, a measured machine, peers that find our costs."""

import numpy as np
import pytest

from controllers.mppi import MPPI
from controllers.presets import preset
from quadsim.app.bench import bench, peers
from quadsim.app.bench.cases import Case, controller, paper_case
from quadsim.app.bench.point_cost import point_cost
from quadsim.app.bench.roofline import bandwidth_gb, peak_gflops
from quadsim.app.bench.work import Machine, Work, count, floor_ns, work
from quadsim.app.cli import race
from quadsim.systems import double_integrator

F, TABLE = np.float32, np.zeros(8)


def helper(x):
    return F(0.5) * x + TABLE[2 * 3 + 1]


def counted(x, y):
    for _ in range(10):
        x = helper(x) * F(1 / 3)
    return helper(-x) if x < y else np.sqrt(y)


def test_operations_are_counted_with_loops_and_calls_but_without_casts_constants_and_indices():
    assert count(helper) == 2
    assert count(counted) == 10 * 3 + 2 + 2
    assert count(double_integrator.step) == 2 + 2 + 3 + 3


def test_work_of_the_double_integrator_is_that_of_its_formulas():
    mppi, _ = controller(paper_case("double_integrator", "colored"))
    todo = work(mppi, "colored")
    assert todo["rollouts"] == Work(10 + 10 + 2 + 3 * 2, 2 * 4)  # step, cost, sum of its terms, clip(U + z)
    assert todo["transform"].operations == pytest.approx(2 * 5 * 130 * np.log2(130) / (2 * 130))
    assert todo["normals"].operations == work(mppi, "gaussian")["normals"].operations


def test_roofline_is_the_longer_of_arithmetic_and_traffic():
    machine = Machine("any", 2, peak_gflops=100.0, bandwidth_gb=10.0, chunk_bandwidth_gb=20.0)
    assert floor_ns(Work(200.0, 20.0), machine) == 2.0
    assert floor_ns(Work(50.0, 20.0), machine) == 1.0


def test_a_machine_is_measured():
    assert peak_gflops(size=64) > 0
    assert bandwidth_gb(size=1000) > 0


def test_a_peer_that_finds_other_costs_is_refused():
    mppi, x = controller(Case("quadrotor", "gaussian", 128, 20, 1))
    ours = MPPI(mppi.system, point_cost(), preset("paper", "gaussian").sampling, mppi.config)

    def costs(x, v, factor=1.0):
        state, total = tuple(np.full(len(v), value) for value in x), 0.0
        for u in v.transpose(1, 2, 0):
            state = ours.system.step(state, tuple(u), ours.system.params, ours.system.dt)
            total = total + sum(ours.cost.terms(None, state, u, (), 0.0, ours.cost.params)[:5])
        return factor * total / v.shape[1]

    assert peers.largest_difference(ours, costs, x) < 1e-5
    with pytest.raises(ValueError, match="expected equal costs"):
        peers.largest_difference(ours, lambda x, v: costs(x, v, 1.01), x)


def test_a_peer_that_is_not_installed_is_named_before_anything_is_timed(monkeypatch, capsys):
    monkeypatch.setattr(peers, "find_spec", lambda name: None if name == "jax" else name)
    monkeypatch.setattr(bench, "cases", None)
    assert race(["bench", "--peers"]) == 2
    assert capsys.readouterr().err == "race bench: --peers: jax is not installed: pip install 'quadsim[peers]'\n"
