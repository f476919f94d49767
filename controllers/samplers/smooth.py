"""Smooth-MPPI (Kim et al. 2022): noise on the derivative of the controls, integrated over the iterations.

    d = D + sigma xi        sampled derivatives around the derivative plan D, xi ~ N(0, 1)
    v = U + d dt            sampled controls: no sum over t, so v is as white as Gaussian sampling's
    D <- sum_m w^m d^m      U <- U + D dt

So D dt is what the plan U changed by in the last iteration, and sampling is centred on U plus that
change: Gaussian sampling with sigma dt and a momentum. Smooth-MPPI* (Vlahov et al. 2024, section
IV-C) is the same with sigma / dt. There, when time moves on by one period, D moves with the plan
(`corrected`) or, by a slip of the authors' public CUDA code that its tables rest on, every derivative
becomes the one at index 1 (`published`).
"""

from __future__ import annotations

import numpy as np

SHIFTS = ("corrected", "published")


class Momentum:
    """D dt, what the last iteration changed the plan by.  `change` (T, n_u)"""

    def __init__(self, horizon: int, channels: int, shift: str):
        self.change = np.zeros((horizon, channels))
        self._shift = shift

    def shift(self, steps: int) -> None:
        """Time has moved on by so many control periods; beyond the horizon the last change goes on."""
        moved = np.minimum(np.arange(len(self.change)) + steps, len(self.change) - 1)
        self.change = self.change[moved if self._shift == "corrected" else np.full_like(moved, moved[0])]
