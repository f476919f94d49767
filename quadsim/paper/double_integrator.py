"""Experiment for Figure 7: state, control and spectrum of the best runs of Table II.

The figure shows the best run of each of the paper's samplers at sigma 1.5.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np
from matplotlib import rc_context
from matplotlib.figure import Figure

from quadsim.console import complain
from quadsim.figures.style import STYLE, line, write_figure
from quadsim.palette import MARK, dotted, style
from quadsim.paper.result import Result, write_csv
from quadsim.paper.table2 import (
    GOAL,
    PAPER_SAMPLERS,
    Cell,
    MotionTask,
    accumulated_cost,
    move,
    samplings,
    scores,
)

SIGMA = 1.5
LOOKS = {
    "gaussian": style("gaussian"),
    "smooth": style("smooth"),
    "smooth_star": style("smooth_star"),
    "log_normal": style("log_normal"),
    "colored_1": style("colored"),
    "colored_2": dotted(style("colored")),
}
SPECTRUM = 2.0  # duration of the controls in the spectrum [s]
AT_GOAL = 0.25  # distance to the goal within which an axis has settled [m]
HIGH = 20.0  # [Hz]


class Track(NamedTuple):
    """One axis of a run. The last control is repeated, so that all arrays have equal length."""

    t: np.ndarray  # [s]
    p: np.ndarray  # position [m]
    u: np.ndarray  # control [m/s^2]


class Best(NamedTuple):
    """The best run of a sampler."""

    seed: int
    cost: float
    track: Track


def make(runs: int, folder: Path) -> Result:
    """Simulate `runs` runs of each sampler, and plot the run of least cost."""
    cells = [Cell(name, SIGMA) for name in PAPER_SAMPLERS]
    best = {
        cell.sampler: best_run(cell.sampler, [run.cost for run in of_cell])
        for cell, of_cell in scores(cells, runs, folder).items()
    }
    numbers = {
        name: {"seed": run.seed, "cost": run.cost} | summary(run.track)
        for name, run in best.items()
    }
    rows = [
        {"sampler": name, "t": t, "p": p, "u": u}
        for name, run in best.items()
        for t, p, u in zip(*(column.tolist() for column in run.track), strict=True)
    ]
    figure = draw({name: run.track for name, run in best.items()})
    files = (
        write_csv(folder / "double_integrator.csv", rows),
        *write_figure(figure, folder, "double_integrator"),
    )
    return Result(numbers, (), files)


def best_run(name: str, costs: list[float]) -> Best:
    """Recompute and return the run of least cost, given the costs by seed."""
    seed = int(np.argmin(costs))
    motion = move(MotionTask(samplings(SIGMA)[name], seed))
    if accumulated_cost(motion) != costs[seed]:
        complain(
            f"{name} seed {seed}: computed again it is another run,"
            " as the code or the machine is another"
        )
    axis = 0
    u = np.append(motion.u[:, axis], motion.u[-1, axis])
    return Best(seed, costs[seed], Track(motion.t, motion.x[:, axis], u))


def summary(track: Track) -> dict[str, float | None]:
    """Return the numbers of a track for the figure.

    Returns:
        settled: time after which the axis stays within AT_GOAL [s]; None if it never does.
        largest_control: largest absolute control [m/s^2].
        control_at_rest: standard deviation of the control in the last second [m/s^2].
        power_above_20_hz: power of the control above 20 Hz [(m/s^2)^2].
    """
    away = np.flatnonzero(abs(track.p - GOAL.x) > AT_GOAL)
    settled = away[-1] + 1 if len(away) else len(track.t)
    last_second = round(1.0 / (track.t[1] - track.t[0]))
    f, power = psd(track.t, track.u)
    return {
        "settled": float(track.t[settled]) if settled < len(track.t) else None,
        "largest_control": float(abs(track.u).max()),
        "control_at_rest": float(track.u[-last_second:].std()),
        "power_above_20_hz": float(power[f > HIGH].sum() * f[1]),
    }


def psd(t: np.ndarray, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the one-sided periodogram of the first SPECTRUM seconds.

    Args:
        t: equidistant times [s]  (n,).
        u: control at these times  (n,).

    Returns:
        Frequencies [Hz], and power per Hz.
    """
    dt = float(t[1] - t[0])
    early = u[: round(SPECTRUM / dt)]
    power = 2 * dt / len(early) * np.abs(np.fft.rfft(early)) ** 2
    return np.fft.rfftfreq(len(early), dt), power


def draw(tracks: Mapping[str, Track]) -> Figure:
    """Return a figure of position, control and the control's spectrum along one axis."""
    with rc_context(STYLE):
        figure = Figure(figsize=(14, 4.4), dpi=110, layout="constrained")
        state, control, spectrum = figure.subplots(1, 3)
        for name, track in tracks.items():
            look = line(LOOKS[name])
            state.plot(track.t, track.p, **look, label=name, linewidth=1.3)
            control.plot(track.t, track.u, **look, linewidth=0.9)
            f, power = psd(track.t, track.u)
            spectrum.loglog(f[1:], power[1:], **look, linewidth=1.0)
        state.axhline(GOAL.x, color=MARK, linestyle="--", linewidth=0.8)
        state.set(title="position of one axis [m]", xlabel="t [s]")
        control.set(title="control [m/s$^2$]", xlabel="t [s]")
        control.set_yscale("symlog", linthresh=5.0)
        spectrum.set(title=f"control's spectrum, first {SPECTRUM:g} s", xlabel="f [Hz]")
        state.legend(loc="lower right")
    return figure
