"""Measurements: values with the instant at which they were true, and nothing about how they came to
be."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from quadsim.rotation import Quaternion, Vec3


@dataclass(frozen=True, slots=True)
class Inertial:
    """A sample of an inertial measurement unit: means over the `dt` that ends at t."""

    t: float  # [s]
    dt: float  # [s]
    gyro: Vec3  # body rates [rad/s]
    specific_force: Vec3  # acceleration less gravity, body frame [m/s^2]


@dataclass(frozen=True, slots=True)
class Pose:
    """A pose measured by motion capture or visual-inertial odometry."""

    t: float  # [s]
    position: Vec3  # [m]
    attitude: Quaternion
    velocity: Vec3 | None  # world [m/s]


@dataclass(frozen=True, slots=True)
class RotorThrust:
    """The thrust of the rotors, by their speeds and the flight controller's thrust map."""

    t: float  # [s]
    thrust: float  # mass-normalised [m/s^2]


@dataclass(frozen=True, slots=True, eq=False)
class Corners:
    """Corners of gates' openings found in one picture. Each may be taken for another: the
    association may be wrong."""

    t: float  # of the exposure [s]
    gates: np.ndarray  # index of the gate that each is taken to belong to  (n,)
    corners: np.ndarray  # index into Gate.corners()  (n,)
    pixels: np.ndarray  # right and down from the picture's corner [px]  (n, 2)
    in_view: int  # how many corners stood in the picture, for the record only


Measurement = Inertial | Pose | RotorThrust | Corners
