"""The picture of results.md about unseen courses: how far flights are above the limit.

.venv/bin/python docs/unseen_figure.py

It draws the rows of docs/results/unseen/, which docs/results/unseen.py has written, and prints the
rows of the table beside it.
"""

from __future__ import annotations

import csv
from typing import NamedTuple

import matplotlib.pyplot as plt
import numpy as np
from shared import DOCS, save, use_style

from quadsim.figures.style import line
from quadsim.palette import style

SEED = 7742  # of the courses whose limits are known
SAMPLERS = ("colored", "gaussian")
MOST = 60.0  # the largest difference that is drawn [%]


class Flight(NamedTuple):
    """A flight of one course."""

    opening: float  # [m]
    above: float  # time above the limit, infinite for a flight that has not finished [%]


def main() -> None:
    """Draw the picture, and print a row for each seed and sampler."""
    use_style()
    figure, (share, size) = plt.subplots(1, 2, figsize=(9.0, 3.2))
    for sampler in SAMPLERS:
        found = flights(sampler)
        above = np.sort([flight.above for flight in found])
        part = 100.0 * np.arange(1, len(above) + 1) / len(above)
        share.step(above, part, where="post", label=sampler, **line(style(sampler)))
        size.plot(
            [flight.opening for flight in found],
            [flight.above for flight in found],
            ".",
            color=style(sampler).colour,
            label=sampler,
        )
    share.set(
        xlim=(0, MOST), ylim=(0, 100), xlabel="above the limit, at most [%]", ylabel="courses [%]"
    )
    size.set(ylim=(0, MOST), xlabel="opening of the gates [m]", ylabel="above the limit [%]")
    share.legend()
    save(figure, "unseen.png")
    for sampler in SAMPLERS:
        flown = [row for row in rows("flights") if row["variant"] == sampler]
        finished = sum(row["outcome"] == "finished" for row in flown)
        above = np.array([flight.above for flight in flights(sampler)])
        low, median, high = np.percentile(above, (25, 50, 75), method="lower")
        print(
            f"| {sampler} | {finished} of {len(flown)} | {len(above)} |"
            f" {median:.1f} % | {low:.1f} to {high:.1f} % |"
        )


def flights(sampler: str) -> list[Flight]:
    """Return the flights of the courses whose limit is known."""
    found = rows("limits")
    limits = {row["course"]: float(row["limit"]) for row in found if float(row["limit"])}
    return [
        Flight(
            opening=float(row["opening"]),
            above=100.0 * (float(row["time"]) / limits[row["course"]] - 1.0)
            if row["outcome"] == "finished"
            else np.inf,
        )
        for row in rows("flights")
        if row["variant"] == sampler and row["course"] in limits
    ]


def rows(what: str) -> list[dict[str, str]]:
    """Return the rows of the flights or of the limits."""
    with (DOCS / "results" / "unseen" / f"{SEED}_{what}.csv").open(newline="") as file:
        return list(csv.DictReader(file))


if __name__ == "__main__":
    main()
