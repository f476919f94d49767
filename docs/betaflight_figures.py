"""The pictures of betaflight.md: step responses, and spectra of both samplers' flights.

.venv/bin/python docs/betaflight_figures.py

It needs the firmware (race firmware build) and orangebox (pip install --editable '.[betaflight]').
"""

from __future__ import annotations

from functools import partial
from itertools import product
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from orangebox import Parser
from scipy.signal import TransferFunction, step, welch
from shared import save, use_style

import quadsim
from quadsim.firmware.actuators import READY, BetaflightActuators
from quadsim.firmware.gain_search import step_response
from quadsim.firmware.identification import RateLoop
from quadsim.firmware.identified import firmware_for, identified
from quadsim.palette import INK, LIMIT, SPARE, STYLES
from quadsim.physics.actuators import Actuators

COURSE = "split_s_swift"
SAMPLERS = ("gaussian", "colored")
SHOWN = 0.3  # of a step response [s]
SEGMENT = 1024  # of Welch's method [samples]
HIGHEST = 300.0  # frequency that is drawn; what the log rounds off lies above [Hz]
BAND = (10.0, HIGHEST)  # of the root mean squares that are printed [Hz]
# Column of the log -> title, factor to the unit (None: of the motors' range), unit of the density
LOGGED = {
    "setpoint[0]": ("commanded roll rate", np.pi / 180.0, "(rad/s)$^2$/Hz"),
    "gyroADC[0]": ("measured roll rate", np.pi / 180.0, "(rad/s)$^2$/Hz"),
    "motor[0]": ("command to a motor", None, "1/Hz"),
}


def main() -> None:
    """Fly and draw the pictures."""
    use_style()
    draw_steps()
    draw_spectra()


def draw_steps() -> None:
    """Draw what a body rate does after a step of its command, about each axis."""
    spec = quadsim.Spec.of(COURSE, flight_controller="betaflight")
    assert spec.betaflight
    vehicle, dt = spec.vehicle, spec.plant_dt
    built, configuration = firmware_for(vehicle, spec.betaflight)
    firmware = partial(BetaflightActuators, vehicle, dt, built, configuration)
    ideal = partial(Actuators, vehicle, dt)
    found = identified(vehicle, spec.betaflight, dt, spec.planner.mppi.dt)

    figure, axes = plt.subplots(1, 3, figsize=(10.5, 3.2), sharey=True)
    for axis, (panel, name) in enumerate(zip(axes, ("roll", "pitch", "yaw"), strict=True)):
        panel.axhline(1.0, color=LIMIT, linewidth=0.8, label="command")
        for new_actuators, style, label in (
            (ideal, SPARE[0], "ideal rate loop"),
            (firmware, SPARE[1], "Betaflight"),
        ):
            response = step_response(vehicle, axis, dt, new_actuators)
            t = dt * np.arange(len(response.rates))
            share = response.rates / response.level
            panel.plot(t, share, color=style.colour, linewidth=1.6, label=label)
        t, share = predicted(found.axes[axis])
        panel.plot(t + found.delay, share, "--", color=INK, linewidth=1.2, label="planner's model")
        panel.set_title(name)
        panel.set_xlim(0.0, SHOWN)
        panel.set_xlabel("time since the command [s]")
    axes[0].set_ylabel("body rate, as a share of the step")
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside upper center", ncols=4)
    save(figure, "betaflight_steps.png")


def predicted(loop: RateLoop) -> tuple[np.ndarray, np.ndarray]:
    """Return times [s] and the step response of the identified second-order system."""
    system = TransferFunction([1.0], [loop.rate_tau * loop.rate_lag, loop.rate_tau, 1.0])
    return step(system, T=np.linspace(0.0, SHOWN, 600))


class Spectrum(NamedTuple):
    """The spectrum of one signal of the firmware's log."""

    f: np.ndarray  # frequencies [Hz]
    density: np.ndarray  # power spectral density


class LoggedLap(NamedTuple):
    """A lap, and the spectra of its log."""

    lap: float  # [s]
    spectra: list[Spectrum]  # of the signals of LOGGED, in their order


def draw_spectra() -> None:
    """Draw the spectra of what the firmware logs of both samplers' flights, and print their powers.

    The figure has the smoothed plans of the preset, the table also plans as they are sampled.
    """
    figure, axes = plt.subplots(1, 3, figsize=(10.5, 3.4))
    for smooth, sampler in product((False, True), SAMPLERS):
        flown = logged_lap(sampler, smooth)
        powers = [f"{rms(spectrum):.3f}" for spectrum in flown.spectra]
        plan = "smoothed" if smooth else "as sampled"
        print(plan, sampler, f"{flown.lap:.3f}", *powers, sep=" | ")
        if smooth:
            for panel, (f, density) in zip(axes, flown.spectra, strict=True):
                shown = (f > 0.0) & (f <= HIGHEST)
                draw_density(panel, f[shown], density[shown], STYLES[sampler].colour, sampler)
    for panel, (title, _, unit) in zip(axes, LOGGED.values(), strict=True):
        panel.set_title(title)
        panel.set_xlabel("frequency [Hz]")
        panel.set_ylabel(f"power spectral density [{unit}]")
    axes[0].legend()
    save(figure, "betaflight_spectra.png")


def logged_lap(sampler: str, smooth: bool) -> LoggedLap:
    """Fly a lap behind the firmware, and read the spectra of its log."""
    with TemporaryDirectory() as folder:
        log = Path(folder) / "flight.bbl"
        run = quadsim.fly(
            COURSE,
            sampler=sampler,
            smooth=smooth,
            flight_controller="betaflight",
            laps=1,
            blackbox=str(log),
        )
        read = Parser.load(str(log))
        frames = [frame.data for frame in read.frames()]
    column = {name: read.field_names.index(name) for name in (*LOGGED, "time")}
    t = 1e-6 * np.array([frame[column["time"]] for frame in frames], float)
    t -= t[0] + READY
    flying = (t >= 0.0) & (t <= run.duration)
    rate = float(1.0 / np.median(np.diff(t)))
    low, high = np.array(read.headers["motorOutput"], float)
    spectra = []
    for name, (_, factor, _) in LOGGED.items():
        signal = np.array([frame[column[name]] for frame in frames], float)[flying]
        scale = 1.0 / (high - low) if factor is None else factor
        spectra.append(Spectrum(*welch(scale * signal, rate, nperseg=SEGMENT)))
    return LoggedLap(run.laps[0], spectra)


def rms(spectrum: Spectrum) -> float:
    """Return the root mean square of a signal within BAND, from its spectrum."""
    inside = (spectrum.f >= BAND[0]) & (spectrum.f <= BAND[1])
    return float(np.sqrt(np.trapezoid(spectrum.density[inside], spectrum.f[inside])))


def draw_density(panel: Axes, f: np.ndarray, density: np.ndarray, colour: str, name: str) -> None:
    """Draw one spectrum on two logarithmic axes."""
    panel.loglog(f, density, color=colour, linewidth=1.4, label=name)
    panel.grid(which="both", alpha=0.25)


if __name__ == "__main__":
    main()
