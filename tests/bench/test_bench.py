"""`race bench`: every case runs, and each part has the time of its own calls. No test depends on
how long they take."""

import io
import json
from dataclasses import replace

import pytest
from rich.console import Console

from controllers import mppi as algorithm
from controllers.lanes import layout
from controllers.samplers import SAMPLERS
from quadsim.bench import bench, stages
from quadsim.bench import cases as bench_cases
from quadsim.bench.cases import (
    HORIZONS,
    SAMPLES,
    TIMED,
    Case,
    cases,
    controller,
    measure,
    paper_case,
)
from quadsim.bench.envs import measure_plants, others
from quadsim.bench.gates import gates_table, measure_gates
from quadsim.bench.machine import Machine
from quadsim.cli.cli import race
from quadsim.physics.plant import PLANTS

MACHINE = Machine("any", 2, 100.0, 10.0, 20.0)
SHORT = 1e-3  # [s]
CASE_KEYS = {
    "name",
    "sampler",
    "samples",
    "horizon",
    "iterations",
    "threads",
    "ms_p50",
    "ms_p95",
    "steps_per_s",
}
PARTS = {
    "gaussian": ["normals", "rollouts", "weights", "weighted mean", "rest", "whole"],
    "colored": ["normals", "transform", "rollouts", "weights", "weighted mean", "rest", "whole"],
}


def small(system, sampler, samples=128, iterations=1):
    return Case(system, sampler, samples, 20, iterations)


@pytest.mark.parametrize("system", TIMED)
@pytest.mark.parametrize("sampler", SAMPLERS)
def test_every_system_is_timed_with_every_sampler(system, sampler):
    row = measure(small(system, sampler), SHORT, MACHINE)
    assert row.keys() >= CASE_KEYS
    assert (row["name"], row["sampler"]) == (f"{system} 128 x 20 x 1", sampler)
    assert 0 < row["ms_p50"] <= row["ms_p95"]
    assert row["steps_per_s"] == pytest.approx(1e3 * 128 * 20 / row["ms_p50"])
    assert row["roofline"] > 0


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


@pytest.mark.parametrize("sampler", PARTS)
def test_stages_are_named_and_every_function_is_put_back(sampler):
    before = algorithm.softmax_weights, algorithm.weights, algorithm.weighted_mean
    rows = list(stages.stages(small("quadrotor", sampler), SHORT, MACHINE))
    assert [row["part"] for row in rows] == PARTS[sampler]
    assert {row["part"] for row in rows if "roofline" in row} == {*PARTS[sampler]} - {
        "weights",
        "rest",
        "whole",
    }
    assert (algorithm.softmax_weights, algorithm.weights, algorithm.weighted_mean) == before


