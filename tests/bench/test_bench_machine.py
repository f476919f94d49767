"""What `race bench` compares with: operations counted as it says, a measured machine, peers that
find our costs."""

from itertools import accumulate
from types import SimpleNamespace

import numpy as np
import pytest
from numpy import minimum

from controllers.mppi import MPPI
from controllers.presets import preset
from quadsim.bench import bench, machine, peers
from quadsim.bench.cases import Case, controller, paper_case
from quadsim.bench.machine import (
    Machine,
    Work,
    bandwidth_gb,
    count,
    floor_ns,
    peak_gflops,
    triad,
    work,
)
from quadsim.cli.cli import race
from quadsim.paper import double_integrator

F, TABLE = np.float32, np.zeros(8)
LIBRARY = ("minimum", "maximum", "sqrt", "where")  # the functions that the model and the cost call


def smallest(x, y):
    return minimum(x, y)


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
    # step, cost, sum of its terms, clip(U + n z)
    assert todo["rollouts"] == Work(10 + 10 + 2 + 4 * 2, 2 * 4)
    assert todo["transform"].operations == pytest.approx(2 * 5 * 130 * np.log2(130) / (2 * 130))
    assert todo["normals"].operations == work(mppi, "gaussian")["normals"].operations


def test_roofline_is_the_longer_of_arithmetic_and_traffic():
    given = Machine("any", 2, peak_gflops=100.0, bandwidth_gb=10.0, chunk_bandwidth_gb=20.0)
    assert floor_ns(Work(200.0, 20.0), given) == 2.0
    assert floor_ns(Work(50.0, 20.0), given) == 1.0


@pytest.mark.parametrize(
    ("rate", "work_done"),
    [(lambda: peak_gflops(size=64), 2 * 64**3), (lambda: bandwidth_gb(size=1000), 3 * 4 * 1000)],
)
def test_a_rate_is_the_work_of_one_call_over_the_shortest_of_five(rate, work_done, monkeypatch):
    waits_and_calls = (0.0, 3.0, 9.0, 0.5, 9.0, 4.0, 9.0, 2.0, 9.0, 7.0)  # [s]
    readings = accumulate(waits_and_calls)
    monkeypatch.setattr(machine, "perf_counter", lambda: next(readings))
    assert rate() == pytest.approx(work_done / 0.5 / 1e9)


def test_the_triad_reads_two_arrays_and_writes_one():
    a, b, c = np.zeros(5, F), np.arange(5, dtype=F), np.full(5, 2, F)
    triad(a, b, c)
    np.testing.assert_array_equal(a, b + 6)


def scan(advance, state, rows):
    """jax.lax.scan, written in numpy; like JAX's it expects a state of one type."""
    found = []
    for row in rows:
        ahead, value = advance(state, row)
        assert type(ahead) is type(state)
        state = ahead
        found.append(value)
    return state, np.stack(found)


def test_a_peer_that_finds_other_costs_is_refused():
    mppi, x = controller(Case("quadrotor", "gaussian", 128, 20, 1))
    ours = MPPI(mppi.system, peers.point_cost(), preset("paper", "gaussian").sampling, mppi.config)
    rollout = peers.jax_rollout(SimpleNamespace(numpy=np, lax=SimpleNamespace(scan=scan)), ours)

    def costs(x, v, factor=1.0):
        return factor * rollout(x, v.transpose(1, 2, 0))

    assert peers.largest_difference(ours, costs, x) < 1e-5
    with pytest.raises(ValueError, match="expected equal costs"):
        peers.largest_difference(ours, lambda x, v: costs(x, v, 1.01), x)


def test_a_rebound_function_calls_the_library_and_the_original_still_calls_numpy():
    def of(values):
        return lambda *_: values

    library = SimpleNamespace(__name__="any", **{name: of(name) for name in LIBRARY})
    assert peers.rebind(smallest, peers.array_backend(library))(1.0, 2.0) == "minimum"
    assert smallest(1.0, 2.0) == 1.0


def test_torch_is_given_tensors_where_it_takes_no_plain_numbers():
    torch = SimpleNamespace(
        __name__="torch", as_tensor=lambda x: ("tensor", x), **dict.fromkeys(LIBRARY, max)
    )
    backend = peers.array_backend(torch)
    assert backend["maximum"](1.0, 2.0) == backend["minimum"](1.0, 2.0) == ("tensor", 2.0)
    assert backend["where"] is max


def test_a_peer_that_is_not_installed_is_named_before_anything_is_timed(monkeypatch, capsys):
    monkeypatch.setattr(peers, "find_spec", lambda name: None if name == "jax" else name)
    monkeypatch.setattr(bench, "cases", None)
    assert race(["bench", "--peers"]) == 2
    said = capsys.readouterr().err
    assert said.startswith("race bench: --peers: jax is not installed: ")
    assert said.count("\n") == 1
    assert all(name in said for name in ("-m pip install", "torch==", "pytorch-mppi", "jax"))
    assert "quadsim" not in said.partition("pip install")[2], "no index has this project"
