"""Metrics of a run, as short pure functions of a RecordedRun or of plain arrays.

Chatter is measured on the commanded thrust, which is constant within each control period, and on
the delivered thrust, which is part of the state.
"""

from __future__ import annotations

from math import pi, sqrt

import numpy as np

from quadsim.dynamics.first_order import remaining
from quadsim.physics.plant_state import MotorUse
from quadsim.racing.events import sector_times
from quadsim.record.run import RecordedRun

# Lag of a racing quadrotor's motors, for vehicles whose thrust acts at once [s]
MOTOR_TAU = 0.033
# Length of a segment of Welch's method [samples]
WELCH_SEGMENT = 256


def chatter(run: RecordedRun) -> dict:
    """Return measures of the chatter of a flight's controls.

    Returns:
        commanded, delivered: measures of the commanded and the delivered thrust and body rates, by
            name.
        motor_tau, motor_corner: the motors' lag [s] and corner frequency [Hz] that the measures
        use.
    """
    x = run.telemetry
    tau = motor_tau(run.spec["vehicle"])
    return {
        "commanded": _chatter(x["t"], x["a_cmd"], commanded_rates(run), tau),
        "delivered": _chatter(x["t"], x["a"], delivered_rates(run), tau),
        "motor_tau": tau,
        "motor_corner": motor_corner(tau),
    }


def _chatter(t: np.ndarray, thrust: np.ndarray, rates: np.ndarray, tau: float) -> dict[str, float]:
    """Return the measures of chatter by name, all zero if there are fewer than two times.

    Args:
        t: times [s].  (n,)
        thrust: mass-normalised thrust [m/s^2].  (n,)
        rates: body rates [rad/s].  (3, n)
        tau: lag of the motors [s].
    """
    if len(t) < 2:
        t = np.array([0.0, 1.0])
        thrust = np.zeros(2)
        rates = np.zeros((3, 2))
    slew = np.diff(thrust) / np.diff(t)
    return {
        "thrust_tv": total_variation(t, thrust),
        "thrust_slew_rms": float(np.sqrt(np.mean(slew**2))),
        "thrust_slew_max": float(np.max(np.abs(slew))),
        "high_frequency_fraction": high_frequency_fraction(t, thrust, motor_corner(tau)),
        "motor_residual": motor_residual(t, thrust, tau),
        "smoothness": smoothness(t, thrust),
        "body_rates_tv": total_variation(t, rates),
    }


def commanded_rates(run: RecordedRun) -> np.ndarray:
    """Return the commanded body rates of every frame [rad/s].  (3, frames)"""
    x = run.telemetry
    return np.stack([x["wx_cmd"], x["wy_cmd"], x["wz_cmd"]])


def delivered_rates(run: RecordedRun) -> np.ndarray:
    """Return the true body rates of every frame [rad/s].  (3, frames)"""
    x = run.telemetry
    return np.stack([x["wx"], x["wy"], x["wz"]])


def speed(run: RecordedRun) -> np.ndarray:
    """Return the speed of every frame [m/s].  (frames,)"""
    x = run.telemetry
    return np.sqrt(x["vx"] ** 2 + x["vy"] ** 2 + x["vz"] ** 2)


def motor_use(run: RecordedRun) -> MotorUse | None:
    """Return the use of the motors per second of flight [1/s], [m/s^2].

    It is None if no firmware commanded the motors.
    """
    x = run.telemetry
    if not run.spec.get("betaflight"):
        return None
    if len(x["t"]) < 2:
        return MotorUse()
    flown = float(x["t"][-1] - x["t"][0])
    return MotorUse(*(float(x[name][-1]) / flown for name in MotorUse._fields))


def path_length(run: RecordedRun) -> float:
    """Return the length of the flown path through the positions of all frames [m]."""
    x = run.telemetry
    steps = np.diff(np.stack([x["px"], x["py"], x["pz"]]))
    return float(np.linalg.norm(steps, axis=0).sum())


def motor_tau(vehicle: dict) -> float:
    """Return the motors' lag [s] of the vehicle in a spec, MOTOR_TAU if it has no rotors."""
    rotors = vehicle.get("rotors")
    return float(rotors["motor_tau"]) if rotors else MOTOR_TAU


def motor_corner(tau: float) -> float:
    """Return the corner frequency 1 / (2 pi tau) of a first-order lag [Hz]."""
    return 1.0 / (2.0 * pi * tau)


def total_variation(t: np.ndarray, u: np.ndarray) -> float:
    """Return sum |du| / T, summed over the rows of u [unit of u / s].

    Args:
        t: times [s].  (n,)
        u: one signal  (n,), or several  (signals, n).
    """
    if len(t) < 2:
        return 0.0
    return float(np.abs(np.diff(u)).sum() / (t[-1] - t[0]))


def motor_residual(t: np.ndarray, u: np.ndarray, tau: float) -> float:
    """Return the RMS of u - lowpass_tau(u), the part that no motor follows [unit of u].

    If u is constant over each period h, the difference e decays as e exp(-s/tau). Its mean square
    in
    the period is e^2 tau (1 - exp(-2h/tau)) / 2h, which is exact in continuous time for any period.
    """
    h = (t[-1] - t[0]) / (len(t) - 1)
    keep = remaining(tau, h)
    y = float(u[0])
    squares = 0.0
    for value in u.tolist():
        squares += (value - y) ** 2
        y = value + keep * (y - value)
    return sqrt(squares / len(u) * tau * (1.0 - keep * keep) / (2.0 * h))


def smoothness(t: np.ndarray, u: np.ndarray) -> float:
    """Return 2/(n f_s) sum M_i f_i over the n frequencies f_i > 0 with amplitudes M_i [unit of u].

    CAPS (Mysore et al. 2021) has this measure; f_s is the rate of the samples.
    """
    rate = (len(t) - 1) / (t[-1] - t[0])
    frequencies = np.fft.rfftfreq(len(u), 1.0 / rate)[1:]
    amplitudes = 2.0 / len(u) * np.abs(np.fft.rfft(u))[1:]
    return float(2.0 / (len(frequencies) * rate) * np.sum(amplitudes * frequencies))


def thrust_psd(t: np.ndarray, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the one-sided power spectral density by Welch's method.

    The segments have Hann windows, overlap by half, and have their mean removed. The integral over
    the frequency is the variance, without changes that are slower than a segment.

    Returns:
        f: frequencies [Hz].
        psd: density [unit of u squared per Hz].
    """
    # Here, as it takes .7 s to import
    from scipy.signal import welch

    rate = (len(t) - 1) / (t[-1] - t[0])
    # Less u[0], so that a constant gives exact zeros
    return welch(u - u[0], rate, nperseg=min(len(u), WELCH_SEGMENT))


def high_frequency_fraction(t: np.ndarray, u: np.ndarray, corner: float) -> float:
    """Return the share of the power above a corner frequency [Hz], 0 for a constant signal."""
    f, psd = thrust_psd(t, u)
    total = float(psd[1:].sum())
    if total <= 0.0:
        return 0.0
    return float(psd[f > corner].sum()) / total


def splits(run: RecordedRun) -> list[list[float]]:
    """Return the flown times from gate to gate [s], one list for each lap."""
    return sector_times(run.events)


def missed_deadlines(run: RecordedRun) -> int:
    """Return the number of control periods that began late because a plan was not ready.

    With the simulated clock there are none.
    """
    period = run.spec["planner"]["mppi"]["dt"]
    gaps = np.diff(run.telemetry["t"])
    return int(np.sum(gaps > period + 0.5 * run.spec["plant_dt"]))
