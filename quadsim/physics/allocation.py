"""Allocation: the thrusts of four rotors for a demanded collective and torque, with priorities
where they saturate."""

from __future__ import annotations

import numpy as np

from quadsim.rotation import Vec3
from quadsim.vehicle import Rotors

PerRotor = tuple[float, ...]  # one number for each of the four rotors


def mixer(rotors: Rotors) -> tuple[PerRotor, ...]:
    """(collective, torque x, y, z) = mixer @ rotor thrusts.  (4, 4), [N, N m]"""
    spin = tuple(s * rotors.kappa for s in rotors.spin)
    xs, ys = zip(*rotors.positions, strict=True)
    return (1.0, 1.0, 1.0, 1.0), ys, tuple(-x for x in xs), spin


def shares(rotors: Rotors) -> tuple[tuple[float, ...], ...]:
    """Inverse of the mixer: row i gives rotor i's part of (collective, torque x, y, z).  (4, 4)

    ValueError unless each rotor carries a quarter of the collective, which `saturate` builds on.
    """
    matrix = np.array(mixer(rotors))
    inverse = np.linalg.pinv(matrix)
    if not np.allclose(matrix @ inverse, np.eye(4)) or not np.allclose(inverse[:, 0], 0.25):
        raise ValueError(
            "rotors: expected four, mirrored about the centre of mass [m], diagonal pairs of equal spin, "
            f"got positions {rotors.positions}, spin {rotors.spin}"
        )
    return tuple(map(tuple, inverse.tolist()))


def allocate(
    share: tuple[tuple[float, ...], ...], collective: float, torque: Vec3, low: float, high: float
) -> PerRotor:
    """Rotor thrusts [N] in [low, high] for a collective [N] and a torque [N m], by the inverse of
    the mixer."""
    x, y, z = torque
    tilt = tuple(s[1] * x + s[2] * y for s in share)
    twist = tuple(s[3] * z for s in share)
    return saturate(tilt, 0.25 * collective, twist, low, high)


def saturate(tilt: PerRotor, lift: float, twist: PerRotor, low: float, high: float) -> PerRotor:
    """tilt + lift + twist within [low, high] per rotor: roll and pitch first, then collective, yaw
    last.

    Yaw is given up first; then the collective moves up or down to make room; only a roll and pitch
    demand wider than the whole range is scaled, its direction kept. The order is that of Smeur,
    Hoeppener and De Wagter, "Prioritized Control Allocation for Quadrotors Subject to Saturation",
    IMAV 2017: roll and pitch direct the thrust, yaw does not.
    """
    spread = max(tilt) - min(tilt)
    scale = (high - low) / spread if spread > high - low else 1.0
    tilt = tuple(scale * r for r in tilt)
    lift = min(max(lift, low - min(tilt)), high - max(tilt))
    base = [lift + r for r in tilt]
    room = min(
        [
            1.0,
            *(
                ((high if t > 0.0 else low) - b) / t
                for b, t in zip(base, twist, strict=True)
                if t != 0.0
            ),
        ]
    )
    room = max(room, 0.0)  # rounding may leave a base slightly outside the range
    return tuple(min(max(b + room * t, low), high) for b, t in zip(base, twist, strict=True))
