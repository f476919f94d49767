"""Checks that find a signal in another unit or frame than was expected, by physics.

An accelerometer measures about 9.81 m/s^2 while a vehicle hovers or stands. Velocity is the
derivative of position, and body rates are that of the attitude.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from math import isfinite
from typing import NamedTuple

import numpy as np

from quadsim.logs.raw_log import LogError

# [s] Steps of time of usable logs, from 10 kHz to 5 Hz
SHORTEST_STEP = 9e-5
LONGEST_STEP = 0.21
# Usual readings of an accelerometer, over a whole flight [m/s^2]
LEAST_FORCE = 3.0
LARGEST_FORCE = 60.0
# A signal is compared with a derivative over this time, in which noise averages out [s].
OVER = 0.1
# A slope of 1 is right. Delays and noise lower it; another unit changes it by far more. Signals
# that are alike to CLEAR tell smaller errors of the scale, too.
LEAST_SLOPE = 0.3
LARGEST_SLOPE = 3.0
CLEAR = 0.9
LEAST_CLEAR_SLOPE = 0.75
LARGEST_CLEAR_SLOPE = 1.35
# Likeness, at most 1, from which a slope says something, and rows that it takes
LEAST_LIKENESS = 0.5
FEWEST = 10
# Motion from which a comparison says something [m/s], [rad/s]
LEAST_SPEED = 0.2
LEAST_RATE = 0.1
# Body rates are compared with their setpoints over this time, later by the lag of a rate loop.
FOLLOWED_OVER = 0.4
FOLLOWED_AFTER = 0.1
LEAST_FOLLOWED = 0.5
LARGEST_FOLLOWED = 2.0
ADVICE = "correct unit or frame of the mapping"


def expect_units(name: str, t: np.ndarray, signals: Mapping[str, np.ndarray]) -> None:
    """Raise LogError if a signal cannot be in the unit or the frame of SIGNALS.

    Args:
        name: name of the log.
        t: time, rising [s]  (n,).
        signals: the signals that the log has.
    """
    step = float(np.median(np.diff(t)))
    if not SHORTEST_STEP <= step <= LONGEST_STEP:
        wanted = f"expected rows every {SHORTEST_STEP:g} to {LONGEST_STEP:g} s"
        raise LogError(f"{name}: time: {wanted}, got one every {step:.3g} s: {ADVICE}")
    if "specific_force" in signals:
        _expect_gravity(name, signals["specific_force"])
    lag = max(1, round(OVER / step))
    if {"position", "velocity"} <= signals.keys():
        moved = _moved(t, signals["position"], lag)
        _expect_slope(name, "velocity", _mean(signals["velocity"], lag), moved, LEAST_SPEED)
    if {"quaternion", "body_rates"} <= signals.keys():
        turned = _turned(t, signals["quaternion"], lag)
        _expect_slope(name, "body_rates", _mean(signals["body_rates"], lag), turned, LEAST_RATE)
    if {"rate_setpoints", "body_rates"} <= signals.keys():
        _expect_followed(name, signals["rate_setpoints"], signals["body_rates"], step)


def _expect_followed(name: str, asked: np.ndarray, rates: np.ndarray, step: float) -> None:
    """Raise LogError if the body rates do not follow their setpoints, one to one."""
    over = max(1, round(FOLLOWED_OVER / step))
    after = round(FOLLOWED_AFTER / step)
    x = _mean(asked, over)[: len(asked) - over - after]
    y = _mean(rates, over)[after:]
    for axis, compared in enumerate(_compared(x, y, LEAST_RATE)):
        if compared is None:
            continue
        if not LEAST_FOLLOWED <= compared.slope <= LARGEST_FOLLOWED:
            wanted = f"expected setpoints that the gyro follows about {'xyz'[axis]}"
            got = f"got rates of {compared.slope:.3g} times the setpoints"
            raise LogError(f"{name}: rate_setpoints: {wanted}, {got}: {ADVICE}")


def _expect_gravity(name: str, force: np.ndarray) -> None:
    """Raise LogError if an accelerometer is not in m/s^2 or points elsewhere."""
    usual = float(np.nanmedian(np.linalg.norm(force, axis=1)))
    if isfinite(usual) and not LEAST_FORCE <= usual <= LARGEST_FORCE:
        wanted = "expected an accelerometer [m/s^2] that usually reads about 9.81"
        raise LogError(f"{name}: specific_force: {wanted}, got {usual:.3g}: {ADVICE}")
    along_z = float(np.nanmedian(force[:, 2]))
    if along_z < -LEAST_FORCE:
        wanted = "expected an accelerometer that reads +9.81 m/s^2 along z (up) at hover"
        raise LogError(f"{name}: specific_force: {wanted}, got {along_z:.3g}: {ADVICE}")


def _expect_slope(
    name: str, signal: str, measured: np.ndarray, derived: np.ndarray, least: float
) -> None:
    """Raise LogError if a signal is not the derivative that it should be.

    Args:
        name: name of the log.
        signal: key of SIGNALS.
        measured: the signal, averaged over OVER  (m, 3).
        derived: the derivative over the same time  (m, 3).
        least: root mean square of a motion that says something.
    """
    for axis, compared in enumerate(_compared(derived, measured, least)):
        if compared is None:
            continue
        is_clear = compared.likeness >= CLEAR
        least_slope = LEAST_CLEAR_SLOPE if is_clear else LEAST_SLOPE
        largest_slope = LARGEST_CLEAR_SLOPE if is_clear else LARGEST_SLOPE
        if not least_slope <= compared.slope <= largest_slope:
            of = "position" if signal == "velocity" else "the attitude"
            wanted = f"expected the derivative of {of} along {'xyz'[axis]}"
            raise LogError(
                f"{name}: {signal}: {wanted}, got {compared.slope:.3g} times that: {ADVICE}"
            )


class Compared(NamedTuple):
    """Two signals along one axis."""

    # cosine between the two: the mean motion counts, too
    likeness: float
    # size of the second over the size of the first, with the sign of the likeness
    slope: float


def _compared(x: np.ndarray, y: np.ndarray, least: float) -> Iterator[Compared | None]:
    """Yield how two signals compare along each axis, None if that says nothing.

    Args:
        x: a signal  (m, 3).
        y: a signal that should be equal  (m, 3).
        least: root mean square of x that says something.
    """
    for axis in range(3):
        good = np.isfinite(x[:, axis]) & np.isfinite(y[:, axis])
        mine = x[good, axis]
        other = y[good, axis]
        if len(mine) < FEWEST or _size(mine) < least or _size(other) == 0.0:
            yield None
            continue
        likeness = float(np.mean(mine * other)) / (_size(mine) * _size(other))
        slope = _size(other) / _size(mine) * float(np.sign(likeness))
        yield Compared(likeness, slope) if abs(likeness) >= LEAST_LIKENESS else None


def _size(x: np.ndarray) -> float:
    return float(np.sqrt(np.mean(x * x)))


def _moved(t: np.ndarray, values: np.ndarray, lag: int) -> np.ndarray:
    """Return the derivative of a signal over `lag` rows.  (n - lag, ...)"""
    return (values[lag:] - values[:-lag]) / (t[lag:] - t[:-lag])[:, None]


def _turned(t: np.ndarray, q: np.ndarray, lag: int) -> np.ndarray:
    """Return the body rates that follow from an attitude, over `lag` rows [rad/s].  (n - lag, 3)"""
    before = q[:-lag]
    after = q[lag:]
    w0, u0 = before[:, :1], before[:, 1:]
    w1, u1 = after[:, :1], after[:, 1:]
    # The vector part of conj(before) after, for the shorter of the two ways
    turn = w0 * u1 - w1 * u0 - np.cross(u0, u1)
    same = np.sum(before * after, axis=1, keepdims=True)
    turn = turn * np.where(same < 0.0, -1.0, 1.0)
    return 2.0 * turn / (t[lag:] - t[:-lag])[:, None]


def _mean(values: np.ndarray, lag: int) -> np.ndarray:
    """Return the mean of a signal over the rows of each `_moved`.  (n - lag, 3)"""
    total = np.cumsum(np.nan_to_num(values), axis=0)
    missing = np.cumsum(~np.isfinite(values), axis=0)
    mean = (total[lag:] - total[:-lag]) / lag
    mean[(missing[lag:] - missing[:-lag]) > 0] = np.nan
    return mean
