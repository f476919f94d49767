"""A run on one page: the path from above and from the side, thrust, body rates, and spectrum."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure, SubFigure
from matplotlib.patheffects import withStroke

from quadsim.course import Course, Gate, parse_course
from quadsim.course.opening import outer_half_sizes
from quadsim.figures.style import STYLE, line
from quadsim.palette import FINE, FRAME, HIT, INK, LIMIT, MARK, style
from quadsim.record.limits import Limit
from quadsim.record.metrics import motor_corner, motor_tau, thrust_psd
from quadsim.record.run import Run, flown_with, not_comparable

NUMBER: dict[str, Any] = {"ha": "center", "va": "center", "weight": "bold", "zorder": 6}
NUMBER["path_effects"] = [withStroke(linewidth=2.5, foreground="white")]
COMMANDED = 2.0  # width of lines
DELIVERED = 0.8  # less than COMMANDED: both are seen where they agree
FEWEST = 16  # frames of a spectrum
LAPS_IN_TITLE = 6


class Mark(NamedTuple):
    """How the events of a kind are drawn."""

    marker: str
    colour: str
    label: str
    size: int = 11


MARKS = {  # by kind of event
    "hit": Mark("X", HIT, "hit"),
    "ground": Mark("P", HIT, "ground"),
    "bounds": Mark("s", HIT, "out of bounds"),
    "stuck": Mark("s", HIT, "stuck"),
    "miss": Mark("v", INK, "miss"),
    "wrong_way": Mark("<", INK, "wrong way"),
    "pass": Mark(".", INK, "passed", size=7),
}


def draw(run: Run, limit: Limit | None = None) -> Figure:
    """limit: the best known one of the run's race, whose path is drawn as well."""
    with rc_context(STYLE):
        figure = Figure(figsize=(15, 9.5), dpi=130, layout="constrained")
        _draw_race(figure, run, limit)
        figure.suptitle(title(run), x=0.012, ha="left", fontsize=12)
    return figure


def _draw_race(figure: Figure, run: Run, limit: Limit | None) -> None:
    left, right = figure.subfigures(1, 2, width_ratios=(1.25, 1), squeeze=False)[0]
    draw_views(left, run, parse_course(run.spec["course_text"], run.spec["course"]), limit)
    over_time, over_frequency = right.subfigures(2, 1, height_ratios=(3.9, 1.8), squeeze=False)[
        :, 0
    ]
    thrust, *rates = over_time.subplots(4, 1, height_ratios=(1.5, 0.8, 0.8, 0.8), sharex=True)
    draw_thrust(thrust, run)
    draw_rates(rates, run)
    draw_spectrum(over_frequency.subplots(), run)


def draw_views(figure: SubFigure, run: Run, course: Course, limit: Limit | None = None) -> None:
    """Above, x and y to scale; below, the longer of both and the height."""
    x = run.telemetry
    points = np.stack([x[k] for k in ("px", "py", "pz")], axis=1)  # (frames, 3)
    speed = np.sqrt(x["vx"] ** 2 + x["vy"] ** 2 + x["vz"] ** 2)
    extent = np.vstack([points, course.points()])
    side = int(np.argmax(np.ptp(extent[:, :2], axis=0)))
    scale = arrow_scale(extent[:, :2])
    top, below = figure.subplots(2, 1, height_ratios=(2.7, 1.0))
    for axes, plane, name in (
        (top, (0, 1), "from above"),
        (below, (side, 2), "from the side, height stretched"),
    ):
        lines = draw_path(axes, points[:, plane], speed)
        if limit:
            look = {"color": INK, "linestyle": "--", "linewidth": 0.8, "zorder": 2.5}
            axes.plot(
                *limit.path()[:, 1:][:, plane].T,
                label=f"best known limit, {limit.time:.3f} s",
                **look,
            )
        draw_gates(axes, course, plane, scale)
        draw_obstacles(axes, course, plane, scale)
        draw_events(axes, run, plane)
        axes.set(title=name, xlabel=f"{'xyz'[plane[0]]} [m]", ylabel=f"{'xyz'[plane[1]]} [m]")
        axes.margins(0.07)
    top.set_aspect("equal", adjustable="datalim")
    top.legend(loc="best")
    below.axhline(0.0, color=MARK, linewidth=1.0)
    below.set_ylim(-0.3, float(extent[:, 2].max()) + 0.8)
    figure.colorbar(lines, ax=[top, below], label="speed [m/s]", aspect=50, pad=0.01)


def title(run: Run) -> str:
    """Return the title of a run: its outcome and laps, and what it was flown with."""
    shown = [f"{t:.3f} s" for t in run.laps[:LAPS_IN_TITLE]]
    if len(run.laps) > LAPS_IN_TITLE:
        shown.append("...")
    laps = f", laps {', '.join(shown)}" if shown else ""
    lines = (
        f"{run.spec['course']}: {run.outcome}{laps}",
        flown_with(run.spec),
        not_comparable(run.spec),
    )
    return "\n".join(line for line in lines if line)


def draw_path(axes: Axes, points: np.ndarray, speed: np.ndarray) -> LineCollection:
    """Draw a path coloured by speed, fast is bright, with one scale for all laps.

    Args:
        axes: to draw on.
        points: places [m]  (frames, 2).
        speed: at these places [m/s]  (frames,).

    Returns:
        The lines, for a bar of colours.
    """
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
    """Draw a mark at each event. plane: world axes."""
    for kind, mark in MARKS.items():
        places = np.array([event.position for event in run.events if event.kind == kind])
        if not len(places):
            continue
        axes.plot(
            *places[:, plane].T,
            mark.marker,
            color=mark.colour,
            label=mark.label,
            markersize=mark.size,
            markeredgecolor="white",
            zorder=5,
        )


