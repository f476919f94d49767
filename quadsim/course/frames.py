"""The physical frames of a course; a gate that is flown several times is one frame.

A course lists passes: the same frame may be listed for both directions, with another yaw or roll,
or with angles that differ by a full turn. The world contains frames: a vehicle touches them, and a
camera sees them.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import dist

import numpy as np

from quadsim.course.gate import Gate

# Two frames whose corners lie this near to each other are one [m]. Two could not stand there, and
# angles that are rounded differently move a corner by some millimetres.
SAME = 0.01


def frames(gates: Sequence[Gate]) -> tuple[Gate, ...]:
    """Return the first gate of each physical frame, in the order of the course."""
    return _told_apart(gates)[0]


def frame_numbers(gates: Sequence[Gate]) -> tuple[int, ...]:
    """Return the frame of each gate, by its index in `frames`."""
    return _told_apart(gates)[1]


def same_frame(a: Gate, b: Gate) -> bool:
    """Return whether two gates are passes through one physical frame."""
    if dist(a.position, b.position) > SAME or abs(a.frame_width - b.frame_width) > SAME:
        return False
    corners = a.corners()[:, None] - b.corners()[None]  # (4, 4, 3)
    apart = np.linalg.norm(corners, axis=2)
    return bool((apart.min(axis=0) <= SAME).all() and (apart.min(axis=1) <= SAME).all())


def _told_apart(gates: Sequence[Gate]) -> tuple[tuple[Gate, ...], tuple[int, ...]]:
    """Return the first gate of each frame, and the index of each gate's frame."""
    found: list[Gate] = []
    known: dict[Gate, int] = {}
    for gate in dict.fromkeys(gates):
        for k, first in enumerate(found):
            if same_frame(first, gate):
                known[gate] = k
                break
        else:
            known[gate] = len(found)
            found.append(gate)
    return tuple(found), tuple(known[gate] for gate in gates)
