"""The figure of a fitted vehicle, which compares measured and simulated signals."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from quadsim.dynamics.quadrotor import Control, ModelParams, State, quadrotor
from quadsim.figures.style import STYLE
from quadsim.identify import VehicleFit
from quadsim.identify.traces import Trace
from quadsim.palette import GRID
from quadsim.vehicle import GRAVITY

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MEASURED = "#8a8f98"
SIMULATED = "#c2410c"
OTHERS = ("#1d4ed8", "#15803d", "#7c3aed")
STEP_TIME = 0.6  # of the step responses [s]
STEP_DT = 0.002
RATE_STEP = 1.0  # [rad/s]
THRUST_STEP = 2.0  # [m/s^2]
TITLES = {"force": "accelerometer", "rate": "body rate", "velocity": "velocity"}


def fit_figure(fit: VehicleFit) -> Figure:
    """Return the figure of a fit.

    Rows of measured and simulated signals, then errors of predicted positions, the distribution of
    the residuals, and step responses of the fitted vehicle.
    """
    import matplotlib as mpl
    from matplotlib.figure import Figure

    channels = list(dict.fromkeys(trace.channel for trace in fit.traces))
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(11.0, 2.3 * (len(channels) + 1) + 0.6), layout="constrained")
        figure.suptitle(f"{fit.name}: measured and simulated", x=0.01, ha="left")
        grid = figure.add_gridspec(len(channels) + 1, 3)
        for row, channel in enumerate(channels):
            mine = [trace for trace in fit.traces if trace.channel == channel]
            for column, trace in enumerate(mine):
                _draw_trace(
                    figure.add_subplot(grid[row, column]), trace, is_first=row + column == 0
                )
        last = len(channels)
        _draw_predictions(figure.add_subplot(grid[last, 0]), fit)
        _draw_residuals(figure.add_subplot(grid[last, 1]), fit)
        _draw_steps(figure.add_subplot(grid[last, 2]), fit)
    return figure


def _draw_trace(axes: Axes, trace: Trace, *, is_first: bool) -> None:
    """Draw a measured signal and its prediction."""
    axes.plot(trace.t, trace.measured, color=MEASURED, linewidth=1.4, label="measured")
    axes.plot(trace.t, trace.predicted, color=SIMULATED, linewidth=0.9, label="simulated")
    axes.set_title(f"{TITLES[trace.channel]} {trace.axis} [{trace.unit}]")
    axes.set_xlabel("time in the log [s]")
    if is_first:
        axes.legend(loc="upper right")


def _draw_predictions(axes: Axes, fit: VehicleFit) -> None:
    """Draw the errors of predicted positions over the time since the prediction began."""
    axes.set_title("error of the predicted position [m]")
    axes.set_xlabel("time since the begin [s]")
    if not fit.predictions:
        axes.text(0.5, 0.5, "the logs have no position", ha="center", transform=axes.transAxes)
        return
    log = fit.predictions[-1].log
    mine = [prediction for prediction in fit.predictions if prediction.log == log]
    seconds = [prediction.seconds for prediction in mine]
    rows = {
        "measured attitude": [prediction.measured_attitude for prediction in mine],
        "simulated attitude": [prediction.simulated_attitude for prediction in mine],
        "constant velocity": [prediction.constant_velocity for prediction in mine],
    }
    for (name, errors), colour in zip(rows.items(), OTHERS, strict=True):
        if None not in errors:
            axes.plot(seconds, errors, "o-", color=colour, markersize=3, label=name)
    axes.set_yscale("log")
    axes.legend(loc="upper left")


def _draw_residuals(axes: Axes, fit: VehicleFit) -> None:
    """Draw the distribution of the residuals beside a normal one."""
    bins = np.linspace(-5.0, 5.0, 61)
    for (kind, values), colour in zip(fit.residuals.items(), OTHERS, strict=False):
        density, _ = np.histogram(values, bins, density=True)
        axes.plot(0.5 * (bins[1:] + bins[:-1]), density, color=colour, label=TITLES[kind])
    normal = np.exp(-0.5 * bins**2) / np.sqrt(2.0 * np.pi)
    axes.plot(bins, normal, color=MEASURED, linestyle="--", label="normal")
    axes.set_title("density of the residuals")
    axes.set_xlabel("residual over its noise")
    axes.legend(loc="upper right")


def _draw_steps(axes: Axes, fit: VehicleFit) -> None:
    """Draw the responses of the fitted vehicle to steps of its commands."""
    system = quadrotor(ModelParams.of(fit.vehicle), STEP_DT)
    late = round(fit.vehicle.latency / STEP_DT)
    count = round(STEP_TIME / STEP_DT)
    t = STEP_DT * np.arange(count)
    hover = Control(0.0, 0.0, 0.0, GRAVITY)
    steps = {
        "roll rate": (hover._replace(wx=RATE_STEP), "wx", 0.0, RATE_STEP),
        "pitch rate": (hover._replace(wy=RATE_STEP), "wy", 0.0, RATE_STEP),
        "thrust": (hover._replace(thrust=GRAVITY + THRUST_STEP), "thrust", GRAVITY, THRUST_STEP),
    }
    for (name, (command, signal, before, size)), colour in zip(steps.items(), OTHERS, strict=True):
        x = State(*np.zeros(len(State._fields)))._replace(qw=1.0, thrust=GRAVITY)
        answer = []
        for k in range(count):
            answer.append((getattr(x, signal) - before) / size)
            x = system.step(x, command if k >= late else hover, system.params, STEP_DT)
        axes.plot(t, answer, color=colour, label=name)
    axes.axhline(1.0, color=GRID, linewidth=1.0)
    axes.set_title("answers to a step, of the vehicle")
    axes.set_xlabel("time since the command [s]")
    axes.legend(loc="lower right")
