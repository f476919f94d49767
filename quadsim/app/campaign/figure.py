"""A comparison on one page, one row a course: laps, success, chatter, and where on the course flights ended."""

from __future__ import annotations

from collections.abc import Sequence
from statistics import fmean
from typing import TYPE_CHECKING

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullFormatter, ScalarFormatter

from quadsim.app.campaign.figure_map import draw_map
from quadsim.app.campaign.summary_stats import FINISHED
from quadsim.app.figure_style import STYLE, line
from quadsim.palette import Style, styles
from quadsim.record.statistics import mean_interval

if TYPE_CHECKING:
    from quadsim.app.campaign.report import Section

JITTER = 0.1  # of the lap strips


def draw(sections: Sequence[Section]) -> Figure:
    with rc_context(STYLE):
        tallest = max(len(s.variants) for s in sections)
        figure = Figure(figsize=(17, (2.6 + 0.75 * tallest) * len(sections)), dpi=110, layout="constrained")
        rows = figure.subfigures(len(sections), 1, squeeze=False, hspace=0.04)
        for row, section in zip(rows[:, 0], sections, strict=True):
            _draw_course(row, section)
    return figure


def _draw_course(figure, section: Section) -> None:
    names = [a.name for a in section.variants]
    looks = styles(names)
    laps, success, chatter, above = figure.subplots(1, 4, width_ratios=(2.1, 1.0, 1.1, 1.7))
    _laps(laps, section, looks)
    _success(success, section, looks)
    _chatter(chatter, section, looks)
    draw_map(above, section, looks)
    for axes in (laps, success, chatter):
        axes.set(yticks=range(len(names)), yticklabels=names if axes is laps else [], ylim=(len(names) - 0.4, -0.6))
        axes.grid(visible=False, axis="y")
        axes.tick_params(axis="y", length=0)
    figure.suptitle(f"{section.course.name}: {section.setting}", x=0.008, ha="left", fontsize=11)


def _laps(axes: Axes, section: Section, looks: Sequence[Style]) -> None:
    """Every attempt's mean lap, a box of the quartiles, and the mean with its interval."""
    for y, (rows, look) in enumerate(zip(section.rows, looks, strict=True)):
        colour = look.colour
        laps = np.array([fmean(r.result["laps"]) for r in rows if r.outcome == FINISHED])
        if not len(laps):
            axes.text(0.5, y, "nobody finished", transform=axes.get_yaxis_transform(), ha="center", color=colour)
            continue
        spread = np.random.default_rng(0).uniform(-JITTER, JITTER, len(laps))
        axes.plot(laps, y + 0.16 + spread, "o", color=colour, markersize=4, alpha=0.55, markeredgewidth=0)
        low, middle, high = np.percentile(laps, (25, 50, 75))
        axes.barh(y - 0.16, high - low, left=low, height=0.2, color=colour, alpha=0.25)
        axes.plot([middle] * 2, [y - 0.26, y - 0.06], color=colour, linewidth=2)
        mean = mean_interval(laps.tolist())
        if mean.n > 1:
            axes.plot([mean.low, mean.high], [y - 0.16] * 2, color="black", linewidth=1.6)
        axes.plot(mean.mean, y - 0.16, "D", color="black", markersize=5)
        axes.annotate(
            f"{mean.mean:.3f}",
            (mean.mean, y - 0.3),
            ha="center",
            va="bottom",
            fontsize=9,
        )
    axes.use_sticky_edges = False  # of the boxes, which would cut a point at the edge
    axes.margins(x=0.08)
    axes.set_title("mean lap of an attempt [s]: dots, quartiles, mean with 95 % interval")


def _success(axes: Axes, section: Section, looks: Sequence[Style]) -> None:
    for y, (variant, look) in enumerate(zip(section.variants, looks, strict=True)):
        low, high = (100 * p for p in variant.success_ci)
        share = 100 * variant.finished / variant.attempts
        axes.barh(y, share, height=0.34, color=look.colour, alpha=0.75)
        axes.plot([low, high], [y, y], color="black", linewidth=1.6)
        axes.text(2, y - 0.3, f"{variant.finished} of {variant.attempts}", va="center", fontsize=9)
    axes.set(xlim=(0, 103), title="finished [%], 95 % interval")


def _chatter(axes: Axes, section: Section, looks: Sequence[Style]) -> None:
    """Logarithmic: samplers differ by factors."""
    for y, (variant, look) in enumerate(zip(section.variants, looks, strict=True)):
        axes.plot([variant.thrust_tv_delivered, variant.thrust_tv], [y, y], **line(look), linewidth=2.5, alpha=0.5)
        axes.plot(variant.thrust_tv, y, "o", color=look.colour, markersize=9)
        axes.plot(variant.thrust_tv_delivered, y, "o", color="white", markeredgecolor=look.colour, markersize=8)
        axes.annotate(f"{variant.thrust_tv:.1f}", (variant.thrust_tv, y - 0.16), ha="center", va="bottom", fontsize=9)
    numbers = [v for a in section.variants for v in (a.thrust_tv, a.thrust_tv_delivered) if v > 0]
    axes.set_xscale("log")
    if numbers:
        axes.set_xlim(min(numbers) / 1.5, max(numbers) * 1.5)
    axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axes.xaxis.set_major_formatter(ScalarFormatter())
    axes.xaxis.set_minor_formatter(NullFormatter())
    axes.set_title("thrust variation [m/s$^2$/s]\nfull: commanded, hollow: delivered")
