"""Table II: accumulated cost of the double integrator under six samplers, and under six that the paper has not."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from pathlib import Path

import numpy as np
from rich.table import Table

from controllers.samplers import make_sampler
from quadsim.app.lap_table import plain_table
from quadsim.app.paper.gather import gather
from quadsim.app.paper.integrator import Variant, record
from quadsim.app.paper.published import TABLE2
from quadsim.app.paper.result import Result, write_csv

SIGMAS = (0.5, 1.5, 3.0)
CHOICES = {  # row -> sampler, gamma, law of the colored noise, shift of the momentum
    "gaussian": ("gaussian", 0.0, "exact", "corrected"),
    "smooth": ("smooth", 0.0, "exact", "published"),
    "smooth_star": ("smooth_star", 0.0, "exact", "published"),
    "log_normal": ("log_normal", 0.0, "exact", "corrected"),
    "colored_1": ("colored", 1.0, "library", "corrected"),
    "colored_2": ("colored", 2.0, "library", "corrected"),
    "colored_1_paper": ("colored", 1.0, "paper", "corrected"),
    "colored_2_paper": ("colored", 2.0, "paper", "corrected"),
    "colored_1_exact": ("colored", 1.0, "exact", "corrected"),
    "colored_2_exact": ("colored", 2.0, "exact", "corrected"),
    "smooth_corrected": ("smooth", 0.0, "exact", "corrected"),
    "smooth_star_corrected": ("smooth_star", 0.0, "exact", "corrected"),
}
RUNS = 50


@dataclass(frozen=True)
class Cell:
    """One row of the report; what the paper does not have is None."""

    sampler: str
    sigma: float
    runs: int
    mean: float
    sd: float
    paper_mean: float | None
    paper_sd: float | None
    ms: float  # of a control step, one thread, every core busy
    paper_ms: float | None  # on an RTX 3080


def variant(name: str, sigma: float) -> Variant:
    sampler, gamma, law, shift = CHOICES[name]
    numbers = {"sigma": (sigma,) * 2, "gamma": (gamma,) * 2, "law": law, "shift": shift}
    return Variant(name, sampler, make_sampler(sampler, **numbers))


def costs(names: tuple[str, ...], sigmas: tuple[float, ...], runs: int, folder: Path) -> dict[tuple[str, float], list]:
    """(name, sigma) -> records by seed."""
    variants = {(name, sigma): variant(name, sigma) for sigma, name in product(sigmas, names)}
    jobs = {a.key(seed): (a, seed) for seed in range(runs) for a in variants.values()}
    made = gather(jobs, record, folder / "table2.jsonl")
    return {cell: [made[a.key(seed)] for seed in range(runs)] for cell, a in variants.items()}


def run(runs: int, folder: Path) -> Result:
    cells = [_cell(*cell, records) for cell, records in costs(tuple(CHOICES), SIGMAS, runs, folder).items()]
    rows = [vars(cell) for cell in cells]
    write_csv(folder / "table2.csv", rows)
    return Result({"cells": rows}, (_table(cells),), (folder / "table2.csv",))


def _cell(name: str, sigma: float, records: list[dict]) -> Cell:
    cost = np.array([r["cost"] for r in records])
    sd = float(cost.std(ddof=1)) if len(cost) > 1 else 0.0
    ms = float(np.median([r["ms"] for r in records]))
    paper_mean, paper_sd, paper_ms = TABLE2.get((name, sigma), (None, None, None))
    return Cell(name, sigma, len(records), float(cost.mean()), sd, paper_mean, paper_sd, ms, paper_ms)


def _table(cells: list[Cell]) -> Table:
    table = plain_table()
    for i, head in enumerate(("sigma", "sampler", "ours", "sd", "paper", "sd", "off", "ms")):
        table.add_column(head, justify="left" if i == 1 else "right")
    for c in cells:
        paper = (
            (f"{c.paper_mean:.0f}", f"{c.paper_sd:.0f}", f"{100 * (c.mean / c.paper_mean - 1):+.1f} %")
            if c.paper_mean is not None and c.paper_sd is not None
            else ("", "", "")
        )
        table.add_row(f"{c.sigma:g}", c.sampler, f"{c.mean:.0f}", f"{c.sd:.0f}", *paper, f"{c.ms:.2f}")
    return table
