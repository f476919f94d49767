"""The figure of a comparison: one row for each course, two rows of the size of a slide for one.

It shows lap times, their differences from one variant, success, chatter, and a map with the
crashes.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import suppress
from math import isfinite
from typing import NamedTuple

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure
from matplotlib.ticker import LogLocator, NullFormatter, ScalarFormatter

from quadsim.campaign.flights.stats import FEWEST_PAIRS, FINISHED, Section, mean_lap
from quadsim.campaign.run.store import AttemptRow
from quadsim.figures.notebook_figure import NotebookFigure
from quadsim.figures.run_figure import arrow_scale, draw_gates, draw_obstacles
from quadsim.figures.style import STYLE, line
from quadsim.files.yaml_errors import cut
from quadsim.palette import MARK, SPARE, Style, styles
from quadsim.record.archive import read_run
from quadsim.record.run import RunError
from quadsim.statistics import mean_interval

PATHS = 6  # number of paths of each variant on the map
JITTER = 0.1  # vertical, of the dots of a variant
QUARTILES = (25, 50, 75)  # [%]
CRASHES = ("X", "P", "*", "v", "s", "h")  # markers of crashes, one for each round of colours
BEHIND_TEXT = {"facecolor": "white", "edgecolor": "none", "pad": 0.5}
PLANE = (0, 1)  # x and y: the map is seen from above
SLIDE = (13.3, 7.5)  # size of a slide [inch]
MOST_ON_A_SLIDE = 6  # variants


def draw(sections: Sequence[Section]) -> Figure:
    """Draw a comparison.

    Args:
        sections: the results, a section for each course.
    """
    with rc_context(STYLE):
        tallest = max(len(section.variants) for section in sections)
        is_slide = len(sections) == 1 and tallest <= MOST_ON_A_SLIDE
        size = SLIDE if is_slide else (20, (2.6 + 0.75 * tallest) * len(sections))
        figure = NotebookFigure(figsize=size, dpi=110, layout="constrained")
        rows = figure.subfigures(len(sections), 1, squeeze=False, hspace=0.04)
        for row, section in zip(rows[:, 0], sections, strict=True):
            _draw_course(row, section, is_slide)
    return figure


class CourseAxes(NamedTuple):
    """The axes of one course; a single variant has no `differences`."""

    laps: Axes
    differences: Sequence[Axes]
    success: Axes
    chatter: Axes
    above: Axes

    @classmethod
    def in_a_row(cls, figure: SubFigure, variants: int) -> CourseAxes:
        """Return axes side by side."""
        ratios = (2.0, 1.4, 0.8, 1.0, 1.7) if variants > 1 else (2.1, 1.0, 1.1, 1.7)
        laps, *differences, success, chatter, above = figure.subplots(
            1, len(ratios), width_ratios=ratios
        )
        return cls(laps, differences, success, chatter, above)

    @classmethod
    def in_two_rows(cls, figure: SubFigure, variants: int) -> CourseAxes:
        """Return axes for a slide: laps and their differences above the others."""
        rows = figure.add_gridspec(2, 1)
        ratios = (2.0, 1.4) if variants > 1 else (2.0,)
        upper = rows[0].subgridspec(1, len(ratios), width_ratios=ratios)
        lower = rows[1].subgridspec(1, 3, width_ratios=(0.8, 1.0, 1.7))
        laps, *differences = [figure.add_subplot(upper[k]) for k in range(len(ratios))]
        success, chatter, above = [figure.add_subplot(lower[k]) for k in range(3)]
        return cls(laps, differences, success, chatter, above)


def _draw_course(figure: SubFigure, section: Section, is_slide: bool) -> None:
    names = [variant.name for variant in section.variants]
    looks = styles(names)
    placed = CourseAxes.in_two_rows if is_slide else CourseAxes.in_a_row
    laps, differences, success, chatter, above = placed(figure, len(names))
    _draw_laps(laps, section, looks)
    for axes in differences:
        _draw_differences(axes, section, looks)
    _draw_success(success, section, looks)
    _draw_chatter(chatter, section, looks)
    _draw_map(above, section, looks)
    for axes in (laps, *differences, success, chatter):
        axes.set(yticks=range(len(names)), yticklabels=[], ylim=(len(names) - 0.4, -0.6))
        axes.grid(visible=False, axis="y")
        axes.tick_params(axis="y", length=0)
    # The first axes of each row of axes name the variants.
    for axes in (laps, success) if is_slide else (laps,):
        axes.set_yticklabels(names)
    figure.suptitle(f"{section.course.name}: {section.setting}", x=0.008, ha="left", fontsize=11)


def _draw_laps(axes: Axes, section: Section, looks: Sequence[Style]) -> None:
    """Draw every attempt's mean lap, a box of the quartiles, and the mean with its interval."""
    for y, (rows, look) in enumerate(zip(section.rows, looks, strict=True)):
        laps = np.array([mean_lap(r) for r in rows if r.outcome == FINISHED and r.result["laps"]])
        if len(laps):
            _draw_laps_of_variant(axes, y, laps, look)
        else:
            _write_across(axes, y, "none finished", look)
    # Sticky edges of the boxes would cut a point at the edge.
    axes.use_sticky_edges = False
    axes.margins(x=0.08)
    axes.set_title("mean lap of an attempt [s]: dots, quartiles, mean with 95 % interval")


