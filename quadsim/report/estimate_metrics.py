"""Metrics of a flight's sensing: the accuracy of the estimate, and the sensors' random errors."""

from __future__ import annotations

from typing import Any, NamedTuple

import msgspec
import numpy as np

from quadsim.record.run import RecordedRun
from quadsim.sensing.config import ImuConfig
from quadsim.sensing.estimate_record import ERRORS
from quadsim.sensing.imu import drawn_mixing
from quadsim.streams import quadrotor_streams, sensor_streams

# An estimate that is off by more is lost: [m], about half an opening, and [deg].
LOST = 0.5
TURNED = 5.0
# Elements beside the diagonal
BESIDE = ~np.eye(3, dtype=bool)


def estimate_errors(run: RecordedRun) -> np.ndarray:
    """Return the estimated minus the true position of every frame [m].  (frames, 3)"""
    x = run.telemetry
    return np.column_stack([x[f"est_{name}"] - x[name] for name in ("px", "py", "pz")])


def attitude_error(run: RecordedRun, frame: int) -> float:
    """Return the angle between estimated and true attitude in a frame [deg]."""
    x = run.telemetry
    names = ("qw", "qx", "qy", "qz")
    q, estimated = ([x[f"{start}{name}"][frame] for name in names] for start in ("", "est_"))
    cosine = min(abs(float(np.dot(q, estimated))), 1.0)
    return float(np.degrees(2.0 * np.arccos(cosine)))


def lost_estimate(run: RecordedRun) -> str:
    """Return the error of the estimate at the end of a flight, and the time from which it was lost.

    Returns:
        One line, such as "estimate 2.4 m off at the end, more than 0.5 m from 1.6 s on"; "" if the
        state was known, or if the estimate was good and the flight has not crashed.
    """
    x = run.telemetry
    if "est_px" not in x or not len(x["t"]):
        return ""
    distance = np.linalg.norm(estimate_errors(run), axis=1)
    end = float(distance[-1])
    turned = attitude_error(run, -1)
    is_lost = end > LOST
    if not (is_lost or turned > TURNED or run.outcome == "crashed"):
        return ""
    off = f"{end:.1f} m" if is_lost else f"{100.0 * end:.1f} cm"
    if turned > TURNED:
        off += f" and {turned:.0f} deg"
    line = f"estimate {off} off at the end"
    if is_lost:
        good = np.flatnonzero(distance <= LOST)
        first = good[-1] + 1 if len(good) else 0
        line += f", more than {LOST:g} m from {x['t'][first]:.1f} s on"
    return line


def sensing_numbers(run: RecordedRun) -> dict | None:
    """Return numbers about the estimate, None if the planner was given the true state.

    Returns:
        sensing: name of the set of sensors.
        position_rms, position_max: distance between estimated and true position [m].
        at_gates: RMS of this distance at the passes of gates [m].
        nees: mean normalised estimation error squared, with `nees_expected` degrees of freedom.
        nis: normalised innovation squared per degree of freedom of the measurements used.
        refused: share of the measurements that were rejected as outliers.
        in_view: mean number of corners in view, over the pictures with at least one.
        found: share of the corners in view that were found.
        unaided: time from the last used measurement, except inertial ones, to the end [s].
        drawn: constant errors of gyroscope and accelerometer, see `drawn_imu_errors`.
        estimate_ms: computing time of an estimate on the wall clock, p50 and p95 [ms].
    """
    x = run.telemetry
    if "est_px" not in x or not len(x["t"]):
        return None
    distance = np.linalg.norm(estimate_errors(run), axis=1)
    used = x["nis_dof"].sum()
    measured = used + x["refused"].sum()
    in_view = x["in_view"]
    return {
        "sensing": run.spec["sensing"]["name"],
        "position_rms": _rms(distance),
        "position_max": float(distance.max()),
        "at_gates": _at_gates(run, distance),
        "nees": float(x["nees"].mean()),
        "nees_expected": ERRORS,
        "nis": float(x["nis"].sum() / used) if used else None,
        "refused": float(x["refused"].sum() / measured) if measured else None,
        "in_view": float(in_view[in_view > 0].mean()) if in_view.any() else None,
        "found": float(x["found"].sum() / in_view.sum()) if in_view.any() else None,
        "unaided": _unaided(run),
        "drawn": {n: errors._asdict() for n, errors in drawn_imu_errors(run.spec).items()},
        "estimate_ms": {
            "p50": float(np.median(x["estimate_ms"])),
            "p95": float(np.percentile(x["estimate_ms"], 95)),
        },
    }


def _at_gates(run: RecordedRun, distance: np.ndarray) -> float | None:
    """Return the RMS of the distances (frames,) at passes of gates, None if there is no pass."""
    passes = [gate["t"] for gate in run.gates]
    if not passes:
        return None
    frames = np.searchsorted(run.telemetry["t"], passes)
    return _rms(distance[frames.clip(max=len(distance) - 1)])


def _unaided(run: RecordedRun) -> float:
    """Return the time from the last frame with a used measurement to the end [s]."""
    t = run.telemetry["t"]
    aided = np.flatnonzero(run.telemetry["nis_dof"])
    last = aided[-1] if len(aided) else 0
    return float(t[-1] - t[last])


def _rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values**2)))


class UnitErrors(NamedTuple):
    """The errors of a gyroscope or an accelerometer that are constant in a flight."""

    scale: list[float]  # error of the scale factor of x, y and z, a share
    # angles between true and measured axes [deg]: of x towards y and z, of y towards x and z, of z
    # towards x and y
    misalignment_deg: list[float]


def drawn_imu_errors(spec: dict[str, Any]) -> dict[str, UnitErrors]:
    """Return the constant errors of a flight's gyroscope and accelerometer, by name.

    They are computed again from the seed.

    Args:
        spec: the spec of the run.

    Returns:
        The errors; empty if the unit has exact scales and axes, or if there is no unit.
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
        errors: matrix from true to measured numbers, minus the identity  (3, 3).
    """
    return UnitErrors(errors.diagonal().tolist(), np.degrees(errors[BESIDE]).tolist())


def drawn_imu_text(drawn: dict[str, UnitErrors]) -> str:
    """Return the result of `drawn_imu_errors` as one line of text, "" if there are no errors."""
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
