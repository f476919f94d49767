"""Figure: state, control and spectrum of the best run at sigma 1.5 of each of the paper's six samplers."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib import rc_context
from matplotlib.figure import Figure

from quadsim.app.figures.style import STYLE, line, write_figure
from quadsim.app.paper.integrator import GOAL, MPPI_CONFIG, frames
from quadsim.app.paper.result import Result, write_csv
from quadsim.app.paper.table2 import costs, variant
from quadsim.palette import MARK, dotted, style

SIGMA = 1.5
LOOKS = {name: style(name) for name in ("gaussian", "smooth", "smooth_star", "log_normal")}
LOOKS |= {"colored_1": style("colored"), "colored_2": dotted(style("colored"))}
NAMES = tuple(LOOKS)
SPECTRUM = 2.0  # seconds of controls in the spectrum
RUNS = 20


def run(runs: int, folder: Path) -> Result:
    made = costs(NAMES, (SIGMA,), runs, folder)
    totals = {name: [r["cost"] for r in made[name, SIGMA]] for name in NAMES}
    best = {name: int(np.argmin(cost)) for name, cost in totals.items()}
    tracks = {name: _track(name, seed) for name, seed in best.items()}
    numbers = {name: {"seed": best[name], "cost": min(totals[name])} | _summary(*tracks[name]) for name in NAMES}
    rows = [
        {"sampler": name, "t": k * MPPI_CONFIG.dt, "p": float(p), "u": float(u)}
        for name, (x, v) in tracks.items()
        for k, (p, u) in enumerate(zip(x, v, strict=True))
    ]
    files = (
        write_csv(folder / "double_integrator.csv", rows),
        *write_figure(_draw(tracks), folder, "double_integrator"),
    )
    return Result(numbers, (), files)


def _track(name: str, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Position and control of the first axis.  (steps + 1,) each, the last control held"""
    flown = frames(variant(name, SIGMA), seed)
    return np.array([f.x[0] for f in flown]), np.array([f.u[0] for f in flown])


def psd(u: np.ndarray, dt: float) -> tuple[np.ndarray, np.ndarray]:
    """One-sided periodogram: f [Hz], power per Hz."""
    power = 2 * dt / len(u) * np.abs(np.fft.rfft(u)) ** 2
    return np.fft.rfftfreq(len(u), dt), power


def _summary(p: np.ndarray, u: np.ndarray) -> dict:
    """When the axis is within .25 m of the goal for good [s]; largest control; control at rest; power above 20 Hz."""
    dt = MPPI_CONFIG.dt
    away = np.flatnonzero(abs(p - GOAL[0]) > 0.25)
    f, power = psd(u[: round(SPECTRUM / dt)], dt)
    return {
        "settled": float((away[-1] + 1) * dt) if len(away) and away[-1] + 1 < len(p) else None,
        "largest_control": float(abs(u).max()),
        "control_at_rest": float(u[-round(1.0 / dt) :].std()),
        "power_above_20_hz": float(power[f > 20.0].sum() * f[1]),
    }


def _draw(tracks: dict[str, tuple[np.ndarray, np.ndarray]]) -> Figure:
    dt = MPPI_CONFIG.dt
    with rc_context(STYLE):
        figure = Figure(figsize=(14, 4.4), dpi=110, layout="constrained")
        state, control, spectrum = figure.subplots(1, 3)
        for name, (p, u) in tracks.items():
            t, look = np.arange(len(p)) * dt, line(LOOKS[name])
            state.plot(t, p, **look, label=name, linewidth=1.3)
            control.plot(t, u, **look, linewidth=0.9)
            f, power = psd(u[: round(SPECTRUM / dt)], dt)
            spectrum.loglog(f[1:], power[1:], **look, linewidth=1.0)
        state.axhline(GOAL[0], color=MARK, linestyle="--", linewidth=0.8)
        state.set(title="position of one axis [m]", xlabel="t [s]")
        control.set(title="control [m/s$^2$]", xlabel="t [s]")
        control.set_yscale("symlog", linthresh=5.0)
        spectrum.set(title=f"control's spectrum, first {SPECTRUM:g} s", xlabel="f [Hz]")
        state.legend(loc="lower right")
    return figure
