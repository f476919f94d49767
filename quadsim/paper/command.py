"""`race paper`: every table and figure of the paper that can be made without its vehicle, by
name."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from msgspec import Meta

from quadsim.cli.flags import Help, Json, RunsDir, Switch
from quadsim.console import UsageError, emit, emit_json
from quadsim.files.yaml_errors import did_you_mean

if TYPE_CHECKING:
    from quadsim.paper.result import Result  # --help does not wait for matplotlib

EXPERIMENTS = {  # name -> module with a function of that name, runs of each variant, what it is
    "noise": ("sampled", 1, "samples of Gaussian and colored noise"),
    "exploration": ("sampled", 1, "300 sampled trajectories of the off-road vehicle"),
    "table2": ("table2", 50, "Table II: cost of the double integrator, six samplers, three sigmas"),
    "double_integrator": ("table2", 20, "the best runs of Table II at sigma 1.5"),
    "quadrotor": ("table1", 20, "Table I, quadrotor rows, on a course of ours"),
    "offroad": ("table1", 20, "Table I, off-road rows, with a simulated stand-in for the vehicle"),
}
Runs = Annotated[int, Meta(ge=1, le=10_000)]
NAMES = (*EXPERIMENTS, "all")


def paper(
    name: Annotated[str, Help(f"{', '.join(EXPERIMENTS)} or all; see docs/paper.md")],
    /,
    *,
    runs: Annotated[Runs | None, Help("of each variant; default: table2 50, else 20")] = None,
    runs_dir: RunsDir = "runs",
    telemetry: Annotated[
        bool, Switch("keep that of table2 and double_integrator too, 1.3 GB of 36 000 runs")
    ] = False,
    json: Json = False,
) -> int:
    """A table or figure of "Low Frequency Sampling in Model Predictive Path Integral Control",
    rerun.

    Finished runs are kept in a campaign in the folder `paper` of --runs-dir: an interrupted command
    goes on where it stopped, and a larger --runs adds to those that there are.

    race paper table2 --runs 1000
    """
    if name not in NAMES:
        raise UsageError(f"no experiment {name!r}: {did_you_mean(name, NAMES)}")
    folder, chosen = Path(runs_dir) / "paper", tuple(EXPERIMENTS) if name == "all" else (name,)
    results = {one: _make(one, runs, folder, telemetry, quiet=json) for one in chosen}
    if json:
        numbers = {one: result.numbers for one, result in results.items()}
        emit_json(numbers if name == "all" else numbers[name])
    return 0


def _make(name: str, runs: int | None, folder: Path, telemetry: bool, quiet: bool) -> Result:
    module, usual, about = EXPERIMENTS[name]
    experiment = getattr(import_module(f"quadsim.paper.{module}"), name)
    result = experiment(
        runs or usual, folder, **({"telemetry": telemetry} if module == "table2" else {})
    )
    if not quiet:
        emit(about, *result.shown, *map(str, result.files), "")
    return result