@pytest.mark.parametrize(("samples", "chunks"), [(1100, 3), (512, 1)])
@pytest.mark.parametrize("sampler", PARTS)
def test_each_part_has_the_time_of_its_calls_in_one_iteration_and_rest_what_remains(
    sampler, samples, chunks, monkeypatch
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
    mppi, x = controller(small("double_integrator", sampler, samples, iterations=2))
    mppi.sampler = replace(mppi.sampler, sample=lasting(40.0, mppi.sampler.sample))
    mppi.rollout = lasting(3.0, mppi.rollout)
    for name, ms in {
        "softmax_weights": 1.0,
        "weights": 7.0,
        "weighted_mean": 2.0,
        "adapt_temperature": 11.0,
    }.items():
        monkeypatch.setattr(algorithm, name, lasting(ms, getattr(algorithm, name)))
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
    found = stages.parts_ms(mppi, x, sampler, SHORT)
    assert found == pytest.approx(parts | {"whole": sum(parts.values())})
    assert list(found) == PARTS[sampler]


def test_normals_of_colored_noise_are_as_many_as_its_numbers(monkeypatch):
    monkeypatch.setattr(layout, "CHUNK", 512)
    filled = []
    monkeypatch.setattr(stages, "fill_normals", lambda out, *_: filled.append(out.size))
    mppi, _ = controller(small("quadrotor", "colored", samples=1024))
    stages.normals_ms(mppi, SHORT)
    assert set(filled) == {512 * 20 * 4}
    assert len(filled) % 2 == 0


def cells(table, row):
    return [list(column.cells)[row] for column in table.columns]


def test_growth_is_ms_for_a_million_steps_and_all_threads_beside_one():
    def row(threads, ms, samples=4096):
        case = replace(paper_case("quadrotor", "gaussian"), samples=samples, threads=threads)
        name = f"quadrotor {case.size}"
        return {**vars(case), "name": name, "ms_p50": ms, "steps_per_s": 1e3 * case.steps / ms}

    table = bench.growth_table([row(1, 8.0), row(2, 4.0), row(1, 0.5, 256), row(2, 0.4, 256)], 2)
    assert cells(table, 0) == ["256 x 150 x 2", "6.51", "5.21", "1.25", "", "", ""]
    assert cells(table, 1) == ["4096 x 150 x 2", "6.51", "3.26", "2.00", "", "", ""]


@pytest.fixture
def quick(monkeypatch):
    """Small cases, and a machine with given rates instead of measured ones."""
    few = [replace(small(system, "gaussian"), threads=1) for system in TIMED]
    monkeypatch.setattr(bench, "cases", lambda most: few)
    monkeypatch.setattr(bench, "paper_case", small)
    monkeypatch.setattr(bench, "measure_machine", lambda threads: MACHINE)


def test_json_holds_cases_stages_and_machine(quick, capsys):
    assert race(["bench", "--json", "--seconds", "0.001"]) == 0
    result = json.loads(capsys.readouterr().out)
    assert [row["system"] for row in result["cases"]] == list(TIMED)
    assert all(row.keys() >= CASE_KEYS and row["threads"] == 1 for row in result["cases"])
    for sampler, parts in PARTS.items():
        assert [row["part"] for row in result["stages"] if row["sampler"] == sampler] == parts
    assert result["machine"] == {
        "cpu": "any",
        "threads": 2,
        "peak_gflops": 100.0,
        "bandwidth_gb": 10.0,
        "chunk_bandwidth_gb": 20.0,
    }


def test_tables_fit_a_terminal_and_name_every_system_and_part(quick, capsys):
    assert race(["bench", "--seconds", "0.001"]) == 0
    out = capsys.readouterr().out
    assert all(name in out for name in (*TIMED, *PARTS["colored"], "100 GFLOP/s", "1 thread"))
    assert max(map(len, out.splitlines()[:-2])) <= 80


@pytest.mark.parametrize("seconds", ["0", "nan", "x"])
def test_no_time_to_measure_is_one_line(seconds, capsys):
    assert race(["bench", "--seconds", seconds]) == 2
    assert capsys.readouterr().err.startswith("race bench: --seconds: expected a number")


def test_flights_along_few_and_many_gates_are_timed_step_by_step_in_turn():
    few, many = measure_gates(flown=0.05, samples=64, horizon=20, iterations=1, threads=1)
    assert (few["gates"], many["gates"]) == (10, 200)
    for row in (few, many):
        assert row["flown"] == pytest.approx(0.05)
        assert 0 < row["plan_ms_least"] <= row["plan_ms"]
        assert 0 < row["rest_ms"] < 1e3 * row["wall_per_s"] * 0.01  # of a control step of 0.01 s
    shown = Console(width=80, file=io.StringIO())
    shown.print(gates_table([few, many]))
    assert "(1.000)" in shown.file.getvalue()


def test_other_simulators_are_timed_beside_the_environments():
    plants = measure_plants(0.05)
    assert {"rigid"} <= plants.keys() <= PLANTS.keys()
    lines = others(plants)
    assert all(any(f": {name}: " in line for line in lines) for name in plants)
    assert sum("published, not measured here" in line for line in lines) == 2
