"""Runs of quadsim as logs: a stored run's folder, and a run that was exported as MCAP.

A run that has kept the measurements of its sensors (--record-sensing) is read on the clock of its
inertial sensor. Any other run is read on the clock of its control steps, with the true state in
place of measurements. Commands hold until the next one.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np

from quadsim.files.arrays import read_bytes
from quadsim.files.extras import imported
from quadsim.logs.raw_log import LogError, RawLog
from quadsim.logs.resampling import held, interpolated
from quadsim.record.archive import read_run
from quadsim.record.run import RunError

RUN = "run.json"
MCAP = b"\x89MCAP0\r\n"
TELEMETRY = "/telemetry"
# Signal -> columns of the telemetry
TRUE = {
    "position": ("px", "py", "pz"),
    "velocity": ("vx", "vy", "vz"),
    "quaternion": ("qw", "qx", "qy", "qz"),
    "body_rates": ("wx", "wy", "wz"),
}
COMMANDS = {"rate_setpoints": ("wx_cmd", "wy_cmd", "wz_cmd"), "thrust_setpoint": ("a_cmd",)}
# Signal -> array of quadsim.sensing.kept
MEASURED = {
    "position": "pose.position",
    "velocity": "pose.velocity",
    "quaternion": "pose.attitude",
}


def is_mcap(head: bytes) -> bool:
    """Return whether a file with these first bytes is an MCAP file."""
    return head.startswith(MCAP)


def read_run_log(folder: Path) -> list[RawLog]:
    """Return the flight of a stored run.

    Raises:
        LogError: the run cannot be read.
    """
    try:
        run = read_run(folder)
    except RunError as error:
        raise LogError(str(error)) from None
    if run.measurements and "imu.t" in run.measurements:
        return [_measured_log(run.telemetry, run.measurements, folder.name)]
    return [_true_log(run.telemetry, folder.name)]


def read_mcap_log(path: Path) -> list[RawLog]:
    """Return the flight of a run that `race export --mcap` has written.

    Raises:
        LogError: the file is damaged, or is no run of quadsim.
        ModuleNotFoundError: the packages of the extra `mcap` are not installed; one line.
    """
    reader = imported("mcap.reader", "mcap-protobuf-support", "mcap")
    decoder = imported("mcap_protobuf.decoder", "mcap-protobuf-support", "mcap")
    read_bytes(path, "a run as MCAP")
    names = ("t", *(name for group in (TRUE, COMMANDS) for each in group.values() for name in each))
    rows = []
    try:
        with path.open("rb") as file:
            made = reader.make_reader(file, decoder_factories=[decoder.DecoderFactory()])
            for message in made.iter_decoded_messages(topics=[TELEMETRY]):
                rows.append([getattr(message.decoded_message, name) for name in names])
    except AttributeError:
        rows = []
    except Exception as error:
        # The library raises errors of many types for a damaged file.
        text = " ".join(str(error).split()) or type(error).__name__
        raise LogError(f"{path}: damaged, or cut off: {text}") from None
    if not rows:
        wanted = f"expected messages {TELEMETRY} of a run of quadsim (race export --mcap)"
        raise LogError(f"{path}: {wanted}, got none")
    table = np.array(rows, float)
    columns = {name: table[:, k] for k, name in enumerate(names)}
    return [_true_log(columns, path.name)]


def _true_log(telemetry: Mapping[str, np.ndarray], name: str) -> RawLog:
    """Return the log of a telemetry, on its own clock."""
    t = telemetry["t"]
    remark = "the true state stands in for measurements: no sensor's readings were kept"
    signals = {**_columns(telemetry, TRUE), **dict(_commands(telemetry, t))}
    return RawLog(name, t, signals, (remark,))


def _measured_log(
    telemetry: Mapping[str, np.ndarray], kept: Mapping[str, np.ndarray], name: str
) -> RawLog:
    """Return the log of the measurements of a flight, on the clock of the inertial sensor."""
    # The sensors begin before the flight.
    flying = kept["imu.t"] >= telemetry["t"][0]
    t = kept["imu.t"][flying]
    signals = {
        "body_rates": kept["imu.gyro"][flying],
        "specific_force": kept["imu.specific_force"][flying],
        **dict(_commands(telemetry, t)),
    }
    remarks = []
    true = _columns(telemetry, TRUE)
    for signal, array in MEASURED.items():
        readings = kept.get(array)
        if readings is not None and np.isfinite(readings).any():
            signals[signal] = interpolated(t, kept["pose.t"], readings)
        elif "pose.t" not in kept:
            signals[signal] = interpolated(t, telemetry["t"], true[signal])
    if "pose.t" not in kept:
        remarks.append("the true pose stands in for a measured one: no sensor measured it")
    return RawLog(name, t, signals, tuple(remarks))


def _columns(
    telemetry: Mapping[str, np.ndarray], names: Mapping[str, tuple[str, ...]]
) -> dict[str, np.ndarray]:
    """Return signals that stand in columns of the telemetry."""
    return {
        signal: np.stack([telemetry[column] for column in columns], axis=1)
        for signal, columns in names.items()
    }


def _commands(
    telemetry: Mapping[str, np.ndarray], t: np.ndarray
) -> Iterator[tuple[str, np.ndarray]]:
    """Yield the commands that act at the times t."""
    for signal, values in _columns(telemetry, COMMANDS).items():
        found = held(t, telemetry["t"], values)
        yield signal, found if values.shape[1] > 1 else found[:, 0]
