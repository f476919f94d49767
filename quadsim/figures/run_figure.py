"""The figure of a run: its path from above and from the side, thrust, body rates, spectrum."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure, SubFigure

from quadsim.course import Course
from quadsim.figures.course import (
    ABOVE,
    arrow_scale,
    draw_gates,
    draw_obstacles,
    draw_start,
)
from quadsim.figures.notebook_figure import NotebookFigure
from quadsim.figures.style import STYLE, line
from quadsim.limit.limits import StoredSolution
from quadsim.palette import FINE, HIT, INK, LIMIT, MARK, SPARE, style
from quadsim.physics.faults import parse_fault
from quadsim.record.run import RecordedRun, flown_by
from quadsim.report.estimate_metrics import estimate_errors
from quadsim.report.metrics import motor_corner, motor_tau, speed, thrust_psd
from quadsim.report.run_text import flown_with, not_comparable


class Mark(NamedTuple):
    """The look of an event on the map."""

    marker: str
    colour: str
    label: str
    size: float = 11.0


MARKS = {
    "hit": Mark("X", HIT, "hit"),
    "ground": Mark("P", HIT, "ground"),
    "bounds": Mark("s", HIT, "out of bounds"),
    "stuck": Mark("s", HIT, "stuck"),
    "miss": Mark("v", INK, "miss"),
    "wrong_way": Mark("<", INK, "wrong way"),
    "pass": Mark(".", INK, "passed", size=7.0),
}
# Line widths, such that both lines are visible if they coincide
COMMANDED = 2.0
DELIVERED = 0.8
# Of an estimate beside the truth
ESTIMATE = SPARE[0].colour
# Smallest number of frames of a spectrum
FEWEST = 16
# Largest number of laps in a title
LAPS = 6


def draw(run: RecordedRun, limit: StoredSolution | None = None) -> Figure:
    """Return the figure of a run.

    Args:
        run: run to draw.
        limit: the best known solution of the race, whose path is drawn as well.
    """
    course = run.course
    with rc_context(STYLE):
        figure = NotebookFigure(figsize=(15, 9.5), dpi=130, layout="constrained")
        left, right = figure.subfigures(1, 2, width_ratios=(1.25, 1), squeeze=False)[0]
        draw_views(left, run, course, limit)
        over_time, over_frequency = right.subfigures(2, 1, height_ratios=(3.9, 1.8))
        sensed = has_estimate(run)
        heights = (1.5, 0.8, 0.8, 0.8, *([0.8] if sensed else []))
        thrust, *rows = over_time.subplots(len(heights), 1, height_ratios=heights, sharex=True)
        draw_thrust(thrust, run)
        draw_rates(rows[:3], run)
        if sensed:
            draw_estimate_error(rows[3], run)
        rows[-1].set_xlabel("t [s]")
        draw_spectrum(over_frequency.subplots(), run)
        figure.suptitle(title(run), x=0.012, ha="left", fontsize=12)
    return figure


def draw_map(run: RecordedRun, course: Course) -> Figure:
    """Return a figure with only the path from above, small enough for a page of text.

    Args:
        run: run to draw.
        course: course of the run.
    """
    with rc_context(STYLE):
        figure = Figure(figsize=(6.4, 4.0), dpi=100, layout="constrained")
        axes = figure.subplots()
        scale = arrow_scale(np.vstack([positions(run), course.points()])[:, :2])
        lines = draw_view(axes, run, course, ABOVE, scale)
        axes.set_aspect("equal", adjustable="datalim")
        figure.colorbar(lines, ax=axes, label="speed [m/s]", aspect=40, pad=0.01)
    return figure


def title(run: RecordedRun) -> str:
    """Return the title of a run's figure: outcome, laps, and the main settings."""
    head = f"{run.course_name}: {run.outcome}"
    if run.laps:
        laps = ", ".join(f"{t:.3f} s" for t in run.laps[:LAPS])
        more = ", ..." if len(run.laps) > LAPS else ""
        head += f", laps {laps}{more}"
    lines = [head, flown_with(run.spec)]
    remark = not_comparable(run.spec)
    if remark:
        lines.append(remark)
    return "\n".join(lines)


