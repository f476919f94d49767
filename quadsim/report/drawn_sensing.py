"""The constant errors of a flight's inertial unit, drawn anew from the seed in its record."""

from __future__ import annotations

from typing import Any, NamedTuple

import msgspec
import numpy as np

from quadsim.sensing.config import ImuConfig
from quadsim.sensing.imu import drawn_mixing
from quadsim.streams import quadrotor_streams, sensor_streams

BESIDE = ~np.eye(3, dtype=bool)


class UnitErrors(NamedTuple):
    """The errors of a gyroscope or an accelerometer that are constant in a flight."""

    scale: list[float]  # error of the scale factor of x, y and z, a share
    # angles between true and measured axes [deg]: of x towards y and z, of y towards x and z, of z
    # towards x and y
    misalignment_deg: list[float]


def drawn_imu_errors(spec: dict[str, Any]) -> dict[str, UnitErrors]:
    """Return the constant errors of a flight's gyroscope and accelerometer, by name.

    They are drawn anew, as the seed determines them.

    Args:
        spec: the spec of the run.

    Returns:
        Empty where the unit has exact scales and axes, or the flight has no unit.
    """
    sensing = spec.get("sensing") or {}
    if not sensing.get("imu"):
        return {}
    config = msgspec.convert(sensing["imu"], ImuConfig)
    imu = sensor_streams(quadrotor_streams(spec["seed"]).sensors).imu
    mixing = drawn_mixing(config, imu)
    if mixing is None:
        return {}
    errors = mixing - np.eye(6)
    return {"gyro": _of_unit(errors[:3, :3]), "accelerometer": _of_unit(errors[3:, 3:])}


def _of_unit(errors: np.ndarray) -> UnitErrors:
    """Return the errors of one unit.

    Args:
        errors: from true to measured numbers, less the identity  (3, 3).
    """
    return UnitErrors(errors.diagonal().tolist(), np.degrees(errors[BESIDE]).tolist())


def drawn_imu_text(drawn: dict[str, UnitErrors]) -> str:
    """Return the errors that `drawn_imu_errors` returns on one line, "" where there are none."""
    parts = []
    for name, errors in drawn.items():
        if any(errors.scale):
            each = ", ".join(f"{100 * share:+.2g}" for share in errors.scale)
            parts.append(f"{name} scale {each} %")
        if any(errors.misalignment_deg):
            parts.append(
                f"{name} axes {max(map(abs, errors.misalignment_deg)):.2g} deg off at most"
            )
    return f"drawn: {', '.join(parts)}" if parts else ""
