"""Online estimation of vehicle parameters: thrust, highest thrust, thrust gain, drag and gust.

A Kalman filter estimates theta = (a, a_max, k, d, w): delivered and highest thrust [m/s^2], thrust
gain [], drag [1/s] and gust in the world (3,) [m/s^2]. k and d are constant, w is an
Ornstein-Uhlenbeck process with correlation time tau:

    v' + g e_z = k R(q) e_z a - d v + w,     w' = -w / tau + noise

The filter learns in one of two ways.

**From exact states.** a is known then, and two consecutive states give the left side; the factors
of k and d are their means over the period. The highest thrust is the thrust at which the rotors
settle below their command by more than the share that is missing at every thrust, as with a weak
rotor. At that limit the learner also estimates which share of the requested angular acceleration is
delivered, and so whether the flight controller gives up thrust to roll and pitch: the share is 1 in
our plant, and 0.46 in RotorPy, which clips each rotor by itself.

**From an accelerometer, and from rotor speeds if they are measured.** Over a control period

    a <- a + (clip(a_cmd, r, a_max - r) - a) k_m + noise,     w <- exp(-dt / tau) w + noise
    specific force = k a e_z - d R^T v + R^T w + noise

with the model's rotor lag k_m and its reserve r for roll and pitch (quadsim.dynamics.quadrotor). An
accelerometer measures the specific force itself, whereas differences of an estimated velocity would
contain its noise divided by dt; the variances of k and d limit their corrections, so a noisy sensor
changes them little. Rotor speeds measure a.

Planning with an estimated disturbance is offset-free predictive control (Pannocchia and Rawlings,
AIChE Journal 49(2), 2003). Here the disturbance is a thrust gain and not a constant acceleration,
because the effect of a wrong mass rotates with the vehicle.
"""

from __future__ import annotations

from dataclasses import replace
from enum import IntEnum
from math import nan, sqrt
from typing import NamedTuple

import numpy as np

from quadsim.dynamics.first_order import remaining, response
from quadsim.dynamics.quadrotor import (
    Control,
    Delivered,
    LearnedModel,
    ModelParams,
    State,
    thrust_axis,
    tilt_reserve,
)
from quadsim.rotation import Vec3, matrix
from quadsim.sensing.config import ImuConfig
from quadsim.sensing.estimation.nominal_rotors import UNSATURATED, Interval, Turning
from quadsim.sensing.estimation.prediction import Acted
from quadsim.sensing.estimation.wrench_learner import SOUND_ROTORS, WrenchLearner
from quadsim.sensing.nominal import Nominal
from quadsim.vehicle import GRAVITY, Vehicle
from quadsim.vehicle.tolerances import VehicleTolerances

# Learning from exact states.

# [m/s^2] standard deviation of v' from two states: the trapezoidal rule's error over one period
ACCELERATION_STD = 0.05
# [m/s^2] A thrust that changes by less in a period has settled.
SETTLED = 0.15
# [m/s^2] A settled thrust that is this far below what a command delivers is saturated.
SHORTFALL = 0.5
# With weak rotors a thrust is saturated if it is short by this share of it more: the error of their
# mean share.
SHARE_ERROR = 0.03
# share of the estimated highest thrust; a command above it tests the estimate
NEAR_LIMIT = 0.97
# A delivered share of the thrust that is nearer to 1 counts as 1: unmodelled lags look like it.
SHARE_TOLERANCE = 0.01
# gain per period of the unasked torque on its error
UNASKED_STEP = 0.05
# share of the highest thrust; a larger reserve for roll and pitch gives no estimate
MAX_RESERVE = 0.05
# gain per such period of the highest thrust, or of the delivered share, on its error
STEP = 0.1
# share of the highest thrust; if the strongest rotor is below it, no rotor is saturated
LEAST_STRONGEST = 0.85
# gain per such period of the highest thrust on its error
STRONGEST_STEP = 0.05
# tolerance of a duration, as a share of a period; the delivered share needs a single period
ON_TIME = 0.1
# share of the highest thrust; a smaller reserve hardly depends on the delivered share
LEAST_RESERVE = 0.03
# delivered share of the requested angular acceleration at the highest thrust; below it the planner
# gives up thrust
LEAST_DELIVERED = 0.7

