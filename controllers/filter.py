"""The Savitzky-Golay filter over a plan."""

from __future__ import annotations

import numpy as np

SAVITZKY_GOLAY = np.array([-3, 12, 17, 12, -3]) / 35  # 5 points, order 2


def savitzky_golay(plan: np.ndarray, executed: np.ndarray) -> np.ndarray:
    """The plan filtered over time; the executed controls pad its left, its last row its right.  (T, n_u)"""
    padded = np.vstack([executed, plan, plan[-1:], plan[-1:]])
    shifted = np.stack([padded[i : i + len(plan)] for i in range(len(SAVITZKY_GOLAY))])
    return np.tensordot(SAVITZKY_GOLAY, shifted, axes=1)
