"""Table I, quadrotor rows: the paper's settings on a course of ours; paths, fastest laps."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure

from quadsim.app.campaign.variants import Variant
from quadsim.app.figures.style import STYLE, write_figure
from quadsim.app.paper.result import Result, csv_rows, draw_paths, flown, load_runs, table1, table1_row, write_csv
from quadsim.course import load_course
from quadsim.palette import INK, style
from quadsim.race.spec import Spec
from quadsim.record.metrics import chatter
from quadsim.record.run import Run
from quadsim.systems.quadrotor import CONTROL

COURSE = "paper_flat"
LAPS_SHOWN = 9  # as in the paper
COLUMNS = ("t", "px", "py", "vx", "vy", *CONTROL)


def quadrotor(runs: int, folder: Path) -> Result:
    variants = [Variant(name, Spec.of(COURSE, preset="paper", sampler=name)) for name in ("gaussian", "colored")]
    attempts = flown(variants, runs, folder)
    flights = load_runs(attempts, folder)
    table = [table1_row("quadrotor", name, rows) | _mean_chatter(flights[name]) for name, rows in attempts.items()]
    finished = {name: [run for run in every if run.outcome == "finished"] for name, every in flights.items()}
    fastest = {name: min(done, key=lambda run: run.laps[0]) for name, done in finished.items() if done}
    figure = _draw(finished, fastest, runs)
    files = (
        write_csv(folder / "quadrotor.csv", table),
        *write_figure(figure, folder, "quadrotor_laps"),
        *(write_csv(folder / f"quadrotor_{name}_fastest.csv", [*csv_rows(x, COLUMNS)]) for name, x in fastest.items()),
    )
    return Result({"variants": table}, (table1(table, "TV", "thrust_tv"),), files)


def _mean_chatter(flights: Sequence[Run]) -> dict:
    """Of the commanded thrust: total variation [m/s^2/s], share of the power above the motors' corner."""
    each = [chatter(run)["commanded"] for run in flights]
    return {key: float(np.mean([c[key] for c in each])) for key in ("thrust_tv", "high_frequency_fraction")}


def _draw(finished: dict[str, list[Run]], fastest: dict[str, Run], attempts: int) -> Figure:
    with rc_context(STYLE):
        figure = Figure(figsize=(12, 8), dpi=110, layout="constrained")
        parts = figure.subfigures(len(finished), 1, squeeze=False)[:, 0]
        for part, (name, flights) in zip(parts, finished.items(), strict=True):
            left, right = part.subfigures(1, 2, width_ratios=(1.5, 1))
            laps = flights[:LAPS_SHOWN]
            axes = _draw_laps(left, laps)
            axes.set_title(f"{name}: first {len(laps)} laps that finished, of {attempts} attempts")
            if laps:
                _draw_controls(right.subplots(4, 1, sharex=True), name, fastest[name])
    return figure


def _draw_laps(part: SubFigure, laps: Sequence[Run]) -> Axes:
    axes = part.subplots()
    speeds = [np.hypot(run.telemetry["vx"], run.telemetry["vy"]) for run in laps]
    lines = draw_paths(axes, laps, speeds, "plasma", top=12.0)
    part.colorbar(lines, ax=axes, label="ground speed [m/s]", pad=0.01, shrink=0.6)
    for gate in load_course(COURSE).gates:
        half = gate.opening[0] / 2 * gate.rotation[:2, 1]
        axes.plot(*np.array([gate.position[:2] - half, gate.position[:2] + half]).T, color=INK, linewidth=3.0)
    axes.margins(0.03)
    return axes


def _draw_controls(rows: np.ndarray, sampler: str, run: Run) -> None:
    names = ("roll [rad/s]", "pitch [rad/s]", "yaw [rad/s]", "thrust [m/s$^2$]")
    for axes, column, title in zip(rows, CONTROL, names, strict=True):
        axes.step(run.telemetry["t"], run.telemetry[column], where="post", color=style(sampler).colour, linewidth=0.9)
        axes.set_ylabel(title)
    rows[0].set_title(f"controls of the fastest lap, {run.laps[0]:.2f} s")
    rows[-1].set_xlabel("t [s]")
