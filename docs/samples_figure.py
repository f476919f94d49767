"""The picture of samplers.md: lap times against the CPU time of a control step.

It takes 8 flights a point, an hour on two cores, and continues where it was interrupted:

    .venv/bin/python docs/samples_figure.py
"""

from __future__ import annotations

from pathlib import Path
from time import process_time
from typing import Any

import matplotlib.pyplot as plt
import numpy as np

import quadsim
from quadsim import Spec
from quadsim.config.build import planner_of, with_threads
from quadsim.figures.style import STYLE, line
from quadsim.palette import style
from quadsim.physics.plant_state import start_state
from quadsim.record.statistics import Mean, mean_interval

FOLDER = Path(__file__).parent
CAMPAIGN = Path("runs/docs/samples.sqlite")
# The races of results.md, with their settings
RACES: dict[str, dict[str, Any]] = {
    "split_s_swift": {},
    "split_s_song": {"vehicle": "cpc", "laps": 2, "thrust_to_weight": 3.3},
    "alphapilot": {"vehicle": "flightmare", "thrust_to_weight": 6.4},
}
SAMPLERS = ("colored", "gaussian")
SAMPLES = (512, 1024, 2048, 4096)
ATTEMPTS = 8
STEPS = 40  # control steps that are timed


def main() -> None:
    """Fly, time and draw the picture, and print its numbers."""
    plt.rcParams.update(STYLE | {"figure.dpi": 130, "figure.constrained_layout.use": True})
    variants: dict[str, Any] = {
        f"{sampler} {samples}": {"sampler": sampler, "samples": samples}
        for sampler in SAMPLERS
        for samples in SAMPLES
    }
    times = {name: step_time(**settings) for name, settings in variants.items()}
    figure, axes = plt.subplots(1, len(RACES), figsize=(9.0, 3.2))
    for ax, (course, settings) in zip(axes, RACES.items(), strict=True):
        laps = mean_laps(course, variants, settings)
        for sampler in SAMPLERS:
            names = [f"{sampler} {samples}" for samples in SAMPLES]
            x = [times[name] for name in names]
            y = np.array([laps[name].mean for name in names])
            below = y - np.array([laps[name].low for name in names])
            above = np.array([laps[name].high for name in names]) - y
            ax.errorbar(x, y, (below, above), label=sampler, **line(style(sampler)))
        ax.set(title=course, xscale="log", xlabel="control step, one thread [ms CPU]")
        ax.set_xticks(x, [f"{value:.1f}" for value in x])
        ax.minorticks_off()
    axes[0].set(ylabel="lap, mean [s]")
    axes[-1].legend()
    figure.suptitle(f"{', '.join(map(str, SAMPLES))} samples, randomized, 95 % intervals")
    figure.savefig(FOLDER / "samples.png")


def mean_laps(course: str, variants: dict[str, Any], settings: dict[str, Any]) -> dict[str, Mean]:
    """Fly the variants, print their comparison, and return the mean lap of each by its name [s]."""
    baseline = f"{SAMPLERS[0]} {SAMPLES[-1]}"
    found = quadsim.compare(
        course,
        variants,
        ATTEMPTS,
        jobs=2,
        campaign=CAMPAIGN,
        baseline=baseline,
        randomize=1,
        **settings,
    )
    print(found, flush=True)
    laps: dict[str, list[float]] = {name: [] for name in variants}
    for attempt in found.attempts:
        if attempt.lap_mean is not None:
            laps[attempt.variant].append(attempt.lap_mean)
    return {name: mean_interval(of_variant) for name, of_variant in laps.items()}


def step_time(sampler: str, samples: int) -> float:
    """Return the median CPU time of a control step from the start, on one thread [ms]."""
    spec = with_threads(Spec.of(next(iter(RACES)), sampler=sampler, samples=samples, threads=1))
    planner = planner_of(spec)
    x = np.array(start_state(spec.course.start, spec.vehicle.radius))
    planner.control(x)  # compiles, and makes the first plan
    taken = []
    for _ in range(STEPS):
        began = process_time()
        planner.control(x)
        taken.append(1e3 * (process_time() - began))
    return float(np.median(taken))


if __name__ == "__main__":
    main()
