"""Dropouts of a camera: times for which all its pictures are lost."""

from __future__ import annotations

from math import inf

import numpy as np

from quadsim.streams import dropout_stream


class Dropouts:
    """Draws whether each picture is lost."""

    def __init__(self, share: float, duration: float, seeds: np.random.SeedSequence):
        """Begin without a dropout.

        Args:
            share: probability per picture that a dropout begins.
            duration: length of a dropout [s].
            seeds: random stream of the camera.
        """
        self._share = share
        self._duration = duration
        # A stream of its own, so that all else is the same without dropouts.
        self._rng = np.random.default_rng(dropout_stream(seeds))
        self._silent_until = -inf

    def lost(self, t: float) -> bool:
        """Return whether the picture that is taken at t [s] is lost; before t = 0 none is."""
        begins = self._rng.random() < self._share
        if begins and t > 0.0:
            self._silent_until = t + self._duration
        return t < self._silent_until
