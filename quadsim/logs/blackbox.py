"""Betaflight's blackbox logs, .bbl and .BFL, read with orangebox (extra `logs`).

Betaflight's axes are ours: x forward, y left, z up, so that a positive pitch rate lowers the nose.
Its motors are rear right, front right, rear left, front left. A command of a digital protocol is
0 for a motor that stands, and 48 to 2047 for the whole range of the motor controller; a motor at
idle has the first number of the header's `motorOutput`. Of an analogue protocol the range is 1000
to 2000.

Orangebox raises errors on logs that pilots have. So each log of a file is read apart, up to where
it cannot be read, and the others survive.
"""

from __future__ import annotations

import logging
from array import array
from collections.abc import Iterator, Mapping, Sequence
from math import pi
from pathlib import Path
from typing import Any

import numpy as np

from quadsim.files.arrays import read_bytes
from quadsim.files.extras import imported
from quadsim.logs.mapping import STANDARD_GRAVITY
from quadsim.logs.raw_log import MOST_ROWS, LogError, RawLog

# Type of a frame of whole values; others have differences to the frames before
WHOLE = "I"
# Frames are lost if a step of time is longer than this multiple of the median step.
LARGEST_STEP = 4.5
BEGIN = b"H Product:Blackbox"
# Betaflight's motors in quadsim's order: front right, rear left, front left, rear right
MOTORS = (1, 2, 3, 0)
AXES = (0, 1, 2)
# Range of commands of a digital protocol, and of an analogue one
DIGITAL = (48.0, 2047.0)
ANALOGUE = (1000.0, 2000.0)
# A `motorOutput` that begins below this is one of a digital protocol.
FIRST_ANALOGUE = 900.0
# Numbers that reach this are in hundredths of a volt, as of Betaflight 4; others in tenths.
FEWEST_HUNDREDTHS = 300.0
# Readings at which the usual gyro and accelerometer saturate: 2000 deg/s, 16 g
LARGEST_RATE = 2000.0 * pi / 180.0
LARGEST_FORCE = 16.0 * STANDARD_GRAVITY
POLES = 14
# Smaller scales of the gyro are in rad/us, of logs before Betaflight.
LEAST_IN_DEGREES = 1e-3
WANTED = (
    "time",
    *(f"{name}[{axis}]" for name in ("gyroADC", "accSmooth", "setpoint") for axis in AXES),
    "setpoint[3]",
    "rcCommand[3]",
    *(f"{name}[{motor}]" for name in ("motor", "eRPM") for motor in range(4)),
    "vbatLatest",
)


def is_blackbox_log(head: bytes) -> bool:
    """Return whether a file with these first bytes is a blackbox log."""
    return BEGIN in head


def read_blackbox_log(path: Path) -> list[RawLog]:
    """Return the flights of a blackbox file, each log of it apart.

    Raises:
        LogError: no log of the file can be read.
        ModuleNotFoundError: orangebox is not installed; one line.
    """
    orangebox = imported("orangebox", "orangebox", "logs")
    logging.getLogger("orangebox").setLevel(logging.CRITICAL)
    _set_header_defaults(orangebox)
    count = read_bytes(path, "a blackbox log").count(BEGIN)
    found = []
    problems = []
    for number in range(1, count + 1):
        name = f"{path.name}[{number}]" if count > 1 else path.name
        try:
            found.append(_read_one(orangebox, path, number, name))
        except LogError as error:
            problems.append(str(error))
    if not found:
        raise LogError(problems[0])
    if problems:
        first = found[0]
        remarks = (*first.remarks, *(f"left out: {problem}" for problem in problems))
        found[0] = RawLog(first.name, first.t, first.signals, remarks, first.largest)
    return found


def _set_header_defaults(orangebox: Any) -> None:
    """Replace the properties of a class, which Python 3.13 no longer has, by their values.

    Orangebox 0.4.0 has them for what a header may leave out.
    """
    defaults = orangebox.defaults.HeaderDefaults
    for name, member in list(vars(defaults).items()):
        if isinstance(member, classmethod) and isinstance(member.__func__, property):
            setattr(defaults, name, member.__func__.__get__(defaults))


def _read_one(orangebox: Any, path: Path, number: int, name: str) -> RawLog:
    """Return one log of a file. Raises LogError."""
    remarks = []
    try:
        parser = orangebox.Parser.load(str(path), number, allow_invalid_header=True)
        places = {field: k for k, field in enumerate(parser.field_names) if field in WANTED}
        frames = parser.frames()
    except Exception as error:
        # Orangebox raises errors of many types for a damaged header.
        raise LogError(f"{name}: its header cannot be read: {_text(error)}") from None
    missing = [field for field in ("time", "gyroADC[0]") if field not in places]
    if missing:
        raise LogError(
            f"{name}: expected the fields time and gyroADC, got none: the log is damaged"
        )
    numbers = array("d")
    problem = _collect(frames, list(places.values()), numbers)
    if problem:
        remarks.append(f"the log is damaged: what follows the damage is left out ({problem})")
    table = np.frombuffer(numbers).reshape(-1, 1 + len(places))
    if len(table) == MOST_ROWS:
        remarks.append(f"the first {MOST_ROWS:,} rows are read, and no more")
    whole = _whole(table[:, 0] == 1.0, table[:, 1 + list(places).index("time")])
    if not whole.all():
        remarks.append(f"rows left out, of differences to a row that is lost: {(~whole).sum()}")
    table = table[whole, 1:]
    if not len(table):
        raise LogError(f"{name}: expected readings, got a header alone")
    columns = {field: table[:, k] for k, field in enumerate(places)}
    signals = dict(_signals(columns, parser.headers))
    largest = {"body_rates": LARGEST_RATE, "specific_force": LARGEST_FORCE}
    return RawLog(name, 1e-6 * columns["time"], signals, tuple(remarks), largest)


