"""Colour ramps."""

from __future__ import annotations

import numpy as np

# dark violet to yellow, equally spaced in lightness (after matplotlib's plasma)
_PLASMA = np.array([(75, 3, 161), (125, 3, 168), (168, 34, 150), (203, 70, 121), (229, 107, 93), (248, 148, 65)])
_PLASMA = np.vstack([_PLASMA, (253, 195, 40), (240, 249, 33)])


def ramp(share: np.ndarray) -> np.ndarray:
    """Colours of 0..1, bright is much.  (n,) -> (n, 3) uint8"""
    at = np.clip(share, 0.0, 1.0) * (len(_PLASMA) - 1)
    k = np.arange(len(_PLASMA))
    return np.stack([np.interp(at, k, _PLASMA[:, c]) for c in range(3)], axis=-1).astype(np.uint8)
