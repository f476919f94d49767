"""Figure 2 of the paper: 300 sampled trajectories of the off-road vehicle, and how far they spread over time."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib import rc_context
from matplotlib.figure import Figure

from controllers.samplers import Colored, Gaussian, Sampling
from quadsim.app.figure_style import STYLE, line
from quadsim.app.paper.result import Result, write_csv, write_figure
from quadsim.app.paper.sampled import DT, draw, paths
from quadsim.palette import dotted, style

SAMPLES = 300
CASES: dict[str, Sampling] = {
    "colored, sigma 0.4": Colored((0.4, 0.4), (4.0, 4.0)),
    "gaussian, sigma 0.4": Gaussian((0.4, 0.4)),
    "gaussian, sigma 2.0": Gaussian((2.0, 2.0)),
}
LOOKS = dict(zip(CASES, (style("colored"), style("gaussian"), dotted(style("gaussian"))), strict=True))
RUNS = 1


def run(runs: int, folder: Path) -> Result:
    """One run: nothing in it is repeated."""
    cases = {name: paths(draw(sampling, SAMPLES)) for name, sampling in CASES.items()}  # (SAMPLES, steps + 1, 2) [m]
    t = np.arange(next(iter(cases.values())).shape[1]) * DT
    variance = {name: p[:, :, 0].var(axis=0) for name, p in cases.items()}
    rows = [{"t": float(t[k])} | {f"var x, {n}": float(v[k]) for n, v in variance.items()} for k in range(len(t))]
    numbers = {
        name: {"x_variance_at_end": float(variance[name][-1]), "y_reach": float(abs(p[:, -1, 1]).max())}
        for name, p in cases.items()
    }
    files = (
        write_csv(folder / "exploration.csv", rows),
        *write_figure(_draw(cases, variance, t), folder, "exploration"),
    )
    return Result(numbers, (), files)


def _draw(cases: dict[str, np.ndarray], variance: dict[str, np.ndarray], t: np.ndarray) -> Figure:
    with rc_context(STYLE):
        figure = Figure(figsize=(13, 6.5), dpi=110, layout="constrained")
        above, below = figure.subfigures(2, 1, height_ratios=(1.6, 1), squeeze=False)[:, 0]
        for axes, (name, places) in zip(above.subplots(1, 3, sharex=True, sharey=True), cases.items(), strict=True):
            axes.plot(*places.transpose(2, 1, 0), linewidth=0.4, alpha=0.6, color=LOOKS[name].colour)
            axes.set(title=name, xlabel="x [m]", aspect="equal")
        above.axes[0].set_ylabel("y [m]")
        axes = below.subplots()
        for name, v in variance.items():
            axes.plot(t, v, **line(LOOKS[name]), label=name)
        axes.set(title="variance of x [m$^2$]", xlabel="t [s]")
        axes.set_yscale("symlog", linthresh=0.1)
        axes.legend(loc="upper left")
    return figure
