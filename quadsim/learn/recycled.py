"""Large arrays that are given out anew: the system's fresh memory costs more time than filling
it."""

from __future__ import annotations

from sys import getrefcount

import numpy as np

MOST = 8  # arrays that are kept
# references to an array that nobody else holds: the list's, the loop's, and the question's own
OURS = 3


class Recycled:
    """float32 arrays of one shape. One that somebody still holds, or a view of it, is never given
    out again."""

    def __init__(self, shape: tuple[int, ...]):
        self._shape, self._made = shape, []

    def take(self) -> np.ndarray:
        """An array whose numbers are to be filled in."""
        for array in self._made:
            if getrefcount(array) == OURS:
                return array
        made = np.empty(self._shape, np.float32)
        if len(self._made) < MOST:
            self._made.append(made)
        return made
