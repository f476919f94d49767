"""What the experiments share: attempts of one campaign, rows of Table I, CSV files."""

from __future__ import annotations

import csv
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from math import isnan, nan
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from rich.console import RenderableType
from rich.table import Table

from quadsim.app.campaign.runner import Runner
from quadsim.app.campaign.store import Row
from quadsim.app.campaign.summary_stats import variant_stats
from quadsim.app.campaign.variants import Variant
from quadsim.app.console import plain_table
from quadsim.app.paper.published import TABLE1
from quadsim.record.archive import load_run
from quadsim.record.run import Run, RunError


@dataclass(frozen=True)
class Result:
    """One experiment, done."""

    numbers: dict  # JSON
    shown: tuple[RenderableType, ...]
    files: tuple[Path, ...]


def flown(variants: Sequence[Variant], runs: int, folder: Path) -> dict[str, list[Row]]:
    """Name of each variant -> its attempts by seed; those that the folder's campaign lacks are flown now.

    Raises RunError where an attempt is lost, KeyboardInterrupt.
    """
    path = folder / "campaign.sqlite"
    with Runner(path) as runner:
        rows = runner(variants, runs)
    if any(len(of_variant) < runs for of_variant in rows):
        raise RunError(f"{path}: a worker process was lost twice; the same command goes on from here")
    return {variant.name: of_variant for variant, of_variant in zip(variants, rows, strict=True)}


def load_runs(attempts: dict[str, list[Row]], folder: Path) -> dict[str, list[Run]]:
    """The same with their telemetry. Raises RunError."""
    return {name: [load_run(folder / row.folder) for row in rows] for name, rows in attempts.items()}


def write_csv(path: Path, rows: Sequence[dict]) -> Path:
    """Rows of equal keys."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with path.open("w", newline="") as file:
            writer = csv.DictWriter(file, rows[0])
            writer.writeheader()
            writer.writerows(rows)
    except OSError as error:
        raise RunError(f"{path}: cannot write: {error.strerror or error}") from error
    return path


def csv_rows(run: Run, columns: Sequence[str]) -> Iterator[dict]:
    """These columns of the telemetry, a row for each control step, to five decimals."""
    for values in zip(*(run.telemetry[name].tolist() for name in columns), strict=True):
        yield {name: round(v, 5) for name, v in zip(columns, values, strict=True)}


def draw_paths(axes: Axes, runs: Sequence[Run], colours: Sequence[np.ndarray], cmap: str, top: float) -> LineCollection:
    """Every run from above; colours: a number from 0 to `top` for each of its control steps."""
    paths = [np.column_stack([run.telemetry["px"], run.telemetry["py"]]) for run in runs]
    segments = [segment for p in paths for segment in np.stack([p[:-1], p[1:]], axis=1)]
    lines = LineCollection(segments, cmap=cmap, linewidths=1.1)
    lines.set_array(np.concatenate([np.zeros(0), *(c[:-1] for c in colours)]))
    lines.set_clim(0.0, top)
    axes.add_collection(lines)
    axes.set(aspect="equal", xlabel="x [m]", ylabel="y [m]")
    return lines


def table1_row(system: str, sampler: str, rows: Sequence[Row]) -> dict:
    """Success and times [s] of the attempts that finished, beside the paper's; None where there are none."""
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
        **{f"paper_{name}": x for name, x in zip((*times, "valid", "attempts"), paper, strict=True)},
    }


def table1(rows: Sequence[dict], title: str, key: str) -> Table:
    """With one more column, from the rows' `key`."""
    heads = ("sampler", "success", "time [s]", "least", "paper [s]", "least", "valid", title)
    table = plain_table(*heads, left=(0,), no_wrap=True)
    for r in rows:
        ours = _spread(r["mean"], r["sd"]), _seconds(r["min"])
        theirs = _spread(r["paper_mean"], r["paper_sd"]), _seconds(r["paper_min"])
        valid = "/".join(str(r[k]) for k in ("paper_valid", "paper_attempts") if r[k] is not None)
        table.add_row(r["sampler"], f"{r['finished']}/{r['attempts']}", *ours, *theirs, valid, f"{r[key]:.3g}")
    return table


def _spread(mean: float | None, sd: float | None) -> str:
    return _seconds(mean) + (f" +-{sd:.2f}" if sd is not None else "")


def _seconds(value: float | None) -> str:
    return "" if value is None else f"{value:.2f}"
