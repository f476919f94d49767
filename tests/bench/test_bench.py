"""`race bench`: every case runs, each part has the time of its calls, peers find our costs.

No test depends on how long anything takes.
"""

import io
import json
from dataclasses import replace
from functools import partial
from types import SimpleNamespace

import numpy as np
import pytest
from numpy import minimum
from oracle import fly_rows
from rich.console import Console

from quadsim.bench import cases as bench_cases
from quadsim.bench import peers, stages
from quadsim.bench.cases import (
    HORIZONS,
    SAMPLES,
    TIMED,
    Case,
    CaseTime,
    cases,
    paper_case,
    starting,
)
from quadsim.bench.envs import (
    RacesSpeed,
    array_steps,
    lane_steps,
    measure_plants,
    race_array_steps,
    race_lane_steps,
    shortest,
)
from quadsim.bench.gates import measure_gates
from quadsim.bench.tables import (
    case_tables,
    gates_table,
    growth_table,
    other_simulators,
    races_table,
)
from quadsim.cli import bench
from quadsim.cli.cli import race
from quadsim.controllers import mppi as algorithm
from quadsim.controllers.lanes import layout
from quadsim.controllers.lanes.layout import from_lanes
from quadsim.controllers.mppi import MPPI
from quadsim.controllers.presets import preset
from quadsim.controllers.samplers import SAMPLERS
from quadsim.learn.races import Races
from quadsim.learn.vector_env import RacingVectorEnv
from quadsim.physics.plant import PLANTS
from tests.small import SMALL

MOMENT = 1e-3  # [s]
PARTS = {
    "gaussian": ["normals", "rollouts", "weights", "weighted mean", "rest", "whole"],
    "colored": ["normals", "transform", "rollouts", "weights", "weighted mean", "rest", "whole"],
}


def small(system, sampler, samples=SMALL["samples"], iterations=1):
    return Case(system, sampler, samples, SMALL["horizon"], iterations)


def test_cases_are_the_papers_budgets_and_the_sweeps_each_once_on_one_thread_and_on_all():
    found = list(cases(2))
    assert len(set(found)) == len(found)
    assert {case.threads for case in found} == {1, 2}
    assert {replace(c, threads=3 - c.threads) for c in found} == set(found)
    assert {case.threads for case in cases(1)} == {1}
    ours = [c for c in found if c.system == "quadrotor"]
    assert {c.sampler for c in ours if c.size == "4096 x 150 x 2"} == set(SAMPLERS)
    assert {c.samples for c in ours if c.horizon == 150} == set(SAMPLES)
    assert {c.horizon for c in ours if c.samples == 4096} == set(HORIZONS)
    assert {c.size for c in found if c.system == "double_integrator"} == {"4096 x 65 x 1"}
    assert {c.size for c in found if c.system == "offroad"} == {"6144 x 250 x 3"}
    assert {c.size for c in found if c.system == "racer"} == {"1024 x 100 x 2"}


@pytest.mark.compiled
@pytest.mark.parametrize("sampler", PARTS)
def test_each_part_has_the_time_of_its_calls_in_one_iteration_and_rest_what_remains(
    sampler, monkeypatch
):
    """By a clock that stands still except in these functions."""
    clock = [0.0]

    def lasting(ms, call):
        def call_and_wait(*arguments):
            clock[0] += 1e-3 * ms
            return call(*arguments)

        return call_and_wait

    for module in (stages, bench_cases):
        monkeypatch.setattr(module, "perf_counter", lambda: clock[0])
    monkeypatch.setattr(layout, "CHUNK", 512)
    chunks = 3
    start = starting(small("double_integrator", sampler, samples=1100, iterations=2))
    mppi = start.mppi
    mppi.sampler = replace(mppi.sampler, sample=lasting(40.0, mppi.sampler.sample))
    mppi.rollout = lasting(3.0, mppi.rollout)
    for name, ms in {
        "softmax_weights": 1.0,
        "weights": 7.0,
        "weighted_mean": 2.0,
    }.items():
        monkeypatch.setattr(algorithm, name, lasting(ms, getattr(algorithm, name)))
    monkeypatch.setattr(layout, "mean_of_chunks", lasting(11.0, layout.mean_of_chunks))
    monkeypatch.setattr(stages, "fill_normals", lasting(30.0, stages.fill_normals))

    noise = (
        {"normals": 40.0 * chunks}
        if sampler == "gaussian"
        else {"normals": 30.0 * chunks, "transform": 10.0 * chunks}
    )
    parts = noise | {
        "rollouts": 3.0 * chunks,
        "weights": 1.0 * chunks + 7.0,
        "weighted mean": 2.0 * chunks,
        "rest": 11.0,
    }
    found = stages.parts_ms(start, sampler, MOMENT)
    assert found == pytest.approx(parts | {"whole": sum(parts.values())})
    assert list(found) == PARTS[sampler]


