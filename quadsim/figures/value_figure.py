"""The value of a course: the best way of a point mass, beside the best known limit."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from quadsim.figures.course import ABOVE, arrow_scale, draw_gates, draw_obstacles
from quadsim.figures.notebook_figure import NotebookFigure
from quadsim.figures.run_figure import draw_limit, draw_path
from quadsim.figures.style import STYLE
from quadsim.limit.limits import LimitProblem, StoredSolution
from quadsim.palette import INK, SPARE
from quadsim.value import CourseValue, value_of_course

POINT_MASS = SPARE[0].colour
RATE = 1000.0  # of the positions at which the limit's speeds at gates are looked up [Hz]


def draw_value(problem: LimitProblem, limit: StoredSolution | None = None) -> Figure:
    """Draw the best way of a point mass through a race, and its speeds and times at the gates.

    Args:
        problem: the race.
        limit: the best known solution of the race, drawn beside it.
    """
    course = problem.course
    value = value_of_course(course, problem.vehicle, problem.laps)
    begin = np.array(course.start.position, float)
    with rc_context(STYLE):
        figure = NotebookFigure(figsize=(15, 7.5), dpi=130, layout="constrained")
        left, right = figure.subfigures(1, 2, width_ratios=(1.3, 1), squeeze=False)[0]
        above = left.subplots()
        way = value.path(begin)
        lines = draw_path(above, way.position[:, ABOVE], np.linalg.norm(way.velocity, axis=1))
        scale = arrow_scale(np.vstack([way.position, course.points()])[:, :2])
        draw_gates(above, course, ABOVE, scale)
        draw_obstacles(above, course, ABOVE, scale)
        if limit:
            draw_limit(above, limit, ABOVE)
            above.legend(loc="best")
        above.set(xlabel="x [m]", ylabel="y [m]", title="from above")
        above.set_aspect("equal", adjustable="datalim")
        left.colorbar(lines, ax=above, label="speed of the point mass [m/s]", aspect=50, pad=0.01)

        speeds, times = right.subplots(2, 1, sharex=True)
        draw_gate_numbers(speeds, times, value, limit, problem)
        title = f"{course.name}, {problem.vehicle.name}: a point mass takes {value.time:.3f} s"
        if limit:
            share = value.time / limit.time
            title += f", {100.0 * share:.1f} % of the best known limit of {limit.time:.3f} s"
        figure.suptitle(title, x=0.012, ha="left", fontsize=12)
    return figure


def draw_gate_numbers(
    speeds: Axes,
    times: Axes,
    value: CourseValue,
    limit: StoredSolution | None,
    problem: LimitProblem,
) -> None:
    """Draw the speeds at the gates, and the times of the legs to them.

    Args:
        speeds: axes for the speeds.
        times: axes for the times.
        value: the way of the point mass.
        limit: the best known solution; None: there is none.
        problem: the race.
    """
    gates = np.arange(1, len(value.passages) + 1)
    look: dict[str, Any] = {"color": POINT_MASS, "marker": "o", "label": "point mass"}
    speeds.plot(gates, value.speeds, **look)
    times.plot(gates, np.diff(value.splits, prepend=0.0), **look)
    if limit:
        passes, at_gates = limit_at_gates(limit, value)
        known: dict[str, Any] = {"color": INK, "marker": "x", "linestyle": "--"}
        known["label"] = "best known limit"
        speeds.plot(gates, at_gates, **known)
        times.plot(gates, np.diff(passes, prepend=0.0), **known)
    for lap in range(1, problem.laps):
        for axes in (speeds, times):
            axes.axvline(lap * len(problem.course.gates) + 0.5, color=INK, linewidth=0.6)
    speeds.set(title="speed at each gate [m/s]", ylim=(0.0, None))
    times.set(title="time from the gate before [s]", ylim=(0.0, None), xlabel="gate")
    speeds.legend(loc="best")


def limit_at_gates(limit: StoredSolution, value: CourseValue) -> tuple[np.ndarray, np.ndarray]:
    """Return the times [s] and speeds [m/s] at which a solution crosses the gates.  (K,) each

    Args:
        limit: the solution.
        value: with the gates of the same race.
    """
    path = limit.path(RATE)
    t, position = path[:, 0], path[:, 1:]
    speed = np.linalg.norm(np.gradient(position, t, axis=0), axis=1)
    passes = []
    speeds = []
    first = 0
    for place, rotation, half in zip(
        value.passages.position, value.passages.rotation, value.passages.half, strict=True
    ):
        along, left, up = ((position[first:] - place) @ rotation).T
        inside = (np.abs(left) < 2.0 * half[0]) & (np.abs(up) < 2.0 * half[1])
        crossed = (along[:-1] < 0.0) & (along[1:] >= 0.0) & inside[1:]
        first += int(crossed.argmax()) + 1 if crossed.any() else len(along) - 1
        passes.append(t[first])
        speeds.append(speed[first])
    return np.array(passes), np.array(speeds)
