"""Four rotors whose speeds follow their commands with a lag."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

from quadsim.dynamics.allocation import PerRotor, allocate, mixer, shares
from quadsim.dynamics.first_order import remaining
from quadsim.rotation import Vec3
from quadsim.vehicle import GRAVITY, Rotors, Vehicle

ALL_ONE: PerRotor = (1.0, 1.0, 1.0, 1.0)


class RotorHealth(NamedTuple):
    """Factors on the nominal numbers of four rotors, which the mixer does not know."""

    # on the thrust and the reaction torque of each rotor
    strengths: PerRotor = ALL_ONE
    # on the lag of each motor
    lags: PerRotor = ALL_ONE
    # on the highest speed of all rotors, which the mixer does know
    top_speed: float = 1.0


SOUND = RotorHealth()


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
        self, collective: float, torque: Vec3, health: RotorHealth = SOUND
    ) -> tuple[float, Vec3]:
        """Advance the rotors by one step towards a demand.

        Args:
            collective: demanded thrust of all rotors [N].
            torque: demanded torque [N m].
            health: health of the rotors.

        Returns:
            The delivered collective [N] and torque [N m] at the end of the step.
        """
        high = self.high
        if health.top_speed != 1.0:
            high = self._rotors.thrust(health.top_speed * self._rotors.motor_omega_max)
        thrusts = allocate(self._share, collective, torque, self.low, high)
        return self.follow(map(self._rotors.speed, thrusts), health)

    def follow(self, commands: Iterable[float], health: RotorHealth = SOUND) -> tuple[float, Vec3]:
        """Advance the rotors by one step towards commanded speeds.

        Args:
            commands: speeds [rad/s]  (4,).
            health: health of the rotors.

        Returns:
            The delivered collective [N] and torque [N m] at the end of the step.
        """
        self.turn(commands, health)
        # A rotor's thrust and its reaction torque fail together.
        t0, t1, t2, t3 = [
            strength * self._rotors.thrust(speed)
            for strength, speed in zip(health.strengths, self.speeds, strict=True)
        ]
        force, x, y, z = [a * t0 + b * t1 + c * t2 + d * t3 for a, b, c, d in self._mixer]
        return force, (x, y, z)

    def turn(self, commands: Iterable[float], health: RotorHealth = SOUND) -> None:
        """Change the rotors' speeds by one step towards commanded speeds.

        Args:
            commands: speeds [rad/s]  (4,).
            health: health of the rotors.
        """
        dt = self._dt
        pairs = zip(self.speeds, commands, strict=True)
        if health is SOUND and self._rotors.motor_response is None:
            left = self._remaining
            self.speeds = tuple([command + (speed - command) * left for speed, command in pairs])
            return
        self.speeds = tuple(
            [
                command + (speed - command) * remaining(lag * self._rotors.lag(speed, command), dt)
                for (speed, command), lag in zip(pairs, health.lags, strict=True)
            ]
        )