def _collect(frames: Iterator[Any], places: Sequence[int], numbers: array[float]) -> str:
    """Append the numbers of each frame; return what has ended the log, "" at its end.

    The first number of a row is 1 for a frame of whole values, 0 for one of differences.
    """
    try:
        for row, frame in enumerate(frames, 1):
            is_whole = float(frame.type.value == WHOLE)
            numbers.extend([is_whole, *(frame.data[place] for place in places)])
            if row == MOST_ROWS:
                break
    except Exception as error:
        # Orangebox raises errors of many types, and a generator that has raised has ended.
        del numbers[len(numbers) - len(numbers) % (1 + len(places)) :]
        return _text(error)
    return ""


def _whole(is_whole: np.ndarray, time: np.ndarray) -> np.ndarray:
    """Return which rows do not depend on a frame that is lost.  (n,)

    A frame of differences is wrong if one before it is lost, up to the next frame of whole values.
    The loss shows in the time: at that frame, or where the frames that follow it begin.

    Args:
        is_whole: whether a row is a frame of whole values  (n,).
        time: [us]  (n,).
    """
    rows = np.arange(len(time))
    steps = np.diff(time)
    usual = np.median(steps) if len(steps) else 1.0
    jumps = np.flatnonzero((steps <= 0.0) | (steps > LARGEST_STEP * usual)) + 1
    jumps = np.concatenate(([0], jumps)).astype(int)
    # The last frame of whole values up to each row, -1 before the first one
    last_whole = np.maximum.accumulate(np.where(is_whole, rows, -1))
    # Differences that follow a jump of the time
    last_jump = np.zeros(len(time), int)
    last_jump[jumps[jumps < len(time)]] = jumps[jumps < len(time)]
    good = last_whole >= np.maximum.accumulate(last_jump)
    # Differences before one: somewhere between two frames of whole values others are lost.
    for jump in jumps[1:]:
        good[last_whole[jump - 1] + 1 : jump] = False
    return good


def _signals(
    columns: Mapping[str, np.ndarray], headers: Mapping[str, Any]
) -> Iterator[tuple[str, np.ndarray]]:
    """Yield the signals that the columns have, in the units of FlightLog."""
    fine = 10.0 if headers.get("blackbox_high_resolution") == 1 else 1.0
    rates = _together(columns, "gyroADC", AXES)
    if rates is not None:
        yield "body_rates", rates * _gyro_scale(headers) / fine
    force = _together(columns, "accSmooth", AXES)
    one_g = headers.get("acc_1G")
    if force is not None and isinstance(one_g, int) and one_g > 1:
        yield "specific_force", force * (STANDARD_GRAVITY / one_g)
    setpoints = _together(columns, "setpoint", AXES)
    if setpoints is not None:
        yield "rate_setpoints", np.radians(setpoints) / fine
    if "setpoint[3]" in columns:
        yield "throttle", columns["setpoint[3]"] / (1000.0 * fine)
    elif "rcCommand[3]" in columns:
        yield "throttle", columns["rcCommand[3]"] / 1000.0 - 1.0
    motors = _together(columns, "motor", MOTORS)
    if motors is not None:
        yield "motor_commands", _commands(motors, headers)
    speeds = _together(columns, "eRPM", MOTORS)
    if speeds is not None:
        # Hundreds of electrical revolutions a minute
        pairs = headers.get("motor_poles", POLES) / 2
        yield "rotor_speeds", speeds * (100.0 * pi / 30.0 / pairs)
    if "vbatLatest" in columns:
        voltage = columns["vbatLatest"]
        hundredths = np.nanmax(np.abs(voltage)) >= FEWEST_HUNDREDTHS
        yield "battery", voltage * (0.01 if hundredths else 0.1)


def _together(
    columns: Mapping[str, np.ndarray], name: str, numbers: Sequence[int]
) -> np.ndarray | None:
    """Return the columns of one field side by side, None if the log lacks any.  (n, numbers)"""
    names = [f"{name}[{number}]" for number in numbers]
    if not set(names) <= columns.keys():
        return None
    return np.stack([columns[each] for each in names], axis=1)


def _commands(motors: np.ndarray, headers: Mapping[str, Any]) -> np.ndarray:
    """Return commands as shares of the motor controller's range.  (n, 4)"""
    output = headers.get("motorOutput")
    first = output[0] if isinstance(output, list) else headers.get("minthrottle", 0)
    low, high = DIGITAL if first < FIRST_ANALOGUE else ANALOGUE
    commands = (motors - low) / (high - low)
    # A motor that stands has a command below the range.
    stands = (motors >= 0.0) & (motors < low)
    return np.where(stands, 0.0, commands)


def _gyro_scale(headers: Mapping[str, Any]) -> float:
    """Return the unit of the gyro [rad/s]. The header has the bits of a 32-bit number."""
    bits = headers.get("gyro_scale", 0)
    if not isinstance(bits, int):
        return pi / 180.0
    scale = float(np.array(bits & 0xFFFFFFFF, np.uint32).view(np.float32))
    if 0.0 < scale < LEAST_IN_DEGREES:
        return 1e6 * scale
    return scale * pi / 180.0 if scale else pi / 180.0


def _text(error: Exception) -> str:
    """Return an error on one line."""
    return " ".join(f"{type(error).__name__}: {error}".split())
