"""Numbers of the sensors, as a sensing file gives them. The estimator is given the same: sensors
are calibrated.

Noises are standard deviations of one sample, per axis. The camera's numbers:
quadsim.sensing.camera_model.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from quadsim.files.strict_yaml import unit

Rate = Annotated[float, unit("Hz", ge=1, le=2000)]
Latency = Annotated[float, unit("s", ge=0, le=0.5)]
Share = Annotated[float, unit("1", ge=0, le=1)]
Metre = Annotated[float, unit("m", ge=0, le=100)]


@dataclass(frozen=True)
class ImuConfig:
    """Of an inertial measurement unit."""

    rate: Rate  # samples a second [Hz]
    gyro_noise: Annotated[float, unit("rad/s", ge=0, le=10)] = 0.0
    gyro_bias: Annotated[float, unit("rad/s", ge=0, le=1)] = 0.0  # standard deviation at the start
    gyro_walk: Annotated[float, unit("rad/s/sqrt(s)", ge=0, le=1)] = 0.0
    gyro_max: Annotated[float, unit("rad/s", gt=0, le=1000)] = 34.9  # 2000 deg/s
    accelerometer_noise: Annotated[float, unit("m/s^2", ge=0, le=100)] = 0.0
    accelerometer_bias: Annotated[float, unit("m/s^2", ge=0, le=10)] = (
        0.0  # standard deviation at the start
    )
    accelerometer_walk: Annotated[float, unit("m/s^2/sqrt(s)", ge=0, le=10)] = 0.0
    accelerometer_max: Annotated[float, unit("m/s^2", gt=0, le=1e4)] = 157.0  # 16 g
    latency: Latency = 0.0  # from the end of a sample to the estimator [s]


@dataclass(frozen=True)
class PoseConfig:
    """Of a pose sensor."""

    rate: Rate  # [Hz]
    latency: Latency = 0.0  # from the instant it is of to the estimator [s]
    position_noise: Metre = 0.0
    attitude_noise_deg: Annotated[float, unit("deg", ge=0, le=90)] = 0.0
    velocity_noise: Annotated[float, unit("m/s", ge=0, le=100)] | None = (
        None  # null: no velocity is measured
    )
    drift: Annotated[float, unit("m/sqrt(s)", ge=0, le=10)] = 0.0  # of the position
    spikes: Share = 0.0  # of all samples
    spike: Metre = 0.0  # how far off they are
    dropouts: Share = 0.0  # probability per sample that one begins
    dropout: Annotated[float, unit("s", ge=0, le=100)] = 0.0  # how long it lasts
    dies_at: Annotated[float, unit("s", ge=0, le=1e5)] | None = None  # from then on it is silent


@dataclass(frozen=True)
class RotorConfig:
    """Of the electronic speed controllers."""

    rate: Rate  # [Hz]
    noise: Annotated[float, unit("rad/s", ge=0, le=1000)] = (
        0.0  # of a rotor's speed, standard deviation
    )
