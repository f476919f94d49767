"""Figure 3 of the paper: samples of Gaussian and of colored noise with growing exponents."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib import rc_context
from matplotlib.figure import Figure

from controllers.samplers import Colored, Gaussian
from quadsim.app.figure_style import STYLE
from quadsim.app.paper.result import Result, write_csv, write_figure
from quadsim.app.paper.sampled import DT, draw
from quadsim.palette import style

GAMMAS = (0.5, 1.0, 2.0, 4.0)
GAUSSIAN = "Gaussian"
SHOWN = 3  # samples of each
RUNS = 1


def run(runs: int, folder: Path) -> Result:
    """One run: nothing in it is repeated."""
    rows = {GAUSSIAN: draw(Gaussian((1.0,)), SHOWN)[:, 0]}
    rows |= {f"gamma = {g:g}": draw(Colored((1.0,), (g,)), SHOWN, seed=1)[:, 0] for g in GAMMAS}
    t = np.arange(next(iter(rows.values())).shape[1]) * DT
    with rc_context(STYLE):
        figure = Figure(figsize=(9, 8), dpi=110, layout="constrained")
        for axes, (name, z) in zip(figure.subplots(len(rows), 1, sharex=True, sharey=True), rows.items(), strict=True):
            colour = style("gaussian" if name == GAUSSIAN else "colored").colour
            for sample, strong in zip(z, np.linspace(1.0, 0.35, SHOWN), strict=True):
                axes.plot(t, sample, linewidth=0.9, color=colour, alpha=strong)
            axes.set_title(name)
        axes.set_xlabel("t [s]")
    csv = [{"t": float(t[k])} | {n: float(z[0, k]) for n, z in rows.items()} for k in range(len(t))]
    steps = {name: float(np.abs(np.diff(z)).mean()) for name, z in rows.items()}
    files = (write_csv(folder / "noise.csv", csv), *write_figure(figure, folder, "noise"))
    return Result({"mean_step": steps}, (), files)
