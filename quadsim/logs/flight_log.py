"""FlightLog: the signals of one flight, in one set of units and frames, on one clock.

Every reader of this package returns this table, so that nothing behind it knows of what kind a log
was. World frame: ENU, z up. Body frame: x forward, y left, z up.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np


class Signal(NamedTuple):
    """The width, unit and range of a signal in any log."""

    # numbers of a reading
    width: int
    unit: str
    # A number outside of these is impossible, and is left out.
    least: float
    largest: float
    # as a message says it
    words: str


# The signals of a log besides its time. A gyro of 4000 deg/s ends at 70 rad/s, and an accelerometer
# of 32 g at 314 m/s^2.
SIGNALS = {
    "position": Signal(3, "m", -1e5, 1e5, "position"),
    "velocity": Signal(3, "m/s", -200.0, 200.0, "velocity"),
    "quaternion": Signal(4, "1", -1.1, 1.1, "attitude"),
    "body_rates": Signal(3, "rad/s", -100.0, 100.0, "body rates"),
    "specific_force": Signal(3, "m/s^2", -400.0, 400.0, "accelerometer"),
    "motor_commands": Signal(4, "1", 0.0, 1.0, "motor commands"),
    "rotor_speeds": Signal(4, "rad/s", 0.0, 20000.0, "rotor speeds"),
    "rate_setpoints": Signal(3, "rad/s", -100.0, 100.0, "rate setpoints"),
    "thrust_setpoint": Signal(1, "m/s^2", -1000.0, 1000.0, "thrust setpoint"),
    "throttle": Signal(1, "1", 0.0, 1.0, "throttle"),
    "battery": Signal(1, "V", 0.0, 200.0, "battery voltage"),
}


@dataclass(frozen=True, eq=False)
class FlightLog:
    """The signals of one flight on one clock.

    A signal that the log lacks is None, and a missing reading is NaN. Rotors are in the order of
    quadsim's vehicles: front right, rear left, front left, rear right.

    Attributes:
        name: name of the file, with the number of the flight if the file has several.
        t: time, which rises and starts at 0 [s]  (n,)
        position: in the world [m]  (n, 3)
        velocity: in the world [m/s]  (n, 3)
        quaternion: attitude, which turns vectors of the body into the world's, wxyz  (n, 4)
        body_rates: of the gyro, in the body [rad/s]  (n, 3)
        specific_force: of the accelerometer, in the body; (0, 0, g) at hover [m/s^2]  (n, 3)
        motor_commands: 0 to 1  (n, 4)
        rotor_speeds: [rad/s]  (n, 4)
        rate_setpoints: commanded body rates [rad/s]  (n, 3)
        thrust_setpoint: commanded mass-normalised thrust [m/s^2]  (n,)
        throttle: of the stick or a command, 0 to 1  (n,)
        battery: [V]  (n,)
        pieces: spans of rows without a gap or a reset, in order.
        remarks: one line each: what the log lacks, and which readings were left out, counted.
        start: what the log's own clock showed at t = 0 [s].
    """

    name: str
    t: np.ndarray
    position: np.ndarray | None
    velocity: np.ndarray | None
    quaternion: np.ndarray | None
    body_rates: np.ndarray | None
    specific_force: np.ndarray | None
    motor_commands: np.ndarray | None
    rotor_speeds: np.ndarray | None
    rate_setpoints: np.ndarray | None
    thrust_setpoint: np.ndarray | None
    throttle: np.ndarray | None
    battery: np.ndarray | None
    pieces: tuple[slice, ...]
    remarks: tuple[str, ...]
    start: float = 0.0

    def has(self, *names: str) -> bool:
        """Return whether the log has all these signals.

        Args:
            names: keys of SIGNALS.
        """
        return all(getattr(self, name) is not None for name in names)

    @property
    def signals(self) -> tuple[str, ...]:
        """The names of the signals that the log has."""
        return tuple(name for name in SIGNALS if self.has(name))

    @property
    def duration(self) -> float:
        """The time from the first reading to the last [s]."""
        return float(self.t[-1])

    @property
    def rate(self) -> float:
        """The number of readings a second, without gaps [Hz]."""
        steps = sum(piece.stop - 1 - piece.start for piece in self.pieces)
        return float(steps / sum(np.ptp(self.t[piece]) for piece in self.pieces))

    def __repr__(self) -> str:
        """Return one short line."""
        names = ", ".join(SIGNALS[name].words for name in self.signals)
        return f"<FlightLog {self.name}: {self.duration:.1f} s at {self.rate:.0f} Hz, {names}>"
