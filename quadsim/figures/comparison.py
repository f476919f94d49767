"""A comparison on one page, one row for each course: lap times, success, chatter, and a map with
the crashes."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import suppress
from math import isfinite
from statistics import fmean

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure
from matplotlib.ticker import LogLocator, NullFormatter, ScalarFormatter

from quadsim.campaign.store import Row
from quadsim.campaign.summary_stats import FINISHED, Section
from quadsim.figures.run_figure import arrow_scale, draw_gates, draw_obstacles
from quadsim.figures.style import STYLE, line
from quadsim.palette import Style, styles
from quadsim.record.archive import load_run
from quadsim.record.run import RunError
from quadsim.record.statistics import mean_interval

PATHS = 6  # of each variant on the map
JITTER = 0.1  # vertical, of the dots of a variant


def draw(sections: Sequence[Section]) -> Figure:
    with rc_context(STYLE):
        tallest = max(len(s.variants) for s in sections)
        figure = Figure(
            figsize=(17, (2.6 + 0.75 * tallest) * len(sections)), dpi=110, layout="constrained"
        )
        rows = figure.subfigures(len(sections), 1, squeeze=False, hspace=0.04)
        for row, section in zip(rows[:, 0], sections, strict=True):
            _draw_course(row, section)
    return figure


def _draw_course(figure: SubFigure, section: Section) -> None:
    names = [a.name for a in section.variants]
    looks = styles(names)
    laps, success, chatter, above = figure.subplots(1, 4, width_ratios=(2.1, 1.0, 1.1, 1.7))
    _draw_laps(laps, section, looks)
    _draw_success(success, section, looks)
    _draw_chatter(chatter, section, looks)
    _draw_map(above, section, looks)
    for axes in (laps, success, chatter):
        axes.set(
            yticks=range(len(names)),
            yticklabels=names if axes is laps else [],
            ylim=(len(names) - 0.4, -0.6),
        )
        axes.grid(visible=False, axis="y")
        axes.tick_params(axis="y", length=0)
    figure.suptitle(f"{section.course.name}: {section.setting}", x=0.008, ha="left", fontsize=11)


def _draw_laps(axes: Axes, section: Section, looks: Sequence[Style]) -> None:
    """Every attempt's mean lap, a box of the quartiles, and the mean with its interval."""
    for y, (rows, look) in enumerate(zip(section.rows, looks, strict=True)):
        colour = look.colour
        laps = np.array(
            [fmean(r.result["laps"]) for r in rows if r.outcome == FINISHED and r.result["laps"]]
        )
        if not len(laps):
            axes.text(
                0.5,
                y,
                "none finished",
                transform=axes.get_yaxis_transform(),
                ha="center",
                color=colour,
            )
            continue
        spread = np.random.default_rng(0).uniform(-JITTER, JITTER, len(laps))
        axes.plot(
            laps, y + 0.16 + spread, "o", color=colour, markersize=4, alpha=0.55, markeredgewidth=0
        )
        low, middle, high = np.percentile(laps, (25, 50, 75))
        axes.barh(y - 0.16, high - low, left=low, height=0.2, color=colour, alpha=0.25)
        axes.plot([middle] * 2, [y - 0.26, y - 0.06], color=colour, linewidth=2)
        mean = mean_interval(laps.tolist())
        if mean.n > 1:
            axes.plot([mean.low, mean.high], [y - 0.16] * 2, color="black", linewidth=1.6)
        axes.plot(mean.mean, y - 0.16, "D", color="black", markersize=5)
        axes.annotate(
            f"{mean.mean:.3f}", (mean.mean, y - 0.3), ha="center", va="bottom", fontsize=9
        )
    axes.use_sticky_edges = False  # of the boxes, which would cut a point at the edge
    axes.margins(x=0.08)
    axes.set_title("mean lap of an attempt [s]: dots, quartiles, mean with 95 % interval")


