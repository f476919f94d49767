"""PX4's logs, .ulg, read with pyulog (extra `logs`).

PX4's world is north, east, down, and its body forward, right, down. Topics are logged at rates of
their own. The clock of the FlightLog is that of the body rates; other signals are interpolated to
it, commands hold until the next one. PX4's motors of a quadrotor X have quadsim's order.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import redirect_stdout
from io import StringIO
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from quadsim.files.arrays import read_bytes
from quadsim.files.extras import imported
from quadsim.logs.frames import from_frd, from_ned, from_ned_and_frd
from quadsim.logs.raw_log import MOST_ROWS, LogError, RawLog, cut_remark
from quadsim.logs.resampling import held, interpolated

BEGIN = b"ULog\x01\x12\x35"
XYZ = ("[0]", "[1]", "[2]")
MOTORS = range(4)
# Range of a motor's pulse [us]
SHORTEST_PULSE = 1000.0
LONGEST_PULSE = 2000.0
ROTARY_WING = 1  # vehicle_type of a multirotor
RPM = np.pi / 30.0  # [rad/s]


class Topic(NamedTuple):
    """The readings of one topic."""

    t: np.ndarray  # [s]  (n,)
    fields: Mapping[str, np.ndarray]

    def vector(self, *names: str) -> np.ndarray | None:
        """Return fields side by side, None if the topic lacks any of them.  (n, names)"""
        if not set(names) <= self.fields.keys():
            return None
        return np.stack([np.asarray(self.fields[name], float) for name in names], axis=1)


def is_ulog(head: bytes) -> bool:
    """Return whether a file with these first bytes is a log of PX4."""
    return head.startswith(BEGIN)


def read_ulog(path: Path) -> list[RawLog]:
    """Return the flight of a log of PX4.

    Raises:
        LogError: the log is damaged, has no body rates, or is no flight of a multirotor.
        ModuleNotFoundError: pyulog is not installed; one line.
    """
    pyulog = imported("pyulog", "pyulog", "logs")
    read_bytes(path, "a log of PX4")
    try:
        # pyulog prints warnings, which would stand amid a command's output.
        with redirect_stdout(StringIO()):
            data = pyulog.ULog(str(path)).data_list
    except Exception as error:
        # pyulog raises errors of many types for a damaged file.
        raise LogError(f"{path}: cannot be read: {' '.join(str(error).split())}") from None
    topics = {
        each.name: _topic(each.data)
        for each in data
        if each.multi_id == 0 and "timestamp" in each.data
    }
    rates = _body_rates(topics)
    if rates is None:
        known = ", ".join(sorted(topics)) or "none"
        wanted = "expected the topic vehicle_angular_velocity or sensor_combined"
        raise LogError(f"{path}: {wanted}, got {known}")
    _expect_multirotor(topics, path)
    t, values = rates
    remarks = [cut_remark(len(t))] if len(t) > MOST_ROWS else []
    t = t[:MOST_ROWS]
    signals = {"body_rates": from_frd(values[:MOST_ROWS]), **dict(_others(topics, t))}
    aloft = ~_landed(topics, t)
    if not aloft.any():
        raise LogError(f"{path}: expected a flight, got a log of a vehicle that stays landed")
    if not aloft.all():
        remarks.append(f"rows left out, in which the vehicle is landed: {int(np.sum(~aloft))}")
    signals = {name: readings[aloft] for name, readings in signals.items()}
    return [RawLog(path.name, t[aloft], signals, tuple(remarks))]


def _expect_multirotor(topics: Mapping[str, Topic], path: Path) -> None:
    """Raise LogError if PX4 says that the vehicle is no multirotor."""
    status = topics.get("vehicle_status")
    if status is None:
        return
    of_vtol = status.vector("is_vtol")
    kinds = status.vector("vehicle_type")
    is_vtol = of_vtol is not None and bool(np.any(of_vtol))
    if is_vtol or (kinds is not None and not np.any(kinds == ROTARY_WING)):
        found = "a VTOL, whose outputs are not four rotors alone" if is_vtol else "another vehicle"
        raise LogError(f"{path}: expected a log of a multirotor, got {found}")


def _landed(topics: Mapping[str, Topic], t: np.ndarray) -> np.ndarray:
    """Return whether PX4 says that the vehicle is on the ground, at the times t  (n,)."""
    detected = topics.get("vehicle_land_detected")
    landed = detected.vector("landed") if detected else None
    if detected is None or landed is None or not len(landed):
        return np.zeros(len(t), bool)
    # The topic is logged at changes: each value holds until the next.
    last = np.searchsorted(detected.t, t, side="right") - 1
    return landed[np.maximum(last, 0), 0] > 0.5


def _topic(data: Mapping[str, Any]) -> Topic:
    """Return a topic, with the instants at which its samples were taken, if the log has them."""
    stamps = np.asarray(data["timestamp"], float)
    sampled = np.asarray(data.get("timestamp_sample", stamps), float)
    return Topic(1e-6 * np.where(sampled > 0.0, sampled, stamps), data)


def _body_rates(topics: Mapping[str, Topic]) -> tuple[np.ndarray, np.ndarray] | None:
    """Return times and body rates, forward, right, down."""
    for topic, fields in (
        ("vehicle_angular_velocity", [f"xyz{k}" for k in XYZ]),
        ("sensor_combined", [f"gyro_rad{k}" for k in XYZ]),
    ):
        found = topics[topic].vector(*fields) if topic in topics else None
        if found is not None and len(found):
            return topics[topic].t, found
    return None


def _others(topics: Mapping[str, Topic], t: np.ndarray) -> Iterator[tuple[str, np.ndarray]]:
    """Yield the other signals that the log has, at the times t."""
    for name, topic, values in _measured(topics):
        yield name, interpolated(t, topics[topic].t, values)
    for name, topic, values in _commanded(topics):
        found = held(t, topics[topic].t, values)
        yield name, found if values.shape[1] > 1 else found[:, 0]


def _measured(topics: Mapping[str, Topic]) -> Iterator[tuple[str, str, np.ndarray]]:
    """Yield signal, topic and readings of the signals that are interpolated."""

    def vector(topic: str, *fields: str) -> np.ndarray | None:
        return topics[topic].vector(*fields) if topic in topics else None

    place = vector("vehicle_local_position", "x", "y", "z")
    if place is not None:
        yield "position", "vehicle_local_position", from_ned(place)
    velocity = vector("vehicle_local_position", "vx", "vy", "vz")
    if velocity is not None:
        yield "velocity", "vehicle_local_position", from_ned(velocity)
    attitude = vector("vehicle_attitude", "q[0]", "q[1]", "q[2]", "q[3]")
    if attitude is not None:
        yield "quaternion", "vehicle_attitude", _one_sign(from_ned_and_frd(attitude))
    force = vector("vehicle_acceleration", *(f"xyz{k}" for k in XYZ))
    topic = "vehicle_acceleration"
    if force is None:
        force = vector("sensor_combined", *(f"accelerometer_m_s2{k}" for k in XYZ))
        topic = "sensor_combined"
    if force is not None:
        yield "specific_force", topic, from_frd(force)
    speeds = vector("esc_status", *(f"esc[{k}].esc_rpm" for k in MOTORS))
    if speeds is not None:
        yield "rotor_speeds", "esc_status", speeds * RPM


def _commanded(topics: Mapping[str, Topic]) -> Iterator[tuple[str, str, np.ndarray]]:
    """Yield signal, topic and readings of what holds until the next reading."""
    motors = topics.get("actuator_motors")
    commands = motors.vector(*(f"control[{k}]" for k in MOTORS)) if motors else None
    if commands is not None:
        # A motor that is not driven has no number.
        yield "motor_commands", "actuator_motors", np.nan_to_num(commands)
    elif "actuator_outputs" in topics:
        pulses = topics["actuator_outputs"].vector(*(f"output[{k}]" for k in MOTORS))
        if pulses is not None:
            shares = (pulses - SHORTEST_PULSE) / (LONGEST_PULSE - SHORTEST_PULSE)
            # Outputs of an unarmed vehicle lie below the range.
            stands = (pulses >= 0.0) & (pulses < SHORTEST_PULSE)
            yield "motor_commands", "actuator_outputs", np.where(stands, 0.0, shares)
    setpoints = topics.get("vehicle_rates_setpoint")
    asked = setpoints.vector("roll", "pitch", "yaw") if setpoints else None
    if asked is not None:
        yield "rate_setpoints", "vehicle_rates_setpoint", from_frd(asked)
    thrust = setpoints.vector("thrust_body[2]") if setpoints else None
    if thrust is not None:
        # Along the body's z, which points down
        yield "throttle", "vehicle_rates_setpoint", -thrust
    battery = topics.get("battery_status")
    voltage = battery.vector("voltage_v") if battery else None
    if voltage is not None:
        yield "battery", "battery_status", voltage


def _one_sign(quaternions: np.ndarray) -> np.ndarray:
    """Return the attitudes with signs that do not change on the way, as q and -q are the same."""
    inner = np.sum(quaternions[1:] * quaternions[:-1], axis=1)
    signs = np.cumprod(np.concatenate(([1.0], np.where(inner < 0.0, -1.0, 1.0))))
    return quaternions * signs[:, None]
