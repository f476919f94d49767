"""`race bench`: control steps timed, as tables or as JSON."""

from __future__ import annotations

from dataclasses import asdict
from typing import Annotated

from msgspec import Meta
from rich.console import Console
from rich.progress import track

from controllers.rollout.threads import use_threads
from quadsim.app.bench.cases import SWEPT, cases, measure, paper_case
from quadsim.app.bench.machine import measure_machine
from quadsim.app.bench.stages import stages
from quadsim.app.bench.tables import tables
from quadsim.app.console import emit, emit_json
from quadsim.app.flags import Help, Json


def bench(
    *,
    seconds: Annotated[float, Meta(gt=0, le=600), Help("for each case [s]")] = 1.0,
    peers: Annotated[bool, Help("also time pytorch-mppi and JAX (extra: peers)", negative="")] = False,
    json: Json = False,
) -> int:
    """Time whole control steps on this machine, which should do nothing else meanwhile: every system at the paper's
    budget, then sweeps over samples and horizon.

    race bench --peers     the same model through pytorch-mppi and JAX, in the same run
    """
    from quadsim.app.bench.peers import compare, require_peers

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


def _measure(seconds: float) -> dict:
    most = use_threads(None)
    machine = measure_machine(most)
    console = Console(stderr=True)
    found = track(list(cases(most)), "timing, the first time also compiling", console=console, transient=True)
    rows = [measure(case, seconds, machine) for case in found]
    use_threads(None)
    parts = [row for name in SWEPT for row in stages(paper_case("quadrotor", name), seconds, machine)]
    return {"cases": rows, "stages": parts, "machine": asdict(machine)}
