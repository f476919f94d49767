"""Experiment for Table II: the cost of the double integrator under six samplers.

Six more rows show the effect of the paper's choices, see docs/paper.md.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from typing import NamedTuple

import numpy as np
from rich.table import Table

from quadsim.console import plain_table
from quadsim.controllers.config import MPPIConfig
from quadsim.controllers.costs import evaluate
from quadsim.controllers.mppi import MPPI
from quadsim.controllers.samplers import Colored, Gaussian, LogNormal, Sampling, Smooth, SmoothStar
from quadsim.paper.integrator import (
    Goal,
    PointControl,
    PointState,
    double_integrator,
    quadratic_cost,
)
from quadsim.paper.result import Result, write_csv
from quadsim.paper.runs import kept_runs
from quadsim.streams import double_integrator_streams

# M = 4096, T = 65, I = 1, dt = .015 s, lambda = 1. By the conventions of the authors' public
# library (MPPI-Generic, ACDSLab) no sample perturbs the control that is about to be executed, the
# last 1 % of the samples perturb the rest control, and a Savitzky-Golay filter smooths the plan.
CONFIG = MPPIConfig(
    samples=4096,
    horizon=65,
    iterations=1,
    dt=0.015,
    temperature=1.0,
    freeze_first=True,
    smooth=True,
)
# Start, goal and length are from that library's example, the source of the paper's numbers.
START = PointState(px=-9.0, py=-9.0, vx=0.1, vy=0.1)
GOAL = Goal(x=-4.0, y=-4.0)
STEPS = 300  # control periods of a run, 4.5 s
SIGMAS = (0.5, 1.5, 3.0)


class Cell(NamedTuple):
    """A cell of the table."""

    sampler: str
    sigma: float  # of both controls [m/s^2]


class PublishedCost(NamedTuple):
    """The numbers of a cell of the published table."""

    mean: float  # accumulated cost
    sd: float  # standard deviation of the cost over 1000 runs
    ms: float  # time of a control step on an RTX 3080


TABLE2 = {
    Cell("gaussian", 0.5): PublishedCost(27919.0, 33.1, 0.259),
    Cell("smooth", 0.5): PublishedCost(61328.7, 1766.8, 0.296),
    Cell("smooth_star", 0.5): PublishedCost(21853.6, 19189.7, 0.295),
    Cell("log_normal", 0.5): PublishedCost(24545.3, 40.3, 0.297),
    Cell("colored_1", 0.5): PublishedCost(13569.7, 65.4, 0.379),
    Cell("colored_2", 0.5): PublishedCost(14201.7, 61.2, 0.379),
    Cell("gaussian", 1.5): PublishedCost(13815.5, 64.6, 0.259),
    Cell("smooth", 1.5): PublishedCost(44401.0, 3232.3, 0.293),
    Cell("smooth_star", 1.5): PublishedCost(11446.3, 71.1, 0.294),
    Cell("log_normal", 1.5): PublishedCost(7316.1, 324.5, 0.299),
    Cell("colored_1", 1.5): PublishedCost(10636.9, 74.4, 0.379),
    Cell("colored_2", 1.5): PublishedCost(11081.2, 75.6, 0.379),
    Cell("gaussian", 3.0): PublishedCost(10815.1, 75.7, 0.259),
    Cell("smooth", 3.0): PublishedCost(68088.2, 7521.7, 0.293),
    Cell("smooth_star", 3.0): PublishedCost(10505.5, 75.6, 0.294),
    Cell("log_normal", 3.0): PublishedCost(6963.5, 380.5, 0.307),
    Cell("colored_1", 3.0): PublishedCost(9191.7, 69.6, 0.380),
    Cell("colored_2", 3.0): PublishedCost(9700.0, 70.2, 0.380),
}
PAPER_SAMPLERS = ("gaussian", "smooth", "smooth_star", "log_normal", "colored_1", "colored_2")


@dataclass(frozen=True)
class MotionTask:
    """The settings that decide one run."""

    sampling: Sampling
    seed: int
    config: MPPIConfig = CONFIG
    steps: int = STEPS


class Motion(NamedTuple):
    """A run of the double integrator."""

    t: np.ndarray  # [s]  (steps + 1,)
    x: np.ndarray  # states, in the order of PointState  (steps + 1, 4)
    u: np.ndarray  # controls, in the order of PointControl  (steps, 2)
    plan_ms: float  # median time of a plan


class Score(NamedTuple):
    """The cost and the computing time of a run, for the table."""

    cost: float  # accumulated cost
    plan_ms: float


def samplings(sigma: float) -> dict[str, Sampling]:
    """Return the sampler of each row of the table; the first six are the paper's."""
    both = (sigma, sigma)
    return {
        "gaussian": Gaussian(both),
        "smooth": Smooth(both, shift="published"),
        "smooth_star": SmoothStar(both, shift="published"),
        "log_normal": LogNormal(both),
        "colored_1": Colored(both, (1.0, 1.0), law="library"),
        "colored_2": Colored(both, (2.0, 2.0), law="library"),
        "colored_1_paper": Colored(both, (1.0, 1.0), law="paper"),
        "colored_2_paper": Colored(both, (2.0, 2.0), law="paper"),
        "colored_1_exact": Colored(both, (1.0, 1.0), law="exact"),
        "colored_2_exact": Colored(both, (2.0, 2.0), law="exact"),
        "smooth_corrected": Smooth(both, shift="corrected"),
        "smooth_star_corrected": SmoothStar(both, shift="corrected"),
    }