# Learning from sensors.

# [m/s^2] initial standard deviation of the delivered thrust
START_STD = 0.5
# [1/s] smallest drag to which the relative tolerance of the drag is applied
LEAST_DRAG = 0.1
# [m/s^2] standard deviation of a specific force: averaging over a period, unmodelled aerodynamics
FORCE_STD = 0.3
# [m/s^2] smallest process noise of the delivered thrust per period
THRUST_STD = 0.05
# relative standard deviation of the reserve
RESERVE_STD = 0.3
# [m/s^2/sqrt(s)] random walk of the highest thrust, as a battery empties
THRUST_MAX_WALK = 1e-2
# innovation gate: limit of the normalised innovation squared, 3 degrees of freedom
OUTLIER = 25.0


class Row(IntEnum):
    """Rows of the filter's state."""

    THRUST = 0
    THRUST_MAX = 1
    THRUST_GAIN = 2
    DRAG = 3
    GUST_X = 4
    GUST_Y = 5
    GUST_Z = 6


GUST = slice(Row.GUST_X, Row.GUST_Z + 1)
# the parameters that an acceleration measures if the thrust is known
OF_ACCELERATION = slice(Row.THRUST_GAIN, Row.GUST_Z + 1)
# the gust's variances in the covariance of these
GUST_DIAGONAL = (np.arange(2, 5), np.arange(2, 5))
# their Jacobian without thrust gain and drag: a gust acts as it is  (3, 5)
GUST_ACTS = np.hstack([np.zeros((3, 2)), np.eye(3)])
ACCELERATION_NOISE = ACCELERATION_STD**2 * np.eye(3)


class VehicleNumbers(NamedTuple):
    """The estimated parameters, or their standard deviations."""

    # thrust delivered now [m/s^2]
    thrust: float
    # highest thrust [m/s^2]
    thrust_max: float
    # thrust gain: acceleration per delivered thrust []
    thrust_gain: float
    # [1/s]
    drag: float
    # acceleration by the wind, in the world [m/s^2]
    gust: Vec3

    @classmethod
    def of(cls, rows: np.ndarray) -> VehicleNumbers:
        """Return the rows (7,) of the filter's state by name."""
        thrust, thrust_max, thrust_gain, drag, *gust = rows.tolist()
        return cls(thrust, thrust_max, thrust_gain, drag, tuple(gust))