def _draw_laps_of_variant(axes: Axes, y: float, laps: np.ndarray, look: Style) -> None:
    """Draw the laps of one variant: dots below y, the box and the mean above it.  (attempts,)"""
    spread = np.random.default_rng(0).uniform(-JITTER, JITTER, len(laps))
    dots = {"color": look.colour, "markersize": 4, "alpha": 0.55, "markeredgewidth": 0}
    axes.plot(laps, y + 0.16 + spread, "o", **dots)

    box = y - 0.16
    low, middle, high = np.percentile(laps, QUARTILES)
    axes.barh(box, high - low, left=low, height=0.2, color=look.colour, alpha=0.25)
    axes.plot([middle, middle], [box - 0.1, box + 0.1], color=look.colour, linewidth=2)

    mean = mean_interval(laps.tolist())
    if mean.n > 1:
        axes.plot([mean.low, mean.high], [box, box], color="black", linewidth=1.6)
    axes.plot(mean.mean, box, "D", color="black", markersize=5)
    above = (mean.mean, y - 0.3)
    axes.annotate(f"{mean.mean:.3f}", above, ha="center", va="bottom", fontsize=9)


def _draw_differences(axes: Axes, section: Section, looks: Sequence[Style]) -> None:
    """Draw the lap difference of each variant from the reference, pair by pair of seeds.

    Unpaired intervals may overlap where this one excludes zero, as variants share conditions.
    """
    reference = section.reference
    of = {pair.b: pair for pair in section.pairs if pair.a == reference}
    axes.axvline(0.0, color=MARK, linewidth=1.0)
    for y, (variant, look) in enumerate(zip(section.variants, looks, strict=True)):
        if variant.name == reference:
            _write_across(axes, y, "the others are compared with it", look)
            continue
        pair = of.get(variant.name)
        found = pair.lap_difference if pair else None
        if pair is None or found is None or not isfinite(found.mean):
            _write_across(axes, y, "no common seed finished", look)
            continue
        if found.n >= FEWEST_PAIRS:
            axes.plot([found.low, found.high], [y, y], color=look.colour, linewidth=2.5)
        axes.plot(found.mean, y, "D", color=look.colour, markersize=6)
        p = pair.corrected.laps if pair.corrected else pair.lap_p
        tested = f", p {p:.2g}" if isfinite(p) else ""
        text = f"{found.mean:+.3f}  (n {found.n}{tested})"
        above = {"ha": "center", "va": "bottom", "fontsize": 8, "bbox": BEHIND_TEXT}
        axes.annotate(text, (found.mean, y - 0.16), **above)
    axes.margins(x=0.3)
    corrected = ", p corrected (Holm)" if section.baseline else ""
    axes.set_title(
        f"lap less that of {cut(reference, 30)} [s], same seeds\n95 % intervals of each{corrected}"
    )


def _write_across(axes: Axes, y: float, text: str, look: Style) -> None:
    """Write a text in the middle of a variant's row."""
    transform = axes.get_yaxis_transform()
    at_middle = {"ha": "center", "va": "center", "bbox": BEHIND_TEXT}
    axes.text(0.5, y, text, transform=transform, color=look.colour, **at_middle)


