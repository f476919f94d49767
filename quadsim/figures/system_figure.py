"""A run of any system on one page: the path from above, states and controls over time, spectra of
the controls.

A quadrotor's has its own page, see run_figure; what both show is here.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure, SubFigure

from quadsim.course.corridor import Corridor
from quadsim.course.point_goal import PointGoal
from quadsim.figures.style import line
from quadsim.palette import FINE, HIT, INK, LIMIT, NEXT, style
from quadsim.record.metrics import thrust_psd
from quadsim.record.run import Run, flown_with, not_comparable, system_of, units_of
from quadsim.spec.systems import SYSTEMS

MARKS = {  # event -> marker, colour, label
    "hit": ("X", HIT, "hit"),
    "ground": ("P", HIT, "ground"),
    "bounds": ("s", HIT, "out of bounds"),
    "wall": ("X", HIT, "wall"),
    "stuck": ("s", HIT, "stuck"),
    "miss": ("v", INK, "miss"),
    "wrong_way": ("<", INK, "wrong way"),
    "pass": (".", INK, "passed"),
}
COMMANDED = 2.0  # width of lines
FEWEST = 16  # frames of a spectrum
PLANE = ("px", "py")  # the first two states of a system that has a path from above


def draw_system(figure: Figure, run: Run) -> None:
    states, controls = units_of(run.spec)
    with_map = tuple(states)[:2] == PLANE
    columns = figure.subfigures(
        1, 2 + with_map, width_ratios=(1.4, 1, 1)[-2 - with_map :], squeeze=False
    )[0]
    if with_map:
        _draw_map(columns[0].subplots(), run)
    _draw_states(columns[-2], run, states)
    over_time, over_frequency = columns[-1].subfigures(2, 1, squeeze=False)[:, 0]
    _draw_controls(over_time, run, controls)
    _draw_spectra(over_frequency, run, controls)


def title(run: Run) -> str:
    laps = ", ".join(f"{t:.3f} s" for t in run.laps[:6]) + (", ..." if len(run.laps) > 6 else "")
    times = f"laps {laps}" if laps else ""
    times = times if system_of(run.spec) == "quadrotor" else f"{run.duration:.3f} s"
    what = f"{run.spec['course']}: {run.outcome}" + (f", {times}" if times else "")
    return "\n".join(
        text for text in (what, flown_with(run.spec), not_comparable(run.spec)) if text
    )


def draw_path(axes: Axes, points: np.ndarray, speed: np.ndarray) -> LineCollection:
    """points: (frames, 2); speed: (frames,). Coloured by speed, fast is bright, with one scale for
    all laps."""
    segments = np.stack([points[:-1], points[1:]], axis=1)  # (frames - 1, 2, 2)
    lines = LineCollection(list(segments), cmap="plasma", linewidths=1.8, capstyle="round")
    lines.set_array(speed[:-1])
    lines.set_clim(0.0, max(float(speed.max(initial=0.0)), 1.0))
    axes.add_collection(lines)
    axes.plot(
        *points[:1].T,
        marker="o",
        color="white",
        markeredgecolor="black",
        markersize=6,
        label="start",
    )
    return lines


def draw_events(axes: Axes, run: Run, plane: tuple[int, int]) -> None:
    """plane: world axes."""
    for kind, (marker, colour, name) in MARKS.items():
        at = np.array([e.position for e in run.events if e.kind == kind])
        if len(at):
            look = {
                "markersize": 7 if kind == "pass" else 11,
                "markeredgecolor": "white",
                "zorder": 5,
            }
            axes.plot(*at[:, plane].T, marker, color=colour, label=name, **look)


def draw_place(axes: Axes, course: object) -> None:
    """The walls of a corridor, the goal of a point mass; nothing of what is unknown."""
    if isinstance(course, Corridor):
        walls = course.walls()  # (2, points, 2)
        for wall in walls:
            axes.plot(*wall.T, color=INK, linewidth=1.5)
        axes.plot(*walls[:, -1].T, color=NEXT, linewidth=1.5, label="goal")
    elif isinstance(course, PointGoal):
        axes.plot(*course.goal, "*", color=NEXT, markersize=12, label="goal")


def _draw_map(axes: Axes, run: Run) -> None:
    """x and y to scale; speed from one frame to the next."""
    x = run.telemetry
    points = np.stack([x[name] for name in PLANE], axis=1)  # (frames, 2)
    way = np.linalg.norm(np.diff(points, axis=0), axis=1)
    speed = np.append(way / np.diff(x["t"]), 0.0)[: len(points)]
    if (system := system_of(run.spec)) in SYSTEMS:
        draw_place(axes, SYSTEMS[system].parse_course(run.spec["course_text"], run.spec["course"]))
    lines = draw_path(axes, points, speed)
    draw_events(axes, run, (0, 1))
    axes.set(title="from above", xlabel="x [m]", ylabel="y [m]")
    axes.set_aspect("equal", adjustable="datalim")
    axes.margins(0.07)
    axes.legend(loc="best")
    axes.figure.colorbar(
        lines, ax=axes, label="speed [m/s]", aspect=50, pad=0.01, location="bottom"
    )


def _draw_states(figure: SubFigure, run: Run, units: Mapping[str, str]) -> None:
    x = run.telemetry
    rows = figure.subplots(len(units), 1, sharex=True, squeeze=False)[:, 0]
    for axes, (name, unit) in zip(rows, units.items(), strict=True):
        axes.plot(x["t"], x[name], color=INK, linewidth=1.2)
        _label(axes, run, name, unit)
    figure.align_ylabels(list(rows))
    rows[0].set_title("states")
    rows[-1].set_xlabel("t [s]")


def _draw_controls(figure: SubFigure, run: Run, units: Mapping[str, str]) -> None:
    x, colour = run.telemetry, style(run.spec["sampler"]).colour
    rows = figure.subplots(len(units), 1, sharex=True, squeeze=False)[:, 0]
    for axes, (name, unit) in zip(rows, units.items(), strict=True):
        axes.step(
            x["t"], x[name], where="post", color=colour, linewidth=COMMANDED, label="commanded"
        )
        _label(axes, run, name, unit)
    rows[0].set_title("controls, commanded")
    rows[-1].set_xlabel("t [s]")


def _label(axes: Axes, run: Run, name: str, unit: str) -> None:
    """And a line at the end of every leg."""
    for e in run.events:
        if e.kind == "pass":
            axes.axvline(e.t, color=LIMIT, linewidth=0.8)
    axes.set_ylabel(name if unit == "1" else f"{name} [{unit.replace('^2', '$^2$')}]")
    axes.margins(x=0.01)
    axes.label_outer()


def _draw_spectra(figure: SubFigure, run: Run, units: Mapping[str, str]) -> None:
    x = run.telemetry
    rows = figure.subplots(len(units), 1, sharex=True, squeeze=False)[:, 0]
    look = line(style(run.spec["sampler"])) | {"linewidth": COMMANDED}
    for axes, name in zip(rows, units, strict=True):
        if len(x["t"]) >= FEWEST:
            f, psd = thrust_psd(x["t"], x[name])
            axes.loglog(f[1:], psd[1:], **look)
        axes.set_ylabel(name)
        axes.grid(which="minor", color=FINE, linewidth=0.4)
        axes.label_outer()
    rows[0].set_title("controls, power spectral density [unit$^2$/Hz]")
    rows[-1].set_xlabel("f [Hz]")
