"""The picture of samplers.md: laps against the CPU time of a control step, paired by seed.

It draws what `make results` has flown, and times control steps, in half a minute:

    .venv/bin/python docs/samples_figure.py
"""

from __future__ import annotations

from collections.abc import Mapping
from time import process_time

import matplotlib.pyplot as plt
import numpy as np
from shared import control_steps, save, use_style

from docs.results.experiments import read
from quadsim import Spec
from quadsim.figures.style import line
from quadsim.palette import style

# Experiments of docs/results/experiments.yaml, whose first variant is the baseline
EXPERIMENTS = ("samples_swift", "samples_song", "samples_alphapilot")
SAMPLERS = ("colored", "gaussian")
SAMPLES = (512, 1024, 2048, 4096)
COURSE = "split_s_swift"  # where control steps are timed
STEPS = 40  # control steps that are timed


def main() -> None:
    """Time control steps, and draw the picture."""
    use_style()
    times = {(name, n): step_time(name, n) for name in SAMPLERS for n in SAMPLES}
    figure, axes = plt.subplots(1, len(EXPERIMENTS), figsize=(9.0, 3.2))
    for ax, experiment in zip(axes, EXPERIMENTS, strict=True):
        rows = {row["variant"]: row for row in read(experiment).rows}
        for sampler in SAMPLERS:
            x = [times[sampler, n] for n in SAMPLES]
            mean, low, high = np.array([difference(rows[f"{sampler}{n}"]) for n in SAMPLES]).T
            ax.errorbar(
                x, mean, (mean - low, high - mean), label=sampler, capsize=2, **line(style(sampler))
            )
        course = next(iter(rows.values()))["course"]
        ax.set(title=course, xscale="log", xlabel="control step, one thread [ms CPU]")
        ax.set_xticks(x, [f"{value:.1f}" for value in x])
        ax.minorticks_off()
    axes[0].set(ylabel="lap - lap of colored 4096 [s]")
    axes[-1].legend()
    figure.suptitle(f"{', '.join(map(str, SAMPLES))} samples, randomized, 95 % intervals")
    save(figure, "samples.png")
    for (sampler, n), ms in times.items():
        print(f"{sampler:9} {n:5}  {ms:5.2f} ms")


def difference(row: Mapping[str, str]) -> tuple[float, float, float]:
    """Return the lap less that of the baseline, with its 95 % interval; zeros for the baseline."""
    names = "lap_difference", "lap_difference_low", "lap_difference_high"
    mean, low, high = (float(row[name] or 0.0) for name in names)
    return mean, low, high


def step_time(sampler: str, samples: int) -> float:
    """Return the median CPU time of a control step from the start, on one thread [ms]."""
    spec = Spec.of(COURSE, sampler=sampler, samples=samples, threads=1)
    return float(np.median(control_steps(spec, STEPS, process_time)))


if __name__ == "__main__":
    main()
