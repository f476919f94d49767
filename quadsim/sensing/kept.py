"""Measurements and estimates of a flight, which are stored on request.

They are arrays by name, in SI units, in the world frame unless another frame is given; n is the
number of measurements, N of frames of the telemetry, G of gates of the course:

    imu.t, imu.taken, imu.dt      end of a sample, when the estimator took it, duration [s]  (n,)
    imu.gyro                      body rates [rad/s]  (n, 3)
    imu.specific_force            acceleration minus gravity, body frame [m/s^2]  (n, 3)
    pose.t, pose.taken            [s]  (n,)
    pose.position, pose.velocity  [m], [m/s], NaN if it was not measured  (n, 3)
    pose.attitude                 wxyz  (n, 4)
    rotors.t, rotors.taken        [s]  (n,)
    rotors.thrust                 by the rotors' speeds, mass-normalised [m/s^2]  (n,)
    barometer.t, barometer.taken  [s]  (n,)
    barometer.height              above the origin of the world [m]  (n,)
    corners.t, corners.taken      exposure of a corner's picture, when it was taken [s]  (n,)
    corners.gate, corners.corner  the gate (index among the course's distinct frames, from 0) and
                                  the corner that the association names  (n,)
    corners.pixels                right and down in the picture [px]  (n, 2)
    estimate.gyro_bias            [rad/s]  (N, 3)
    estimate.accelerometer_bias   [m/s^2]  (N, 3)
    estimate.gates                centres of the gates' openings [m]  (N, G, 3), with a camera and
                                  displaced gates
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np

from quadsim.rotation import Vec3
from quadsim.sensing.measurements import Corners, Height, Inertial, Measurement, Pose, RotorThrust

UNKNOWN = (float("nan"),) * 3


class Kept(NamedTuple):
    """The measurements and estimates of one frame."""

    taken: float  # time of the frame [s]
    measurements: tuple[Measurement, ...]  # taken since the last frame
    gyro_bias: Vec3  # as it is estimated [rad/s]
    accelerometer_bias: Vec3  # as it is estimated [m/s^2]
    gates: np.ndarray | None  # estimated centres (gates, 3) [m]; None: the map is taken as exact


class Column(NamedTuple):
    """An array of the record: its name, its type, and the numbers of one of its rows."""

    name: str
    dtype: str
    shape: tuple[int, ...]


class Table(NamedTuple):
    """The arrays of one sensor, which have a row for each measurement."""

    sensor: str
    columns: tuple[Column, ...]


TABLES = (
    Table(
        "imu",
        (
            Column("imu.t", "float64", ()),
            Column("imu.taken", "float64", ()),
            Column("imu.dt", "float64", ()),
            Column("imu.gyro", "float64", (3,)),
            Column("imu.specific_force", "float64", (3,)),
        ),
    ),
    Table(
        "pose",
        (
            Column("pose.t", "float64", ()),
            Column("pose.taken", "float64", ()),
            Column("pose.position", "float64", (3,)),
            Column("pose.attitude", "float64", (4,)),
            Column("pose.velocity", "float64", (3,)),
        ),
    ),
    Table(
        "rotors",
        (
            Column("rotors.t", "float64", ()),
            Column("rotors.taken", "float64", ()),
            Column("rotors.thrust", "float64", ()),
        ),
    ),
    Table(
        "barometer",
        (
            Column("barometer.t", "float64", ()),
            Column("barometer.taken", "float64", ()),
            Column("barometer.height", "float64", ()),
        ),
    ),
    Table(
        "corners",
        (
            Column("corners.t", "float64", ()),
            Column("corners.taken", "float64", ()),
            Column("corners.gate", "int64", ()),
            Column("corners.corner", "int64", ()),
            Column("corners.pixels", "float64", (2,)),
        ),
    ),
)
GYRO_BIAS = "estimate.gyro_bias"
ACCELEROMETER_BIAS = "estimate.accelerometer_bias"
GATES = "estimate.gates"


def rows_of(kept: Kept) -> Iterable[tuple[str, tuple]]:
    """Yield the sensor of each measurement, and its row in the sensor's table."""
    for one in kept.measurements:
        match one:
            case Inertial():
                yield "imu", (one.t, kept.taken, one.dt, one.gyro, one.specific_force)
            case Pose():
                row = (one.t, kept.taken, one.position, one.attitude, one.velocity or UNKNOWN)
                yield "pose", row
            case RotorThrust():
                yield "rotors", (one.t, kept.taken, one.thrust)
            case Height():
                yield "barometer", (one.t, kept.taken, one.height)
            case Corners():
                for gate, corner, pixel in zip(one.gates, one.corners, one.pixels, strict=True):
                    yield "corners", (one.t, kept.taken, gate, corner, pixel)


def kept_arrays(frames: Sequence[Kept]) -> dict[str, np.ndarray]:
    """Return the arrays of a flight by name; sensors without measurements have none."""
    rows: dict[str, list[tuple]] = {table.sensor: [] for table in TABLES}
    for kept in frames:
        for sensor, row in rows_of(kept):
            rows[sensor].append(row)
    found = {}
    for table in TABLES:
        if rows[table.sensor]:
            values = zip(*rows[table.sensor], strict=True)
            for column, numbers in zip(table.columns, values, strict=True):
                found[column.name] = np.array(numbers, column.dtype)
    found[GYRO_BIAS] = np.array([kept.gyro_bias for kept in frames])
    found[ACCELEROMETER_BIAS] = np.array([kept.accelerometer_bias for kept in frames])
    gates = [kept.gates for kept in frames if kept.gates is not None]
    if gates:
        found[GATES] = np.array(gates)
    return found
