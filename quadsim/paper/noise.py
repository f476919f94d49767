"""Experiment for Figure 3: samples of Gaussian noise and of colored noise."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from matplotlib import rc_context
from matplotlib.figure import Figure

from quadsim.controllers.lanes.layout import from_lanes
from quadsim.controllers.samplers import Colored, Gaussian, Sampling
from quadsim.controllers.samplers.lane_sampler import stream_key
from quadsim.figures.style import STYLE, write_figure
from quadsim.palette import style
from quadsim.paper.result import Result, write_csv

DT = 0.02  # [s]
HORIZON = 250  # steps
GAMMAS = (0.5, 1.0, 2.0, 4.0)
GAUSSIAN = "Gaussian"
SHOWN = 3  # number of samples of each noise


def make(runs: int, folder: Path) -> Result:
    """Draw the samples. The figure has no repetitions, so `runs` is not used."""
    samples = {GAUSSIAN: perturbations(Gaussian((1.0,)), SHOWN)[:, 0]}
    for gamma in GAMMAS:
        colored = perturbations(Colored((1.0,), (gamma,)), SHOWN, seed=1)
        samples[f"gamma = {gamma:g}"] = colored[:, 0]
    t = np.arange(HORIZON) * DT
    rows = [
        {"t": float(t[k])} | {name: float(z[0, k]) for name, z in samples.items()}
        for k in range(HORIZON)
    ]
    mean_step = {name: float(np.abs(np.diff(z)).mean()) for name, z in samples.items()}
    files = (
        write_csv(folder / "noise.csv", rows),
        *write_figure(draw(samples, t), folder, "noise"),
    )
    return Result({"mean_step": mean_step}, (), files)


def perturbations(sampling: Sampling, samples: int, seed: int = 0) -> np.ndarray:
    """Return perturbations of a sampler, a row for each sample.  (samples, n_u, HORIZON)"""
    z = sampling.build(samples, (1,) * HORIZON, stream_key(seed), DT).sample(1)
    return from_lanes(z, samples, HORIZON)


def draw(samples: Mapping[str, np.ndarray], t: np.ndarray) -> Figure:
    """Return a figure of samples (samples, HORIZON) of each noise over time t (HORIZON,) [s]."""
    with rc_context(STYLE):
        figure = Figure(figsize=(9, 8), dpi=110, layout="constrained")
        rows = figure.subplots(len(samples), 1, sharex=True, sharey=True)
        for axes, (name, z) in zip(rows, samples.items(), strict=True):
            colour = style("gaussian" if name == GAUSSIAN else "colored").colour
            for sample, strong in zip(z, np.linspace(1.0, 0.35, SHOWN), strict=True):
                axes.plot(t, sample, linewidth=0.9, color=colour, alpha=strong)
            axes.set_title(name)
        rows[-1].set_xlabel("t [s]")
    return figure