@pytest.mark.compiled
def test_normals_of_colored_noise_are_as_many_as_its_numbers(monkeypatch):
    monkeypatch.setattr(layout, "CHUNK", 512)
    filled = []
    monkeypatch.setattr(stages, "fill_normals", lambda out, *_: filled.append(out.size))
    start = starting(small("quadrotor", "colored", samples=1024))
    stages.normals_ms(start.mppi, MOMENT)
    assert set(filled) == {512 * SMALL["horizon"] * 4}
    assert len(filled) % 2 == 0


def cells(table, row):
    return [list(column.cells)[row] for column in table.columns]


def timed(case, threads, ms):
    return CaseTime.of(case, threads, ms_p50=ms, ms_p95=ms, operations=300, peak=60e9)


def test_growth_is_ms_for_a_million_steps_and_all_threads_beside_one():
    paper = paper_case("quadrotor", "gaussian")
    fewer = replace(paper, samples=256)
    rows = [timed(paper, 1, 8.0), timed(paper, 2, 4.0), timed(fewer, 1, 0.5), timed(fewer, 2, 0.4)]
    table = growth_table(rows, 2)
    assert cells(table, 0) == ["256 x 150 x 2", "6.51", "5.21", "1.25", "", "", ""]
    assert cells(table, 1) == ["4096 x 150 x 2", "6.51", "3.26", "2.00", "", "", ""]


def test_share_of_the_peak_is_the_arithmetic_over_what_the_threads_can_do():
    case = paper_case("quadrotor", "gaussian")
    of_peak = 4096 * 150 * 2 * 300 / 8e-3 / 60e9
    assert timed(case, 1, 8.0).of_peak == pytest.approx(of_peak)
    assert timed(case, 2, 8.0).of_peak == pytest.approx(of_peak / 2)


def test_tables_of_every_case_fit_a_terminal():
    console = Console(width=200, file=io.StringIO())
    for part in case_tables([timed(case, case.threads, 8.0) for case in cases(2)], 2):
        console.print(part)
    shown = console.file.getvalue()
    assert all(f"{system}" in shown for system in TIMED)
    assert max(len(line.rstrip()) for line in shown.splitlines()) <= 80


@pytest.fixture
def quick(monkeypatch):
    """Small cases, by the cost of the preset `race`, which other tests compile as well."""
    assert bench_cases.PRESETS["quadrotor"] == "paper"
    monkeypatch.setitem(bench_cases.PRESETS, "quadrotor", "race")
    few = [replace(small(system, "gaussian"), threads=1) for system in TIMED]
    monkeypatch.setattr(bench, "cases", lambda most: few)
    monkeypatch.setattr(bench, "paper_case", small)


def parts_of_the_planner():
    """Return the functions that are timed by others in their place."""
    return algorithm.softmax_weights, algorithm.weights, algorithm.weighted_mean


@pytest.mark.compiled
def test_json_holds_cases_stages_and_machine(quick, capsys):
    before = parts_of_the_planner()
    assert race(["bench", "--json", "--seconds", "0.001"]) == 0
    assert parts_of_the_planner() == before, "every function is put back"
    result = json.loads(capsys.readouterr().out)
    assert [row["system"] for row in result["cases"]] == list(TIMED)
    for row in result["cases"]:
        assert row.keys() == set(CaseTime._fields)
        assert row["name"] == f"{row['system']} 128 x 40 x 1"
        assert 0 < row["ms_p50"] <= row["ms_p95"]
        assert row["steps_per_s"] == pytest.approx(1e3 * 128 * 40 / row["ms_p50"])
        assert row["threads"] == 1
        assert 0.0 < row["of_peak"] < 1.0, "no loop does more than the loop of the peak"
    for sampler, parts in PARTS.items():
        assert [row["part"] for row in result["stages"] if row["sampler"] == sampler] == parts
    assert result["machine"].keys() == {"cpu", "threads", "peak_operations_per_s"}


@pytest.mark.compiled
def test_tables_name_every_system_and_part(quick, capsys):
    assert race(["bench", "--seconds", "0.001"]) == 0
    out = capsys.readouterr().out
    assert all(name in out for name in (*TIMED, *PARTS["colored"], "1 thread"))


