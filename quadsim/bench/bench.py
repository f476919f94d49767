"""`race bench`: control steps timed, as tables or as JSON. A step is one step of one sample in one
iteration."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict
from typing import Annotated

import numpy as np
from msgspec import Meta
from rich.console import RenderableType
from rich.progress import track
from rich.table import Table

from controllers.lanes.planner_loops import module_source
from controllers.lanes.threads import use_threads
from quadsim.bench.cases import SWEPT, cases, measure, paper_case
from quadsim.bench.envs import envs_table, measure_envs, measure_plants, others
from quadsim.bench.gates import gates_table, measure_gates
from quadsim.bench.machine import measure_machine
from quadsim.bench.stages import stages
from quadsim.cli.flags import Help, Json, Switch
from quadsim.console import emit, emit_json, plain_table, progress_console
from quadsim.spec.spec import Spec

Rows = list[dict]
ROOFLINE = "of the\nroofline"


def bench(
    *,
    seconds: Annotated[float, Meta(gt=0, le=600), Help("for each case [s]")] = 1.0,
    peers: Annotated[bool, Switch("also time pytorch-mppi and JAX (extra: peers)")] = False,
    gates: Annotated[bool, Switch("only flights along 10 and along 200 gates")] = False,
    envs: Annotated[
        bool, Switch("only environments for learning, in lanes and in arrays (extra: rl)")
    ] = False,
    show_code: Annotated[
        bool, Switch("print the loops that are compiled for the default race, and time nothing")
    ] = False,
    json: Json = False,
) -> int:
    """Time whole control steps on this machine, which should do nothing else meanwhile: every
    system at the paper's budget, then sweeps over samples and horizon.

    race bench --peers     the same model through pytorch-mppi and JAX, in the same run

    race bench --gates     does a control step take longer on a course with more gates?

    race bench --envs      steps of learning environments a second, over vehicles and threads

    race bench --show-code the compiled loops as text: model and cost, inlined into a loop over
    samples
    """
    if show_code:
        print(planner_code())
        return 0
    if envs:
        rows, plants = measure_envs(seconds), measure_plants(seconds)
        emit_json({"envs": rows, "plants": plants}) if json else emit(
            envs_table(rows), *others(plants)
        )
        return 0
    if gates:
        rows = measure_gates()
        emit_json({"gates": rows}) if json else emit(gates_table(rows))
        return 0
    from quadsim.bench.peers import compare, require_peers

    if peers:
        require_peers()
    result = _measure(seconds)
    if peers:
        result["peers"] = compare(seconds)
    if json:
        emit_json(result)
    else:
        emit(*tables(result))
    return 0


def planner_code() -> str:
    """Return the text of the loops that are compiled for the default race."""
    spec = Spec.of()
    return module_source(
        spec.entry.system(spec.model, spec.planner.mppi.dt), spec.entry.cost(spec), np.float32
    )


def _measure(seconds: float) -> dict:
    most = use_threads(None)
    machine = measure_machine(most)
    console = progress_console()
    found = track(
        list(cases(most)), "timing, the first time also compiling", console=console, transient=True
    )
    rows = [measure(case, seconds, machine) for case in found]
    use_threads(None)
    parts = [
        row for name in SWEPT for row in stages(paper_case("quadrotor", name), seconds, machine)
    ]
    return {"cases": rows, "stages": parts, "machine": asdict(machine)}


def tables(result: dict) -> Iterator[RenderableType]:
    """Cases, their cost for each step, the stages, the machine, then the peers if they were
    timed."""
    machine = result["machine"]
    for system in dict.fromkeys(row["system"] for row in result["cases"]):
        yield cases_table(system, [row for row in result["cases"] if row["system"] == system])
        yield ""
    yield "ms for a million steps: equal down a column where cost grows linearly"
    yield growth_table(result["cases"], machine["threads"])
    yield ""
    yield stages_table(result["stages"], machine["threads"])
    yield ""
    yield (
        f"{machine['cpu']}, {machine['threads']} threads: {machine['peak_gflops']:.0f} GFLOP/s in a matrix product; "
        f"{machine['chunk_bandwidth_gb']:.0f} GB/s over a chunk, {machine['bandwidth_gb']:.0f} GB/s in memory"
    )
    for row in result.get("peers", ()):
        yield (
            f"{row['name']}: {row['ms_p50']:.1f} ms, {row['ratio']:.1f} times ours ({row['ours_ms']:.2f} ms); "
            f"costs agree to {row['largest_difference']:.1e}"
        )


def cases_table(system: str, rows: Rows) -> Table:
    heads = (
        f"{system}\nM x T x I",
        "\nsampler",
        "\nthreads",
        "p50\n[ms]",
        "p95\n[ms]",
        "\nsteps/s",
        ROOFLINE,
    )
    table = plain_table(*heads, left=(0, 1), no_wrap=True)
    for row in rows:
        times = (f"{row['ms_p50']:.2f}", f"{row['ms_p95']:.2f}", f"{row['steps_per_s']:.2e}")
        table.add_row(
            _size(row),
            row["sampler"],
            str(row["threads"]),
            *times,
            f"{100 * row['roofline']:.0f} %",
        )
    return table


def growth_table(rows: Rows, most: int) -> Table:
    """ms for a million steps by size, on one thread and on all, and the ratio of the two."""
    heads = ("1 thread", f"{most} threads", "ratio") if most > 1 else ("1 thread",)
    columns = [
        f"{sampler if i == 0 else ''}\n{head}" for sampler in SWEPT for i, head in enumerate(heads)
    ]
    table = plain_table("\nM x T x I", *columns, left=(0,), no_wrap=True)
    cost = {(row["name"], row["sampler"], row["threads"]): 1e9 / row["steps_per_s"] for row in rows}
    for name, row in {row["name"]: row for row in sorted(rows, key=_order)}.items():
        cells: list[str] = []
        for sampler in SWEPT:
            one, every = cost.get((name, sampler, 1)), cost.get((name, sampler, most))
            numbers = one, every, one / every if one and every else None
            cells += [f"{x:.2f}" if x else "" for x in numbers[: len(heads)]]
        table.add_row(_size(row) if row["system"] == "quadrotor" else row["system"], *cells)
    return table


def stages_table(rows: Rows, threads: int) -> Table:
    """A block of parts for each sampler."""
    first = f"{rows[0]['name']}\none iteration, {threads} threads"
    heads = (first, "\nsampler", "\nms", "operations\na step", "bytes\na step", ROOFLINE)
    table = plain_table(*heads, left=(0, 1), no_wrap=True)
    for row in rows:
        known = "operations" in row
        counted = (
            (f"{row['operations']:.0f}", f"{row['bytes']:.0f}", f"{100 * row['roofline']:.0f} %")
            if known
            else ()
        )
        table.add_row(row["part"], row["sampler"], f"{row['ms']:.2f}", *counted)
    return table


def _order(row: dict) -> tuple:
    """The quadrotor first, by samples at the paper's horizon, then by horizon at the paper's
    samples."""
    paper = paper_case("quadrotor", "gaussian")
    return (
        row["system"] != "quadrotor",
        row["horizon"] != paper.horizon,
        row["samples"],
        row["horizon"],
    )


def _size(row: dict) -> str:
    return f"{row['samples']} x {row['horizon']} x {row['iterations']}"
