"""Prepared stretches: signals as the fit reads them, computed once for all its numbers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Literal, NamedTuple

import numpy as np

from quadsim.identify.stretches import Stretch, cropped
from quadsim.rotation import to_body
from quadsim.vehicle import Vehicle

SETTLED = (
    0.3  # time after the begin of a stretch in which the speeds of the rotors are not known [s]
)
MOST_ROWS = 10_000  # of each signal; in longer logs, neighbouring residuals are averaged
LONGEST_MEAN = 0.02  # neighbours are averaged over this time at most [s]

LEAST_SPREAD = 0.01  # of the voltage, standard deviation over mean: less tells nothing

Drive = Literal["motor_commands", "rotor_speeds", "thrust_setpoint", "throttle"]
# Drives by how much they tell
BEST_FIRST: tuple[Drive, ...] = ("motor_commands", "rotor_speeds", "thrust_setpoint", "throttle")
# Drives that tell each rotor, and drives whose effect changes with the battery's voltage
SINGLE_DRIVES = ("motor_commands", "rotor_speeds")
VOLTAGE_DRIVES = ("motor_commands", "throttle")


class Prepared(NamedTuple):
    """A stretch with what is computed once for all numbers; missing readings are 0 here."""

    stretch: Stretch
    ratio: np.ndarray  # voltage over the reference  (n,)
    usable: np.ndarray  # flying, settled, and the motors known  (n,)
    drive: Drive
    command: np.ndarray  # what drives the rotors, in shares of the full command  (n, 4)
    rates: np.ndarray | None  # (n, 3)
    attitude: np.ndarray | None  # (n, 4)
    v_body: np.ndarray | None  # velocity in the body's axes [m/s]  (n, 3)
    has_pose: np.ndarray  # whether attitude and velocity are known  (n,)
    mean_rows: int  # neighbouring residuals that are averaged

    @property
    def has_single(self) -> bool:
        """Whether the log has a signal of each rotor."""
        return self.drive in SINGLE_DRIVES


def drive_of(part: Stretch) -> Drive | None:
    """Return the logged signal that is nearest to the rotors; None: the log has none of them."""
    if part.motor_commands is not None:
        return "motor_commands"
    if part.rotor_speeds is not None:
        return "rotor_speeds"
    if part.thrust_setpoint is not None:
        return "thrust_setpoint"
    return None if part.throttle is None else "throttle"


def prepare(
    parts: Sequence[Stretch], base: Vehicle, reference: float | None = None
) -> list[Prepared]:
    """Return the stretches that have the best drive of all, prepared.

    Args:
        parts: stretches, each with a drive.
        base: the prior vehicle.
        reference: voltage to which the numbers refer [V]; None: the median of the stretches.
    """
    drives: list[Drive | None] = [drive_of(part) for part in parts]
    known: list[Drive] = [each for each in drives if each is not None]
    drive = min(known, key=BEST_FIRST.index)
    chosen = [part for part, its in zip(parts, drives, strict=True) if its == drive]
    reference = reference or reference_voltage(chosen)
    average = _rows_to_average(chosen)
    return [prepared(part, drive, base, reference, average) for part in chosen]


def reference_voltage(parts: Sequence[Stretch]) -> float | None:
    """Return the median voltage in flight, None if a log lacks it. [V]"""
    found = []
    for part in parts:
        if part.battery is None:
            return None
        found.append(part.battery[part.flying])
    values = np.concatenate(found)
    values = values[np.isfinite(values) & (values > 0.0)]
    return float(np.median(values)) if len(values) else None


def prepared(
    part: Stretch, drive: Drive, base: Vehicle, reference: float | None, mean_rows: int
) -> Prepared:
    """Return a stretch with what is computed once for all numbers.

    Args:
        part: the stretch.
        drive: what drives the rotors.
        base: the prior vehicle.
        reference: voltage to which the numbers refer [V]; None: the log has no voltage.
        mean_rows: neighbouring residuals that are averaged.
    """
    ratio = np.ones(len(part))
    # Speeds are what they are, whatever the voltage.
    if reference is not None and part.battery is not None and drive in VOLTAGE_DRIVES:
        ratio = np.where(part.battery > 0.0, part.battery / reference, np.nan)
    command = _command(part, drive, base)
    usable = part.flying & np.all(np.isfinite(command), axis=1)
    usable[: round(SETTLED / part.dt)] = False
    v_body = None
    has_pose = np.zeros(len(part), bool)
    if part.velocity is not None and part.quaternion is not None:
        v_body = np.stack(to_body(part.quaternion.T, part.velocity.T), axis=1)
        has_pose = np.all(np.isfinite(v_body), axis=1)
    return Prepared(
        stretch=part,
        ratio=np.where(np.isfinite(ratio), ratio, 1.0),
        usable=usable,
        drive=drive,
        command=_filled(command),
        rates=_zeroed(part.body_rates),
        attitude=_zeroed(part.quaternion),
        v_body=_zeroed(v_body),
        has_pose=has_pose,
        mean_rows=mean_rows,
    )


def middle(part: Prepared, time: float) -> Prepared:
    """Return the rows in the middle of the flight of a stretch.

    Args:
        part: the stretch.
        time: duration of what is returned [s].
    """
    flying = np.flatnonzero(part.usable)
    count = round(time / part.stretch.dt)
    first = max(int(flying[len(flying) // 2]) - count // 2, 0) if len(flying) else 0
    rows = slice(first, first + count)
    return _of_rows(part, rows, cropped(part.stretch, rows))


def every_second(part: Prepared) -> Prepared:
    """Return every second row of a stretch, as of a log with half as many rows."""
    rows = slice(0, None, 2)
    fewer = cropped(part.stretch, rows)
    averaged = max(part.mean_rows // 2, 1)
    return _of_rows(part, rows, replace(fewer, dt=2.0 * fewer.dt))._replace(mean_rows=averaged)


def _of_rows(part: Prepared, rows: slice, stretch: Stretch) -> Prepared:
    """Return some rows of a prepared stretch, whose readings are `stretch`."""

    def cut(values: np.ndarray | None) -> np.ndarray | None:
        return None if values is None else values[rows]

    return part._replace(
        stretch=stretch,
        ratio=part.ratio[rows],
        usable=part.usable[rows],
        command=part.command[rows],
        rates=cut(part.rates),
        attitude=cut(part.attitude),
        v_body=cut(part.v_body),
        has_pose=part.has_pose[rows],
    )


def _rows_to_average(parts: Sequence[Stretch]) -> int:
    """Return how many neighbouring residuals are averaged."""
    rows = sum(len(part) for part in parts)
    dt = min(part.dt for part in parts)
    return max(min(round(rows / MOST_ROWS), int(LONGEST_MEAN / dt)), 1)


def _command(part: Stretch, drive: Drive, base: Vehicle) -> np.ndarray:
    """Return the commands of the rotors in shares of the full one, NaN where missing  (n, 4)."""
    assert base.rotors
    if drive == "motor_commands":
        assert part.motor_commands is not None
        return part.motor_commands
    if drive == "rotor_speeds":
        assert part.rotor_speeds is not None
        return part.rotor_speeds / base.rotors.motor_omega_max
    if drive == "thrust_setpoint":
        # The flight controller asks each rotor for a quarter, by the prior's thrust map.
        assert part.thrust_setpoint is not None
        share = np.sqrt(np.clip(part.thrust_setpoint / base.thrust_max, 0.0, 1.0))
    else:
        assert part.throttle is not None
        share = part.throttle
    return np.repeat(share[:, None], 4, axis=1)


def _filled(values: np.ndarray) -> np.ndarray:
    """Return a signal whose missing readings are those before them."""
    known = np.all(np.isfinite(values), axis=1)
    if np.all(known):
        return values
    last = np.maximum.accumulate(np.where(known, np.arange(len(values)), 0))
    return np.nan_to_num(values[last])


def _zeroed(values: np.ndarray | None) -> np.ndarray | None:
    return None if values is None else np.nan_to_num(values)
