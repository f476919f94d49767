"""Table I, off-road rows, in simulation: who gets through the corridor, how fast; two figures."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.figure import Figure

from quadsim.app.campaign.variants import Variant
from quadsim.app.figures.style import STYLE, line, write_figure
from quadsim.app.paper.result import Result, csv_rows, draw_paths, flown, load_runs, table1, table1_row, write_csv
from quadsim.course.corridor import load_corridor
from quadsim.palette import HIT, INK, LIMIT, style
from quadsim.race.spec import Spec
from quadsim.record.run import Run
from quadsim.systems.offroad import CONTROL_UNITS, STATE_UNITS

CORRIDOR = "zigzag"
VARIANTS: dict[str, dict] = {  # name -> settings
    "gaussian": {"sampler": "gaussian"},
    "colored": {"sampler": "colored"},
    "gaussian_cold": {"sampler": "gaussian", "temperature": 0.02},  # does the temperature hold it back?
}
COLUMNS = ("t", *STATE_UNITS, *CONTROL_UNITS)
SHOWN = 8.0  # seconds of controls, as in the paper


def offroad(runs: int, folder: Path) -> Result:
    """A quarter as many runs at the lower temperature."""
    *paper, cold = (Variant(name, spec(**settings)) for name, settings in VARIANTS.items())
    attempts = flown(paper, runs, folder) | flown([cold], -(-runs // 4), folder)
    drives = load_runs(attempts, folder)
    table = [table1_row("offroad", name, rows) | _ends(drives[name]) for name, rows in attempts.items()]
    files = (
        write_csv(folder / "offroad.csv", table),
        *write_figure(_draw_paths(drives), folder, "offroad_paths"),
        *write_figure(_draw_controls(drives), folder, "offroad_controls"),
        *(_csv(folder, name, of_variant) for name, of_variant in drives.items()),
    )
    return Result({"variants": table}, (table1(table, "legs", "mean_legs"),), files)


def spec(**settings: Any) -> Spec:
    """A drive through the corridor with its random disturbance."""
    return Spec.of(CORRIDOR, randomize=1.0, **settings)


def _ends(drives: Sequence[Run]) -> dict:
    """How many legs were driven to their end line, and how attempts ended that did not finish."""
    outcomes = [run.outcome for run in drives]
    ended = {outcome: outcomes.count(outcome) for outcome in ("crashed", "stuck", "timeout")}
    return {"mean_legs": float(np.mean([run.telemetry["passed"][-1] for run in drives]))} | ended


def _draw_paths(drives: dict[str, list[Run]]) -> Figure:
    """Every attempt, coloured by the time since its start; a cross where one ended before the goal."""
    corridor = load_corridor(CORRIDOR)
    with rc_context(STYLE):
        figure = Figure(figsize=(13, 5), dpi=110, layout="constrained")
        for axes, (name, runs) in zip(figure.subplots(1, len(drives), sharey=True), drives.items(), strict=True):
            for wall in corridor.walls():
                axes.plot(*wall.T, color=INK, linewidth=1.5)
            lines = draw_paths(axes, runs, [run.telemetry["t"] for run in runs], "viridis", top=20.0)
            lost = [run.telemetry for run in runs if run.outcome != "finished"]
            axes.plot([x["px"][-1] for x in lost], [x["py"][-1] for x in lost], "x", color=HIT, markersize=6, zorder=4)
            axes.plot(*corridor.points[0], "o", color=INK, zorder=5)
            axes.set_title(f"{name}: {len(runs) - len(lost)} of {len(runs)} reach the goal")
        figure.colorbar(lines, ax=figure.axes, label="t [s]", pad=0.01)
    return figure


def _draw_controls(drives: dict[str, list[Run]]) -> Figure:
    """Commands in the first seconds of the first attempts; throttle above zero, brake below."""
    with rc_context(STYLE):
        figure = Figure(figsize=(9, 5), dpi=110, layout="constrained")
        rows = figure.subplots(2, 1, sharex=True)
        for axes, column, title in zip(rows, CONTROL_UNITS, ("throttle and brake", "steering"), strict=True):
            for name in ("gaussian", "colored"):
                x = drives[name][0].telemetry
                early = x["t"] <= SHOWN
                axes.plot(x["t"][early], x[column][early], **line(style(name)), linewidth=1.1, label=name)
            axes.axhline(0.0, color=LIMIT, linewidth=0.8)
            axes.set(title=title, ylim=(-1.05, 1.05))
        rows[0].legend(loc="lower right", ncols=2)
        rows[-1].set_xlabel("t [s]")
    return figure


def _csv(folder: Path, name: str, drives: Sequence[Run]) -> Path:
    rows = [{"attempt": i} | row for i, run in enumerate(drives) for row in csv_rows(run, COLUMNS)]
    return write_csv(folder / f"offroad_{name}.csv", rows)
