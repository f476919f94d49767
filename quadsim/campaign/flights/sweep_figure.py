"""The figure of a sweep: a column for each setting, and three rows for each course.

The rows show how many flights finish, by how much laps differ from the laps at the first value with
the same seeds, and, if it is known, the total variation of the thrust. The values stand at equal
distances, in the given order. Settings that do not fit side by side continue below.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import ceil, isfinite, nan
from textwrap import fill
from typing import NamedTuple

from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure

from quadsim.campaign.flights.stats import FEWEST_PAIRS
from quadsim.campaign.flights.sweep_curves import Curve, SweepPoint
from quadsim.figures.notebook_figure import NotebookFigure
from quadsim.figures.style import STYLE, line
from quadsim.palette import MARK, Style, styles

WIDTH = 3.4  # of a setting [inches]
HEIGHT = 7.6  # of settings side by side [inches]
SIDE_BY_SIDE = 4  # most settings side by side
# Distance between the variants at one value, as a share of that between values
APART = 0.16
# Values with more letters than these together are written at an angle.
LETTERS = 26
LETTERS_PER_INCH = 11  # of a title


class Measured(NamedTuple):
    """A number with its 95 % interval; unknown numbers are nan."""

    value: float
    low: float = nan
    high: float = nan


class DrawnPoint(NamedTuple):
    """The measured numbers of a variant at one value of a setting, as they are drawn."""

    place: int  # of the value, from 0
    finished: Measured  # flights [%]
    change: Measured  # of the lap from that at the first value [s]
    # total variation of the commanded thrust [m/s^2/s]; nan: it is not drawn
    thrust: Measured = Measured(nan)


class DrawnCurve(NamedTuple):
    """One variant at all values of one setting on one course, as it is drawn."""

    course: str  # heads the panels of the course
    setting: str  # title of the axis
    values: tuple[str, ...]
    variant: str
    points: tuple[DrawnPoint, ...]


def draw_sweep(curves: Sequence[Curve]) -> Figure:
    """Draw a sweep.

    Args:
        curves: one for each course, setting and variant.
    """
    return draw_curves([_drawn(curve) for curve in curves])


def draw_curves(curves: Sequence[DrawnCurve]) -> Figure:
    """Draw curves; each course and setting has panels of its own.

    Args:
        curves: one for each course, setting and variant.
    """
    variants = list(dict.fromkeys(curve.variant for curve in curves))
    looks = dict(zip(variants, styles(variants), strict=True))
    rows = _rows(curves)
    columns = max(len(row) for row in rows)
    with rc_context(STYLE):
        figure = NotebookFigure(
            figsize=(max(WIDTH * columns, 6.0), HEIGHT * len(rows)),
            dpi=110,
            layout="constrained",
        )
        parts = figure.subfigures(len(rows), 1, squeeze=False, hspace=0.04)[:, 0]
        for part, row in zip(parts, rows, strict=True):
            _draw_row(part, row, columns, looks)
    return figure


def _rows(curves: Sequence[DrawnCurve]) -> list[list[list[DrawnCurve]]]:
    """Return the curves of each panel, by row: a course has its own rows, about equally long."""
    by_course: dict[str, dict[str, list[DrawnCurve]]] = {}
    for curve in curves:
        by_course.setdefault(curve.course, {}).setdefault(curve.setting, []).append(curve)
    rows = []
    for settings in by_course.values():
        panels = list(settings.values())
        length = ceil(len(panels) / ceil(len(panels) / SIDE_BY_SIDE))
        rows += [panels[k : k + length] for k in range(0, len(panels), length)]
    return rows


def _draw_row(
    figure: SubFigure,
    row: Sequence[Sequence[DrawnCurve]],
    columns: int,
    looks: dict[str, Style],
) -> None:
    """Draw some settings of one course side by side, with common scales.

    Args:
        figure: the part of the figure for them.
        row: the curves of each setting.
        columns: number of panels side by side; the last ones may stay empty.
        looks: style of each variant.
    """
    drawn = [point for curves in row for curve in curves for point in curve.points]
    has_thrust = any(isfinite(point.thrust.value) for point in drawn)
    panels = figure.subplots(2 + has_thrust, columns, squeeze=False, sharey="row", sharex="col")
    for column, curves in enumerate(row):
        finished, laps, *thrusts = panels[:, column]
        laps.axhline(0.0, color=MARK, linewidth=1.0)
        for place, curve in enumerate(curves):
            beside = APART * (place - (len(curves) - 1) / 2)
            look = looks[curve.variant]
            shares = [(point.place + beside, point.finished) for point in curve.points]
            _draw_curve(finished, shares, look, curve.variant)
            changes = [(point.place + beside, point.change) for point in curve.points]
            _draw_curve(laps, changes, look)
            variations = [(point.place + beside, point.thrust) for point in curve.points]
            for thrust in thrusts:
                _draw_curve(thrust, variations, look)
        _label_values(list(panels[:, column]), curves[0])
    for free in panels[:, len(row) :].flat:
        free.remove()
    first_finished, first_laps, *first_thrusts = panels[:, 0]
    first_finished.set(ylim=(-4, 104), ylabel="finished [%]")
    first_laps.set_ylabel("change of the lap [s]")
    for first in first_thrusts:
        first.set_ylabel("thrust variation [m/s²/s]")
        first.set_ylim(bottom=0.0)
    first_finished.legend(loc="lower left", handlelength=3)
    inches = figure.get_figure(root=True).get_figwidth()
    title = fill(f"{row[0][0].course}; 95 % intervals", int(LETTERS_PER_INCH * inches))
    figure.suptitle(title, x=0.008, ha="left", fontsize=11)


def _label_values(panels: Sequence[Axes], curve: DrawnCurve) -> None:
    """Label the panels of one setting, which are given from top to bottom."""
    lowest = panels[-1]
    lowest.set(xticks=range(len(curve.values)), xlabel=curve.setting)
    slanted = {"rotation": 30, "ha": "right"} if len("".join(curve.values)) > LETTERS else {}
    lowest.set_xticklabels(curve.values, **slanted)
    for axes in panels:
        axes.set_xlim(-0.5, len(curve.values) - 0.5)
        axes.grid(visible=False, axis="x")


def _draw_curve(
    axes: Axes, points: Sequence[tuple[float, Measured]], look: Style, label: str = ""
) -> None:
    """Draw numbers with their intervals, without the unknown ones.

    Args:
        axes: the panel.
        points: place on the axis of the values, and the number.
        look: style of the curve.
        label: name in the legend, "" for none.
    """
    known = [(x, found) for x, found in points if isfinite(found.value)]
    for x, found in known:
        if isfinite(found.low):
            interval = [found.low, found.high]
            axes.plot([x, x], interval, color=look.colour, linewidth=2.0, alpha=0.6)
    axes.plot(
        [x for x, _ in known],
        [found.value for _, found in known],
        **line(look),
        linewidth=1.4,
        marker="o",
        label=label,
    )


def _drawn(curve: Curve) -> DrawnCurve:
    """Return the drawn points of a curve, without the values that were not flown."""
    course = curve.section.course.name
    labels = [value.label for value in curve.swept.values]
    points = (
        DrawnPoint(
            labels.index(point.value),
            _finished(point),
            _change(point),
            Measured(point.stats.thrust_tv),
        )
        for point in curve.points
    )
    return DrawnCurve(
        course=f"{course}: {curve.section.setting}",
        setting=curve.swept.title,
        values=tuple(labels),
        variant=curve.variant,
        points=tuple(points),
    )


def _finished(point: SweepPoint) -> Measured:
    """Return the share of flights that finished [%]."""
    stats = point.stats
    low, high = stats.success_ci
    return Measured(100 * stats.finished / stats.attempts, 100 * low, 100 * high)


def _change(point: SweepPoint) -> Measured:
    """Return the change of the lap [s]; few pairs have no interval."""
    if point.change is None:
        # The first value is what the others are compared with.
        return Measured(0.0)
    found = point.change.lap_difference
    if found.n < FEWEST_PAIRS:
        return Measured(found.mean)
    return Measured(found.mean, found.low, found.high)