def _draw_success(axes: Axes, section: Section, looks: Sequence[Style]) -> None:
    for y, (variant, look) in enumerate(zip(section.variants, looks, strict=True)):
        low, high = (100 * p for p in variant.success_ci)
        share = 100 * variant.finished / variant.attempts
        axes.barh(y, share, height=0.34, color=look.colour, alpha=0.75)
        axes.plot([low, high], [y, y], color="black", linewidth=1.6)
        axes.text(2, y - 0.3, f"{variant.finished} of {variant.attempts}", va="center", fontsize=9)
    axes.set(xlim=(0, 103), title="finished [%], 95 % interval")


def _draw_chatter(axes: Axes, section: Section, looks: Sequence[Style]) -> None:
    """Logarithmic: samplers differ by factors."""
    for y, (variant, look) in enumerate(zip(section.variants, looks, strict=True)):
        if not isfinite(variant.thrust_tv):
            axes.text(
                0.5,
                y,
                "no thrust",
                transform=axes.get_yaxis_transform(),
                ha="center",
                color=look.colour,
            )
            continue
        axes.plot(
            [variant.thrust_tv_delivered, variant.thrust_tv],
            [y, y],
            **line(look),
            linewidth=2.5,
            alpha=0.5,
        )
        axes.plot(variant.thrust_tv, y, "o", color=look.colour, markersize=9)
        axes.plot(
            variant.thrust_tv_delivered,
            y,
            "o",
            color="white",
            markeredgecolor=look.colour,
            markersize=8,
        )
        axes.annotate(
            f"{variant.thrust_tv:.1f}",
            (variant.thrust_tv, y - 0.16),
            ha="center",
            va="bottom",
            fontsize=9,
        )
    numbers = [v for a in section.variants for v in (a.thrust_tv, a.thrust_tv_delivered) if v > 0]
    axes.set_xscale("log")
    if numbers:
        axes.set_xlim(min(numbers) / 1.5, max(numbers) * 1.5)
    axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axes.xaxis.set_major_formatter(ScalarFormatter())
    axes.xaxis.set_minor_formatter(NullFormatter())
    axes.set_title("thrust variation [m/s$^2$/s]\nfull: commanded, hollow: delivered")


def _draw_map(axes: Axes, section: Section, looks: Sequence[Style]) -> None:
    """The course from above, with some paths of each variant and the places of all crashes."""
    points = section.course.points(frames=False)[:, :2]
    draw_gates(axes, section.course, (0, 1), arrow_scale(points))
    draw_obstacles(axes, section.course, (0, 1), arrow_scale(points))
    axes.plot(*points[0], "o", color="white", markeredgecolor="black", markersize=5, zorder=6)
    for rows, look, variant in zip(section.rows, looks, section.variants, strict=True):
        for path in _paths(section, rows):
            axes.plot(*path.T, **line(look), linewidth=0.8, alpha=0.5, zorder=1)
        ends = np.array(
            [r.result["crash"]["position"][:2] for r in rows if r.result["crash"]]
        ).reshape(-1, 2)
        style = {"markeredgecolor": "white", "markeredgewidth": 0.8, "alpha": 0.9, "zorder": 7}
        axes.plot(
            *ends.T,
            "X",
            color=look.colour,
            markersize=9,
            label=f"{variant.name}: {len(ends)} crashed",
            **style,
        )
    axes.set_aspect("equal", adjustable="datalim")
    axes.set_title("from above [m]: some paths, crosses where flights crashed")
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.05), ncols=2, fontsize=8)


def _paths(section: Section, rows: Sequence[Row]) -> Iterator[np.ndarray]:
    """Of the first attempts, finished ones before others.  (frames, 2)"""
    for row in sorted(rows, key=lambda r: (r.outcome != FINISHED, r.seed))[:PATHS]:
        with suppress(RunError):  # telemetry may have been removed
            x = load_run(section.home / row.folder).telemetry
            yield np.column_stack([x["px"], x["py"]])