def planner(
    sampling: Sampling, config: MPPIConfig = CONFIG, seed: int | np.random.SeedSequence = 0
) -> MPPI:
    """Return the planner of the double integrator."""
    return MPPI(double_integrator(config.dt), quadratic_cost(GOAL), sampling, config, seed)


def move(task: MotionTask) -> Motion:
    """Return a run of the double integrator from START under the planner's controls."""
    mppi = planner(task.sampling, task.config, double_integrator_streams(task.seed).planner)
    system = double_integrator(task.config.dt)
    x = START
    states = [x]
    controls = []
    plan_ms = []
    for _ in range(task.steps):
        began = perf_counter()
        control, _ = mppi.control(np.array(x))
        plan_ms.append(1e3 * (perf_counter() - began))
        u = PointControl(*control.tolist())
        x = system.next(x, u)
        controls.append(u)
        states.append(x)
    return Motion(
        t=task.config.dt * np.arange(task.steps + 1),
        x=np.array(states),
        u=np.array(controls),
        plan_ms=float(np.median(plan_ms)),
    )


def score(task: MotionTask) -> Score:
    """Return the numbers of a run for the table."""
    motion = move(task)
    return Score(accumulated_cost(motion), motion.plan_ms)


def accumulated_cost(motion: Motion) -> float:
    """Return the sum of the cost over all states except the first."""
    x = PointState(*motion.x[1:].T)
    found = evaluate(quadratic_cost(GOAL), x, x, (), GOAL)
    return sum(float(np.sum(term)) for term in found.terms.values())


def scores(cells: Sequence[Cell], runs: int, folder: Path) -> dict[Cell, list[Score]]:
    """Return the scores of cells by seed; missing scores are computed."""
    tasks = [
        MotionTask(samplings(cell.sigma)[cell.sampler], seed)
        for cell in cells
        for seed in range(runs)
    ]
    found = iter(kept_runs(tasks, score, Score, folder))
    return {cell: [next(found) for _ in range(runs)] for cell in cells}


def make(runs: int, folder: Path) -> Result:
    """Run every cell `runs` times."""
    cells = [Cell(sampler, sigma) for sigma in SIGMAS for sampler in samplings(sigma)]
    rows = [row(cell, of_cell) for cell, of_cell in scores(cells, runs, folder).items()]
    return Result({"cells": rows}, (table(rows),), (write_csv(folder / "table2.csv", rows),))


def row(cell: Cell, runs: Sequence[Score]) -> dict:
    """Return one cell of the table as JSON; values that the paper lacks are None.

    `ms` is the time of a control step on one thread with all cores busy; `paper_ms` is the paper's
    time on an RTX 3080.
    """
    cost = np.array([run.cost for run in runs])
    paper = TABLE2.get(cell)
    return {
        "sampler": cell.sampler,
        "sigma": cell.sigma,
        "runs": len(cost),
        "mean": float(cost.mean()),
        "sd": float(cost.std(ddof=1)) if len(cost) > 1 else 0.0,
        "paper_mean": paper.mean if paper else None,
        "paper_sd": paper.sd if paper else None,
        "ms": float(np.median([run.plan_ms for run in runs])),
        "paper_ms": paper.ms if paper else None,
    }


def table(rows: Sequence[dict]) -> Table:
    """Return the rows as a table."""
    shown = plain_table("sigma", "sampler", "ours", "sd", "paper", "sd", "off", "ms", left=(1,))
    for cell in rows:
        published = ("", "", "")
        if cell["paper_mean"] is not None:
            off = 100 * (cell["mean"] / cell["paper_mean"] - 1)
            published = (f"{cell['paper_mean']:.0f}", f"{cell['paper_sd']:.0f}", f"{off:+.1f} %")
        shown.add_row(
            f"{cell['sigma']:g}",
            cell["sampler"],
            f"{cell['mean']:.0f}",
            f"{cell['sd']:.0f}",
            *published,
            f"{cell['ms']:.2f}",
        )
    return shown
