"""The figures of imperfections.md: what `make results` has flown, drawn as `race sweep` does.

.venv/bin/python docs/imperfections_figure.py
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from math import nan

from shared import DOCS

from docs.results.experiments import csv_file, experiments, read
from quadsim.campaign.flights.sweep_figure import (
    DrawnCurve,
    DrawnPoint,
    Measured,
    draw_curves,
)
from quadsim.figures.style import save_figure

# Figure -> experiments of docs/results/experiments.yaml, each with the heading of its panels
FIGURES = {
    "imperfections_swift": {
        "swept_swift": "split_s_swift, one lap on the true state",
        "swept_swift_sensing": "split_s_swift, one lap on camera and inertial unit",
    },
    "imperfections_aigp": {
        "swept_aigp": "aigp_physical, one lap on camera and inertial unit",
    },
}

Row = Mapping[str, str]


def main() -> None:
    """Draw the figures of the experiments that have been flown."""
    for figure, headings in FIGURES.items():
        flown = [name for name in headings if csv_file(name).exists()]
        curves = [curve for name in flown for curve in curves_of(name, headings[name])]
        if curves:
            print(save_figure(draw_curves(curves), DOCS / f"{figure}.png"))


def curves_of(name: str, heading: str) -> Iterator[DrawnCurve]:
    """Yield a curve for each setting and variant of an experiment.

    Args:
        name: the experiment.
        heading: heads its panels.
    """
    by_curve: dict[tuple[str, str], list[Row]] = {}
    for row in read(name).rows:
        by_curve.setdefault((row["setting"], row["variant"]), []).append(row)
    labels = experiments()[name].labels
    for (setting, variant), rows in by_curve.items():
        values = [row["value"] for row in rows]
        yield DrawnCurve(
            course=heading,
            setting=labels.get(setting, setting),
            values=tuple(labels.get(f"{setting}={value}", value) for value in values),
            variant=variant,
            points=tuple(points_of(rows)),
        )


def points_of(rows: Sequence[Row]) -> Iterator[DrawnPoint]:
    """Yield what is drawn of each row."""
    for place, row in enumerate(rows):
        share = 100.0 * int(row["finished"]) / int(row["attempts"])
        low, high = (100.0 * float(row[f"finished_{end}"]) for end in ("low", "high"))
        ends = ("lap_change", "lap_change_low", "lap_change_high")
        # The first value is what the others are compared with.
        change = Measured(*(number(row[end]) for end in ends)) if place else Measured(0.0)
        yield DrawnPoint(place, Measured(share, low, high), change)


def number(text: str) -> float:
    """Return a number of a CSV file, nan for an unknown one."""
    return float(text) if text else nan


if __name__ == "__main__":
    main()