def _draw_success(axes: Axes, section: Section, looks: Sequence[Style]) -> None:
    for y, (variant, look) in enumerate(zip(section.variants, looks, strict=True)):
        low, high = variant.success_ci
        share = 100 * variant.finished / variant.attempts
        axes.barh(y, share, height=0.34, color=look.colour, alpha=0.75)
        axes.plot([100 * low, 100 * high], [y, y], color="black", linewidth=1.6)
        axes.text(2, y - 0.3, f"{variant.finished} of {variant.attempts}", va="center", fontsize=9)
    axes.set(xlim=(0, 103), title="finished [%], 95 % interval")


def _draw_chatter(axes: Axes, section: Section, looks: Sequence[Style]) -> None:
    """Draw thrust variation on a logarithmic axis, as samplers differ by factors."""
    numbers = []
    for y, (variant, look) in enumerate(zip(section.variants, looks, strict=True)):
        commanded = variant.thrust_tv
        delivered = variant.thrust_tv_delivered
        numbers += [number for number in (commanded, delivered) if number > 0]
        axes.plot([delivered, commanded], [y, y], **line(look), linewidth=2.5, alpha=0.5)
        axes.plot(commanded, y, "o", color=look.colour, markersize=9)
        hollow = {"color": "white", "markeredgecolor": look.colour, "markersize": 8}
        axes.plot(delivered, y, "o", **hollow)
        above = (commanded, y - 0.16)
        axes.annotate(f"{commanded:.1f}", above, ha="center", va="bottom", fontsize=9)
    axes.set_xscale("log")
    if numbers:
        axes.set_xlim(min(numbers) / 1.5, max(numbers) * 1.5)
    axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axes.xaxis.set_major_formatter(ScalarFormatter())
    axes.xaxis.set_minor_formatter(NullFormatter())
    axes.set_title("thrust variation [m/s$^2$/s]\nfull: commanded, hollow: delivered")


def _draw_map(axes: Axes, section: Section, looks: Sequence[Style]) -> None:
    """Draw the course from above, some paths of each variant and the places of all crashes."""
    points = section.course.points(frames=False)[:, :2]
    scale = arrow_scale(points)
    draw_gates(axes, section.course, PLANE, scale)
    draw_obstacles(axes, section.course, PLANE, scale)
    start = {"color": "white", "markeredgecolor": "black", "markersize": 5, "zorder": 6}
    axes.plot(*points[0], "o", **start)
    flown = zip(section.rows, looks, section.variants, strict=True)
    for number, (rows, look, variant) in enumerate(flown):
        for path in _paths(section, rows):
            axes.plot(*path.T, **line(look), linewidth=0.8, alpha=0.5, zorder=1)
        crashes = [r.result["crash"] for r in rows]
        places = [crash["position"][:2] for crash in crashes if crash is not None]
        label = f"{variant.name}: {len(places)} crashed"
        marker = CRASHES[number // len(SPARE) % len(CRASHES)]
        _draw_crashes(axes, np.array(places).reshape(-1, 2), look, marker)
        # the legend shows colour, dashes and cross together
        shown = {**line(look), "linewidth": 1.4, "marker": marker, "markersize": 7}
        axes.plot([], [], **shown, markeredgecolor="white", label=label)
    axes.set_aspect("equal", adjustable="datalim")
    axes.set_title("from above [m]: some paths, crosses where flights crashed")
    axes.legend(
        loc="upper center", bbox_to_anchor=(0.5, -0.05), ncols=2, fontsize=8, handlelength=4
    )


def _draw_crashes(axes: Axes, places: np.ndarray, look: Style, marker: str) -> None:
    """Draw a marker at each place.  (crashes, 2)"""
    axes.plot(
        *places.T,
        marker,
        color=look.colour,
        markersize=9,
        markeredgecolor="white",
        markeredgewidth=0.8,
        alpha=0.9,
        zorder=7,
    )


def _paths(section: Section, rows: Sequence[AttemptRow]) -> Iterator[np.ndarray]:
    """Yield x and y [m] of at most PATHS attempts, finished attempts first.  (frames, 2)"""
    finished_first = sorted(rows, key=lambda r: (r.outcome != FINISHED, r.seed))
    for row in finished_first[:PATHS]:
        # Telemetry may have been removed, or never been kept.
        with suppress(RunError):
            columns = read_run(section.home / row.folder).telemetry
            yield np.column_stack([columns["px"], columns["py"]])
