"""The figure of a race: ranks at each gate, gaps to the leader, and all paths from above."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from quadsim.course import Course
from quadsim.figures.course import ABOVE, arrow_scale, draw_gates, draw_obstacles
from quadsim.figures.notebook_figure import NotebookFigure
from quadsim.figures.style import STYLE, line
from quadsim.heat.result import HeatEvent, placings
from quadsim.palette import HIT, MARK, Style, styles
from quadsim.record.run import RecordedRun

# Largest gap that is drawn [s]; larger if no entrant but the leader ends with a smaller gap
LARGEST_GAP = 4.0


def draw_heat(
    names: Sequence[str],
    runs: Sequence[RecordedRun],
    start_times: Sequence[float],
    events: Sequence[HeatEvent],
    course: Course,
) -> Figure:
    """Return the figure of a race.

    Args:
        names: names of the entrants.
        runs: runs of the entrants, in the same order.
        start_times: times of their starts [s].
        events: events between vehicles.
        course: the course.
    """
    looks = styles(names)
    passes = [_passes(run, start) for run, start in zip(runs, start_times, strict=True)]
    with rc_context(STYLE):
        figure = NotebookFigure(figsize=(13, 8.5), dpi=110, layout="constrained")
        left, right = figure.subfigures(1, 2, width_ratios=(1.15, 1), squeeze=False)[0]
        draw_paths(left.subplots(), runs, looks, events, course)
        places, gaps = right.subplots(2, 1, height_ratios=(1, 1.2), sharex=True)
        draw_places(places, names, passes, looks, len(course.gates))
        draw_gaps(gaps, passes, looks, len(course.gates))
        figure.suptitle(_title(names, runs, course), x=0.012, ha="left", fontsize=12)
        handles, labels = places.get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=min(len(names), 4))
    return figure


def _passes(run: RecordedRun, start_time: float) -> list[float]:
    """Return the race times at which a run passed its gates [s]."""
    return [start_time + event.t for event in run.events if event.kind == "pass"]


def _title(names: Sequence[str], runs: Sequence[RecordedRun], course: Course) -> str:
    """Return the results in one line."""
    results = []
    for placing in placings(names, runs, course):
        time = f"{placing.time:.3f} s" if placing.time is not None else placing.outcome
        results.append(f"{placing.rank} {placing.name} {time}")
    return f"{course.name}: " + ", ".join(results)


def draw_paths(
    axes: Axes,
    runs: Sequence[RecordedRun],
    looks: Sequence[Style],
    events: Sequence[HeatEvent],
    course: Course,
) -> None:
    """Draw all paths from above, and the places of crashes."""
    paths = [np.column_stack([run.telemetry["px"], run.telemetry["py"]]) for run in runs]
    scale = arrow_scale(np.vstack([*paths, course.points()[:, :2]]))
    draw_gates(axes, course, ABOVE, scale)
    draw_obstacles(axes, course, ABOVE, scale)
    for path, run, look in zip(paths, runs, looks, strict=True):
        axes.plot(*path.T, **line(look), linewidth=1.2)
        axes.plot(*path[0], "o", color=look.colour, markersize=5)
        if run.outcome == "crashed":
            axes.plot(*path[-1], "X", color=HIT, markersize=10, zorder=7)
    axes.set_aspect("equal", adjustable="datalim")
    axes.set_xlabel("x, east [m]")
    axes.set_ylabel("y, north [m]")
    overtakes = sum(event.kind == "overtake" for event in events)
    contacts = sum(event.kind == "contact" for event in events)
    axes.set_title(f"paths from above: overtakes {overtakes}, contacts {contacts}")


def draw_places(
    axes: Axes,
    names: Sequence[str],
    passes: Sequence[Sequence[float]],
    looks: Sequence[Style],
    gates: int,
) -> None:
    """Draw the rank of each entrant at each gate."""
    most = max(map(len, passes))
    for k, (name, look) in enumerate(zip(names, looks, strict=True)):
        numbers = np.arange(1, len(passes[k]) + 1)
        places = [
            1 + sum(len(of) > g and of[g] < t for of in passes) for g, t in enumerate(passes[k])
        ]
        axes.plot(numbers, places, **line(look), linewidth=2.0, marker="o", ms=4, label=name)
        if len(places) < most:
            last = places[-1] if places else len(names)
            axes.plot(len(places) or 1, last, "X", color=HIT, markersize=9, zorder=7)
    axes.set_ylim(len(names) + 0.5, 0.5)
    axes.set_yticks(range(1, len(names) + 1))
    axes.set_ylabel("place")
    axes.set_title("places at the gates")
    _mark_laps(axes, most, gates)


def draw_gaps(
    axes: Axes, passes: Sequence[Sequence[float]], looks: Sequence[Style], gates: int
) -> None:
    """Draw the time by which each entrant passes each gate behind the first one."""
    most = max(map(len, passes))
    first = [min(of[g] for of in passes if len(of) > g) for g in range(most)]
    last = []
    for of, look in zip(passes, looks, strict=True):
        gaps = np.array(of) - np.array(first[: len(of)])
        axes.plot(np.arange(1, len(of) + 1), gaps, **line(look), linewidth=1.8)
        last += gaps[-1:].tolist()
    low, high = axes.get_ylim()
    second = 1.1 * sorted(last)[1] if len(last) > 1 else 0.0
    axes.set_ylim(min(high, max(LARGEST_GAP, second)), min(low, -0.05))
    axes.set_ylabel("gap to the leader [s]")
    axes.set_xlabel("gates passed since the start")
    _mark_laps(axes, most, gates)


def _mark_laps(axes: Axes, passed: int, gates: int) -> None:
    """Draw a line at the last gate of each lap."""
    for gate in range(gates, passed + 1, gates):
        axes.axvline(gate, color=MARK, linewidth=0.8, linestyle=":")
