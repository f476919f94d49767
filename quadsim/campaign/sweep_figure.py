"""The figure of a sweep: a column for each setting, and two rows for each course.

The upper row shows how many flights finish, the lower one by how much laps differ from those at the
first value, flown with the same seeds. The values stand at equal distances in their order.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import isfinite

from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure

from quadsim.campaign.summary_stats import FEWEST_PAIRS
from quadsim.campaign.sweep_curves import Curve
from quadsim.figures.notebook_figure import NotebookFigure
from quadsim.figures.style import STYLE, line
from quadsim.palette import MARK, Style, styles

WIDTH = 3.4  # of a setting [inches]
HEIGHT = 5.4  # of a course [inches]
# Distance between the variants at one value, as a share of that between values
APART = 0.16
# Values with more letters than these together are written at an angle.
LETTERS = 26


def draw_sweep(curves: Sequence[Curve]) -> Figure:
    """Draw a sweep.

    Args:
        curves: one for each course, setting and variant.
    """
    courses = list(dict.fromkeys(curve.section.course.name for curve in curves))
    settings = list(dict.fromkeys(curve.swept.name for curve in curves))
    variants = list(dict.fromkeys(curve.variant for curve in curves))
    looks = dict(zip(variants, styles(variants), strict=True))
    with rc_context(STYLE):
        figure = NotebookFigure(
            figsize=(max(WIDTH * len(settings), 6.0), HEIGHT * len(courses)),
            dpi=110,
            layout="constrained",
        )
        rows = figure.subfigures(len(courses), 1, squeeze=False, hspace=0.04)
        for row, course in zip(rows[:, 0], courses, strict=True):
            of_course = [curve for curve in curves if curve.section.course.name == course]
            _draw_course(row, of_course, settings, looks)
    return figure


def _draw_course(
    figure: SubFigure, curves: Sequence[Curve], settings: Sequence[str], looks: dict[str, Style]
) -> None:
    """Draw the settings of one course side by side, with a common scale in each row."""
    panels = figure.subplots(2, len(settings), squeeze=False, sharey="row", sharex="col")
    for column, setting in enumerate(settings):
        of_setting = [curve for curve in curves if curve.swept.name == setting]
        if not of_setting:
            continue
        finished, laps = panels[:, column]
        for place, curve in enumerate(of_setting):
            beside = APART * (place - (len(of_setting) - 1) / 2)
            _draw_finished(finished, curve, beside, looks[curve.variant])
            _draw_laps(laps, curve, beside, looks[curve.variant])
        swept = of_setting[0].swept
        labels = [value.label for value in swept.values]
        laps.set(xticks=range(len(labels)), xlabel=swept.title)
        slanted = {"rotation": 30, "ha": "right"} if len("".join(labels)) > LETTERS else {}
        laps.set_xticklabels(labels, **slanted)
        for axes in (finished, laps):
            axes.set_xlim(-0.5, len(labels) - 0.5)
            axes.grid(visible=False, axis="x")
    first_finished, first_laps = panels[:, 0]
    first_finished.set(ylim=(-4, 104), ylabel="finished [%]")
    first_laps.set_ylabel("lap less that at the first value [s]")
    first_finished.legend(loc="lower left", handlelength=3)
    setting_text = curves[0].section.setting
    figure.suptitle(
        f"{curves[0].section.course.name}: {setting_text}; 95 % intervals",
        x=0.008,
        ha="left",
        fontsize=11,
    )


def _places(curve: Curve, beside: float) -> list[float]:
    """Return the place of each point on the axis of the values, some of which may not be flown."""
    labels = [value.label for value in curve.swept.values]
    return [labels.index(point.value) + beside for point in curve.points]


def _draw_finished(axes: Axes, curve: Curve, beside: float, look: Style) -> None:
    """Draw the share of flights that finished, with its interval."""
    places = _places(curve, beside)
    shares = []
    for x, point in zip(places, curve.points, strict=True):
        stats = point.stats
        low, high = stats.success_ci
        shares.append(100 * stats.finished / stats.attempts)
        axes.plot([x, x], [100 * low, 100 * high], color=look.colour, linewidth=2.0, alpha=0.6)
    axes.plot(places, shares, **line(look), linewidth=1.4, marker="o", label=curve.variant)


def _draw_laps(axes: Axes, curve: Curve, beside: float, look: Style) -> None:
    """Draw the lap differences from the first value, with their intervals."""
    axes.axhline(0.0, color=MARK, linewidth=1.0)
    places = _places(curve, beside)
    shown = []
    for x, point in zip(places, curve.points, strict=True):
        if point.change is None:
            # The first value is what the others are compared with.
            shown.append((x, 0.0))
            continue
        found = point.change.lap_difference
        if not isfinite(found.mean):
            continue
        shown.append((x, found.mean))
        if found.n >= FEWEST_PAIRS:
            interval = [found.low, found.high]
            axes.plot([x, x], interval, color=look.colour, linewidth=2.0, alpha=0.6)
    axes.plot(*zip(*shown, strict=True), **line(look), linewidth=1.4, marker="o")
