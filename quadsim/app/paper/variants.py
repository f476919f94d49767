"""Rows of Table I: success and times of a variant's attempts, beside the paper's."""

from __future__ import annotations

import numpy as np
from rich.markup import escape
from rich.table import Table

from quadsim.app.campaign.statistics import wilson
from quadsim.app.console import plain_table
from quadsim.app.paper.published import TABLE1

VARIANTS = ("gaussian", "colored")


def variant_stats(system: str, sampler: str, records: list[dict]) -> dict:
    """Times [s] of the attempts that finished; null where none did."""
    times = [r["time"] for r in records if r["outcome"] == "finished"]
    low, high = wilson(len(times), len(records))
    mean, sd, least, valid, attempts = TABLE1.get((system, sampler), (None,) * 5)
    return {
        "sampler": sampler,
        "attempts": len(records),
        "finished": len(times),
        "success_low": low,
        "success_high": high,
        "mean": float(np.mean(times)) if times else None,
        "sd": float(np.std(times, ddof=1)) if len(times) > 1 else None,
        "min": min(times) if times else None,
        "ms": float(np.median([r["ms"] for r in records])),
        "paper_mean": mean,
        "paper_sd": sd,
        "paper_min": least,
        "paper_valid": valid,
        "paper_attempts": attempts,
    }


def variant_table(rows: list[dict], more: dict[str, str]) -> Table:
    """more: title -> key of further columns."""
    table = plain_table()
    heads = ("sampler", "success", "time [s]", "least", "paper [s]", "least", "valid", *more)
    for i, head in enumerate(heads):
        table.add_column(escape(head), justify="left" if i == 0 else "right", no_wrap=True)
    for r in rows:
        success = f"{r['finished']}/{r['attempts']}"
        ours = _spread(r["mean"], r["sd"]), _seconds(r["min"])
        theirs = _spread(r["paper_mean"], r["paper_sd"]), _seconds(r["paper_min"])
        valid = "/".join(str(r[key]) for key in ("paper_valid", "paper_attempts") if r[key] is not None)
        table.add_row(r["sampler"], success, *ours, *theirs, valid, *(f"{r[key]:.3g}" for key in more.values()))
    return table


def _spread(mean: float | None, sd: float | None) -> str:
    return _seconds(mean) + (f" +-{sd:.2f}" if sd is not None else "")


def _seconds(value: float | None) -> str:
    return "" if value is None else f"{value:.2f}"
