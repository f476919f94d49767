"""`race bench`: control steps timed, as tables or as JSON.

A step is one step of one sample in one iteration.
"""

from __future__ import annotations

from typing import Annotated

import numpy as np
from msgspec import Meta
from rich.progress import track

from quadsim.bench.cases import QUADROTOR, SWEPT, cases, measure, paper_case
from quadsim.bench.envs import measure_envs, measure_plants, measure_races
from quadsim.bench.gates import measure_gates
from quadsim.bench.heats import measure_heats
from quadsim.bench.peers import compare, require_peers
from quadsim.bench.stages import stages
from quadsim.bench.tables import (
    case_tables,
    envs_table,
    gates_table,
    heat_table,
    other_simulators,
    others_table,
    peer_lines,
    races_table,
    stages_table,
    worlds_table,
)
from quadsim.cli.flags import Help, Json, Switch
from quadsim.config.build_cost import cost_on
from quadsim.config.build_plant import system_of
from quadsim.config.spec import Spec
from quadsim.console import emit, emit_json, progress_console
from quadsim.controllers.lanes.peak import peak_operations
from quadsim.controllers.lanes.planner_loops import module_source
from quadsim.controllers.lanes.threads import use_threads
from quadsim.record.provenance import cpu_name


def bench(
    *,
    seconds: Annotated[float, Meta(gt=0, le=600), Help("time for each case [s]")] = 1.0,
    peers: Annotated[bool, Switch("also time pytorch-mppi and JAX (extra: peers)")] = False,
    gates: Annotated[bool, Switch("only flights along 10 and along 200 gates")] = False,
    envs: Annotated[
        bool, Switch("only environments for learning, in lanes and in arrays (extra: rl)")
    ] = False,
    heats: Annotated[
        bool,
        Switch("only races of several: control steps beside others, the world, whole races"),
    ] = False,
    show_code: Annotated[
        bool, Switch("print the loops that are compiled for the default race, and time nothing")
    ] = False,
    json: Json = False,
) -> int:
    """Time whole control steps on this machine, which should be otherwise idle.

    Every system is timed at the paper's budget and the racer at its own, then the quadrotor with
    other samples and horizons. The last column is the arithmetic of model and cost, over the most
    that a loop of multiplications and additions did on one thread in the same run.

    race bench --peers     the same model through pytorch-mppi and JAX, in the same run

    race bench --gates     does a control step take longer on a course with more gates?

    race bench --envs      steps per second of learning environments and races of several vehicles

    race bench --heats     a control step beside 1, 3 and 7 other vehicles, and whole races

    race bench --show-code the compiled loops as text: model and cost, inlined into a loop over
    samples
    """
    if show_code:
        print(planner_code())
    elif envs:
        _bench_envs(seconds, json)
    elif gates:
        _bench_gates(json)
    elif heats:
        _bench_heats(seconds, json)
    else:
        _bench_planner(seconds, peers, json)
    return 0


def planner_code() -> str:
    """Return the source text of the compiled loops for the default race."""
    spec = Spec.of()
    return module_source(system_of(spec), cost_on(spec, spec.course), np.float32)


def _bench_planner(seconds: float, peers: bool, json: bool) -> None:
    """Time control steps and their parts, and the other libraries if requested."""
    if peers:
        require_peers()
    most = use_threads(None)
    every = track(
        list(cases(most)),
        "timing, the first time also compiling",
        console=progress_console(),
        transient=True,
    )
    peak = peak_operations()
    times = [measure(case, seconds, peak) for case in every]
    use_threads(None)
    parts = [part for sampler in SWEPT for part in stages(paper_case(QUADROTOR, sampler), seconds)]
    others = compare(seconds) if peers else []
    if json:
        result = {
            "cases": [row._asdict() for row in times],
            "stages": [row._asdict() for row in parts],
            "machine": {"cpu": cpu_name(), "threads": most, "peak_operations_per_s": peak},
        }
        if peers:
            result["peers"] = [row._asdict() for row in others]
        emit_json(result)
        return
    emit(
        *case_tables(times, most),
        "",
        stages_table(parts, most),
        "",
        f"{cpu_name()}, {most} threads, peak of one thread {1e-9 * peak:.1f} GFLOP/s",
        *peer_lines(others),
    )


def _bench_gates(json: bool) -> None:
    """Time flights along few and along many gates."""
    rows = measure_gates()
    if json:
        emit_json({"gates": [row._asdict() for row in rows]})
    else:
        emit(gates_table(rows))


def _bench_heats(seconds: float, json: bool) -> None:
    """Time control steps with other vehicles, steps of a world of several vehicles, and races."""
    times = measure_heats(seconds)
    if json:
        result = {
            "others": [row._asdict() for row in times.beside],
            "worlds": [row._asdict() for row in times.worlds],
            "races": [row._asdict() for row in times.races],
        }
        emit_json(result)
    else:
        emit(others_table(times.beside), "", worlds_table(times.worlds))
        emit("", heat_table(times.races))


def _bench_envs(seconds: float, json: bool) -> None:
    """Time learning environments, and simulators of one vehicle."""
    rows = measure_envs(seconds)
    races = measure_races(seconds)
    plants = measure_plants(seconds)
    if json:
        result = {
            "envs": [row._asdict() for row in rows],
            "races": [row._asdict() for row in races],
            "plants": plants,
        }
        emit_json(result)
    else:
        emit(envs_table(rows), "", races_table(races), "", *other_simulators(plants))
