"""`race paper`: every table and figure of the paper that can be made without its vehicle, by name."""

from __future__ import annotations

from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Annotated

from msgspec import Meta
from tyro.conf import DisallowNone, FlagCreatePairsOff, Positional, arg

from quadsim.app.console import complain, emit, emit_json
from quadsim.app.flags import UsageError, check, otherwise
from quadsim.app.paper.result import Result
from quadsim.files.yaml_words import did_you_mean

EXPERIMENTS = {  # name -> what it is
    "noise": "samples of Gaussian and colored noise",
    "exploration": "300 sampled trajectories of the off-road vehicle",
    "table2": "Table II: cost of the double integrator, six samplers, three sigmas",
    "double_integrator": "the best runs of Table II at sigma 1.5",
    "quadrotor": "Table I, quadrotor rows, on a course of ours",
    "offroad": "Table I, off-road rows, with a simulated stand-in for the vehicle",
}
INTERRUPTED = 130


@dataclass(frozen=True)
class Paper:
    """A table or figure of "Low Frequency Sampling in Model Predictive Path Integral Control", rerun.

    Finished runs are kept: an interrupted command goes on where it stopped, more runs add to those there are.

    race paper table2 --runs 1000
    """

    name: Annotated[str, Positional, arg(metavar="|".join((*EXPERIMENTS, "all")))]  # see docs/paper.md
    runs: Annotated[Annotated[int, Meta(ge=1, le=10_000)] | None, DisallowNone, otherwise("table2 50, else 20")] = None
    runs_dir: str = "runs"  # where runs are kept, in a folder `paper`
    json: FlagCreatePairsOff[bool] = False  # one JSON object instead of tables

    def run(self) -> int:
        check(self)
        if self.name != "all" and self.name not in EXPERIMENTS:
            raise UsageError(f"no experiment {self.name!r}: {did_you_mean(self.name, (*EXPERIMENTS, 'all'))}")
        names = tuple(EXPERIMENTS) if self.name == "all" else (self.name,)
        try:
            results = {name: self._make(name) for name in names}
        except KeyboardInterrupt:
            complain(
                f"race paper: interrupted; finished runs are in {self._folder}, the same command goes on from there"
            )
            return INTERRUPTED
        if self.json:
            numbers = {name: result.numbers for name, result in results.items()}
            emit_json(numbers if self.name == "all" else numbers[self.name])
        return 0

    @property
    def _folder(self) -> Path:
        return Path(self.runs_dir) / "paper"

    def _make(self, name: str) -> Result:
        experiment = import_module(f"quadsim.app.paper.{name}")
        result = experiment.run(self.runs or experiment.RUNS, self._folder)
        if not self.json:
            emit(EXPERIMENTS[name], *result.shown, *map(str, result.files), "")
        return result
