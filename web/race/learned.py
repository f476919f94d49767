"""What a flight has learned of its vehicle by a frame, from the columns of its telemetry."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from quadsim.record.run import NOTABLE, SHARES, LearnedDelay, LearnedRotor


class Learned(NamedTuple):
    """The rotors that are found to be weak or strong, and a delay of the commands, if any."""

    rotors: tuple[LearnedRotor, ...]
    delay: LearnedDelay | None


def learned_by(x: Mapping[str, np.ndarray], i: int) -> Learned:
    """Return what is learned at frame i; at the last one it is what the stored run names.

    Args:
        x: columns of the telemetry.  (frames,)
    """
    rotors = []
    for rotor, name in enumerate(SHARES, 1):
        share = x[name][: i + 1]
        is_notable = np.abs(share - 1.0) >= NOTABLE
        if is_notable[-1]:
            rotors.append(LearnedRotor(rotor, float(share[-1]), _since(is_notable, x["t"])))
    delays = x["delay"][: i + 1]
    delay = float(delays[-1])
    late = LearnedDelay(delay, _since(delays == delay, x["t"])) if delay else None
    return Learned(tuple(rotors), late)


def _since(holds: np.ndarray, t: np.ndarray) -> float:
    """Return the time from which something has held, which holds at the end [s]."""
    others = np.flatnonzero(~holds)
    return float(t[others[-1] + 1 if len(others) else 0])
