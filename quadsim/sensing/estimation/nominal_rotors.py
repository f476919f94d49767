"""The rotors of the nominal vehicle under the commands that were given.

The rate loop, the allocation and the rotors' lag are those of the vehicle file: with the body rates
that the real vehicle had, they give the thrust of each rotor if it was sound. The rate loop
runs faster than the planner, so a control period has several steps, between whose ends the body
rates are interpolated.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from quadsim.dynamics.allocation import PerRotor, allocate, mixer, shares
from quadsim.dynamics.first_order import response
from quadsim.dynamics.quadrotor import Control
from quadsim.dynamics.rate_torque import gyroscopic, rate_torque
from quadsim.dynamics.rotors import Motors
from quadsim.rotation import Vec3
from quadsim.sensing.estimation.prediction import Acted
from quadsim.vehicle import Vehicle

# [s] longest step of the rate loop
LONGEST_STEP = 0.0025
# share of a rotor's highest thrust, above which its thrust depends on the highest thrust
NEAR_FULL = 0.93
# share of the nominal highest thrust up to which every vehicle is expected to follow: a thrust that
# is missing below it is missing at every level, and the highest thrust is not sought there
UNSATURATED = 0.9


class Turning(NamedTuple):
    """Body rates and angular acceleration of the vehicle at an instant, about its axes."""

    # [rad/s]
    rates: Vec3
    # [rad/s^2]
    acceleration: Vec3


class Interval(NamedTuple):
    """An interval with its commands and the motion of the vehicle at both ends."""

    # at both ends
    before: Turning
    after: Turning
    acted: Acted
    # [s]
    duration: float


class Motion(NamedTuple):
    """The body rates within an interval, (bend s + slope) s + first at the share s of it.

    The angular acceleration changes linearly, and the rates are its integral, moved such that they
    end at the rates after the interval.
    """

    # about the body's axes [rad/s]
    first: Vec3
    slope: Vec3
    bend: Vec3
    # angular acceleration at the beginning, and its change [rad/s^2]
    acceleration: Vec3
    change: Vec3

    @classmethod
    def of(cls, interval: Interval) -> Motion:
        """Return the motion between the ends of an interval."""
        before, after, _, duration = interval
        axes = []
        ends = zip(before.rates, after.rates, before.acceleration, after.acceleration, strict=True)
        for w0, w1, b0, b1 in ends:
            bend = duration * (b1 - b0) / 2
            axes.append((w0, w1 - w0 - bend, bend, b0, b1 - b0))
        return cls(*zip(*axes, strict=True))

    def at(self, share: float) -> Turning:
        """Return the turning when this share of the interval has passed."""
        (wx, wy, wz), (sx, sy, sz), (ex, ey, ez), (bx, by, bz), (cx, cy, cz) = self
        rates = (
            (ex * share + sx) * share + wx,
            (ey * share + sy) * share + wy,
            (ez * share + sz) * share + wz,
        )
        return Turning(rates, (bx + share * cx, by + share * cy, bz + share * cz))


class Followed(NamedTuple):
    """The response of the nominal rotors in an interval. Thrusts are mass-normalised."""

    # thrust of each rotor at the end, and its mean [m/s^2]  (4,)
    last: np.ndarray
    mean: np.ndarray
    # thrust that was still to come, on average [m/s^2]
    unsettled: float
    # share of the time in which a rotor was asked for nearly its highest thrust
    full: float
    # yaw that was asked for and not given, on average, in units of thrust [m/s^2]
    missing_yaw: float


class NominalRotors:
    """Follows the rotors of the nominal vehicle, from hover on."""

    def __init__(self, vehicle: Vehicle, dt: float):
        """Begin at hover.

        Args:
            vehicle: the nominal vehicle, which has rotors.
            dt: control period [s].
        """
        assert vehicle.rotors
        self._vehicle = vehicle
        self._rotors = vehicle.rotors
        self._step = dt / max(1, round(dt / LONGEST_STEP))
        self._motors = Motors(vehicle, vehicle.rotors, self._step)
        self._share = shares(vehicle.rotors)
        # highest nominal thrust of a rotor [N]
        self._nominal_high = vehicle.thrust_max * vehicle.mass / 4
        x, y, z = (response(tau, self._step) / self._step for tau in vehicle.rate_tau)
        # gains of the rate loop [1/s]
        self._gains = (x, y, z)

        # Collective and torques of the thrusts (4,) are levers * (signs @ thrusts).
        to_wrench = np.array(mixer(vehicle.rotors))
        levers = abs(to_wrench).max(axis=1)
        self.signs = to_wrench / levers[:, None]
        # angular acceleration per thrust at the lever, about each axis [1/m]  (3,)
        self.turn_per_thrust = vehicle.mass * levers[1:] / np.array(vehicle.inertia)

    def wrench_of(self, thrust: float, turning: Turning) -> np.ndarray:
        """Return thrust and torques in units of thrust [m/s^2]  (4,).

        Args:
            thrust: thrust of all rotors, mass-normalised [m/s^2].
            turning: rates and angular acceleration that they cause.
        """
        inertia = self._vehicle.inertia
        gyro = np.array(gyroscopic(turning.rates, inertia)) / inertia
        torques = (np.array(turning.acceleration) + gyro) / self.turn_per_thrust
        return np.array([thrust, *torques])

    def advance(self, interval: Interval, thrust_max: float) -> Followed:
        """Move the rotors by one interval, and return their response.

        Args:
            interval: what was commanded, and how the vehicle turned.
            thrust_max: the highest thrust, as it is known [m/s^2].
        """
        acted = interval.acted
        counts = [max(1, round(share * interval.duration / self._step)) for share in acted.shares]
        steps = sum(counts)
        commands = [
            u for u, count in zip(acted.commands, counts, strict=True) for _ in range(count)
        ]
        low = self._motors.low
        high = max(thrust_max * self._vehicle.mass / 4, low)
        nearly_full = max(NEAR_FULL * high, UNSATURATED * self._nominal_high)
        motion = Motion.of(interval)
        thrusts = []
        unsettled = full = missing_yaw = 0.0
        for i, u in enumerate(commands):
            torque = self._torque(u, motion.at(i / steps))
            asked = allocate(self._share, self._vehicle.mass * u.thrust, torque, low, high)
            self._motors.turn(map(self._rotors.speed, asked))

            delivered = [self._rotors.thrust(speed) for speed in self._motors.speeds]
            thrusts.append(delivered)
            unsettled += sum(asked) - sum(delivered)
            full += max(asked) > nearly_full
            missing_yaw += abs(torque[2] / self._rotors.kappa - self._yaw_of(asked))
        mean = [sum(column) / steps for column in zip(*thrusts, strict=True)]
        mass = self._vehicle.mass
        return Followed(
            last=np.array(thrusts[-1]) / mass,
            mean=np.array(mean) / mass,
            unsettled=unsettled / (steps * mass),
            full=full / steps,
            missing_yaw=missing_yaw / (steps * mass),
        )

    def _yaw_of(self, thrusts: PerRotor) -> float:
        """Return the torque about z of four thrusts, over the torque per thrust [N]."""
        a, b, c, d = self._rotors.spin
        t0, t1, t2, t3 = thrusts
        return a * t0 + b * t1 + c * t2 + d * t3

    def _torque(self, u: Control, turning: Turning) -> Vec3:
        """Return the torque that the rate loop asks for [N m]."""
        lx, ly, lz = self._vehicle.rate_lead
        bx, by, bz = turning.acceleration
        commanded = (u.wx - lx * bx, u.wy - ly * by, u.wz - lz * bz)
        return rate_torque(turning.rates, commanded, self._gains, self._vehicle.inertia)
