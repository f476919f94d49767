"""The path from above and from the side, coloured by speed, with gates, crossings and incidents."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import SubFigure
from matplotlib.patheffects import withStroke

from quadsim.course import Course, Gate
from quadsim.palette import FRAME, HIT, INK, MARK
from quadsim.record.run import Run

MARKS = {  # event -> marker, colour, what it is called
    "hit": ("X", HIT, "hit"),
    "ground": ("P", HIT, "ground"),
    "bounds": ("s", HIT, "out of bounds"),
    "miss": ("v", INK, "miss"),
    "wrong_way": ("<", INK, "wrong way"),
    "pass": (".", INK, "passed"),
}
NUMBER: dict[str, Any] = {"ha": "center", "va": "center", "weight": "bold", "zorder": 6}
NUMBER["path_effects"] = [withStroke(linewidth=2.5, foreground="white")]


def draw_views(figure: SubFigure, run: Run, course: Course) -> None:
    """Above, x and y to scale; below, the longer of both and the height."""
    points = np.stack([run.telemetry[k] for k in ("px", "py", "pz")], axis=1)  # (frames, 3)
    extent = np.vstack([points, [course.start.position], *(g.corners(g.frame_width) for g in course.gates)])
    side = int(np.argmax(np.ptp(extent[:, :2], axis=0)))
    scale = max(float(np.ptp(extent[:, side])) / 20.0, 0.3)  # of arrows and labels [m]
    top, below = figure.subplots(2, 1, height_ratios=(2.7, 1.0))
    for axes, plane, name in ((top, (0, 1), "from above"), (below, (side, 2), "from the side, height stretched")):
        lines = _draw_path(axes, run, points[:, plane])
        draw_gates(axes, course, plane, scale)
        _draw_events(axes, run, plane)
        axes.set(title=name, xlabel=f"{'xyz'[plane[0]]} [m]", ylabel=f"{'xyz'[plane[1]]} [m]")
        axes.margins(0.07)
    top.set_aspect("equal", adjustable="datalim")
    top.legend(loc="best")
    below.axhline(0.0, color=MARK, linewidth=1.0)
    below.set_ylim(-0.3, float(extent[:, 2].max()) + 0.8)
    figure.colorbar(lines, ax=[top, below], label="speed [m/s]", aspect=50, pad=0.01)


def _draw_path(axes: Axes, run: Run, points: np.ndarray) -> LineCollection:
    """points: (frames, 2). Every lap the same colours, fast is bright."""
    x = run.telemetry
    speed = np.sqrt(x["vx"] ** 2 + x["vy"] ** 2 + x["vz"] ** 2)
    segments = np.stack([points[:-1], points[1:]], axis=1)  # (frames - 1, 2, 2)
    lines = LineCollection(list(segments), cmap="plasma", linewidths=1.8, capstyle="round")
    lines.set_array(speed[:-1])
    lines.set_clim(0.0, max(float(speed.max(initial=0.0)), 1.0))
    axes.add_collection(lines)
    axes.plot(*points[:1].T, marker="o", color="white", markeredgecolor="black", markersize=6, label="start")
    return lines


def draw_gates(axes: Axes, course: Course, plane: tuple[int, int], scale: float) -> None:
    """Frame, opening, an arrow along the passage, and the gate's number. scale: of arrows and labels [m]."""
    for number, gate in enumerate(course.gates, start=1):
        for border, colour, width in ((gate.frame_width, FRAME, 4.0), (0.0, INK, 2.0)):
            ring = gate.corners(border)[[0, 1, 3, 2, 0]][:, plane]
            axes.plot(*ring.T, color=colour, linewidth=width, solid_capstyle="butt", zorder=3)
        (x, y), (dx, dy) = (np.array(v)[list(plane)] for v in (gate.position, 1.2 * scale * gate.rotation[:, 0]))
        arrow = {"arrowstyle": "->", "color": INK, "lw": 1.3}
        axes.annotate("", (x + dx, y + dy), (x, y), arrowprops=arrow, zorder=3)
        left, up = _label(gate, plane, scale)
        axes.text(left, up, str(number), **NUMBER)


def _label(gate: Gate, plane: tuple[int, int], scale: float) -> np.ndarray:
    """Outside the frame, on the side the gate is entered from; from the side, above it unless it is seen edge on."""
    passage, left, _ = gate.rotation.T
    width, height = (size / 2 + gate.frame_width for size in gate.opening)
    if plane == (0, 1):
        return (gate.position + left * (width + 0.5 * scale) - 0.5 * scale * passage)[:2]
    beside, above = -0.7 * scale * passage, np.array([0.0, 0.0, height + 0.3])
    return (gate.position + (beside if abs(passage[plane[0]]) > 0.9 else above))[list(plane)]


def _draw_events(axes: Axes, run: Run, plane: tuple[int, int]) -> None:
    for kind, (marker, colour, name) in MARKS.items():
        at = np.array([e.position for e in run.events if e.kind == kind])
        if len(at):
            size = 7 if kind == "pass" else 11
            axes.plot(
                *at[:, plane].T, marker, color=colour, markersize=size, markeredgecolor="white", label=name, zorder=5
            )
