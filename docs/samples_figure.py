"""The picture of samplers.md: laps against the CPU time of a control step, paired by seed.

It takes 6 flights a point, half an hour on two cores, and continues where it was interrupted:

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
from quadsim.record.statistics import Mean

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
BASELINE = "colored 4096"
ATTEMPTS = 6
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
        difference = differences(course, variants, settings)
        for sampler in SAMPLERS:
            names = [f"{sampler} {samples}" for samples in SAMPLES]
            x = [times[name] for name in names]
            y = [difference[name].mean for name in names]
            below = [difference[name].mean - difference[name].low for name in names]
            above = [difference[name].high - difference[name].mean for name in names]
            ax.errorbar(x, y, (below, above), label=sampler, capsize=2, **line(style(sampler)))
        ax.set(title=course, xscale="log", xlabel="control step, one thread [ms CPU]")
        ax.set_xticks(x, [f"{value:.1f}" for value in x])
        ax.minorticks_off()
    axes[0].set(ylabel=f"lap - lap of {BASELINE} [s]")
    axes[-1].legend()
    figure.suptitle(f"{', '.join(map(str, SAMPLES))} samples, randomized, 95 % intervals")
    figure.savefig(FOLDER / "samples.png")


def differences(course: str, variants: dict[str, Any], settings: dict[str, Any]) -> dict[str, Mean]:
    """Fly the variants, print their comparison, and return how much longer the laps of each are.

    The differences are from the laps of BASELINE with the same seed [s].
    """
    found = quadsim.compare(
        course,
        variants,
        ATTEMPTS,
        jobs=2,
        campaign=CAMPAIGN,
        baseline=BASELINE,
        randomize=1,
        **settings,
    )
    print(found, flush=True)
    own = {BASELINE: Mean(mean=0.0, low=0.0, high=0.0, n=ATTEMPTS, sd=0.0)}
    return own | {pair.b: pair.lap_difference for pair in found.pairs}


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
