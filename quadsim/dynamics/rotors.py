"""Four rotors whose speeds follow their commands with a lag."""

from __future__ import annotations

from collections.abc import Iterable

from quadsim.dynamics.allocation import PerRotor, allocate, mixer, shares
from quadsim.dynamics.first_order import remaining
from quadsim.rotation import Vec3
from quadsim.vehicle import GRAVITY, Rotors, Vehicle

# strengths of four healthy rotors
SOUND: PerRotor = (1.0, 1.0, 1.0, 1.0)


class Motors:
    """Four rotors, initially at hover, whose speeds follow their commands with first-order lag."""

    def __init__(self, vehicle: Vehicle, rotors: Rotors, dt: float):
        """dt: physics step [s]."""
        self._rotors = rotors
        self._mixer = mixer(rotors)
        self._share = shares(rotors)
        # limits of a rotor's thrust [N]; a fitted thrust map may go below zero at idle
        self.low = max(0.0, rotors.thrust(rotors.motor_omega_min))
        self.high = rotors.thrust(rotors.motor_omega_max)
        self._dt = dt
        self._remaining = remaining(rotors.motor_tau, dt)
        # [rad/s]
        self.speeds: PerRotor = (rotors.speed(0.25 * vehicle.mass * GRAVITY),) * 4

    def drive(
        self, collective: float, torque: Vec3, strengths: PerRotor = SOUND
    ) -> tuple[float, Vec3]:
        """Advance the rotors by one step towards a demand.

        Args:
            collective: demanded thrust of all rotors [N].
            torque: demanded torque [N m].
            strengths: share of its nominal thrust that each rotor gives, which the mixer does not
                know  (4,).

        Returns:
            The delivered collective [N] and torque [N m] at the end of the step.
        """
        thrusts = allocate(self._share, collective, torque, self.low, self.high)
        return self.follow(map(self._rotors.speed, thrusts), strengths)

    def follow(self, commands: Iterable[float], strengths: PerRotor = SOUND) -> tuple[float, Vec3]:
        """Advance the rotors by one step towards commanded speeds.

        Args:
            commands: speeds [rad/s]  (4,).
            strengths: share of its nominal thrust that each rotor gives  (4,).

        Returns:
            The delivered collective [N] and torque [N m] at the end of the step.
        """
        self.speeds = tuple(
            command + (speed - command) * self._share_left(speed, command)
            for speed, command in zip(self.speeds, commands, strict=True)
        )
        # A rotor's thrust and its reaction torque fail together.
        t0, t1, t2, t3 = (
            strength * self._rotors.thrust(speed)
            for strength, speed in zip(strengths, self.speeds, strict=True)
        )
        force, x, y, z = (a * t0 + b * t1 + c * t2 + d * t3 for a, b, c, d in self._mixer)
        return force, (x, y, z)

    def _share_left(self, speed: float, command: float) -> float:
        """Return the share of the distance from a speed to its command that a step leaves."""
        if self._rotors.motor_response is None:
            return self._remaining
        return remaining(self._rotors.lag(speed, command), self._dt)
