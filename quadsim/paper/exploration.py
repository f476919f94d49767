"""Experiment for Figure 2: the spread of sampled trajectories of the off-road vehicle."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from matplotlib import rc_context
from matplotlib.figure import Figure

from quadsim.controllers.samplers import Colored, Gaussian, Sampling
from quadsim.figures.style import STYLE, line, write_figure
from quadsim.palette import dotted, style
from quadsim.paper.car import NOMINAL, CarState, car
from quadsim.paper.noise import DT, HORIZON, perturbations
from quadsim.paper.result import Result, write_csv

SPEED = 5.0  # speed of the vehicle at the start [m/s]
SAMPLES = 300
CASES: dict[str, Sampling] = {
    "colored, sigma 0.4": Colored((0.4, 0.4), (4.0, 4.0)),
    "gaussian, sigma 0.4": Gaussian((0.4, 0.4)),
    "gaussian, sigma 2.0": Gaussian((2.0, 2.0)),
}
LOOKS = {
    "colored, sigma 0.4": style("colored"),
    "gaussian, sigma 0.4": style("gaussian"),
    "gaussian, sigma 2.0": dotted(style("gaussian")),
}


def make(runs: int, folder: Path) -> Result:
    """Draw the trajectories. The figure has no repetitions, so `runs` is not used."""
    spread = {name: paths(perturbations(case, SAMPLES)) for name, case in CASES.items()}
    variance = {name: places[:, :, 0].var(axis=0) for name, places in spread.items()}
    t = np.arange(HORIZON + 1) * DT
    rows = [
        {"t": float(t[k])} | {f"var x, {name}": float(v[k]) for name, v in variance.items()}
        for k in range(len(t))
    ]
    numbers = {
        name: {
            "x_variance_at_end": float(variance[name][-1]),
            "y_reach": float(abs(places[:, -1, 1]).max()),
        }
        for name, places in spread.items()
    }
    figure = draw(spread, variance, t)
    files = (
        write_csv(folder / "exploration.csv", rows),
        *write_figure(figure, folder, "exploration"),
    )
    return Result(numbers, (), files)


def paths(controls: np.ndarray) -> np.ndarray:
    """Return the paths of the vehicle under controls, from the origin with heading east.

    Args:
        controls: controls of each sample  (samples, 2, horizon).

    Returns:
        Positions [m]  (samples, horizon + 1, 2).
    """
    system = car(NOMINAL, DT)
    u = np.clip(controls, -1.0, 1.0)
    origin = CarState(px=0.0, py=0.0, hx=1.0, hy=0.0, v=SPEED, r=0.0, steer=0.0, drive=0.0)
    x = CarState._make(np.full(len(u), value) for value in origin)
    places = [np.stack([x.px, x.py], axis=1)]
    for t in range(u.shape[2]):
        x = system.next(x, u[:, :, t].T)
        places.append(np.stack([x.px, x.py], axis=1))
    return np.stack(places, axis=1)


def draw(
    spread: Mapping[str, np.ndarray], variance: Mapping[str, np.ndarray], t: np.ndarray
) -> Figure:
    """Return a figure of the paths from above, and of the variance of x over time.

    Args:
        spread: positions of each case [m]  (samples, times, 2).
        variance: variance of x in each case [m^2]  (times,).
        t: times [s]  (times,).
    """
    with rc_context(STYLE):
        figure = Figure(figsize=(13, 6.5), dpi=110, layout="constrained")
        above, below = figure.subfigures(2, 1, height_ratios=(1.6, 1), squeeze=False)[:, 0]
        columns = above.subplots(1, len(spread), sharex=True, sharey=True)
        for axes, (name, places) in zip(columns, spread.items(), strict=True):
            x, y = places.transpose(2, 1, 0)
            axes.plot(x, y, linewidth=0.4, alpha=0.6, color=LOOKS[name].colour)
            axes.set(title=name, xlabel="x [m]", aspect="equal")
        columns[0].set_ylabel("y [m]")

        axes = below.subplots()
        for name, v in variance.items():
            axes.plot(t, v, **line(LOOKS[name]), label=name)
        axes.set(title="variance of x [m$^2$]", xlabel="t [s]")
        axes.set_yscale("symlog", linthresh=0.1)
        axes.legend(loc="upper left")
    return figure
