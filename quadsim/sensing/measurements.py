"""Measurements: values of sensors with the instant at which they were taken."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from quadsim.rotation import Quaternion, Vec3


@dataclass(frozen=True, slots=True)
class Inertial:
    """A sample of an inertial measurement unit: means over the interval `dt` that ends at t."""

    # [s]
    t: float
    # [s]
    dt: float
    # body rates [rad/s]
    gyro: Vec3
    # specific force: acceleration minus gravity, body frame [m/s^2]
    specific_force: Vec3


@dataclass(frozen=True, slots=True)
class Pose:
    """A pose measured by motion capture or visual-inertial odometry."""

    # [s]
    t: float
    # in the world [m]
    position: Vec3
    # wxyz
    attitude: Quaternion
    # in the world [m/s]; None: not measured
    velocity: Vec3 | None


@dataclass(frozen=True, slots=True)
class RotorThrust:
    """The thrust of the rotors, from their speeds and the flight controller's thrust map."""

    # [s]
    t: float
    # mass-normalised [m/s^2]
    thrust: float


@dataclass(frozen=True, slots=True)
class Height:
    """A height measured by a barometer."""

    # [s]
    t: float
    # above the origin of the world [m]
    height: float


@dataclass(frozen=True, slots=True, eq=False)
class Corners:
    """Corners of gates' openings found in one picture.

    The association of a corner with a gate may be wrong.
    """

    # time of the exposure [s]
    t: float
    # index of the gate with which each corner is associated  (n,)
    gates: np.ndarray
    # index into Gate.corners()  (n,)
    corners: np.ndarray
    # right and down from the picture's corner [px]  (n, 2)
    pixels: np.ndarray
    # number of corners in view, for the record only
    in_view: int
    # variance of each corner in addition to the camera's noise [px^2]  (n,); None: zero
    variance: np.ndarray | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Photo:
    """A picture of a camera."""

    # middle of the exposure of the picture's middle row [s]
    t: float
    # (height, width, 3) uint8
    rgb: np.ndarray


# Measurements that bound the drift of the inertial unit.
Aiding = Pose | Height | Corners
Measurement = Inertial | RotorThrust | Photo | Aiding
