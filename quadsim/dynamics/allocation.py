"""Allocation: rotor thrusts for a collective and a torque, with priorities in saturation."""

from __future__ import annotations

import numpy as np

from quadsim.rotation import Vec3
from quadsim.vehicle import Rotors

PerRotor = tuple[float, ...]  # one number for each of the four rotors


def mixer(rotors: Rotors) -> tuple[PerRotor, ...]:
    """Return the matrix from the rotors' thrusts to collective and torque.

    Returns:
        Rows of (collective [N], torque about x, y, z [N m]), columns of rotors  (4, 4).
    """
    xs, ys = zip(*rotors.positions, strict=True)
    about_y = tuple(-x for x in xs)
    about_z = tuple(spin * rotors.kappa for spin in rotors.spin)
    return (1.0, 1.0, 1.0, 1.0), ys, about_y, about_z


def shares(rotors: Rotors) -> tuple[PerRotor, ...]:
    """Return the inverse of the mixer, the part of each rotor in collective and torque.

    Each rotor carries a quarter of the collective, as `saturate` requires.

    Returns:
        Row i gives rotor i's thrust per (collective, torque about x, y, z)  (4, 4).
    """
    inverse = np.linalg.pinv(np.array(mixer(rotors)))
    return tuple(map(tuple, inverse.tolist()))


def allocate(
    share: tuple[PerRotor, ...], collective: float, torque: Vec3, low: float, high: float
) -> PerRotor:
    """Return the thrusts of the rotors for a collective and a torque, within their limits.

    Args:
        share: the inverse of the mixer  (4, 4).
        collective: demanded thrust of all rotors [N].
        torque: demanded torque [N m].
        low, high: limits of a rotor's thrust [N].

    Returns:
        Rotor thrusts [N]  (4,).
    """
    x, y, z = torque
    tilt = tuple([row[1] * x + row[2] * y for row in share])
    twist = tuple([row[3] * z for row in share])
    return saturate(tilt, 0.25 * collective, twist, low, high)


def saturate(tilt: PerRotor, lift: float, twist: PerRotor, low: float, high: float) -> PerRotor:
    """Return tilt + lift + twist within the limits: roll and pitch first, yaw last.

    Yaw is given up first; then the collective moves up or down to make room; roll and pitch are
    scaled, in a constant direction, only if their demand exceeds the whole range. The order follows
    Smeur, Hoeppener and De Wagter, "Prioritized Control Allocation for Quadrotors Subject to
    Saturation", IMAV 2017: roll and pitch direct the thrust, yaw does not.

    Args:
        tilt: part of each rotor in the torque about x and y [N]  (4,).
        lift: a quarter of the collective [N].
        twist: part of each rotor in the torque about z [N]  (4,).
        low, high: limits of a rotor's thrust [N].

    Returns:
        Rotor thrusts [N]  (4,).
    """
    # Roll and pitch: scaled if they alone need more than the whole range.
    most = max(tilt)
    least = min(tilt)
    spread = most - least
    if spread > high - low:
        scale = (high - low) / spread
        tilt = tuple([scale * part for part in tilt])
        most = max(tilt)
        least = min(tilt)

    # Collective: moved until both the highest and the lowest rotor are within the limits.
    lift = min(max(lift, low - least), high - most)
    base = [lift + part for part in tilt]

    # Yaw: the largest share that keeps every rotor within the limits.
    room = 1.0
    for thrust, part in zip(base, twist, strict=True):
        if part != 0.0:
            limit = high if part > 0.0 else low
            room = min(room, (limit - thrust) / part)
    # Rounding may leave a base slightly outside the range.
    room = max(room, 0.0)
    thrusts = [thrust + room * part for thrust, part in zip(base, twist, strict=True)]
    return tuple([min(max(thrust, low), high) for thrust in thrusts])