class VehicleLearner:
    """Estimates the parameters of a quadrotor in flight, once each control period.

    Make one with `for_exact_states` or with `for_sensors`, and call the matching `learn` methods.
    """

    def __init__(
        self,
        model: ModelParams,
        dt: float,
        tolerances: VehicleTolerances,
        covariance: np.ndarray,
        force_variance: float,
        delivered: float | None,
        wrench: WrenchLearner | None,
    ):
        """Start at the nominal parameters.

        Args:
            model: the nominal model.
            dt: control period [s].
            tolerances: prior of the differences between vehicle and model.
            covariance: initial covariance of the parameters  (7, 7).
            force_variance: variance of a specific force per axis [m^2/s^4].
            delivered: delivered share of the requested angular acceleration at the highest thrust;
                None: the share is not estimated.
            wrench: estimator of what the rotors deliver; None: they are taken to be sound.
        """
        self._nominal = model
        self._dt = dt
        self._tolerances = tolerances
        self._theta = np.array(
            [GRAVITY, model.thrust_max, model.thrust_gain, model.drag, 0.0, 0.0, 0.0]
        )
        self._P = covariance
        self._R = force_variance * np.eye(3)
        self._delivered = delivered
        self.wrench = wrench
        # share of the asked thrust that is delivered below the highest thrust
        self._thrust_share = 1.0
        # angular acceleration about x and y that nobody asks for, per thrust [1/m]  (2,)
        self._unasked = np.zeros(2)
        self._rotor_response = response(model.motor_tau, dt)
        self._rate_responses = np.array([response(lag, dt) for lag in model.rate_lags[:2]])
        # about x and y [1/s]
        self._rate_gains = np.array([response(tau, dt) / dt for tau in model.rate_tau[:2]])

    @classmethod
    def for_exact_states(
        cls,
        model: ModelParams,
        dt: float,
        tolerances: VehicleTolerances = VehicleTolerances(),  # noqa: B008 (frozen)
        vehicle: Vehicle | None = None,
    ) -> VehicleLearner:
        """Return a learner for `learn_from_states`.

        A drag that is nominally zero is not estimated.

        Args:
            model: the nominal model.
            dt: control period [s].
            tolerances: prior of the differences between vehicle and model.
            vehicle: the nominal vehicle, if it is to be estimated what its rotors deliver.
        """
        t = tolerances
        std = np.zeros(len(Row))
        std[Row.THRUST_MAX] = uniform_std(t.thrust * model.thrust_max)
        std[Row.THRUST_GAIN] = uniform_std(t.mass)
        std[Row.DRAG] = uniform_std(t.drag * model.drag)
        std[GUST] = t.gust
        # A mixer that gives up thrust for yaw gives it up for roll and pitch, too. The mixer of a
        # vehicle whose rotors are learned is known.
        delivered = None if model.yaw_first or vehicle else 1.0
        wrench = WrenchLearner(vehicle, model, dt, None) if vehicle else None
        return cls(model, dt, tolerances, np.diag(std**2), 0.0, delivered, wrench)

    @classmethod
    def for_sensors(
        cls,
        model: ModelParams,
        dt: float,
        imu: ImuConfig,
        tolerances: VehicleTolerances = VehicleTolerances(),  # noqa: B008 (frozen)
        vehicle: Vehicle | None = None,
    ) -> VehicleLearner:
        """Return a learner for a vehicle whose state is estimated from sensors.

        Update it with `learn_from_force` and `learn_from_rotors`.

        Args:
            model: the nominal model.
            dt: control period [s].
            imu: the accelerometer and the gyroscope, whose noise limits the accuracy.
            tolerances: prior of the differences between vehicle and model.
            vehicle: the nominal vehicle, if the thrust that its rotors deliver is to be estimated.
        """
        t = tolerances
        # not squares of `uniform_std`, so that flights are repeated to the last bit
        variance = np.zeros(len(Row))
        variance[Row.THRUST] = START_STD**2
        variance[Row.THRUST_MAX] = uniform_variance(t.thrust * model.thrust_max)
        variance[Row.THRUST_GAIN] = uniform_variance(t.mass)
        variance[Row.DRAG] = uniform_variance(t.drag * max(model.drag, LEAST_DRAG))
        variance[GUST] = t.gust**2
        force_variance = imu.accelerometer_noise**2 + FORCE_STD**2
        wrench = WrenchLearner(vehicle, model, dt, imu.gyro_noise) if vehicle else None
        covariance = np.diag(variance)
        return cls(model, dt, tolerances, covariance, force_variance, delivered=None, wrench=wrench)

    @property
    def model(self) -> ModelParams:
        """The nominal model with the present estimates of its parameters."""
        now = self.numbers
        tilt_first = self._nominal.tilt_first
        if self._delivered is not None:
            tilt_first = self._delivered > LEAST_DELIVERED
        model = replace(
            self._nominal,
            thrust_gain=now.thrust_gain,
            drag=now.drag,
            thrust_max=now.thrust_max,
            tilt_first=tilt_first,
        )
        return LearnedModel.of_model(model, self.wrench.delivered) if self.wrench else model

    @property
    def numbers(self) -> VehicleNumbers:
        """The present estimates."""
        return VehicleNumbers.of(self._theta)

    @property
    def delivered(self) -> Delivered:
        """The output of the rotors; that of sound rotors if it is not estimated."""
        return self.wrench.delivered if self.wrench else SOUND_ROTORS

    @property
    def std(self) -> VehicleNumbers:
        """The standard deviations of the estimates.

        With exact states, the standard deviation of the highest thrust stays at its prior.
        """
        return VehicleNumbers.of(np.sqrt(np.diag(self._P)))

    def forget_rotors(self) -> None:
        """Take the rotors to be sound again, as if nothing had been learned of them."""
        if self.wrench:
            self.wrench.forget()

    def learn_from_states(self, before: State, after: State, acted: Acted, duration: float) -> None:
        """Learn from two consecutive exact states.

        Args:
            before, after: states at the beginning and at the end of the period.
            acted: the commands that acted between them.
            duration: time between them [s].
        """
        self._theta[Row.THRUST] = after.thrust
        self._correct_by_acceleration(before, after, duration)
        if self.wrench:
            thrust_max = float(self._theta[Row.THRUST_MAX])
            first, last = (Turning(x.body_rates, x.angular_acceleration) for x in (before, after))
            measured = self.wrench.rotors.wrench_of(after.thrust, last)
            self.wrench.learn(Interval(first, last, acted, duration), thrust_max, measured)
        if self._nominal.yaw_first:
            self._update_by_strongest_rotor(before, after, acted)
            return
        self._update_thrust_max(before, after, acted)
        if self._delivered is not None and abs(duration - self._dt) < ON_TIME * self._dt:
            self._update_delivered(before, after, acted)

    def learn_from_force(
        self, a_cmd: float, reserve: float, force: Vec3 | None, nominal: Nominal
    ) -> None:
        """Learn from one control period of an accelerometer.

        Args:
            a_cmd: commanded thrust [m/s^2].
            reserve: thrust reserved for roll and pitch in the period [m/s^2].
            force: mean specific force measured in the period, body frame [m/s^2]  (3,); None: there
                was no sample.
            nominal: estimate of attitude and velocity at the period's end.
        """
        self._predict(a_cmd, reserve)
        if force is not None:
            self._correct_by_force(np.array(force), nominal)

    def learn_from_gyro(
        self,
        ends: tuple[Turning, Turning],
        u: Control,
        acceleration: Vec3 | None,
        force: Vec3 | None,
        nominal: Nominal,
    ) -> None:
        """Learn the output of the rotors from one control period of a gyroscope.

        Args:
            ends: how the vehicle turned at both ends of the period.
            u: the command.
            acceleration: mean angular acceleration measured in the period [rad/s^2]  (3,); None: it
                was not measured.
            force: mean specific force measured in the period, body frame [m/s^2]  (3,); None: there
                was no sample.
            nominal: estimate of attitude and velocity at the period's end.
        """
        if self.wrench is None:
            return
        measured = None
        if acceleration is not None:
            thrust = nan
            if force is not None:
                expected, _ = self._expected_force(nominal)
                thrust = self.numbers.thrust + (force[2] - expected[2]) / self.numbers.thrust_gain
            first, last = ends
            wx, wy, wz = np.add(first.rates, last.rates) / 2
            measured = self.wrench.rotors.wrench_of(thrust, Turning((wx, wy, wz), acceleration))
        interval = Interval(*ends, Acted((u,), (1.0,)), self._dt)
        self.wrench.learn(interval, float(self._theta[Row.THRUST_MAX]), measured)

    def learn_from_rotors(self, thrust: float, std: float) -> None:
        """Learn from rotor speeds.

        Args:
            thrust: thrust at the measured speeds [m/s^2].
            std: standard deviation of that thrust [m/s^2].
        """
        gain = self._P[:, Row.THRUST] / (self._P[Row.THRUST, Row.THRUST] + std * std)
        self._theta = self._theta + gain * (thrust - self._theta[Row.THRUST])
        self._P = self._P - np.outer(gain, self._P[Row.THRUST])

    def _gust_process(self, duration: float) -> tuple[float, float]:
        """Return the share of a gust that remains after a duration [s], and the added variance.

        The variance is in m^2/s^4.
        """
        keep = remaining(self._tolerances.gust_tau, duration)
        return keep, self._tolerances.gust**2 * (1.0 - keep**2)

    def _correct_by_acceleration(self, before: State, after: State, duration: float) -> None:
        """Predict over a duration [s], then correct by its mean acceleration y = H theta + e."""
        keep, fresh = self._gust_process(duration)
        F = np.array([1.0, 1.0, keep, keep, keep])
        theta = F * self._theta[OF_ACCELERATION]
        P = F[:, None] * self._P[OF_ACCELERATION, OF_ACCELERATION] * F
        P[GUST_DIAGONAL] += fresh

        change = [new - old for old, new in zip(before.velocity, after.velocity, strict=True)]
        x, y, z = (each / duration for each in change)
        measured = np.array([x, y, z + GRAVITY])
        H = GUST_ACTS.copy()
        H[:, 0] = (thrust_vector(before) + thrust_vector(after)) / 2
        mean = [(old + new) / 2 for old, new in zip(before.velocity, after.velocity, strict=True)]
        H[:, 1] = [-velocity for velocity in mean]
        HP = H @ P
        K = np.linalg.solve(HP @ H.T + ACCELERATION_NOISE, HP).T
        self._theta[OF_ACCELERATION] = theta + K @ (measured - H @ theta)
        self._P[OF_ACCELERATION, OF_ACCELERATION] = P - K @ H @ P

    def _update_thrust_max(self, before: State, after: State, acted: Acted) -> None:
        """Learn the highest thrust from a thrust that has settled.

        The highest thrust and the commands are what the rotors are asked for. They deliver a share
        of it, so a thrust that is short by this share alone is not at its limit.
        """
        change = after.thrust - before.thrust
        if abs(change) >= SETTLED:
            return
        delivered = before.thrust + change / self._rotor_response
        asked = self._asked_thrust(delivered, acted)

        thrust_max = float(self._theta[Row.THRUST_MAX])
        reserve = self._mean_reserve(before, after, acted)
        # The shares of weak rotors are known less accurately than the thrust.
        shortfall = SHORTFALL
        if self._has_weak_rotors:
            shortfall += SHARE_ERROR * asked
        is_short = acted.least_thrust > asked + shortfall
        if is_short and reserve < MAX_RESERVE * thrust_max:
            # Thrust and reserve for roll and pitch then add up to the highest thrust.
            self._move_limit(asked + reserve, STEP)
        elif not is_short:
            self._raise_limit(acted, reserve)

    def _move_limit(self, seen: float, gain: float) -> None:
        """Move the highest thrust towards one that was seen [m/s^2], but not below its floor."""
        thrust_max = float(self._theta[Row.THRUST_MAX])
        thrust_max += gain * (seen - thrust_max)
        self._theta[Row.THRUST_MAX] = max(thrust_max, UNSATURATED * self._nominal.thrust_max)

    def _raise_limit(self, acted: Acted, reserve: float) -> None:
        """Raise a highest thrust that was delivered, if no vehicle within the tolerances has it.

        With weak rotors it is raised up to the nominal one: before their shares were known, the
        missing thrust was taken for a limit.

        Args:
            acted: the commands that acted.
            reserve: thrust reserved for roll and pitch [m/s^2].
        """
        thrust_max = float(self._theta[Row.THRUST_MAX])
        is_tested = acted.least_thrust > NEAR_LIMIT * (thrust_max - reserve)
        highest = self._nominal.thrust_max
        if not self._has_weak_rotors:
            highest *= 1.0 - self._tolerances.thrust
        if is_tested and thrust_max < highest:
            self._theta[Row.THRUST_MAX] = thrust_max + SETTLED

    @property
    def _has_weak_rotors(self) -> bool:
        """Whether rotors are known to deliver less than they are asked for, at every level."""
        return self.delivered.thrust_share < 1.0

    def _asked_thrust(self, delivered: float, acted: Acted) -> float:
        """Return the thrust that the vehicle asks of its rotors when this thrust has settled.

        The share that they deliver is known, or learned from commands below the highest thrust.
        """
        if self.wrench:
            return delivered / self.delivered.thrust_share
        if GRAVITY < acted.least_thrust <= UNSATURATED * self._nominal.thrust_max:
            self._thrust_share += STEP * (delivered / acted.mean_thrust - self._thrust_share)
        is_sound = abs(self._thrust_share - 1.0) <= SHARE_TOLERANCE
        return delivered if is_sound else delivered / self._thrust_share

    def _update_by_strongest_rotor(self, before: State, after: State, acted: Acted) -> None:
        """Learn the highest thrust from the strongest rotor, if the mixer gives up thrust."""
        change = after.thrust - before.thrust
        settled = before.thrust + change / self._rotor_response
        if acted.least_thrust <= settled + SHORTFALL:
            if abs(change) < SETTLED:
                self._raise_limit(acted, self._mean_reserve(before, after, acted))
            return
        first, last = np.array([before.angular_acceleration, after.angular_acceleration])
        bx, by, bz = abs(first + (last - first) / self._rotor_response).tolist()
        strongest = settled + tilt_reserve(*self._nominal.tilt_cost, bx, by)
        strongest += self._nominal.yaw_cost * bz
        thrust_max = self._theta[Row.THRUST_MAX]
        # A thrust that still grows has not been given up.
        if strongest > LEAST_STRONGEST * thrust_max:
            self._move_limit(strongest, STRONGEST_STEP)

    def _update_delivered(self, before: State, after: State, acted: Acted) -> None:
        """Learn the delivered share if thrust and reserve request more than the highest thrust.

        The share is the ratio of the angular acceleration to its command.
        """
        assert self._delivered is not None
        reserve = self._mean_reserve(before, after, acted)
        thrust_max = self._theta[Row.THRUST_MAX]
        is_limited = acted.least_thrust > thrust_max - reserve / 2

        rates = np.add(before.body_rates, after.body_rates)[:2] / 2
        asked = self._rate_gains * (acted.mean_tilt_rates - rates)
        first, last = np.array([before.angular_acceleration[:2], after.angular_acceleration[:2]])
        settled = first + (last - first) / self._rate_responses
        thrust = (before.thrust + after.thrust) / 2
        unasked = self._unasked_turn(settled - asked, thrust, is_limited)
        if reserve > LEAST_RESERVE * thrust_max and is_limited:
            share = float((settled - unasked) @ asked / (asked @ asked))
            self._delivered += STEP * (share - self._delivered)

    def _unasked_turn(self, rest: np.ndarray, thrust: float, is_limited: bool) -> np.ndarray:
        """Return the angular acceleration about x and y that nobody asks for [rad/s^2]  (2,).

        Args:
            rest: angular acceleration beyond what was asked for [rad/s^2]  (2,).
            thrust: delivered thrust [m/s^2].
            is_limited: whether the thrust is at its limit, where a part of the torque that is asked
                for may be missing, which is not a torque that nobody asks for.
        """
        # Unequal rotors and a centre of mass off the middle make it grow with the thrust. What is
        # asked for changes its sign often, this does not.
        if thrust > GRAVITY and not is_limited:
            self._unasked += UNASKED_STEP * (rest / thrust - self._unasked)
        return self._unasked * thrust

    def _mean_reserve(self, before: State, after: State, acted: Acted) -> float:
        """Return the reserve for roll and pitch, averaged over the period [m/s^2].

        The reserve under one command is that of the mean error of both ends.
        """
        reserve = 0.0
        gain_x, gain_y = self._rate_gains
        for u, share in zip(acted.commands, acted.shares, strict=True):
            bx = gain_x * (abs(u.wx - before.wx) + abs(u.wx - after.wx)) / 2
            by = gain_y * (abs(u.wy - before.wy) + abs(u.wy - after.wy)) / 2
            reserve += share * tilt_reserve(*self._nominal.tilt_cost, bx, by)
        return reserve

    def _predict(self, a_cmd: float, reserve: float) -> None:
        """Move the delivered thrust towards its command, and the gust towards zero.

        Args:
            a_cmd: commanded thrust [m/s^2].
            reserve: thrust reserved for roll and pitch [m/s^2].
        """
        # The thrust follows its command, clipped as in the model; if clipped from above, it follows
        # the highest thrust, and the Jacobian depends on that.
        lag = self._rotor_response
        theta = self._theta
        most = theta[Row.THRUST_MAX] - reserve
        limited = a_cmd > most
        share = self.delivered.thrust_share
        step = share * (most if limited else max(a_cmd, reserve)) - theta[Row.THRUST]

        keep, fresh = self._gust_process(self._dt)
        F = np.eye(len(Row))
        F[Row.THRUST, Row.THRUST] = 1.0 - lag
        F[Row.THRUST, Row.THRUST_MAX] = share * lag if limited else 0.0
        F[GUST, GUST] *= keep
        moved = F @ theta
        moved[Row.THRUST] = theta[Row.THRUST] + lag * step

        # The uncertainty of lag and reserve adds to the variance of the thrust.
        unsure = self._tolerances.lag * lag * step / sqrt(3) + RESERVE_STD * reserve * lag
        Q = np.zeros(len(Row))
        Q[Row.THRUST] = unsure**2 + THRUST_STD**2
        Q[Row.THRUST_MAX] = THRUST_MAX_WALK**2 * self._dt
        Q[GUST] = fresh
        self._theta = moved
        self._P = F @ self._P @ F.T + np.diag(Q)

    def _expected_force(self, nominal: Nominal) -> tuple[np.ndarray, np.ndarray]:
        """Return the expected force k a e_z - d v + w in the body frame, and its Jacobian.

        Returns:
            Force [m/s^2]  (3,), Jacobian  (3, 7).
        """
        a = self._theta[Row.THRUST]
        k = self._theta[Row.THRUST_GAIN]
        d = self._theta[Row.DRAG]
        to_body = matrix(nominal.attitude).T
        v = to_body @ nominal.velocity
        w = to_body @ self._theta[GUST]
        H = np.zeros((3, len(Row)))
        H[2, Row.THRUST] = k
        H[2, Row.THRUST_GAIN] = a
        H[:, Row.DRAG] = -v
        H[:, GUST] = to_body
        expected = w - d * v
        expected[2] += k * a
        return expected, H

    def _correct_by_force(self, force: np.ndarray, nominal: Nominal) -> None:
        """Correct by a mean specific force [m/s^2] (3,), unless it is an outlier."""
        expected, H = self._expected_force(nominal)
        innovation = force - expected

        PHt = self._P @ H.T
        S = H @ PHt + self._R
        # S^-1 [H P, innovation]
        solved = np.linalg.solve(S, np.column_stack([PHt.T, innovation]))
        if innovation @ solved[:, -1] < OUTLIER:
            self._theta = self._theta + PHt @ solved[:, -1]
            P = self._P - PHt @ solved[:, :-1]
            self._P = 0.5 * (P + P.T)


def uniform_std(half_width: float) -> float:
    """Return the standard deviation of a uniform distribution of this half width."""
    return half_width / np.sqrt(3)


def uniform_variance(half_width: float) -> float:
    """Return the variance of a uniform distribution of this half width."""
    return half_width * half_width / 3


def thrust_vector(x: State) -> np.ndarray:
    """Return R(q) e_z a, the delivered thrust in the world [m/s^2].  (3,)"""
    return x.thrust * np.array(thrust_axis(*x.attitude))
