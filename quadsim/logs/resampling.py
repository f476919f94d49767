"""Signals at the times of another clock."""

from __future__ import annotations

import numpy as np

# A value is missing if its readings are farther apart than this multiple of their median step.
LATEST = 3.5


def interpolated(t: np.ndarray, own: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Return a signal between its readings; NaN in gaps, before the first and after the last.

    Args:
        t: times wanted [s]  (n,).
        own: times of the readings, in any order [s]  (m,).
        values: the readings  (m, k).

    Returns:
        (n, k)
    """
    own, values = _in_order(own, values)
    if len(own) < 2:
        return np.full((len(t), values.shape[1]), np.nan)
    found = np.stack([np.interp(t, own, column) for column in values.T], axis=1)
    after = np.clip(np.searchsorted(own, t), 1, len(own) - 1)
    steps = np.diff(own)
    missing = steps[after - 1] > LATEST * np.median(steps)
    found[missing | (t < own[0]) | (t > own[-1])] = np.nan
    return found


def held(t: np.ndarray, own: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Return the last reading at each time; NaN before the first one.

    Args:
        t: times wanted [s]  (n,).
        own: times of the readings, in any order [s]  (m,).
        values: the readings  (m, k).

    Returns:
        (n, k)
    """
    own, values = _in_order(own, values)
    found = np.full((len(t), values.shape[1]), np.nan)
    last = np.searchsorted(own, t, side="right") - 1
    found[last >= 0] = values[last[last >= 0]]
    return found


def _in_order(own: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return readings by their times, each time once."""
    times, rows = np.unique(own, return_index=True)
    return times, values[rows]