def draw_views(
    figure: SubFigure, run: RecordedRun, course: Course, limit: StoredSolution | None = None
) -> None:
    """Draw the path from above, to scale, and from the side, the longer of x and y and the height.

    Args:
        figure: figure of matplotlib.
        run: run to draw.
        course: course of the run.
        limit: see `draw`.
    """
    extent = np.vstack([positions(run), course.points()])
    scale = arrow_scale(extent[:, :2])
    longer = int(np.argmax(np.ptp(extent[:, :2], axis=0)))
    from_side = (longer, 2)
    top, below = figure.subplots(2, 1, height_ratios=(2.7, 1.0))

    for axes, plane in ((top, ABOVE), (below, from_side)):
        lines = draw_view(axes, run, course, plane, scale)
        if limit:
            draw_limit(axes, limit, plane)
    top.set_title("from above")
    top.set_aspect("equal", adjustable="datalim")
    if top.get_legend_handles_labels()[1]:
        top.legend(loc="best")
    below.set_title("from the side, height stretched")
    below.axhline(0.0, color=MARK, linewidth=1.0)
    below.set_ylim(-0.3, float(extent[:, 2].max()) + 0.8)
    figure.colorbar(lines, ax=[top, below], label="speed [m/s]", aspect=50, pad=0.01)


def positions(run: RecordedRun) -> np.ndarray:
    """Return the position of every frame [m].  (frames, 3)"""
    x = run.telemetry
    return np.stack([x["px"], x["py"], x["pz"]], axis=1)


def draw_view(
    axes: Axes, run: RecordedRun, course: Course, plane: tuple[int, int], scale: float
) -> LineCollection:
    """Draw the path, the course and the events in one view.

    Args:
        axes: axes of matplotlib.
        run: run to draw.
        course: course of the run.
        plane: indices of the two world axes of the view.
        scale: result of `arrow_scale` [m].

    Returns:
        The path, for a colour bar of the speed.
    """
    lines = draw_path(axes, positions(run)[:, plane], speed(run))
    draw_gates(axes, course, plane, scale)
    draw_obstacles(axes, course, plane, scale)
    if has_estimate(run):
        draw_estimate(axes, run, plane)
    draw_events(axes, run, plane)
    horizontal, vertical = ("xyz"[axis] for axis in plane)
    axes.set(xlabel=f"{horizontal} [m]", ylabel=f"{vertical} [m]")
    axes.margins(0.07)
    return lines


def has_estimate(run: RecordedRun) -> bool:
    """Return whether a run flew on sensors."""
    return "est_px" in run.telemetry


def draw_estimate(axes: Axes, run: RecordedRun, plane: tuple[int, int]) -> None:
    """Draw the estimated path in the view of two world axes, and measured poses if stored."""
    x = run.telemetry
    estimated = np.stack([x["est_px"], x["est_py"], x["est_pz"]], axis=1)
    if run.measurements and "pose.position" in run.measurements:
        measured = run.measurements["pose.position"]
        look: dict[str, Any] = {"color": MARK, "markersize": 2.0, "zorder": 1.5}
        axes.plot(*measured[:, plane].T, ".", label="measured poses", **look)
    axes.plot(
        *estimated[:, plane].T,
        color=ESTIMATE,
        linestyle="--",
        linewidth=1.0,
        zorder=3,
        label="estimate",
    )


def draw_path(axes: Axes, points: np.ndarray, speed: np.ndarray) -> LineCollection:
    """Draw a path coloured by speed, bright for fast, with one scale for all laps.

    Args:
        axes: axes of matplotlib.
        points: the path in the view [m].  (frames, 2)
        speed: speed at each point [m/s]  (frames,).
    """
    segments = np.stack([points[:-1], points[1:]], axis=1)
    lines = LineCollection(list(segments), cmap="plasma", linewidths=1.8, capstyle="round")
    lines.set_array(speed[:-1])
    lines.set_clim(0.0, max(float(speed.max(initial=0.0)), 1.0))
    axes.add_collection(lines)
    if len(points):
        draw_start(axes, points[0])
    return lines


def draw_events(axes: Axes, run: RecordedRun, plane: tuple[int, int]) -> None:
    """Draw the places of a run's events in the view of two world axes."""
    for kind, mark in MARKS.items():
        places = np.array([event.position for event in run.events if event.kind == kind])
        if len(places):
            axes.plot(
                *places[:, plane].T,
                mark.marker,
                color=mark.colour,
                label=mark.label,
                markersize=mark.size,
                markeredgecolor="white",
                zorder=5,
            )


