"""Parameters of the sensors, as a sensing file gives them.

The estimator uses the same parameters, as sensors are calibrated. It ignores the errors of scale
factors and axes that remain after an inertial unit's calibration. Noises are standard deviations of
one sample, per axis.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np

from quadsim.files.strict_yaml import setting, unit
from quadsim.sensing.camera import NEAREST, Camera

Rate = Annotated[float, unit("Hz", ge=1, le=2000)]
Latency = Annotated[float, unit("s", ge=0, le=0.5)]
Share = Annotated[float, unit("1", ge=0, le=1)]
Metre = Annotated[float, unit("m", ge=0, le=100)]
ScaleError = Annotated[float, unit("1", ge=0, le=0.5)]
BurstLength = Annotated[float, unit("1", ge=1, le=1e4)]
Tilt = Annotated[float, unit("deg", ge=0, le=30)]
EndOfLife = Annotated[float, unit("s", ge=0, le=1e5)]


@dataclass(frozen=True)
class ImuConfig:
    """The parameters of an inertial measurement unit."""

    rate: Annotated[Rate, setting("samples a second [Hz]")]
    gyro_noise: Annotated[
        float, setting("noise of the body rates [rad/s]", unit="rad/s", ge=0, le=10)
    ] = 0.0
    gyro_bias: Annotated[
        float,
        setting(
            "standard deviation of the gyroscope's bias at the start [rad/s]",
            unit="rad/s",
            ge=0,
            le=1,
        ),
    ] = 0.0
    gyro_walk: Annotated[
        float,
        setting(
            "random walk of the gyroscope's bias [rad/s/sqrt(s)]",
            unit="rad/s/sqrt(s)",
            ge=0,
            le=1,
        ),
    ] = 0.0
    # 2000 deg/s
    gyro_max: Annotated[
        float, setting("largest body rate measured [rad/s]", unit="rad/s", gt=0, le=1000)
    ] = 34.9
    accelerometer_noise: Annotated[
        float, setting("noise of the specific force [m/s^2]", unit="m/s^2", ge=0, le=100)
    ] = 0.0
    accelerometer_bias: Annotated[
        float,
        setting(
            "standard deviation of the accelerometer's bias at the start [m/s^2]",
            unit="m/s^2",
            ge=0,
            le=10,
        ),
    ] = 0.0
    accelerometer_walk: Annotated[
        float,
        setting(
            "random walk of the accelerometer's bias [m/s^2/sqrt(s)]",
            unit="m/s^2/sqrt(s)",
            ge=0,
            le=10,
        ),
    ] = 0.0
    # 16 g
    accelerometer_max: Annotated[
        float, setting("largest specific force measured [m/s^2]", unit="m/s^2", gt=0, le=1e4)
    ] = 157.0
    latency: Annotated[Latency, setting("time from the end of a sample to the estimator [s]")] = 0.0
    gyro_scale: Annotated[
        ScaleError,
        setting("standard deviation of the error of each gyroscope axis's scale factor"),
    ] = 0.0
    gyro_misalignment_deg: Annotated[
        Tilt,
        setting("standard deviation of the angles between true and measured axes of rotation"),
    ] = 0.0
    accelerometer_scale: Annotated[
        ScaleError,
        setting("standard deviation of the error of each accelerometer axis's scale factor"),
    ] = 0.0
    accelerometer_misalignment_deg: Annotated[
        Tilt,
        setting("standard deviation of the angles between true and measured axes of the force"),
    ] = 0.0

    # A chip that samples at an instant and without a filter: motion faster than half the rate
    # comes as something slower.
    vibration: Annotated[
        float,
        setting(
            "amplitude of the rotors' vibration on each axis of the specific force, which is"
            " sampled at an instant [m/s^2]",
            unit="m/s^2",
            ge=0,
            le=1000,
        ),
    ] = 0.0
    vibration_hz: Annotated[
        float, setting("frequency of the vibration [Hz]", unit="Hz", gt=0, le=5000)
    ] = 130.0


@dataclass(frozen=True)
class PoseConfig:
    """The parameters of a pose sensor: motion capture, or visual-inertial odometry."""

    rate: Annotated[Rate, setting("samples a second [Hz]")]
    latency: Annotated[
        Latency, setting("time from the instant of a sample to the estimator [s]")
    ] = 0.0
    position_noise: Annotated[Metre, setting("noise of the position [m]")] = 0.0
    attitude_noise_deg: Annotated[
        float, setting("noise of the attitude [deg]", unit="deg", ge=0, le=90)
    ] = 0.0
    velocity_noise: (
        Annotated[
            float,
            setting(
                "noise of the velocity [m/s]; null: no velocity is measured",
                unit="m/s",
                ge=0,
                le=100,
            ),
        ]
        | None
    ) = None
    drift: Annotated[
        float,
        setting("random walk of the position [m/sqrt(s)]", unit="m/sqrt(s)", ge=0, le=10),
    ] = 0.0
    spikes: Annotated[Share, setting("share of samples with a position far off")] = 0.0
    spike: Annotated[Metre, setting("distance by which a spike is off [m]")] = 0.0
    dropouts: Annotated[Share, setting("probability per sample that a dropout begins")] = 0.0
    dropout: Annotated[float, setting("duration of a dropout [s]", unit="s", ge=0, le=100)] = 0.0
    dies_at: Annotated[
        EndOfLife | None, setting("time from which on the sensor is silent [s]; null: never")
    ] = None


@dataclass(frozen=True)
class RotorConfig:
    """The parameters of electronic speed controllers, which report rotor speeds without delay."""

    # [s]
    latency: ClassVar[float] = 0.0
    rate: Annotated[Rate, setting("samples a second [Hz]")]
    noise: Annotated[
        float, setting("noise of a rotor's speed [rad/s]", unit="rad/s", ge=0, le=1000)
    ] = 0.0


@dataclass(frozen=True)
class BarometerConfig:
    """The parameters of a barometer."""

    rate: Annotated[Rate, setting("samples a second [Hz]")]
    noise: Annotated[Metre, setting("noise of the height [m]")] = 0.0
    latency: Annotated[
        Latency, setting("time from the instant of a sample to the estimator [s]")
    ] = 0.0
    wash: Annotated[
        Metre,
        setting(
            "by how much it reads low in hover, as turning rotors change the pressure, in"
            " proportion to the thrust [m]"
        ),
    ] = 0.0


@dataclass(frozen=True)
class CornerCamera(Camera):
    """A camera in whose pictures the corners of gates' openings are found."""

    range: Annotated[
        float,
        setting("distance beyond which no corner is found [m]", unit="m", gt=0, le=1000),
    ] = 20.0
    latency: Annotated[Latency, setting("time from exposure to corners [s]")] = 0.0
    noise: Annotated[float, setting("noise of a found corner [px]", unit="px", ge=0, le=1000)] = 1.0

    def in_view(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the pixels of points, and whether each is in front of the camera and in view.

        Args:
            points: points of the body frame [m]  (n, 3).

        Returns:
            Pixels (n, 2), and the mask (n,).
        """
        pixels, depth = self.to_pixels((points - self.position) @ self.axes)
        return pixels, (depth > NEAREST) & self.in_picture(pixels)


@dataclass(frozen=True)
class GateCameraConfig(CornerCamera):
    """A camera, and the network that finds the corners of gates' openings in its pictures."""

    blind_within: Annotated[
        Metre,
        setting("distance within which no corner is found, as the gate overfills the picture [m]"),
    ] = 0.0
    misses: Annotated[Share, setting("share of the corners in view that are not found")] = 0.0
    miss_burst: Annotated[
        BurstLength | None,
        setting(
            "mean number of pictures in a row in which a corner is missed; null: it is missed"
            " independently"
        ),
    ] = None
    outliers: Annotated[
        Share, setting("share of the found corners that are anywhere in the picture")
    ] = 0.0
    swaps: Annotated[
        Share,
        setting("share of the found corners that are matched to a different corner"),
    ] = 0.0
    dies_at: Annotated[
        EndOfLife | None, setting("time from which on the camera is silent [s]; null: never")
    ] = None
    dropouts: Annotated[Share, setting("probability per picture that a dropout begins")] = 0.0
    dropout: Annotated[float, setting("duration of a dropout [s]", unit="s", gt=0, le=100)] = 0.5


@dataclass(frozen=True)
class PixelCameraConfig(CornerCamera):
    """A camera whose pictures are rendered, and in which edges of gates are detected.

    `noise` is the standard deviation [px] that the estimator assumes for a detected corner.
    """

    exposure: Annotated[
        float, setting("time for which each row is exposed [s]", unit="s", ge=0, le=0.05)
    ] = 0.004
    readout: Annotated[
        float,
        setting(
            "time from the exposure of the first row to that of the last [s]; 0: all at once",
            unit="s",
            ge=0,
            le=0.05,
        ),
    ] = 0.0
    passes: Annotated[
        int, setting("passes of the renderer for each picture", unit="1", ge=1, le=16)
    ] = 4
    brightness: Annotated[
        float, setting("factor of the picture's numbers", unit="1", gt=0, le=10)
    ] = 1.0
    read_noise: Annotated[
        float, setting("noise of a black pixel, of numbers up to 255", unit="1", ge=0, le=255)
    ] = 0.0
    shot_noise: Annotated[
        float,
        setting("variance of a pixel's noise per unit of its number", unit="1", ge=0, le=255),
    ] = 0.0
    jpeg: Annotated[
        int, setting("quality of the picture's JPEG; 0: not compressed", unit="1", ge=0, le=95)
    ] = 0
    varied: Annotated[
        bool, setting("whether ground, light and sky are drawn from the seed of the flight")
    ] = False
    network: Annotated[
        str | None,
        setting(
            "network that finds gates at the start and after a loss: gates, or a FILE.onnx of race"
            " train-pixels; null: none"
        ),
    ] = None
    banners: Annotated[
        int, setting("sheets of the gates' colour beside the course", unit="1", ge=0, le=100)
    ] = 0
    dropouts: Annotated[Share, setting("probability per picture that a dropout begins")] = 0.0
    dropout: Annotated[float, setting("duration of a dropout [s]", unit="s", gt=0, le=100)] = 0.5
