"""Metrics: what a report says, each a short pure function of a Run or of plain arrays.

Of a quadrotor, chatter is measured on the commanded thrust (held over each control period) and on
the delivered one (the state); of any other system on each commanded control.
"""

from __future__ import annotations

from math import pi, sqrt

import numpy as np

from quadsim.dynamics.first_order import remaining
from quadsim.race.events import sector_times
from quadsim.record.run import Run, system_of, units_of

MOTOR_TAU = 0.033  # [s] a racing quadrotor's, for vehicles whose thrust acts at once
WELCH_SEGMENT = 256  # samples


def chatter(run: Run) -> dict:
    """Of a quadrotor {commanded: {...}, delivered: {...}}, and the motor lag [s] and corner [Hz]
    they refer to.

    Of any other system {commanded: {control: {unit, tv, slew_max}}}, both in unit/s.
    """
    x = run.telemetry
    if system_of(run.spec) != "quadrotor":
        units = units_of(run.spec)[1].items()
        return {
            "commanded": {
                name: {"unit": unit, **_variation(x["t"], x[name])} for name, unit in units
            }
        }
    tau = motor_tau(run.spec["vehicle"])
    commanded = _chatter(x["t"], x["a_cmd"], _rows(x, "wx_cmd", "wy_cmd", "wz_cmd"), tau)
    delivered = _chatter(x["t"], x["a"], _rows(x, "wx", "wy", "wz"), tau)
    return {
        "commanded": commanded,
        "delivered": delivered,
        "motor_tau": tau,
        "motor_corner": motor_corner(tau),
    }


def _variation(t: np.ndarray, u: np.ndarray) -> dict[str, float]:
    """Total variation and largest slew, both [unit of u / s]."""
    slew = np.abs(np.diff(u)) / np.diff(t)  # (n - 1,)
    return {"tv": total_variation(t, u), "slew_max": float(slew.max(initial=0.0))}


def _chatter(t: np.ndarray, thrust: np.ndarray, rates: np.ndarray, tau: float) -> dict[str, float]:
    """All zero for a flight too short to change anything."""
    if len(t) < 2:
        t, thrust, rates = np.array([0.0, 1.0]), np.zeros(2), np.zeros((3, 2))
    slew = np.diff(thrust) / np.diff(t)  # (n - 1,)
    return {
        "thrust_tv": total_variation(t, thrust),
        "thrust_slew_rms": float(np.sqrt(np.mean(slew**2))),
        "thrust_slew_max": float(np.max(np.abs(slew))),
        "high_frequency_fraction": high_frequency_fraction(t, thrust, motor_corner(tau)),
        "motor_residual": motor_residual(t, thrust, tau),
        "smoothness": smoothness(t, thrust),
        "body_rates_tv": total_variation(t, rates),
    }


def motor_tau(vehicle: dict) -> float:
    """The motors' lag [s] in a spec's vehicle, MOTOR_TAU where it has none."""
    rotors = vehicle.get("rotors")
    return float(rotors["tau"]) if rotors else MOTOR_TAU


def motor_corner(tau: float) -> float:
    """1 / (2 pi tau) [Hz]"""
    return 1.0 / (2.0 * pi * tau)


def total_variation(t: np.ndarray, u: np.ndarray) -> float:
    """sum |du| / T, summed over the rows of u [unit of u / s]."""
    return float(np.abs(np.diff(u)).sum() / (t[-1] - t[0])) if len(t) > 1 else 0.0


def motor_residual(t: np.ndarray, u: np.ndarray, tau: float) -> float:
    """RMS of u - lowpass_tau(u), the part no motor follows [unit of u].

    With u held over each period h the gap decays as e exp(-s/tau), so its mean square there is
    e^2 tau (1 - exp(-2h/tau)) / 2h: exact in continuous time, whatever the period.
    """
    h = (t[-1] - t[0]) / (len(t) - 1)
    keep, y, total = remaining(tau, h), float(u[0]), 0.0
    for v in u.tolist():
        total += (v - y) ** 2
        y = v + keep * (y - v)
    return sqrt(total / len(u) * tau * (1.0 - keep * keep) / (2.0 * h))


def smoothness(t: np.ndarray, u: np.ndarray) -> float:
    """2/(n f_s) sum M_i f_i over the n frequencies f_i > 0, amplitudes M_i (CAPS, Mysore et al.
    2021) [unit of u]."""
    rate = (len(t) - 1) / (t[-1] - t[0])
    frequencies = np.fft.rfftfreq(len(u), 1.0 / rate)[1:]
    amplitudes = 2.0 / len(u) * np.abs(np.fft.rfft(u))[1:]
    return float(2.0 / (len(frequencies) * rate) * np.sum(amplitudes * frequencies))


def thrust_psd(t: np.ndarray, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """One-sided power spectral density by Welch: Hann windows, half overlapping, mean removed.

    f [Hz], psd [unit of u squared per Hz]; the integral over f is the variance, less what is slower
    than a segment.
    """
    from scipy.signal import welch  # takes .7 s to import

    rate = (len(t) - 1) / (t[-1] - t[0])
    # less u[0], so that a constant gives exact zeros
    return welch(u - u[0], rate, nperseg=min(len(u), WELCH_SEGMENT))


def high_frequency_fraction(t: np.ndarray, u: np.ndarray, corner: float) -> float:
    """Share of the power above a corner [Hz]; 0 for a constant."""
    f, psd = thrust_psd(t, u)
    total = float(psd[1:].sum())
    return float(psd[f > corner].sum()) / total if total > 0.0 else 0.0


def splits(run: Run) -> list[list[float]]:
    """Flown seconds from gate to gate, one list a lap."""
    return sector_times(run.events)


def missed_deadlines(run: Run) -> int:
    """Control periods that came late because a plan was not ready; none under the simulated
    clock."""
    period = run.spec["planner"]["mppi"]["dt"]
    gaps = np.diff(run.telemetry["t"])
    return int(np.sum(gaps > period + 0.5 * run.spec["plant_dt"]))


def _rows(x: dict[str, np.ndarray], *names: str) -> np.ndarray:
    return np.stack([x[name] for name in names])  # (names, frames)
