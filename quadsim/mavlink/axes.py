"""North-east-down and forward-right-down, as MAVLink has them, from and to the axes of quadsim.

The world of quadsim is east, north, up; its bodies are forward, left, up. Each function here is its
own inverse, so the same one leads to MAVLink's axes and back.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import sqrt

from quadsim.rotation import Quaternion, Vec3, product

HALF = sqrt(0.5)
# The turn from north, east, down to east, north, up: half a turn about the line between both
NED_FROM_ENU: Quaternion = (0.0, HALF, HALF, 0.0)
# Half a turn about the x axis
FLU_FROM_FRD: Quaternion = (0.0, 1.0, 0.0, 0.0)


def ned(v: Sequence[float]) -> Vec3:
    """Return an ENU vector in NED axes, or an NED vector in ENU axes."""
    x, y, z = v
    return y, x, -z


def frd(v: Sequence[float]) -> Vec3:
    """Return an FLU vector in FRD axes, or an FRD vector in FLU axes."""
    x, y, z = v
    return x, -y, -z


def ned_attitude(q: Sequence[float]) -> Quaternion:
    """Return an attitude of FLU axes in ENU as one of FRD axes in NED, or back, with w >= 0.

    Args:
        q: attitude, wxyz: forward-left-up in east-north-up, or forward-right-down in
            north-east-down.
    """
    w, x, y, z = product(product(NED_FROM_ENU, q), FLU_FROM_FRD)
    return (w, x, y, z) if w >= 0.0 else (-w, -x, -y, -z)
