"""Drawings of a course from above or from the side, common to all figures.

Gates are bars with an arrow along the passage, obstacles are filled outlines. Drawings without
matplotlib get the geometry in metres from `gate_bar` and the obstacles' `outline`.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patheffects import withStroke

from quadsim.course import Course, Gate
from quadsim.course.opening import outer_half_sizes
from quadsim.palette import FRAME, INK, MARK

# World axes of a view: from above, x to the right and y up
ABOVE = (0, 1)
NUMBER: dict[str, Any] = {
    "ha": "center",
    "va": "center",
    "weight": "bold",
    "zorder": 6,
    "path_effects": [withStroke(linewidth=2.5, foreground="white")],
}
ARROW: dict[str, Any] = {"arrowstyle": "->", "color": INK, "lw": 1.3}


class Bar(NamedTuple):
    """A gate from above, as line segments [m], each with two ends in x and y  (2, 2)."""

    # The frame, from outer edge to outer edge
    frame: np.ndarray
    # The opening in it
    opening: np.ndarray


def gate_bar(gate: Gate) -> Bar:
    """Return the frame and the opening of a gate from above."""
    # Diagonally opposite corners are the farthest apart in any attitude of the gate
    frame = gate.corners(gate.frame_width)[[0, 3]]
    opening = gate.corners()[[0, 3]]
    return Bar(frame[:, :2], opening[:, :2])


def draw_course(axes: Axes, course: Course, *, bounds: bool = False, numbers: bool = True) -> None:
    """Draw a course from above, north up and to scale: gates, obstacles and the start.

    Args:
        axes: axes of matplotlib.
        course: course to draw.
        bounds: whether the bounds are drawn, too.
        numbers: whether each gate's number is written beside it.
    """
    scale = arrow_scale(course.points(frames=False)[:, :2])
    draw_gates(axes, course, ABOVE, scale, numbers=numbers)
    draw_obstacles(axes, course, ABOVE, scale)
    if bounds:
        (x_min, x_max), (y_min, y_max), _ = course.bounds
        corners = [(x_min, y_min), (x_max, y_min), (x_max, y_max), (x_min, y_max), (x_min, y_min)]
        axes.plot(*np.transpose(corners), color=FRAME, linestyle=":", linewidth=1.0, zorder=1)
    draw_start(axes, np.array(course.start.position[:2]))
    axes.set(xlabel="x [m]", ylabel="y [m]")
    axes.set_aspect("equal", adjustable="datalim")


def arrow_scale(points: np.ndarray) -> float:
    """Return a length for arrows and distances of labels in a map of points (n, axes) [m]."""
    return max(float(np.ptp(points, axis=0).max()) / 20.0, 0.3)


def draw_start(axes: Axes, position: np.ndarray) -> None:
    """Draw the start of a flight at a position in the view [m]  (2,)."""
    axes.plot(
        *position,
        marker="o",
        color="white",
        markeredgecolor="black",
        markersize=6,
        linestyle="none",
        label="start",
    )


def draw_gates(
    axes: Axes, course: Course, plane: tuple[int, int], scale: float, *, numbers: bool = True
) -> None:
    """Draw frame and opening of each gate, an arrow along the passage, and its number.

    Args:
        axes: axes of matplotlib.
        course: course with the gates.
        plane: indices of the two world axes of the view.
        scale: result of `arrow_scale` [m].
        numbers: whether each gate's number is written beside it.
    """
    view = list(plane)
    for number, gate in enumerate(course.gates, start=1):
        _draw_ring(axes, gate.corners(gate.frame_width)[:, view], FRAME, width=4.0)
        _draw_ring(axes, gate.corners()[:, view], INK, width=2.0)
        x, y = np.array(gate.position)[view]
        dx, dy = 1.2 * scale * gate.rotation[view, 0]
        axes.annotate("", (x + dx, y + dy), (x, y), arrowprops=ARROW, zorder=3)
        if numbers:
            left, up = _label_position(gate, plane, scale)
            axes.text(left, up, str(number), **NUMBER)


def draw_obstacles(axes: Axes, course: Course, plane: tuple[int, int], scale: float) -> None:
    """Draw the filled outlines of the obstacles, in the view from above with their numbers.

    Args:
        axes: axes of matplotlib.
        course: course with the obstacles.
        plane: indices of the two world axes of the view.
        scale: result of `arrow_scale` [m].
    """
    for number, obstacle in enumerate(course.obstacles, start=1):
        corners = obstacle.corners()[:, list(plane)]
        x_min, y_min = corners.min(axis=0)
        x_max, y_max = corners.max(axis=0)
        outline = np.array([(x_min, y_min), (x_max, y_min), (x_max, y_max), (x_min, y_max)])
        if plane == ABOVE:
            outline = obstacle.outline()
        axes.fill(*outline.T, facecolor=FRAME, edgecolor=MARK, linewidth=2.0, zorder=2.8)
        if plane == ABOVE:
            place = (x_max + 0.25 * scale, y_max)
            axes.text(*place, str(number), color=MARK, fontsize=7, zorder=6)


def _draw_ring(axes: Axes, corners: np.ndarray, colour: str, width: float) -> None:
    """Draw the border through four corners (4, 2) in the order of Gate.corners."""
    ring = corners[[0, 1, 3, 2, 0]]
    axes.plot(*ring.T, color=colour, linewidth=width, solid_capstyle="butt", zorder=3)


def _label_position(gate: Gate, plane: tuple[int, int], scale: float) -> np.ndarray:
    """Return the position of a gate's number, outside its frame.

    From above the number is in front of the gate and to its left; from the side it is above the
    gate, or in front of it if the opening is seen edge-on.
    """
    passage, left, _ = gate.rotation.T
    outer = outer_half_sizes(gate.opening, gate.frame_width)
    view = list(plane)
    if plane == ABOVE:
        beside = left * (outer.left + 0.5 * scale) - 0.5 * scale * passage
    elif abs(passage[plane[0]]) > 0.9:
        beside = -0.7 * scale * passage
    else:
        beside = np.array([0.0, 0.0, outer.up + 0.3])
    return (gate.position + beside)[view]
