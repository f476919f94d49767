"""The picture of faults.md: three flights of a lap, each with one fault, beside one without.

.venv/bin/python docs/faults_figures.py
"""

from __future__ import annotations

from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from shared import save, use_style

import quadsim
from quadsim.course import load_course
from quadsim.figures.course import draw_gates
from quadsim.figures.run_figure import draw_faults
from quadsim.palette import HIT, INK, LIMIT, SPARE
from quadsim.record.run import RecordedRun

COURSE = "split_s_swift"
SETTINGS: dict[str, Any] = {"laps": 1, "seed": 0}
FAULTS = ("rotor2=.7@2", "rotor2=0@2", "commands=lost@2~.3")
# seconds before and after the beginning of the faults that are drawn over time
BEFORE = 0.3
AFTER = 1.2
BEGIN = 2.0


def main() -> None:
    """Fly and draw the picture."""
    use_style()
    sound = quadsim.fly(COURSE, **SETTINGS)
    figure, axes = plt.subplots(
        3, len(FAULTS), figsize=(10.5, 7.6), height_ratios=(2.2, 1, 1), sharex="row", sharey="row"
    )
    for column, fault in zip(axes.T, FAULTS, strict=True):
        faulty = quadsim.fly(COURSE, fault=fault, **SETTINGS)
        above, thrust, roll = column
        draw_paths(above, sound, faulty)
        above.set_title(f"{fault}: {outcome(faulty)}")
        draw_column(thrust, faulty, "a")
        draw_column(roll, faulty, "wx")
        above.set_xlabel("x [m]")
        roll.set_xlabel("t [s]")
    for row, label in zip(axes, ("y [m]", "thrust [m/s$^2$]", "roll rate [rad/s]"), strict=True):
        row[0].set_ylabel(label)
    figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside upper center", ncols=4)
    axes[1, 2].legend(loc="lower right")
    save(figure, "faults.png")


def outcome(run: RecordedRun) -> str:
    """Return how and when a flight ended."""
    return f"{run.outcome}, {run.duration:.2f} s"


def draw_paths(axes: Axes, sound: RecordedRun, faulty: RecordedRun) -> None:
    """Draw both paths from above, and where the fault began."""
    draw_gates(axes, load_course(COURSE), (0, 1), 1.0)
    for run, colour, label in ((sound, LIMIT, "no fault"), (faulty, SPARE[0].colour, "fault")):
        x = run.telemetry
        axes.plot(x["px"], x["py"], color=colour, linewidth=1.6, label=label)
    k = int(np.searchsorted(faulty.telemetry["t"], BEGIN))
    x = faulty.telemetry
    axes.plot(x["px"][k], x["py"][k], "o", color=HIT, label="it begins")
    if faulty.outcome == "crashed":
        axes.plot(x["px"][-1], x["py"][-1], "X", color=HIT, label="crash", markersize=9)
    axes.set_aspect("equal")


def draw_column(axes: Axes, run: RecordedRun, name: str) -> None:
    """Draw a column of telemetry around the fault, commanded and delivered."""
    x = run.telemetry
    shown = (x["t"] >= BEGIN - BEFORE) & (x["t"] <= BEGIN + AFTER)
    axes.step(x["t"][shown], x[f"{name}_cmd"][shown], where="post", color=LIMIT, label="commanded")
    axes.plot(x["t"][shown], x[name][shown], color=INK, linewidth=1.0, label="delivered")
    draw_faults(axes, run)
    axes.set_xlim(BEGIN - BEFORE, BEGIN + AFTER)


if __name__ == "__main__":
    main()
