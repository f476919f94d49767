"""Errors of a gyro whose log has a measured attitude, too: bias, scale factors and tilted axes.

Over pieces of a quarter of a second the rates are integrated to a turn, theta, which is compared
with the turn between the measured attitudes:

    theta - true turn = E theta + b T,      E = diag(scale) + tilts

b is the bias. A turn of the gyro's axes against those of the attitude is the antisymmetric part of
E. The fit of thrust and inertia takes the gyro as it is.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from quadsim.identify.prepared import Prepared
from quadsim.rotation import product

PIECE = 0.25  # duration of a piece [s]
LEAST_PIECES = 40
LEAST_TURN = 0.03  # root mean square of the turns about each axis in the pieces [rad]
LARGEST = 4.0  # residuals of more standard deviations are left out
# A gyro that is read up to this time later or earlier than the attitude seems to have a bias, as
# far as its accelerations do not average out; scale factors of attitudes are not exact either.
BIAS_FLOOR = 1e-3  # [rad/s]
SCALE_FLOOR = 1e-3


class GyroNumber(NamedTuple):
    """One error of a gyro with its standard deviation."""

    key: str
    unit: str
    value: float
    std: float


def gyro_errors(parts: Sequence[Prepared]) -> tuple[GyroNumber, ...]:
    """Return the errors of the gyro, none if the flights turn too little to find them.

    Args:
        parts: stretches with a gyro; those without a measured attitude are left out.
    """
    pairs = [pair for part in parts if (pair := _turns(part)) is not None]
    if not pairs:
        return ()
    measured, error = (np.concatenate(each) for each in zip(*pairs, strict=True))
    turns = np.sqrt(np.mean(measured**2, axis=0))
    if len(measured) < LEAST_PIECES or np.min(turns) < LEAST_TURN:
        return ()
    known = np.column_stack([measured, np.full(len(measured), PIECE)])
    found = []
    stds = []
    for column in error.T:
        value, std = _regression(known, column)
        found.append(value)
        stds.append(std)
    E = np.array(found)  # a row for each axis of the gyro: by turns about x, y, z, and the bias
    S = np.array(stds)
    numbers = [
        GyroNumber(f"gyro_bias.{axis}", "rad/s", E[k, 3], float(np.hypot(S[k, 3], BIAS_FLOOR)))
        for k, axis in enumerate("xyz")
    ]
    numbers += [
        GyroNumber(f"gyro_scale.{axis}", "1", E[k, k], float(np.hypot(S[k, k], SCALE_FLOOR)))
        for k, axis in enumerate("xyz")
    ]
    for axis, (i, j) in zip("xyz", ((1, 2), (2, 0), (0, 1)), strict=True):
        # Axes that are turned by phi measure theta - phi x theta.
        value = 0.5 * (E[i, j] - E[j, i])
        std = 0.5 * float(np.hypot(S[i, j], S[j, i]))
        numbers.append(GyroNumber(f"gyro_tilt.{axis}", "rad", value, np.hypot(std, SCALE_FLOOR)))
    return tuple(number._replace(value=float(number.value)) for number in numbers)


def _turns(part: Prepared) -> tuple[np.ndarray, np.ndarray] | None:
    """Return the turns that the gyro measures in the pieces, and how far they are off  (p, 3)."""
    stretch = part.stretch
    if stretch.quaternion is None or stretch.body_rates is None:
        return None
    rows = round(PIECE / stretch.dt)
    begins = np.arange(0, len(stretch) - rows, rows)
    known = part.usable & np.all(np.isfinite(stretch.quaternion), axis=1)
    known &= np.all(np.isfinite(stretch.body_rates), axis=1)
    missing = np.concatenate([[0], np.cumsum(~known)])
    begins = begins[missing[begins + rows + 1] == missing[begins]]
    if not len(begins):
        return None
    turn = np.zeros((4, len(begins)))
    turn[0] = 1.0
    for k in range(rows):
        mean = 0.5 * (stretch.body_rates[begins + k] + stretch.body_rates[begins + k + 1])
        turn = _product(turn, _small_turn(mean.T * stretch.dt))
    back = stretch.quaternion[begins].T * np.array([[1.0], [-1.0], [-1.0], [-1.0]])
    true = _product(back, stretch.quaternion[begins + rows].T)
    # The difference in the axes at mid-piece is that in the body's at either end, to first order.
    measured, whole = _vector(turn), _vector(true)
    return measured, measured - whole


def _product(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return the attitudes a followed by the turns b  (4, p)."""
    return np.array(product(tuple(a), tuple(b)))


def _small_turn(vector: np.ndarray) -> np.ndarray:
    """Return the quaternions of some turns [rad], of shape (3, p)  (4, p)."""
    half = 0.5 * np.linalg.norm(vector, axis=0)
    return np.stack([np.cos(half), *(0.5 * np.sinc(half / np.pi) * vector)])


def _vector(q: np.ndarray) -> np.ndarray:
    """Return the shortest turns [rad] of some quaternions of shape (4, p)  (p, 3)."""
    q = np.where(q[0] < 0.0, -1.0, 1.0) * q
    length = np.linalg.norm(q[1:], axis=0)
    angle = 2.0 * np.arctan2(length, q[0])
    return (np.where(length > 0.0, angle / np.maximum(length, 1e-12), 2.0) * q[1:]).T


def _regression(known: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the coefficients of least squares without outliers, and their deviations."""
    used = np.ones(len(values), bool)
    coefficients = np.zeros(known.shape[1])
    for _ in range(3):
        coefficients = np.linalg.lstsq(known[used], values[used], rcond=None)[0]
        residual = values - known @ coefficients
        used = np.abs(residual) <= LARGEST * np.std(residual[used])
    inverse = np.linalg.inv(known[used].T @ known[used])
    return coefficients, np.std(residual[used]) * np.sqrt(np.diag(inverse))
