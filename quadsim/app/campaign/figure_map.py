"""The course from above: some paths of each variant, and where flights ended that should not have."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import suppress
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patheffects import withStroke

from quadsim.app.campaign.store import Row
from quadsim.app.campaign.summary_stats import FINISHED
from quadsim.app.figure_style import line
from quadsim.app.figure_views import draw_gates
from quadsim.palette import Style
from quadsim.record.archive import load_run
from quadsim.record.run import RunError

if TYPE_CHECKING:
    from quadsim.app.campaign.compare import Section

PATHS = 6  # of each variant


def draw_map(axes: Axes, section: Section, looks: Sequence[Style]) -> None:
    points = np.array([section.course.start.position, *(g.position for g in section.course.gates)])[:, :2]
    scale = max(float(np.ptp(points, axis=0).max()) / 20.0, 0.3)
    for rows, look in zip(section.rows, looks, strict=True):
        for path in _paths(section, rows):
            axes.plot(*path.T, **line(look), linewidth=0.8, alpha=0.5, zorder=1)
    draw_gates(axes, section.course, (0, 1), scale)
    for rows, look, variant in zip(section.rows, looks, section.variants, strict=True):
        ends = np.array([r.result["crash"]["position"][:2] for r in rows if r.result["crash"]]).reshape(-1, 2)
        style = {"markeredgecolor": "white", "markeredgewidth": 0.8, "alpha": 0.9, "zorder": 7}
        axes.plot(*ends.T, "X", color=look.colour, markersize=9, label=f"{variant.name}: {len(ends)} crashed", **style)
    axes.plot(*points[0], "o", color="white", markeredgecolor="black", markersize=5, zorder=6)
    axes.set_aspect("equal", adjustable="datalim")
    axes.set_title("from above [m]: some paths, crashes crossed")
    legend = axes.legend(loc="best", fontsize=8)
    for text in legend.get_texts():
        text.set_path_effects([withStroke(linewidth=2, foreground="white")])


def _paths(section: Section, rows: Sequence[Row]) -> Iterator[np.ndarray]:
    """Of the first attempts, finished ones before others.  (frames, 2)"""
    for row in sorted(rows, key=lambda r: (r.outcome != FINISHED, r.seed))[:PATHS]:
        with suppress(RunError):  # telemetry may have been cleared away
            x = load_run(section.home / row.folder).telemetry
            yield np.column_stack([x["px"], x["py"]])
