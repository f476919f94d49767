"""`race bench`: control steps timed, as tables or as JSON."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Annotated

from msgspec import Meta
from rich.console import Console
from rich.progress import track
from tyro.conf import FlagCreatePairsOff

from controllers.rollout.threads import use_threads
from quadsim.app.bench.cases import SWEPT, cases, measure, paper_case
from quadsim.app.bench.machine import measure_machine
from quadsim.app.bench.stages import stages
from quadsim.app.bench.tables import tables
from quadsim.app.console import emit, emit_json
from quadsim.app.flags import check


@dataclass(frozen=True)
class Bench:
    """Time whole control steps on this machine, which should do nothing else meanwhile: every system at the paper's
    budget, then sweeps over samples and horizon.

    race bench --peers     the same model through pytorch-mppi and JAX, in the same run
    """

    seconds: Annotated[float, Meta(gt=0, le=600)] = 1.0  # for each case [s]
    peers: FlagCreatePairsOff[bool] = False  # also time pytorch-mppi and JAX (extra: peers)
    json: FlagCreatePairsOff[bool] = False  # one JSON object instead of tables

    def run(self) -> int:
        check(self)
        from quadsim.app.bench.peers import compare, require_peers

        if self.peers:
            require_peers()
        result = self._measure()
        if self.peers:
            result["peers"] = compare(self.seconds)
        if self.json:
            emit_json(result)
        else:
            emit(*tables(result))
        return 0

    def _measure(self) -> dict:
        most = use_threads(None)
        machine = measure_machine(most)
        console = Console(stderr=True)
        found = track(list(cases(most)), "timing, the first time also compiling", console=console, transient=True)
        rows = [measure(case, self.seconds, machine) for case in found]
        use_threads(None)
        parts = [row for name in SWEPT for row in stages(paper_case("quadrotor", name), self.seconds, machine)]
        return {"cases": rows, "stages": parts, "machine": asdict(machine)}
