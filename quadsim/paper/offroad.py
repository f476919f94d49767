"""Experiment for the off-road rows of Table I, in simulation, and Figures 4 and 5.

The results compare the samplers' success, times, paths and controls in the corridor.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from math import ceil
from pathlib import Path
from time import perf_counter
from typing import NamedTuple

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

from quadsim.controllers.config import MPPIConfig
from quadsim.controllers.mppi import MPPI
from quadsim.controllers.samplers import Colored, Gaussian, Sampling
from quadsim.dynamics.estimate import Estimate
from quadsim.figures.style import STYLE, line, write_figure
from quadsim.palette import HIT, INK, LIMIT, style
from quadsim.paper.car import DRIVEN, NOMINAL, CarControl, CarState, car, disturbed
from quadsim.paper.corridor import ZIGZAG, DriveReferee
from quadsim.paper.corridor_cost import corridor_cost
from quadsim.paper.result import Result, write_csv
from quadsim.paper.runs import kept_runs
from quadsim.paper.table1 import MotionAttempt, draw_paths, table1, table1_row
from quadsim.streams import offroad_streams

# Section IV-A: "I = 3 iterations, M = 6144 samples, lambda = 0.1, dt = 0.02 s, and T = 250"; "the
# control standard deviations were both set to 0.8, the combined throttle and brake exponent was 10,
# and the steering exponent was 4".
CONFIG = MPPIConfig(samples=6144, horizon=250, iterations=3, dt=0.02, temperature=0.1, smooth=True)
GAUSSIAN = Gaussian(sigma=(0.8, 0.8))
COLORED = Colored(sigma=(0.8, 0.8), gamma=(10.0, 4.0))
COLD = replace(CONFIG, temperature=0.02)  # to see whether the temperature holds Gaussian back

PLANT_DT = 0.005  # physics step of the driven vehicle [s]
TIMEOUT = 40.0  # [s]
SECONDS_SHOWN = 8.0  # duration of the controls in the figure [s], as in the paper
START = CarState(
    px=ZIGZAG.points[0][0],
    py=ZIGZAG.points[0][1],
    hx=float(ZIGZAG.directions[0, 0]),
    hy=float(ZIGZAG.directions[0, 1]),
    v=0.0,
    r=0.0,
    steer=0.0,
    drive=0.0,
)


@dataclass(frozen=True)
class DriveTask:
    """The settings that decide one drive."""

    sampling: Sampling
    config: MPPIConfig
    seed: int  # of the planner and of the disturbance
    timeout: float  # [s]


class Step(NamedTuple):
    """One control step of a drive."""

    t: float  # [s]
    x: CarState
    u: CarControl
    plan_ms: float


class Drive(NamedTuple):
    """A finished drive, with arrays over its control steps."""

    outcome: str  # finished, crashed, stuck or timeout
    time: float  # duration of the drive [s]
    legs: int  # number of completed legs
    plan_ms: float  # median time of a plan
    t: np.ndarray  # times of the control steps and of the end [s]  (steps,)
    x: np.ndarray  # states, in the order of CarState  (steps, 8)
    u: np.ndarray  # controls from t on, in the order of CarControl  (steps, 2)


def planner(sampling: Sampling, config: MPPIConfig, seed: int | np.random.SeedSequence = 0) -> MPPI:
    """Return the planner with the nominal model of the vehicle."""
    cost = corridor_cost(ZIGZAG, NOMINAL.half_width, config.dt)
    return MPPI(car(NOMINAL, config.dt), cost, sampling, config, seed)


def drive(task: DriveTask) -> Drive:
    """Return a drive of the disturbed vehicle along the corridor, which the referee ends."""
    streams = offroad_streams(task.seed)
    mppi = planner(task.sampling, task.config, streams.planner)
    vehicle = car(DRIVEN, PLANT_DT)
    disturbance = np.random.default_rng(streams.gusts)
    referee = DriveReferee(ZIGZAG, DRIVEN.half_width, task.timeout)

    x = START
    plant_steps = 0
    steps: list[Step] = []
    while referee.outcome is None:
        t = plant_steps * PLANT_DT
        began = perf_counter()
        control, _ = mppi.control(Estimate(t, np.array(x), referee.legs))
        plan_ms = 1e3 * (perf_counter() - began)
        u = CarControl(*control.tolist())
        steps.append(Step(t, x, u, plan_ms))

        # The vehicle moves in finer steps than the planner's model, each with a disturbance.
        for _ in range(round(task.config.dt / PLANT_DT)):
            x = disturbed(vehicle.next(x, u), PLANT_DT, disturbance)
            plant_steps += 1
            referee.observe(plant_steps * PLANT_DT, np.array([x.px, x.py]))
            if referee.outcome:
                break
    end = steps[-1]._replace(t=plant_steps * PLANT_DT, x=x)  # with the last control

    every = [*steps, end]
    return Drive(
        outcome=referee.outcome,
        time=end.t,
        legs=referee.legs,
        plan_ms=float(np.median([step.plan_ms for step in steps])),
        t=np.array([step.t for step in every]),
        x=np.array([step.x for step in every]),
        u=np.array([step.u for step in every]),
    )


def make(runs: int, folder: Path) -> Result:
    """Drive `runs` times with each sampler, and a quarter as often at the lower temperature."""
    cold_runs = ceil(runs / 4)
    tasks = {
        "gaussian": [DriveTask(GAUSSIAN, CONFIG, seed, TIMEOUT) for seed in range(runs)],
        "colored": [DriveTask(COLORED, CONFIG, seed, TIMEOUT) for seed in range(runs)],
        "gaussian_cold": [DriveTask(GAUSSIAN, COLD, seed, TIMEOUT) for seed in range(cold_runs)],
    }
    every = [task for of_variant in tasks.values() for task in of_variant]
    driven = iter(kept_runs(every, drive, Drive, folder))
    drives = {name: [next(driven) for _ in of_variant] for name, of_variant in tasks.items()}

    table = [row(name, of_variant) for name, of_variant in drives.items()]
    files = [
        write_csv(folder / "offroad.csv", table),
        *write_figure(draw_drives(drives), folder, "offroad_paths"),
        *write_figure(draw_drive_controls(drives), folder, "offroad_controls"),
    ]
    for name, of_variant in drives.items():
        steps = [
            {"attempt": i} | step
            for i, of_attempt in enumerate(of_variant)
            for step in csv_rows(of_attempt)
        ]
        files.append(write_csv(folder / f"offroad_{name}.csv", steps))
    return Result({"variants": table}, (table1(table, "legs", "mean_legs"),), tuple(files))


def row(name: str, drives: Sequence[Drive]) -> dict:
    """Return a row of Table I, with completed legs and the outcomes of unfinished drives."""
    attempts = [
        MotionAttempt(drive.time if drive.outcome == "finished" else None, drive.plan_ms)
        for drive in drives
    ]
    outcomes = [drive.outcome for drive in drives]
    return {
        **table1_row("offroad", name, attempts),
        "mean_legs": float(np.mean([drive.legs for drive in drives])),
        "crashed": outcomes.count("crashed"),
        "stuck": outcomes.count("stuck"),
        "timeout": outcomes.count("timeout"),
    }


def csv_rows(of_attempt: Drive) -> list[dict]:
    """Return a row for each control step, to five decimals."""
    names = ("t", *CarState._fields, *CarControl._fields)
    table = np.column_stack([of_attempt.t, of_attempt.x, of_attempt.u])
    return [
        {name: round(number, 5) for name, number in zip(names, numbers, strict=True)}
        for numbers in table.tolist()
    ]


def draw_drives(drives: Mapping[str, Sequence[Drive]]) -> Figure:
    """Return a figure of every attempt from above, coloured by the time since its start."""
    with rc_context(STYLE):
        figure = Figure(figsize=(13, 5), dpi=110, layout="constrained")
        columns = figure.subplots(1, len(drives), sharey=True)
        for axes, (name, of_variant) in zip(columns, drives.items(), strict=True):
            lines = _draw_variant(axes, name, of_variant)
        figure.colorbar(lines, ax=figure.axes, label="t [s]", pad=0.01)
    return figure


def _draw_variant(axes: Axes, name: str, drives: Sequence[Drive]) -> LineCollection:
    """Draw the corridor and the paths, with a cross at the end of each unfinished one."""
    for wall in ZIGZAG.walls():
        axes.plot(*wall.T, color=INK, linewidth=1.5)
    paths = [drive.x[:, :2] for drive in drives]
    lines = draw_paths(axes, paths, [drive.t for drive in drives], "viridis", top=20.0)

    lost = [drive for drive in drives if drive.outcome != "finished"]
    ends_x = [drive.x[-1, 0] for drive in lost]
    ends_y = [drive.x[-1, 1] for drive in lost]
    axes.plot(ends_x, ends_y, "x", color=HIT, markersize=6, zorder=4)
    axes.plot(*ZIGZAG.points[0], "o", color=INK, zorder=5)
    axes.set_title(f"{name}: {len(drives) - len(lost)} of {len(drives)} reach the goal")
    return lines


def draw_drive_controls(drives: Mapping[str, Sequence[Drive]]) -> Figure:
    """Return a figure of the commands in the first seconds of the first attempts."""
    titles = ("throttle and brake", "steering")
    with rc_context(STYLE):
        figure = Figure(figsize=(9, 5), dpi=110, layout="constrained")
        rows = figure.subplots(2, 1, sharex=True)
        for channel, (axes, title) in enumerate(zip(rows, titles, strict=True)):
            for name in ("gaussian", "colored"):
                first = drives[name][0]
                early = first.t <= SECONDS_SHOWN
                look = line(style(name))
                axes.plot(
                    first.t[early], first.u[early, channel], **look, linewidth=1.1, label=name
                )
            axes.axhline(0.0, color=LIMIT, linewidth=0.8)
            axes.set(title=title, ylim=(-1.05, 1.05))
        rows[0].legend(loc="lower right", ncols=2)
        rows[-1].set_xlabel("t [s]")
    return figure
