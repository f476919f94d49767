"""Signals turned from other frames into the frames of FlightLog: ENU; x forward, y left, z up."""

from __future__ import annotations

from math import sqrt

import numpy as np

# Turns vectors of a body with z down (forward, right, down) into ours, and back
FROM_FRD = np.array((1.0, -1.0, -1.0))
# The same as quaternions, wxyz: half a turn about x; half a turn about the bisector of x and y
HALF_TURN = np.array((0.0, 1.0, 0.0, 0.0))
NED_TO_ENU = np.array((0.0, sqrt(0.5), sqrt(0.5), 0.0))


def from_ned(vectors: np.ndarray) -> np.ndarray:
    """Return north-east-down vectors in east-north-up axes  (n, 3)."""
    return vectors[:, [1, 0, 2]] * np.array((1.0, 1.0, -1.0))


def from_frd(vectors: np.ndarray) -> np.ndarray:
    """Return forward-right-down vectors in forward-left-up axes  (n, 3)."""
    return vectors * FROM_FRD


def from_ned_and_frd(quaternions: np.ndarray) -> np.ndarray:
    """Return attitudes of FRD axes in an NED world as attitudes of FLU axes in an ENU world.

    Args:
        quaternions: turn vectors of the body into the world's, wxyz  (n, 4).
    """
    return products(products(NED_TO_ENU, quaternions), HALF_TURN)


def products(p: np.ndarray, q: np.ndarray) -> np.ndarray:
    """Return the products p q of quaternions, wxyz; one of the two may be a single one.  (n, 4)"""
    pw, px, py, pz = np.moveaxis(p, -1, 0)
    qw, qx, qy, qz = np.moveaxis(q, -1, 0)
    return np.stack(
        (
            pw * qw - px * qx - py * qy - pz * qz,
            pw * qx + px * qw + py * qz - pz * qy,
            pw * qy - px * qz + py * qw + pz * qx,
            pw * qz + px * qy - py * qx + pz * qw,
        ),
        axis=-1,
    )


def from_euler_angles(angles: np.ndarray) -> np.ndarray:
    """Return attitudes of roll, pitch and yaw, as quadsim.rotation has them.

    Args:
        angles: roll, pitch, yaw [rad]  (n, 3).

    Returns:
        wxyz  (n, 4)
    """
    roll, pitch, yaw = 0.5 * angles.T
    nothing = np.zeros_like(roll)
    about_x = np.stack((np.cos(roll), np.sin(roll), nothing, nothing), axis=-1)
    about_y = np.stack((np.cos(pitch), nothing, np.sin(pitch), nothing), axis=-1)
    about_z = np.stack((np.cos(yaw), nothing, nothing, np.sin(yaw)), axis=-1)
    return products(products(about_z, about_y), about_x)
