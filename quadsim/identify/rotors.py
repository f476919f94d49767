"""Rotors: their speeds from the logged commands, through delay and lag, and their thrust."""

from __future__ import annotations

from math import floor

import numpy as np
from scipy.signal import lfilter

from quadsim.dynamics.first_order import remaining
from quadsim.identify.numbers import FitNumbers
from quadsim.identify.prepared import Prepared


def lagged(
    command: np.ndarray, dt: float, tau: float, delay: float, factor: np.ndarray | None = None
) -> np.ndarray:
    """Return what follows a command with a delay and a first-order lag, in the steady state first.

    The command of row k holds from row k to row k + 1. The answer is exact, for a delay between
    two rows, too, and smooth in the delay, so that a search can find it.

    Args:
        command: in equal steps of time  (n,) or (n, k).
        dt: the step [s].
        tau: the lag [s].
        delay: the delay [s]; below 0 the command is logged late.
        factor: multiplies the command at the time at which it acts, such as the effect of the
            voltage, and holds from row to row  (n,); None: 1.
    """
    rows = delay / dt
    whole = floor(rows)
    share = rows - whole
    newer = _shifted(command, whole)
    older = _shifted(command, whole + 1)
    if factor is not None:
        factor = factor.reshape(-1, *(1,) * (command.ndim - 1))
        newer = factor * newer
        older = factor * older

    # In the first `share` of a step the older command acts, then the newer one.
    left = remaining(tau, dt)
    since_newer = remaining(tau, (1.0 - share) * dt)
    pushed = (since_newer - left) * older + (1.0 - since_newer) * newer
    first = older[:1]
    answer, _ = lfilter([1.0], [1.0, -left], pushed, axis=0, zi=left * first)
    return np.concatenate([first, answer[:-1]])


def _shifted(values: np.ndarray, rows: int) -> np.ndarray:
    """Return a signal that is later by a number of rows, with its first or last value repeated."""
    index = np.clip(np.arange(len(values)) - rows, 0, len(values) - 1)
    return values[index]


def thrusts(speeds: np.ndarray, numbers: FitNumbers) -> np.ndarray:
    """Return the rotors' thrusts over the mass [m/s^2].

    Args:
        speeds: in shares of the full command  (n, 4).
        numbers: with c2, c1, c0.
    """
    return (numbers.c2 * speeds + numbers.c1) * speeds + numbers.c0


def rotor_speeds(part: Prepared, numbers: FitNumbers, lag: float = 0.0) -> np.ndarray:
    """Return the speeds of the rotors, in shares of the full command  (n, 4).

    Args:
        part: the stretch.
        numbers: with delay and lag of the rotors.
        lag: time by which the speeds are returned late [s].
    """
    if part.drive == "rotor_speeds":
        return part.command if not lag else lagged(part.command, part.stretch.dt, 0.0, lag)
    # The voltage acts at once, the command after its delay.
    effect = part.ratio**numbers.voltage_power
    return lagged(part.command, part.stretch.dt, numbers.tau, numbers.delay + lag, effect)
