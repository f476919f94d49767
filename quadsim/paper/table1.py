"""Table I. Quadrotor rows: the paper's settings on a course of ours. Off-road rows in simulation:
who gets through the corridor, and how fast. With paths and controls of each.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure, SubFigure

from quadsim.campaign.variants import Variant
from quadsim.course import load_course
from quadsim.course.corridor import load_corridor
from quadsim.course.opening import half_sizes
from quadsim.dynamics.quadrotor import CONTROL
from quadsim.figures.style import STYLE, line, write_figure
from quadsim.palette import HIT, INK, LIMIT, style
from quadsim.paper.offroad import CONTROL_UNITS, STATE_UNITS
from quadsim.paper.result import Result, flown, load_runs, table1, table1_row, write_csv
from quadsim.record.metrics import chatter
from quadsim.record.run import Run
from quadsim.spec.spec import Spec

COURSE, CORRIDOR = "paper_flat", "zigzag"
DRIVES: dict[str, dict] = {  # name -> settings
    "gaussian": {"sampler": "gaussian"},
    "colored": {"sampler": "colored"},
    # does the temperature hold it back?
    "gaussian_cold": {"sampler": "gaussian", "temperature": 0.02},
}
# paths of the quadrotor, controls of the off-road vehicle; as in the paper
LAPS_SHOWN, SECONDS_SHOWN = 9, 8.0


def quadrotor(runs: int, folder: Path) -> Result:
    variants = [
        Variant(name, Spec.of(COURSE, preset="paper", sampler=name))
        for name in ("gaussian", "colored")
    ]
    attempts = flown(variants, runs, folder)
    flights = load_runs(variants, attempts, folder)
    table = [
        table1_row("quadrotor", name, rows) | _mean_chatter(flights[name])
        for name, rows in attempts.items()
    ]
    files = [
        write_csv(folder / "quadrotor.csv", table),
        *write_figure(_draw_laps(flights), folder, "quadrotor_laps"),
    ]
    for name, of_sampler in flights.items():
        if run := _fastest(of_sampler):
            rows = list(_csv_rows(run, ("t", "px", "py", "vx", "vy", *CONTROL)))
            files.append(write_csv(folder / f"quadrotor_{name}_fastest.csv", rows))
    return Result({"variants": table}, (table1(table, "TV", "thrust_tv"),), tuple(files))


def offroad(runs: int, folder: Path) -> Result:
    """A quarter as many runs at the lower temperature."""
    *paper, cold = (Variant(name, drive(**settings)) for name, settings in DRIVES.items())
    attempts = flown(paper, runs, folder) | flown([cold], -(-runs // 4), folder)
    drives = load_runs([*paper, cold], attempts, folder)
    table = [
        table1_row("offroad", name, rows) | _ends(drives[name]) for name, rows in attempts.items()
    ]
    files = [
        write_csv(folder / "offroad.csv", table),
        *write_figure(_draw_drives(drives), folder, "offroad_paths"),
        *write_figure(_draw_drive_controls(drives), folder, "offroad_controls"),
    ]
    for name, of_variant in drives.items():
        each = (_csv_rows(run, ("t", *STATE_UNITS, *CONTROL_UNITS)) for run in of_variant)
        rows = [{"attempt": i} | row for i, of_run in enumerate(each) for row in of_run]
        files.append(write_csv(folder / f"offroad_{name}.csv", rows))
    return Result({"variants": table}, (table1(table, "legs", "mean_legs"),), tuple(files))


def drive(**settings: Any) -> Spec:
    """Through the corridor with its random disturbance."""
    return Spec.of(CORRIDOR, randomize=1.0, **settings)


def _mean_chatter(flights: Sequence[Run]) -> dict:
    """Of the commanded thrust: total variation [m/s^2/s], share of the power above the motors'
    corner."""
    each = [chatter(run)["commanded"] for run in flights]
    return {
        key: float(np.mean([c[key] for c in each]))
        for key in ("thrust_tv", "high_frequency_fraction")
    }


def _ends(drives: Sequence[Run]) -> dict:
    """How many legs were driven to their end line, and how attempts ended that did not finish."""
    outcomes = [run.outcome for run in drives]
    ended = {outcome: outcomes.count(outcome) for outcome in ("crashed", "stuck", "timeout")}
    return {"mean_legs": float(np.mean([run.telemetry["passed"][-1] for run in drives]))} | ended


def _finished(runs: Sequence[Run]) -> list[Run]:
    return [run for run in runs if run.outcome == "finished"]


def _fastest(flights: Sequence[Run]) -> Run | None:
    return min(_finished(flights), key=lambda run: run.laps[0], default=None)


def _csv_rows(run: Run, columns: Sequence[str]) -> Iterator[dict]:
    """These columns of the telemetry, a row for each control step, to five decimals."""
    for values in zip(*(run.telemetry[name].tolist() for name in columns), strict=True):
        yield {name: round(v, 5) for name, v in zip(columns, values, strict=True)}


def _draw_paths(
    axes: Axes, runs: list[Run], colours: list[np.ndarray], cmap: str, top: float
) -> LineCollection:
    """Every run from above; colours: a number from 0 to `top` for each of its control steps."""
    paths = [np.column_stack([run.telemetry["px"], run.telemetry["py"]]) for run in runs]
    segments = [segment for p in paths for segment in np.stack([p[:-1], p[1:]], axis=1)]
    lines = LineCollection(segments, cmap=cmap, linewidths=1.1)
    lines.set_array(np.concatenate([np.zeros(0), *(c[:-1] for c in colours)]))
    lines.set_clim(0.0, top)
    axes.add_collection(lines)
    axes.set(aspect="equal", xlabel="x [m]", ylabel="y [m]")
    return lines


def _draw_laps(flights: dict[str, list[Run]]) -> Figure:
    """For each sampler the first laps that finished, and the controls of the fastest."""
    with rc_context(STYLE):
        figure = Figure(figsize=(12, 8), dpi=110, layout="constrained")
        parts = figure.subfigures(len(flights), 1, squeeze=False)[:, 0]
        for part, (name, of_sampler) in zip(parts, flights.items(), strict=True):
            left, right = part.subfigures(1, 2, width_ratios=(1.5, 1))
            _draw_first_laps(left, name, of_sampler)
            if run := _fastest(of_sampler):
                _draw_lap_controls(right.subplots(4, 1, sharex=True), name, run)
    return figure


def _draw_first_laps(part: SubFigure, sampler: str, flights: Sequence[Run]) -> None:
    axes, laps = part.subplots(), _finished(flights)[:LAPS_SHOWN]
    speeds = [np.hypot(run.telemetry["vx"], run.telemetry["vy"]) for run in laps]
    lines = _draw_paths(axes, laps, speeds, "plasma", top=12.0)
    part.colorbar(lines, ax=axes, label="ground speed [m/s]", pad=0.01, shrink=0.6)
    axes.set_title(f"{sampler}: first {len(laps)} laps that finished, of {len(flights)} attempts")
    for gate in load_course(COURSE).gates:
        half = half_sizes(gate.opening).left * gate.rotation[:2, 1]
        axes.plot(
            *np.array([gate.position[:2] - half, gate.position[:2] + half]).T,
            color=INK,
            linewidth=3.0,
        )
    axes.margins(0.03)


def _draw_lap_controls(rows: np.ndarray, sampler: str, run: Run) -> None:
    names = ("roll [rad/s]", "pitch [rad/s]", "yaw [rad/s]", "thrust [m/s$^2$]")
    for axes, column, title in zip(rows, CONTROL, names, strict=True):
        axes.step(
            run.telemetry["t"],
            run.telemetry[column],
            where="post",
            color=style(sampler).colour,
            linewidth=0.9,
        )
        axes.set_ylabel(title)
    rows[0].set_title(f"controls of the fastest lap, {run.laps[0]:.2f} s")
    rows[-1].set_xlabel("t [s]")


def _draw_drives(drives: dict[str, list[Run]]) -> Figure:
    """Every attempt, coloured by the time since its start; a cross where one ended before the
    goal."""
    corridor = load_corridor(CORRIDOR)
    with rc_context(STYLE):
        figure = Figure(figsize=(13, 5), dpi=110, layout="constrained")
        for axes, (name, runs) in zip(
            figure.subplots(1, len(drives), sharey=True), drives.items(), strict=True
        ):
            for wall in corridor.walls():
                axes.plot(*wall.T, color=INK, linewidth=1.5)
            lines = _draw_paths(
                axes, runs, [run.telemetry["t"] for run in runs], "viridis", top=20.0
            )
            lost = [run.telemetry for run in runs if run.outcome != "finished"]
            axes.plot(
                [x["px"][-1] for x in lost],
                [x["py"][-1] for x in lost],
                "x",
                color=HIT,
                markersize=6,
                zorder=4,
            )
            axes.plot(*corridor.points[0], "o", color=INK, zorder=5)
            axes.set_title(f"{name}: {len(runs) - len(lost)} of {len(runs)} reach the goal")
        figure.colorbar(lines, ax=figure.axes, label="t [s]", pad=0.01)
    return figure


def _draw_drive_controls(drives: dict[str, list[Run]]) -> Figure:
    """Commands in the first seconds of the first attempts; throttle above zero, brake below."""
    with rc_context(STYLE):
        figure = Figure(figsize=(9, 5), dpi=110, layout="constrained")
        rows = figure.subplots(2, 1, sharex=True)
        for axes, column, title in zip(
            rows, CONTROL_UNITS, ("throttle and brake", "steering"), strict=True
        ):
            for name in ("gaussian", "colored"):
                x = drives[name][0].telemetry
                early = x["t"] <= SECONDS_SHOWN
                axes.plot(
                    x["t"][early], x[column][early], **line(style(name)), linewidth=1.1, label=name
                )
            axes.axhline(0.0, color=LIMIT, linewidth=0.8)
            axes.set(title=title, ylim=(-1.05, 1.05))
        rows[0].legend(loc="lower right", ncols=2)
        rows[-1].set_xlabel("t [s]")
    return figure
