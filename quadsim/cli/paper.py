"""`race paper`: the tables and figures of the paper that can be made without its vehicle."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NamedTuple

from msgspec import Meta

from quadsim.cli.flags import Help, Json, RunsDir
from quadsim.console import UsageError, emit, emit_json
from quadsim.files.yaml_errors import did_you_mean

if TYPE_CHECKING:
    from quadsim.paper.result import Result  # --help does not wait for matplotlib


class Experiment(NamedTuple):
    """An experiment, run by the module of its name in quadsim.paper."""

    runs: int  # default number of runs of each variant
    about: str


EXPERIMENTS = {
    "noise": Experiment(1, "samples of Gaussian and colored noise"),
    "exploration": Experiment(1, "300 sampled trajectories of the off-road vehicle"),
    "table2": Experiment(50, "Table II: cost of the double integrator, six samplers, three sigmas"),
    "double_integrator": Experiment(20, "the best runs of Table II at sigma 1.5"),
    "quadrotor": Experiment(20, "Table I, quadrotor rows, on a course of ours"),
    "offroad": Experiment(20, "Table I, off-road rows, with a simulated stand-in for the vehicle"),
}
Runs = Annotated[int, Meta(ge=1, le=10_000)]
NAMES = (*EXPERIMENTS, "all")


def paper(
    name: Annotated[str, Help(f"{', '.join(EXPERIMENTS)} or all; see docs/paper.md")],
    /,
    *,
    runs: Annotated[Runs | None, Help("runs of each variant; default: table2 50, else 20")] = None,
    runs_dir: RunsDir = "runs",
    json: Json = False,
) -> int:
    """Rerun a table or figure of the paper.

    The paper is "Low Frequency Sampling in Model Predictive Path Integral Control", 2024. Finished
    runs are kept in the folder `paper` of --runs-dir: an interrupted command continues where
    it stopped, and a larger --runs adds to the stored runs.

    race paper table2 --runs 1000
    """
    if name not in NAMES:
        raise UsageError(f"no experiment {name!r}: {did_you_mean(name, NAMES)}")
    from quadsim.record.whole_files import try_writing  # --help does not load it

    folder = Path(runs_dir) / "paper"
    try_writing(folder)
    chosen = tuple(EXPERIMENTS) if name == "all" else (name,)
    results = {}
    for one in chosen:
        results[one] = _make(one, runs, folder)
        if not json:
            emit(EXPERIMENTS[one].about, *results[one].shown, *map(str, results[one].files), "")
    if json:
        numbers = {one: result.numbers for one, result in results.items()}
        emit_json(numbers if name == "all" else numbers[name])
    return 0


def _make(name: str, runs: int | None, folder: Path) -> Result:
    """Run one experiment."""
    module = import_module(f"quadsim.paper.{name}")
    return module.make(runs or EXPERIMENTS[name].runs, folder)
