"""A flight of manoeuvres in a box, from which the numbers of a vehicle can be fitted.

Each manoeuvre excites only some numbers of the vehicle:

| manoeuvre | shows |
|---|---|
| chirp of a body rate about x, y, z | rate loop, inertia, delay |
| steps of the thrust | thrust map, lag of the rotors, delay, drag along z |
| dashes along x and y | drag along x and y |
| climbs and descents | drag along z |

A loop over position and attitude, slower than the manoeuvres, keeps the vehicle near the centre of
the box. At the end it flies through the first gate of the course, which finishes the race.
"""

from __future__ import annotations

from itertools import accumulate
from math import cos, exp, hypot, log, pi, radians, tan
from typing import NamedTuple

import numpy as np

from quadsim.controllers.plan import PlanStats
from quadsim.course import Course
from quadsim.dynamics.estimate import Estimate
from quadsim.dynamics.quadrotor import Control, State
from quadsim.rotation import Vec3, to_body, to_world
from quadsim.vehicle import GRAVITY, Vehicle

# Takes the place of the sampler in a record
EXCITE = "excite"

# Chirps: the frequency rises by a constant factor a second [Hz]
FIRST_FREQUENCY = 0.4
LAST_FREQUENCY = 6.0
# amplitude of the angle [rad], and of the rate as a share of the vehicle's limit
CHIRP_ANGLE = 0.4
CHIRP_SHARE = 0.6
# Durations of the thrust's steps, in turn [s]
STEPS = (0.12, 0.31, 0.2, 0.25, 0.15, 0.4)
# Thrust of a step up as a share of the largest, at most twice gravity, and of one down [m/s^2]
STEP_UP = 0.85
LARGEST_STEP = 2.0 * GRAVITY
STEP_DOWN = 0.4 * GRAVITY
# Weight of the climb rate beside the height when the next step is chosen [s]
CLIMB = 0.6
# Time from one end of a dash to the other [s]
DASH = 1.6
# Room between the ends of a dash and the bounds of the course [m]
ROOM = 3.0
LARGEST_REACH = 5.0
# Position loop: the limit of its natural frequency [rad/s]; the ratio of the attitude loop's
# frequency to its horizontal one, at least; its damping ratio; the largest tilt
LARGEST_FREQUENCY = 2.0
SLOWER_THAN_ATTITUDE = 4.0
DAMPING = 0.7
TILT = radians(50.0)
# Integral of the height's error: acceleration per metre and second [1/s^3], and the most [m/s^2].
# Behind a firmware, which gives up thrust to turn, the vehicle would sink without it.
INTEGRAL = 1.0
LARGEST_INTEGRAL = 3.0
# Share of the largest thrust that the loop uses
LARGEST_THRUST = 0.9
# Attitude loop: the limit of its gain, body rate per angle [1/s], and the ratio of the rate loop's
# frequency to that gain
LARGEST_GAIN = 8.0
SLOWER = 2.5
HEADING_GAIN = 1.5
# Share of the attitude's loop that stays on the axis of a chirp
DURING_CHIRP = 0.3
# The way through the gate begins slowly [m/s^2], and ends so far behind it [m].
LEAVING = 3.0
BEHIND = 2.0


class Manoeuvre(NamedTuple):
    """A part of the flight."""

    name: str
    # axis of a body rate or of a dash: 0, 1, 2
    axis: int
    duration: float  # [s]


MANOEUVRES = (
    Manoeuvre("hover", 0, 3.0),
    Manoeuvre("chirp", 0, 8.0),
    Manoeuvre("chirp", 1, 8.0),
    Manoeuvre("chirp", 2, 8.0),
    Manoeuvre("hover", 0, 1.5),
    Manoeuvre("steps", 2, 9.0),
    Manoeuvre("hover", 0, 1.5),
    Manoeuvre("dash", 0, 7.0),
    Manoeuvre("dash", 1, 7.0),
    Manoeuvre("dash", 2, 7.0),
)
LEAVE = Manoeuvre("leave", 0, 0.0)
ENDS = tuple(accumulate(manoeuvre.duration for manoeuvre in MANOEUVRES))