def arrow_scale(points: np.ndarray) -> float:
    """Length of arrows and distance of labels in a map of these points (n, axes) [m]."""
    return max(float(np.ptp(points, axis=0).max()) / 20.0, 0.3)


def draw_gates(axes: Axes, course: Course, plane: tuple[int, int], scale: float) -> None:
    """Frame, opening, an arrow along the passage, and the gate's number. plane: world axes; scale:
    see arrow_scale."""
    for number, gate in enumerate(course.gates, start=1):
        for border, colour, width in ((gate.frame_width, FRAME, 4.0), (0.0, INK, 2.0)):
            ring = gate.corners(border)[[0, 1, 3, 2, 0]][:, plane]
            axes.plot(*ring.T, color=colour, linewidth=width, solid_capstyle="butt", zorder=3)
        (x, y), (dx, dy) = (
            np.array(v)[list(plane)] for v in (gate.position, 1.2 * scale * gate.rotation[:, 0])
        )
        arrow = {"arrowstyle": "->", "color": INK, "lw": 1.3}
        axes.annotate("", (x + dx, y + dy), (x, y), arrowprops=arrow, zorder=3)
        left, up = _label(gate, plane, scale)
        axes.text(left, up, str(number), **NUMBER)


def draw_obstacles(axes: Axes, course: Course, plane: tuple[int, int], scale: float) -> None:
    """Their outlines, filled, and from above the number of each. plane, scale: as of
    `draw_gates`."""
    for number, obstacle in enumerate(course.obstacles, start=1):
        (x0, y0), (x1, y1) = (f(obstacle.corners()[:, plane], axis=0) for f in (np.min, np.max))
        from_above = plane == (0, 1)
        outline = (
            obstacle.outline() if from_above else np.array([(x0, y0), (x1, y0), (x1, y1), (x0, y1)])
        )
        axes.fill(*outline.T, facecolor=FRAME, edgecolor=MARK, linewidth=2.0, zorder=2.8)
        if from_above:
            axes.text(x1 + 0.25 * scale, y1, str(number), color=MARK, fontsize=7, zorder=6)


def _label(gate: Gate, plane: tuple[int, int], scale: float) -> np.ndarray:
    """Position of the number, outside the frame: from above, before the gate and to its left; from
    the side, above the gate, or before it where its opening is seen edge on.
    """
    passage, left, _ = gate.rotation.T
    outer = outer_half_sizes(gate.opening, gate.frame_width)
    if plane == (0, 1):
        return (gate.position + left * (outer.left + 0.5 * scale) - 0.5 * scale * passage)[:2]
    beside, above = -0.7 * scale * passage, np.array([0.0, 0.0, outer.up + 0.3])
    return (gate.position + (beside if abs(passage[plane[0]]) > 0.9 else above))[list(plane)]


def draw_thrust(axes: Axes, run: Run) -> None:
    x, limit = run.telemetry, run.spec["vehicle"]["thrust_max"]
    _draw_pair(axes, run, "a_cmd", "a")
    axes.axhline(limit, color=LIMIT, linestyle=":", linewidth=1.2)
    axes.set(
        title="thrust, mass-normalised [m/s$^2$]",
        ylim=(-0.5, 1.05 * max(limit, x["a"].max(initial=1.0))),
    )
    axes.legend(loc="lower right", ncols=2)


def draw_rates(rows: Sequence[Axes], run: Run) -> None:
    for axes, name, axis in zip(rows, ("roll", "pitch", "yaw"), "xyz", strict=True):
        _draw_pair(axes, run, f"w{axis}_cmd", f"w{axis}")
        axes.set_ylabel(name)
        axes.label_outer()
    rows[0].set_title("body rates [rad/s]")
    rows[-1].set_xlabel("t [s]")


def _draw_pair(axes: Axes, run: Run, commanded: str, delivered: str) -> None:
    x, colour = run.telemetry, style(run.spec["sampler"]).colour
    axes.step(
        x["t"], x[commanded], where="post", color=colour, linewidth=COMMANDED, label="commanded"
    )
    axes.plot(x["t"], x[delivered], color=INK, linewidth=DELIVERED, label="delivered")
    for end in np.cumsum(run.laps):
        axes.axvline(end, color=LIMIT, linewidth=0.8)
    axes.margins(x=0.01)


def draw_spectrum(axes: Axes, run: Run) -> None:
    """Power spectral density of the thrust, with the frequency above which the motors attenuate."""
    x, tau = run.telemetry, motor_tau(run.spec["vehicle"])
    axes.set(title="thrust, power spectral density [(m/s$^2$)$^2$/Hz]", xlabel="f [Hz]")
    if len(x["t"]) < FEWEST:
        return
    commanded = line(style(run.spec["sampler"])) | {"linewidth": COMMANDED, "label": "commanded"}
    delivered = {"color": INK, "linewidth": DELIVERED, "label": "delivered"}
    for column, look in (("a_cmd", commanded), ("a", delivered)):
        f, psd = thrust_psd(x["t"], x[column])
        axes.loglog(f[1:], psd[1:], **look)
    corner = motor_corner(tau)
    axes.axvline(
        corner, color=MARK, linestyle="--", linewidth=1.0, label=f"motors' corner, {corner:.1f} Hz"
    )
    axes.grid(which="minor", color=FINE, linewidth=0.4)
    axes.legend(loc="lower left")
