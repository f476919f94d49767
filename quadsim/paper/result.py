"""What the experiments share: attempts of one campaign, CSV files, and Table I beside the published
one.

The paper: Vlahov, Gibson, Theodorou, "Low Frequency Sampling in Model Predictive Path Integral
Control", IEEE RA-L 2024.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import isnan, nan
from pathlib import Path

from rich.console import RenderableType
from rich.table import Table

from quadsim.campaign.attempt import fly_attempt
from quadsim.campaign.runner import Runner
from quadsim.campaign.store import Row
from quadsim.campaign.summary_stats import variant_stats
from quadsim.campaign.variants import Variant
from quadsim.console import complain, plain_table
from quadsim.files.csv_rows import csv_text
from quadsim.record.archive import load_run
from quadsim.record.run import Run, RunError
from quadsim.record.whole_files import write_whole
from quadsim.spec.spec import Spec

# Table I: (system, sampler) -> mean, standard deviation and least time [s] of the valid attempts;
# valid, attempts
TABLE1 = {
    ("offroad", "gaussian"): (None, None, None, 0, None),  # how many attempts is not said
    ("offroad", "colored"): (38.333, 3.316, 35.99, 5, 6),
    ("quadrotor", "gaussian"): (8.547, 0.206, 8.360, 9, 37),
    ("quadrotor", "colored"): (8.691, 0.457, 7.695, 9, 21),
}
Rows = Sequence[Row]


@dataclass(frozen=True)
class Result:
    """One experiment, done."""

    numbers: dict  # JSON
    shown: tuple[RenderableType, ...]
    files: tuple[Path, ...]


def flown(
    variants: Sequence[Variant], runs: int, folder: Path, telemetry: bool = True
) -> dict[str, list[Row]]:
    """Name of each variant -> its attempts by seed; those that the folder's campaign lacks are
    flown now.

    telemetry: keep it of those, some 36 kB each.
    Raises RunError where an attempt is lost, KeyboardInterrupt.
    """
    path = folder / "campaign.sqlite"
    with Runner(path, telemetry=telemetry) as runner:
        rows = runner(variants, runs)
    if any(len(of_variant) < runs for of_variant in rows):
        raise RunError(
            f"{path}: a worker process was lost twice; the same command goes on from here"
        )
    return {variant.name: of_variant for variant, of_variant in zip(variants, rows, strict=True)}


def load_runs(
    variants: Sequence[Variant], attempts: dict[str, list[Row]], folder: Path
) -> dict[str, list[Run]]:
    """The same with their telemetry; what is not there or damaged is flown again."""
    specs = {variant.name: variant.spec for variant in variants}
    return {
        name: [_load(row, specs[name], folder) for row in rows] for name, rows in attempts.items()
    }


def _load(row: Row, spec: Spec, folder: Path) -> Run:
    if row.folder:
        try:
            return load_run(folder / row.folder)
        except RunError as error:
            complain(f"{error}; flown again")
    run = fly_attempt(replace(spec, seed=row.seed)).run
    if run.digest() != row.result["digest"]:
        complain(
            f"{row.name} seed {row.seed}: flown again it is another flight, as the code or the machine is another"
        )
    return run


def write_csv(path: Path, rows: Sequence[dict]) -> Path:
    """Rows of equal keys. Raises RunError."""
    write_whole(path, csv_text(rows).encode())
    return path


def table1_row(system: str, sampler: str, rows: Rows) -> dict:
    """Success and times [s] of the attempts that finished, beside the paper's; None where there are
    none."""
    ours = variant_stats(sampler, rows, limit=nan)
    times = {"mean": ours.lap_mean, "sd": ours.lap_sd, "min": ours.lap_min}
    paper = TABLE1.get((system, sampler), (None,) * 5)
    low, high = ours.success_ci
    return {
        "sampler": sampler,
        "attempts": ours.attempts,
        "finished": ours.finished,
        "success_low": low,
        "success_high": high,
        **{name: None if isnan(time) else time for name, time in times.items()},
        "ms": ours.plan_ms,
        **{
            f"paper_{name}": x for name, x in zip((*times, "valid", "attempts"), paper, strict=True)
        },
    }


def table1(rows: Sequence[dict], title: str, key: str) -> Table:
    """With one more column, from the rows' `key`."""
    heads = ("sampler", "success", "time [s]", "least", "paper [s]", "least", "valid", title)
    table = plain_table(*heads, left=(0,), no_wrap=True)
    for r in rows:
        ours = _spread(r["mean"], r["sd"]), _seconds(r["min"])
        theirs = _spread(r["paper_mean"], r["paper_sd"]), _seconds(r["paper_min"])
        valid = "/".join(str(r[k]) for k in ("paper_valid", "paper_attempts") if r[k] is not None)
        table.add_row(
            r["sampler"], f"{r['finished']}/{r['attempts']}", *ours, *theirs, valid, f"{r[key]:.3g}"
        )
    return table


def _spread(mean: float | None, sd: float | None) -> str:
    return _seconds(mean) + (f" +-{sd:.2f}" if sd is not None else "")


def _seconds(value: float | None) -> str:
    return "" if value is None else f"{value:.2f}"