class Excitation:
    """The controller of one flight of manoeuvres; see quadsim.racing.flight.Controller.

    Examples:
        >>> import quadsim
        >>> run = quadsim.fly(excite=True, vehicle="kingfisher", plant="rigid")
        >>> run.outcome, sorted(run.measurements)[:2]
        ('finished', ['estimate.accelerometer_bias', 'estimate.gyro_bias'])
    """

    def __init__(self, vehicle: Vehicle, course: Course):
        """Prepare a flight.

        Args:
            vehicle: vehicle whose limits scale the manoeuvres.
            course: course whose bounds are the box, and whose first gate ends the flight.
        """
        self.rest = np.array(Control(0.0, 0.0, 0.0, GRAVITY))
        self._vehicle = vehicle
        spans = [(low, high) for low, high in course.bounds]
        # The ground bounds the box even if the bounds lie below it.
        spans[2] = (max(spans[2][0], 0.0), spans[2][1])
        self._centre = tuple(0.5 * (low + high) for low, high in spans)
        self._reach = tuple(
            min(max(0.5 * (high - low) - ROOM, 0.0), LARGEST_REACH) for low, high in spans
        )
        self._gains = tuple(min(LARGEST_GAIN, 1.0 / (SLOWER * tau)) for tau in vehicle.rate_tau)
        horizontal = min(LARGEST_FREQUENCY, min(self._gains[:2]) / SLOWER_THAN_ATTITUDE)
        # of the position's loop along x, y, z [rad/s]
        self._frequencies = (horizontal, horizontal, LARGEST_FREQUENCY)
        gate = course.gates[0]
        forward = gate.axes[0]
        self._out = tuple(p + BEHIND * d for p, d in zip(gate.position, forward, strict=True))
        # The integral's acceleration [m/s^2], and the time up to which it goes [s]
        self._lift = 0.0
        self._lifted = 0.0
        # The present step of the thrust [m/s^2], its end [s], and how many there were
        self._step = GRAVITY
        self._step_ends = 0.0
        self._steps = 0

    def control(self, estimate: Estimate) -> tuple[np.ndarray, PlanStats]:
        """Return the command for the estimated state, and zero statistics, as there is no plan."""
        x = State(*estimate.x.tolist())
        manoeuvre, since = manoeuvre_at(estimate.t)
        self._integrate(x, manoeuvre, estimate.t)
        up = self._acceleration(x, manoeuvre, since)
        rates = self._attitude_rates(x, up)
        if manoeuvre.name == "chirp":
            axis = manoeuvre.axis
            rates[axis] = DURING_CHIRP * rates[axis] + self._chirp(axis, since, manoeuvre.duration)
        if manoeuvre.name == "steps":
            thrust = self._stepped_thrust(x, estimate.t)
        else:
            along = to_world(x.attitude, (0.0, 0.0, 1.0))
            wanted = sum(a * b for a, b in zip(up, along, strict=True))
            thrust = min(max(wanted, 0.0), LARGEST_THRUST * self._vehicle.thrust_max)
        u = np.array(self._limited(rates, thrust))
        return u, PlanStats(0.0, 0.0, 0.0)

    def _integrate(self, x: State, manoeuvre: Manoeuvre, t: float) -> None:
        """Integrate the error of the height during manoeuvres that keep the height."""
        step = t - self._lifted
        self._lifted = t
        if manoeuvre.name != "steps" and (manoeuvre.name, manoeuvre.axis) != ("dash", 2):
            height = self._out[2] if manoeuvre.name == "leave" else self._centre[2]
            lift = self._lift + INTEGRAL * (height - x.pz) * step
            self._lift = min(max(lift, -LARGEST_INTEGRAL), LARGEST_INTEGRAL)

    def _acceleration(self, x: State, manoeuvre: Manoeuvre, since: float) -> Vec3:
        """Return the thrust vector in the world that leads to the manoeuvre's place [m/s^2]."""
        place = list(self._centre)
        largest = GRAVITY * tan(TILT)
        if manoeuvre.name == "dash":
            side = 1.0 if int(since / DASH) % 2 == 0 else -1.0
            place[manoeuvre.axis] += side * self._reach[manoeuvre.axis]
        elif manoeuvre.name == "leave":
            place = list(self._out)
            largest = LEAVING
        wanted = [
            w * (w * (there - here) - 2.0 * DAMPING * speed)
            for w, there, here, speed in zip(
                self._frequencies, place, x.position, x.velocity, strict=True
            )
        ]
        wanted[2] += self._lift
        sideways = hypot(wanted[0], wanted[1])
        shrink = min(1.0, largest / sideways) if sideways > 0.0 else 1.0
        # Some thrust is always left to turn with.
        upwards = max(GRAVITY + wanted[2], 0.3 * GRAVITY)
        most = LARGEST_THRUST * self._vehicle.thrust_max
        return shrink * wanted[0], shrink * wanted[1], min(upwards, most)

    def _attitude_rates(self, x: State, up: Vec3) -> list[float]:
        """Return body rates that turn the thrust towards `up` and the nose towards x [rad/s]."""
        length = hypot(*up)
        ahead = to_body(x.attitude, (up[0] / length, up[1] / length, up[2] / length))
        nose = to_body(x.attitude, (1.0, 0.0, 0.0))
        roll, pitch, yaw = self._gains
        return [-roll * ahead[1], pitch * ahead[0], min(HEADING_GAIN, yaw) * nose[1]]

    def _chirp(self, axis: int, since: float, duration: float) -> float:
        """Return the body rate of a chirp [rad/s]."""
        growth = log(LAST_FREQUENCY / FIRST_FREQUENCY) / duration
        frequency = FIRST_FREQUENCY * exp(growth * since)
        phase = 2.0 * pi * (frequency - FIRST_FREQUENCY) / growth
        amplitude = min(
            CHIRP_ANGLE * 2.0 * pi * frequency, CHIRP_SHARE * self._vehicle.omega_max[axis]
        )
        return amplitude * cos(phase)

    def _stepped_thrust(self, x: State, t: float) -> float:
        """Return the thrust of the present step, which is chosen so that the height is kept."""
        if t >= self._step_ends:
            height = x.pz + CLIMB * x.vz - self._centre[2]
            up = min(STEP_UP * self._vehicle.thrust_max, LARGEST_STEP)
            self._step = STEP_DOWN if height > 0.0 else up
            self._step_ends = t + STEPS[self._steps % len(STEPS)]
            self._steps += 1
        return self._step

    def _limited(self, rates: list[float], thrust: float) -> Control:
        """Return the command within the vehicle's limits."""
        roll, pitch, yaw = (
            min(max(rate, -most), most)
            for rate, most in zip(rates, self._vehicle.omega_max, strict=True)
        )
        return Control(roll, pitch, yaw, thrust)


def manoeuvre_at(t: float) -> tuple[Manoeuvre, float]:
    """Return the manoeuvre at a time, and the time since it began [s]."""
    for manoeuvre, end in zip(MANOEUVRES, ENDS, strict=True):
        if t < end:
            return manoeuvre, t - (end - manoeuvre.duration)
    return LEAVE, t - ENDS[-1]
