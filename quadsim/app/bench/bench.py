"""`race bench`: control steps timed, as a table or as JSON."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Annotated

from msgspec import Meta
from rich.console import Console, RenderableType
from rich.markup import escape
from rich.progress import track
from tyro.conf import FlagCreatePairsOff

from controllers.rollout.roofline import bandwidth_gb, peak_gflops
from controllers.rollout.threads import use_threads
from quadsim.app.bench.cases import Case, cases, controller, measure
from quadsim.app.bench.stages import stages, work
from quadsim.app.console import emit, emit_json
from quadsim.app.lap_table import plain_table
from quadsim.provenance import cpu_name


@dataclass(frozen=True)
class Bench:
    """Time whole control steps on this machine: every sampler at the paper's budget, then sweeps. Keep it quiet.

    race bench --peers     the same model through pytorch-mppi and JAX, in the same run
    """

    seconds: Annotated[float, Meta(gt=0, le=600)] = 1.0  # for each case [s]
    peers: FlagCreatePairsOff[bool] = False  # also time pytorch-mppi and JAX (extra: peers)
    json: FlagCreatePairsOff[bool] = False  # one JSON object instead of tables

    def run(self) -> int:
        most = use_threads(None)
        found = list(cases(most))
        rows = [
            measure(case, self.seconds) for case in track(found, "timing", console=Console(stderr=True), transient=True)
        ]
        use_threads(None)
        parts = {name: dict(stages(Case(name), self.seconds)) for name in ("gaussian", "colored")}
        machine = machine_facts(most)
        result = {"cases": rows, "stages": parts, "machine": machine}
        if self.peers:
            from quadsim.app.bench.peers import compare

            result["peers"] = compare(self.seconds)
        if self.json:
            emit_json(result)
        else:
            emit(*tables(result))
        return 0


def machine_facts(threads: int) -> dict:
    operations, moved = work(controller(Case("gaussian"))[0])
    return {
        "cpu": cpu_name(),
        "threads": threads,
        "peak_gflops": peak_gflops(),
        "bandwidth_gb": bandwidth_gb(),
        "operations_per_step": operations,
        "bytes_per_step": moved,
    }


def tables(result: dict) -> Iterator[RenderableType]:
    """Cases, then where the time goes, then the machine, then the peers if they were timed."""
    machine = result["machine"]
    peak = 1e9 * machine["peak_gflops"] / machine["operations_per_step"]  # steps/s if nothing but arithmetic took time
    steps = plain_table()
    for name in ("M x T x I", "sampler", "threads", "p50 [ms]", "p95 [ms]", "steps/s", "arithmetic"):
        steps.add_column(escape(name), justify="left" if name[0] in "Ms" and name != "steps/s" else "right")
    for row in result["cases"]:
        share = row["steps_per_s"] / peak * machine["threads"] / row["threads"]
        numbers = (f"{row['ms_p50']:.2f}", f"{row['ms_p95']:.2f}", f"{row['steps_per_s']:.2e}", f"{100 * share:.0f} %")
        steps.add_row(row["name"], row["sampler"], str(row["threads"]), *numbers)
    yield steps
    yield ""
    where = plain_table()
    where.add_column("one iteration, 4096 x 150")
    for name in result["stages"]:
        where.add_column(f"{name} [ms]".replace("[", r"\["), justify="right")
    for part in next(iter(result["stages"].values())):
        where.add_row(part, *(f"{times[part]:.2f}" for times in result["stages"].values()))
    yield where
    yield ""
    yield (
        f"{machine['cpu']}, {machine['threads']} threads: {machine['peak_gflops']:.0f} GFLOP/s, "
        f"{machine['bandwidth_gb']:.0f} GB/s measured; a sample's step is {machine['operations_per_step']} operations "
        f"on {machine['bytes_per_step']} bytes of noise"
    )
    for row in result.get("peers", ()):
        yield (
            f"{row['name']}: {row['ms_p50']:.1f} ms, {row['ratio']:.1f} times ours ({row['ours_ms']:.2f} ms); "
            f"costs agree to {row['largest_difference']:.1e}"
        )
