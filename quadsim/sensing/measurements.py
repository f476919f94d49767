"""What sensors say: values with the instant they are of, and nothing about how they came to be."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from quadsim.rotation import Quaternion, Vec3


@dataclass(frozen=True, slots=True)
class Inertial:
    """Of an inertial measurement unit: means over the `dt` that ends at t."""

    t: float  # [s]
    dt: float  # [s]
    gyro: Vec3  # body rates [rad/s]
    specific_force: Vec3  # acceleration less gravity, body frame [m/s^2]


@dataclass(frozen=True, slots=True)
class Pose:
    """Of motion capture or visual-inertial odometry."""

    t: float  # [s]
    position: Vec3  # [m]
    attitude: Quaternion
    velocity: Vec3 | None  # world [m/s]


@dataclass(frozen=True, slots=True)
class RotorThrust:
    """What the rotors deliver, by their speeds and the flight controller's thrust map."""

    t: float  # [s]
    thrust: float  # mass-normalised [m/s^2]


@dataclass(frozen=True, slots=True, eq=False)
class Corners:
    """Corners of gates' openings in one picture. None may be true: the association may be wrong."""

    t: float  # of the exposure [s]
    gates: np.ndarray  # index of the gate that each is said to belong to  (n,)
    corners: np.ndarray  # index into Gate.corners()  (n,)
    pixels: np.ndarray  # right and down from the picture's corner [px]  (n, 2)
    in_view: int  # how many stood in the picture, for the record only


Measurement = Inertial | Pose | RotorThrust | Corners
