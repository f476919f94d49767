"""Figures 2 and 3 of the paper: what samplers draw, without a planner."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib import rc_context
from matplotlib.figure import Figure

from controllers.lanes.layout import from_lanes
from controllers.samplers import Colored, Gaussian, Sampling
from controllers.samplers.lane_sampler import stream_key
from quadsim.figures.style import STYLE, line, write_figure
from quadsim.palette import dotted, style
from quadsim.paper.offroad import NOMINAL, State, offroad
from quadsim.paper.result import Result, write_csv

DT = 0.02  # [s]
HORIZON = 250  # steps
SPEED = 5.0  # of the vehicle at the start [m/s]
GAMMAS = (0.5, 1.0, 2.0, 4.0)
GAUSSIAN = "Gaussian"
SHOWN = 3  # samples of each noise
SAMPLES = 300
CASES: dict[str, Sampling] = {
    "colored, sigma 0.4": Colored((0.4, 0.4), (4.0, 4.0)),
    "gaussian, sigma 0.4": Gaussian((0.4, 0.4)),
    "gaussian, sigma 2.0": Gaussian((2.0, 2.0)),
}
LOOKS = dict(
    zip(CASES, (style("colored"), style("gaussian"), dotted(style("gaussian"))), strict=True)
)


def noise(runs: int, folder: Path) -> Result:
    """Figure 3: samples of Gaussian and of colored noise with growing exponents. Nothing in it is
    repeated."""
    rows = {GAUSSIAN: perturbations(Gaussian((1.0,)), SHOWN)[:, 0]}
    rows |= {
        f"gamma = {g:g}": perturbations(Colored((1.0,), (g,)), SHOWN, seed=1)[:, 0] for g in GAMMAS
    }
    t = np.arange(HORIZON) * DT
    csv = [{"t": float(t[k])} | {n: float(z[0, k]) for n, z in rows.items()} for k in range(len(t))]
    steps = {name: float(np.abs(np.diff(z)).mean()) for name, z in rows.items()}
    files = (
        write_csv(folder / "noise.csv", csv),
        *write_figure(_draw_noise(rows, t), folder, "noise"),
    )
    return Result({"mean_step": steps}, (), files)


def exploration(runs: int, folder: Path) -> Result:
    """Figure 2: sampled trajectories of the off-road vehicle, and how far they spread. Nothing in
    it is repeated."""
    cases = {name: paths(perturbations(sampling, SAMPLES)) for name, sampling in CASES.items()}
    t = np.arange(HORIZON + 1) * DT
    variance = {name: p[:, :, 0].var(axis=0) for name, p in cases.items()}
    rows = [
        {"t": float(t[k])} | {f"var x, {n}": float(v[k]) for n, v in variance.items()}
        for k in range(len(t))
    ]
    numbers = {
        name: {
            "x_variance_at_end": float(variance[name][-1]),
            "y_reach": float(abs(p[:, -1, 1]).max()),
        }
        for name, p in cases.items()
    }
    figure = _draw_exploration(cases, variance, t)
    files = (
        write_csv(folder / "exploration.csv", rows),
        *write_figure(figure, folder, "exploration"),
    )
    return Result(numbers, (), files)


def perturbations(sampling: Sampling, samples: int, seed: int = 0) -> np.ndarray:
    """One row for each sample.  (samples, n_u, HORIZON)"""
    z = sampling.build(samples, HORIZON, stream_key(seed), DT).sample(1)
    return from_lanes(z, samples, HORIZON)


def paths(controls: np.ndarray) -> np.ndarray:
    """Where controls lead the off-road vehicle from the origin, heading east.

    (samples, 2, horizon) -> (samples, horizon + 1, 2) [m]
    """
    system = offroad(NOMINAL, DT)
    u = np.clip(controls, -1.0, 1.0)
    origin = State(px=0.0, py=0.0, hx=1.0, hy=0.0, v=SPEED, r=0.0, steer=0.0, drive=0.0)
    x = State._make(np.full(len(u), value) for value in origin)
    places = [np.stack(x[:2], axis=1)]
    for t in range(u.shape[2]):
        x = system.next(x, u[:, :, t].T)
        places.append(np.stack(x[:2], axis=1))
    return np.stack(places, axis=1)


def _draw_noise(rows: dict[str, np.ndarray], t: np.ndarray) -> Figure:
    with rc_context(STYLE):
        figure = Figure(figsize=(9, 8), dpi=110, layout="constrained")
        for axes, (name, z) in zip(
            figure.subplots(len(rows), 1, sharex=True, sharey=True), rows.items(), strict=True
        ):
            colour = style("gaussian" if name == GAUSSIAN else "colored").colour
            for sample, strong in zip(z, np.linspace(1.0, 0.35, SHOWN), strict=True):
                axes.plot(t, sample, linewidth=0.9, color=colour, alpha=strong)
            axes.set_title(name)
        axes.set_xlabel("t [s]")
    return figure


def _draw_exploration(
    cases: dict[str, np.ndarray], variance: dict[str, np.ndarray], t: np.ndarray
) -> Figure:
    with rc_context(STYLE):
        figure = Figure(figsize=(13, 6.5), dpi=110, layout="constrained")
        above, below = figure.subfigures(2, 1, height_ratios=(1.6, 1), squeeze=False)[:, 0]
        for axes, (name, places) in zip(
            above.subplots(1, 3, sharex=True, sharey=True), cases.items(), strict=True
        ):
            axes.plot(
                *places.transpose(2, 1, 0), linewidth=0.4, alpha=0.6, color=LOOKS[name].colour
            )
            axes.set(title=name, xlabel="x [m]", aspect="equal")
        above.axes[0].set_ylabel("y [m]")
        axes = below.subplots()
        for name, v in variance.items():
            axes.plot(t, v, **line(LOOKS[name]), label=name)
        axes.set(title="variance of x [m$^2$]", xlabel="t [s]")
        axes.set_yscale("symlog", linthresh=0.1)
        axes.legend(loc="upper left")
    return figure
