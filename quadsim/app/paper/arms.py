"""Rows of Table I: success and times of an arm's attempts, beside the paper's."""

from __future__ import annotations

import numpy as np
from rich.table import Table

from quadsim.app.lap_table import plain_table
from quadsim.app.paper.published import TABLE1
from quadsim.metrics import wilson

ARMS = ("gaussian", "colored")


def arm_numbers(system: str, sampler: str, records: list[dict]) -> dict:
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


def arm_table(rows: list[dict], more: dict[str, str]) -> Table:
    """more: title -> key of further columns."""
    table = plain_table()
    for i, head in enumerate(
        ("sampler", "success", "95 %", "mean", "sd", "least", "paper", "sd", "least", "valid", *more)
    ):
        table.add_column(head, justify="left" if i == 0 else "right")
    for r in rows:
        interval = f"{100 * r['success_low']:.0f} to {100 * r['success_high']:.0f} %"
        ours = (_seconds(r[key]) for key in ("mean", "sd", "min"))
        theirs = (_seconds(r[key]) for key in ("paper_mean", "paper_sd", "paper_min"))
        valid = "/".join(str(r[key]) for key in ("paper_valid", "paper_attempts") if r[key] is not None)
        rest = (f"{r[key]:.3g}" for key in more.values())
        table.add_row(r["sampler"], f"{r['finished']}/{r['attempts']}", interval, *ours, *theirs, valid, *rest)
    return table


def _seconds(value: float | None) -> str:
    return "" if value is None else f"{value:.2f}"