def test_the_compiled_loop_is_shown_with_the_names_of_its_source(capsys):
    assert race(["bench", "--show-code"]) == 0
    out = capsys.readouterr().out
    assert "thrust" in out
    compile(out, "loop", "exec")


def test_no_time_to_measure_is_one_line(capsys):
    for seconds in ("0", "nan", "x"):
        assert race(["bench", "--seconds", seconds]) == 2
        assert capsys.readouterr().err.startswith("race bench: --seconds: ")


@pytest.mark.compiled
def test_flights_along_few_and_many_gates_are_timed_step_by_step_in_turn():
    few, many = measure_gates(flown=0.05, threads=1, **SMALL)
    assert (few.gates, many.gates) == (10, 200)
    for row in (few, many):
        assert row.flown == pytest.approx(0.05)
        assert 0 < row.plan_ms_least <= row.plan_ms
        assert 0 < row.rest_ms < 1e3 * row.wall_per_s * 0.01  # of a control step of 0.01 s
    shown = Console(width=80, file=io.StringIO())
    shown.print(gates_table([few, many]))
    assert "(1.000)" in shown.file.getvalue()


@pytest.mark.compiled
def test_environments_are_stepped_in_lanes_and_in_arrays():
    envs = RacingVectorEnv(64, start="anywhere", autoreset_mode="SameStep")
    envs.reset(seed=0)
    best = shortest({"lanes": lane_steps(64), "arrays": array_steps(envs)}, MOMENT)
    assert 0 < best["lanes"] < np.inf
    assert 0 < best["arrays"] < np.inf


@pytest.mark.compiled
def test_races_are_stepped_in_lanes_and_in_arrays():
    races = Races(64, racers=3, start="anywhere")
    races.reset(seed=0)
    functions = {"lanes": race_lane_steps(races), "arrays": race_array_steps(races)}
    best = shortest(functions, MOMENT)
    assert 0 < best["lanes"] < np.inf
    assert 0 < best["arrays"] < np.inf
    row = RacesSpeed(64, 3, 1, lanes=5.04e6, arrays=1.06e6)
    cells = [list(column.cells) for column in races_table([row]).columns]
    assert cells == [["64"], ["3"], ["1"], ["5.0"], ["1.1"]]


def test_other_simulators_are_timed_beside_the_environments():
    plants = measure_plants(0.05)
    assert {"rigid"} <= plants.keys() <= PLANTS.keys()
    lines = list(other_simulators(plants))
    assert all(any(f": {name}: " in line for line in lines) for name in plants)
    assert sum("published, not measured here" in line for line in lines) == 2


LIBRARY = ("minimum", "maximum", "sqrt", "where")  # functions that the model and the cost call


def smallest(x, y):
    return minimum(x, y)


def scan(advance, state, rows):
    """Stand for jax.lax.scan; like JAX's it expects a state of one type."""
    found = []
    for row in rows:
        ahead, value = advance(state, row)
        assert type(ahead) is type(state)
        state = ahead
        found.append(value)
    return state, np.stack(found)


class RolloutByOracle:
    """Fills in costs as the compiled loops do, which nothing else compiles for this cost."""

    def __init__(self, system, cost):
        self._fly = partial(fly_rows, system, cost)

    def __call__(self, x, plan, z, target, J):
        samples = from_lanes(z, J.size, len(plan))
        J.ravel()[:] = self._fly(x, plan, samples, target).J


# The samples come from compiled code.
@pytest.mark.compiled
def test_a_peer_that_finds_other_costs_is_refused(monkeypatch):
    monkeypatch.setattr(peers, "Rollout", RolloutByOracle)
    mppi, x = starting(small("quadrotor", "gaussian"))
    ours = MPPI(mppi.system, peers.point_cost(), preset("paper", "gaussian").sampling, mppi.config)
    rollout = peers.jax_rollout(SimpleNamespace(numpy=np, lax=SimpleNamespace(scan=scan)), ours)

    def costs(x, v, factor=1.0):
        return factor * rollout(x, v.transpose(1, 2, 0))

    assert peers.largest_difference(ours, costs, x) < 1e-5
    with pytest.raises(ValueError, match="equal costs"):
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
    err = capsys.readouterr().err
    assert err.startswith("race bench: --peers: jax ")
    assert err.count("\n") == 1
    assert all(name in err for name in ("-m pip install", "torch==", "pytorch-mppi", "jax"))
    assert "quadsim" not in err.partition("pip install")[2], "no index has this project"
