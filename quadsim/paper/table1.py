"""Rows of Table I, which compare attempts of this project with published ones, and paths."""

from __future__ import annotations

from collections.abc import Sequence
from math import isnan
from statistics import median
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from rich.table import Table

from quadsim.console import plain_table
from quadsim.statistics import mean_interval, wilson


class PublishedTimes(NamedTuple):
    """A row of the published table; None stands for numbers that the paper does not give."""

    mean: float | None = None  # of the times of the valid attempts [s]
    sd: float | None = None
    min: float | None = None
    valid: int | None = None
    attempts: int | None = None


class MotionAttempt(NamedTuple):
    """An attempt that quadsim flew or drove for Table 1."""

    time: float | None  # from the start to the goal [s]; None: not finished
    plan_ms: float  # median planning time of the control steps


PUBLISHED = {
    ("offroad", "gaussian"): PublishedTimes(valid=0),
    ("offroad", "colored"): PublishedTimes(mean=38.333, sd=3.316, min=35.99, valid=5, attempts=6),
    ("quadrotor", "gaussian"): PublishedTimes(
        mean=8.547, sd=0.206, min=8.360, valid=9, attempts=37
    ),
    ("quadrotor", "colored"): PublishedTimes(mean=8.691, sd=0.457, min=7.695, valid=9, attempts=21),
}


def table1_row(system: str, sampler: str, attempts: Sequence[MotionAttempt]) -> dict:
    """Return success and times [s] of finished attempts, with the paper's values.

    Missing numbers are None.
    """
    times = [attempt.time for attempt in attempts if attempt.time is not None]
    spread = mean_interval(times)
    low, high = wilson(len(times), len(attempts))
    paper = PUBLISHED.get((system, sampler), PublishedTimes())
    return {
        "sampler": sampler,
        "attempts": len(attempts),
        "finished": len(times),
        "success_low": low,
        "success_high": high,
        "mean": _known(spread.mean),
        "sd": _known(spread.sd),
        "min": min(times, default=None),
        "ms": median(attempt.plan_ms for attempt in attempts),
        **{f"paper_{name}": number for name, number in paper._asdict().items()},
    }


def table1(rows: Sequence[dict], title: str, key: str) -> Table:
    """Return the rows as a table, with an extra column `title` from the rows' `key`."""
    heads = ("sampler", "success", "time [s]", "least", "paper [s]", "least", "valid", title)
    table = plain_table(*heads, left=(0,), no_wrap=True)
    for row in rows:
        published = [row["paper_valid"], row["paper_attempts"]]
        table.add_row(
            row["sampler"],
            f"{row['finished']}/{row['attempts']}",
            _spread(row["mean"], row["sd"]),
            _seconds(row["min"]),
            _spread(row["paper_mean"], row["paper_sd"]),
            _seconds(row["paper_min"]),
            "/".join(str(number) for number in published if number is not None),
            f"{row[key]:.3g}",
        )
    return table


def draw_paths(
    axes: Axes, paths: Sequence[np.ndarray], colours: Sequence[np.ndarray], cmap: str, top: float
) -> LineCollection:
    """Draw paths from above, and return them for a colour bar.

    Args:
        axes: axes to draw on.
        paths: positions of each attempt [m]  (steps, 2) each.
        colours: a number from 0 to `top` for each position  (steps,) each.
        cmap: name of a matplotlib colour map.
        top: the number at the end of the colour map.
    """
    segments = [segment for path in paths for segment in np.stack([path[:-1], path[1:]], axis=1)]
    lines = LineCollection(segments, cmap=cmap, linewidths=1.1)
    lines.set_array(np.concatenate([np.zeros(0), *(numbers[:-1] for numbers in colours)]))
    lines.set_clim(0.0, top)
    axes.add_collection(lines)
    axes.set(aspect="equal", xlabel="x [m]", ylabel="y [m]")
    return lines


def _known(number: float) -> float | None:
    return None if isnan(number) else number


def _spread(mean: float | None, sd: float | None) -> str:
    return _seconds(mean) if sd is None else f"{_seconds(mean)} +-{sd:.2f}"


def _seconds(value: float | None) -> str:
    return "" if value is None else f"{value:.2f}"