def draw_limit(axes: Axes, limit: StoredSolution, plane: tuple[int, int]) -> None:
    """Draw the path of the best known solution."""
    positions = limit.path()[:, 1:]
    axes.plot(
        *positions[:, plane].T,
        color=INK,
        linestyle="--",
        linewidth=0.8,
        zorder=2.5,
        label=f"best known limit, {limit.time:.3f} s",
    )


def draw_thrust(axes: Axes, run: RecordedRun) -> None:
    """Draw commanded and delivered thrust over time, with the vehicle's limit."""
    limit = run.spec["vehicle"]["thrust_max"]
    greatest = run.telemetry["a"].max(initial=1.0)
    _draw_pair(axes, run, "a_cmd", "a")
    axes.axhline(limit, color=LIMIT, linestyle=":", linewidth=1.2)
    axes.set_title("thrust, mass-normalised [m/s$^2$]")
    axes.set_ylim(-0.5, 1.05 * max(limit, greatest))
    axes.legend(loc="lower right", ncols=2)


def draw_rates(rows: Sequence[Axes], run: RecordedRun) -> None:
    """Draw commanded and delivered roll, pitch and yaw rates over time, one in each row."""
    for axes, name, axis in zip(rows, ("roll", "pitch", "yaw"), "xyz", strict=True):
        _draw_pair(axes, run, f"w{axis}_cmd", f"w{axis}")
        axes.set_ylabel(name)
        axes.label_outer()
    rows[0].set_title("body rates [rad/s]")


def draw_estimate_error(axes: Axes, run: RecordedRun) -> None:
    """Draw the error of the estimated position over time, and the error that the filter expects.

    The expected error is the root of the trace of the position's covariance.
    """
    x = run.telemetry
    off = np.linalg.norm(estimate_errors(run), axis=1)
    expected = np.sqrt(x["cov_xx"] + x["cov_yy"] + x["cov_zz"])
    axes.plot(x["t"], off, color=ESTIMATE, linewidth=COMMANDED, label="off the true position")
    axes.plot(x["t"], expected, color=INK, linewidth=DELIVERED, label="standard deviation")
    draw_faults(axes, run)
    axes.margins(x=0.01)
    axes.set_ylim(bottom=0.0)
    axes.set_title("estimated position [m]")
    axes.legend(loc="upper left", ncols=2)
    axes.label_outer()


def _draw_pair(axes: Axes, run: RecordedRun, commanded: str, delivered: str) -> None:
    """Draw two columns over time, a line at the end of each lap, and a band for each fault."""
    x = run.telemetry
    colour = style(flown_by(run.spec)).colour
    look: dict[str, Any] = {"color": colour, "linewidth": COMMANDED, "label": "commanded"}
    axes.step(x["t"], x[commanded], where="post", **look)
    axes.plot(x["t"], x[delivered], color=INK, linewidth=DELIVERED, label="delivered")
    for end in np.cumsum(run.laps):
        axes.axvline(end, color=LIMIT, linewidth=0.8)
    draw_faults(axes, run)
    axes.margins(x=0.01)


def draw_faults(axes: Axes, run: RecordedRun) -> None:
    """Draw a band over the time of each fault of a run."""
    for text in run.spec.get("drawn_faults", ()):
        window = parse_fault(text).window
        end = min(window.end, run.duration)
        if window.start is not None and window.start < end:
            axes.axvspan(window.start, end, color=HIT, alpha=0.12, linewidth=0)


def draw_spectrum(axes: Axes, run: RecordedRun) -> None:
    """Draw the thrust's power spectral density and the corner frequency of the motors."""
    x = run.telemetry
    axes.set(title="thrust, power spectral density [(m/s$^2$)$^2$/Hz]", xlabel="f [Hz]")
    if len(x["t"]) < FEWEST:
        return
    look = line(style(flown_by(run.spec))) | {"linewidth": COMMANDED}
    f, psd = thrust_psd(x["t"], x["a_cmd"])
    axes.loglog(f[1:], psd[1:], **look, label="commanded")
    f, psd = thrust_psd(x["t"], x["a"])
    axes.loglog(f[1:], psd[1:], color=INK, linewidth=DELIVERED, label="delivered")
    corner = motor_corner(motor_tau(run.spec["vehicle"]))
    name = f"motors' corner, {corner:.1f} Hz"
    axes.axvline(corner, color=MARK, linestyle="--", linewidth=1.0, label=name)
    axes.grid(which="minor", color=FINE, linewidth=0.4)
    axes.legend(loc="lower left")
