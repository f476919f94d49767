"""Online estimation of the rotors' output for a given demand.

All numbers are in units of thrust [m/s^2]: p = (a, torques over mass and lever), to which rotor i
contributes (1, s_x, s_y, s_z) times its thrust, with signs s. If it delivers the share eta_i of the
thrust t_i of a sound rotor (quadsim.sensing.estimation.nominal_rotors), then

    p = sum_i eta_i (1, s_x, s_y, s_z) t_i + (0, b) + (0, g q),      q = sum_i (s_x, s_y, s_z) t_i

with a torque b that is always there and an error g of the rate loop's gain. A Kalman filter
estimates theta = (eta, b, g), a random walk, on the p that is measured once each control period.
g is estimated only so that it is not taken for weak rotors; the planner uses eta and b.

What is not observable: a centre of mass off the middle is the same as stronger rotors on one side.
Near the highest thrust the shares' mean is not observable, as the highest thrust itself is unknown;
there no rotor is taken to be stronger than nominal. b and eta differ only if the thrust varies.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import isnan, sqrt
from typing import NamedTuple

import numpy as np

from quadsim.dynamics.first_order import response
from quadsim.dynamics.quadrotor import Delivered, ModelParams
from quadsim.sensing.estimation.nominal_rotors import Interval, NominalRotors
from quadsim.vehicle import Vehicle

SHARES = slice(0, 4)
ALWAYS = slice(4, 7)
SIZE = 10
# theta of a sound vehicle
SOUND = np.concatenate([np.ones(4), np.zeros(6)])
# the variances of the shares, in a covariance
SHARE_DIAGONAL = (np.arange(4), np.arange(4))
SOUND_ROTORS = Delivered()
# rows of the torques in a measurement, and the columns of what acts on one torque each
AXES = np.arange(1, 4)
ALWAYS_COLUMNS = np.arange(4, 7)
GAIN_COLUMNS = np.arange(7, 10)

# the part of the Jacobian that does not change: a constant torque acts as it is
CONSTANT_ROWS = np.zeros((4, SIZE))
CONSTANT_ROWS[AXES, ALWAYS_COLUMNS] = 1.0


class Deviations(NamedTuple):
    """Standard deviations of shares [], constant torques [m/s^2] and gain errors []."""

    share: float
    always: float
    gain: float

    @property
    def covariance(self) -> np.ndarray:
        """The covariance of independent numbers  (10, 10)."""
        return np.diag(np.square([self.share] * 4 + [self.always] * 3 + [self.gain] * 3))


@dataclass
class Channel:
    """The errors of one measured number: the thrust, or a torque about x, y or z."""

    # variance of the measurement [m^2/s^4]
    nominal: float
    # mean square of the errors, as far as they were used [m^2/s^4]
    mean_square: float = 0.0
    # mean error in standard deviations
    surprise: float = 0.0

    def noise(self, error: float, variance: float, rate: float) -> float:
        """Return the variance of a measurement to which the errors of sound flight are added.

        What the filter cannot explain in sound flight, too, is noise.

        Args:
            error: error of the measurement [m/s^2].
            variance: variance without these errors [m^2/s^4]; a large one tells nothing of them.
            rate: weight of the newest error in the mean square.
        """
        usual = 4.0 * self.nominal
        if variance < usual:
            bounded = min(error * error, usual + 4.0 * self.mean_square)
            self.mean_square += rate * (bounded - self.mean_square)
        return variance + ERROR_FACTOR * self.mean_square

    def surprised(self, surprise: float) -> float:
        """Return the mean error with a new error, all in standard deviations."""
        self.surprise += SURPRISE_SHARE * (surprise - self.surprise)
        return abs(self.surprise)


class Estimated(NamedTuple):
    """An estimate and its covariance."""

    theta: np.ndarray
    P: np.ndarray


START = Deviations(share=0.03, always=0.05, gain=0.1)
# random walk, per sqrt(s)
WALK = Deviations(share=0.03, always=0.03, gain=0.02)
# What is nearer to a sound vehicle counts as sound, because unmodelled effects look like it, and
# the planner uses nothing larger: shares [], constant torques [m/s^2]
SHARE_TOLERANCE = 0.02
LARGEST_SHARE = 0.7
ALWAYS_TOLERANCE = 0.05
LARGEST_ALWAYS = 3.0

# [m/s^2] standard deviations of a measurement with exact states: thrust, torques about x, y, z
EXACT_STD = (0.3, 0.12, 0.12, 0.12)
# [m/s^2] standard deviation of the thrust by an accelerometer
FORCE_STD = 0.6
# [rad/s] lower bound of the gyroscope's assumed noise
LEAST_GYRO_NOISE = 1e-3
# [m/s^2] standard deviation of the thrust while a rotor is near its highest thrust
FULL_STD = 10.0
# weight of the newest error in the mean square of the errors, per second
ERROR_RATE = 2.0
# factor on that mean square, which adds to the variance of a measurement
ERROR_FACTOR = 3.0
# An innovation of more standard deviations counts less.
OUTLIER = 3.0
# mean surprise, in standard deviations, from which the shares of rotors are taken to have changed
SURPRISE = 1.5
# weight of the newest surprise in the mean
SURPRISE_SHARE = 0.2
# standard deviation of such a change
CHANGED_STD = 0.2
# [s] from a change until the next one; if its errors keep their sign before, it is rejected
TRIAL = 0.15
# A share that is larger cannot be.
STRONGEST = 1.3
# share of the time near the highest thrust from which no rotor is taken to be stronger than nominal
MOSTLY_FULL = 0.2
# by more than this share, and the standard deviation of that
SPARE_SHARE = 0.015
SPARE_STD = 0.02


class WrenchLearner:
    """Estimates the output of the rotors once each control period."""

    def __init__(self, vehicle: Vehicle, model: ModelParams, dt: float, gyro_noise: float | None):
        """Start with a sound vehicle.

        Args:
            vehicle: the nominal vehicle, which has rotors.
            model: the nominal model.
            dt: control period [s].
            gyro_noise: standard deviation of the gyroscope [rad/s]; None: states are exact.
        """
        # Imported here, as commands that fly nothing import this module too
        from scipy.linalg import get_lapack_funcs

        # Solves a system with a symmetric positive definite matrix
        (self._solve_positive,) = get_lapack_funcs(("posv",), dtype=float)
        self.rotors = NominalRotors(vehicle, dt)
        self._dt = dt
        self._rotor_response = response(model.motor_tau, dt)
        # In the model, a rate loop with a lead has a smaller lag, see `led_rate_loop`.
        self._led = np.array([lag / model.motor_tau for lag in model.rate_lags])
        self._theta = SOUND
        self._P = START.covariance
        self._Q = WALK.covariance * dt
        self._is_exact = gyro_noise is None
        std = np.array(EXACT_STD)
        if gyro_noise is not None:
            noise = np.sqrt(2.0) * max(gyro_noise, LEAST_GYRO_NOISE) / dt
            std = np.hypot(std, [FORCE_STD, *(noise / self.rotors.turn_per_thrust)])
        # thrust, torques about x, y, z
        self._channels = [Channel(variance) for variance in (std**2).tolist()]
        # time left of a change's trial [s], and the estimate before it; None: it was rejected
        self._trial = 0.0
        self._before: Estimated | None = None
        # `full` and `missing_yaw` of the rotors, behind their lag
        self._full = 0.0
        self._missing_yaw = 0.0
        # output of the rotors, for the planner's model
        self.delivered = Delivered()

    @property
    def shares(self) -> np.ndarray:
        """The share that each rotor delivers of its nominal thrust  (4,)."""
        return self._theta[SHARES].copy()

    def _delivered(self) -> Delivered:
        """Return the output of the rotors by the present estimate."""
        theta = self._theta.tolist()
        shares = [counted(eta - 1.0, SHARE_TOLERANCE, LARGEST_SHARE) for eta in theta[SHARES]]
        always = [counted(torque, ALWAYS_TOLERANCE, LARGEST_ALWAYS) for torque in theta[ALWAYS]]
        if not any(shares) and not any(always):
            return SOUND_ROTORS
        thrust, *turn = self.rotors.signs @ (1.0 + np.array(shares)) / 4
        scale = self.rotors.turn_per_thrust * self._led
        return Delivered(float(thrust), *(turn * scale).tolist(), *(always * scale).tolist())

    def learn(self, interval: Interval, thrust_max: float, measured: np.ndarray | None) -> None:
        """Learn from one interval.

        Args:
            interval: what was commanded, and how the vehicle turned.
            thrust_max: the highest thrust, as it is known [m/s^2].
            measured: p at the end, or with sensors its mean [m/s^2]  (4,), with NaN for a thrust
                that was not measured; None: nothing was.
        """
        followed = self.rotors.advance(interval, thrust_max)
        self._full += self._rotor_response * (followed.full - self._full)
        self._missing_yaw += self._rotor_response * (followed.missing_yaw - self._missing_yaw)
        self._P = self._P + self._Q
        if measured is None:
            return
        thrusts = followed.last if self._is_exact else followed.mean

        # The thrust tells the shares' mean only if it has settled below the highest thrust, and
        # yaw tells something only if it is not limited.
        variance = [channel.nominal for channel in self._channels]
        variance[0] += (FULL_STD * self._full) ** 2 + followed.unsettled**2
        variance[3] += self._missing_yaw**2
        rows = slice(1 if isnan(measured[0]) else 0, None)
        H = self._jacobian(thrusts)[rows]
        error = measured[rows] - H @ self._theta
        PHt = self._P @ H.T
        S = H @ PHt

        # Errors that keep their sign tell that a rotor has changed, while a single large error
        # counts less.
        R = []
        self._trial -= self._dt
        is_on_trial = self._trial > 0.0
        has_changed = False
        columns = zip(
            self._channels[rows], variance[rows], error.tolist(), S.diagonal().tolist(), strict=True
        )
        for channel, nominal, e, predicted in columns:
            r = channel.noise(e, nominal, ERROR_RATE * self._dt)
            surprise = e / sqrt(predicted + r)
            R.append(r * max(abs(surprise) / OUTLIER, 1.0))
            is_large = channel.surprised(surprise) > SURPRISE
            has_changed |= is_large and (is_on_trial or channel is not self._channels[0])
        if has_changed:
            for channel in self._channels:
                channel.surprise = 0.0
            if is_on_trial:
                self._reject_change()
                return
            self._expect_change()
            PHt = self._P @ H.T
            S = H @ PHt

        self._correct(error, PHt, S + np.diag(R))
        if self._theta[SHARES].max() > STRONGEST:
            self._reject_change()
            return
        self._limit_strongest()
        self.delivered = self._delivered()

    def forget(self) -> None:
        """Take the vehicle to be sound, as at the beginning."""
        self._theta, self._P = SOUND, START.covariance
        self._before = None
        self._trial = 0.0
        for channel in self._channels:
            channel.mean_square = channel.surprise = 0.0
        self.delivered = SOUND_ROTORS

    def _expect_change(self) -> None:
        """Let the shares change at once, on trial."""
        self._before = Estimated(self._theta, self._P.copy())
        self._P[SHARE_DIAGONAL] += CHANGED_STD**2
        self._trial = TRIAL

    def _reject_change(self) -> None:
        """Return to the estimate from before a change that cannot be, or has explained no errors.

        So it is if the commands are lost, or if something pushes the vehicle. If that estimate
        explains nothing either, the vehicle is taken to be sound again.
        """
        sound = Estimated(SOUND, START.covariance)
        self._theta, self._P = self._before or sound
        self._before = None
        self._trial = TRIAL
        self.delivered = self._delivered()

    def _jacobian(self, thrusts: np.ndarray) -> np.ndarray:
        """Return H of p = H theta.  (4, 10)

        thrusts: of the nominal rotors [m/s^2]  (4,).
        """
        H = CONSTANT_ROWS.copy()
        of_shares = self.rotors.signs * thrusts
        H[:, SHARES] = of_shares
        H[AXES, GAIN_COLUMNS] = of_shares.sum(axis=1)[1:]
        return H

    def _limit_strongest(self) -> None:
        """Lower all shares near the highest thrust if a rotor is stronger than nominal."""
        if self._full <= MOSTLY_FULL:
            return
        excess = self._theta[SHARES].max() - 1.0 - SPARE_SHARE
        if excess > 0.0:
            PHt = self._P[:, SHARES].sum(axis=1, keepdims=True) / 4
            S = PHt[SHARES].sum(axis=0, keepdims=True) / 4
            self._correct(np.array([-excess]), PHt, S + SPARE_STD**2)

    def _correct(self, error: np.ndarray, PHt: np.ndarray, S: np.ndarray) -> None:
        """Correct by innovations (n,) with covariance S (n, n), and P H^T (10, n)."""
        # S^-1 [H P, error]
        _, solved, _ = self._solve_positive(S, np.column_stack([PHt.T, error]))
        self._theta = self._theta + PHt @ solved[:, -1]
        P = self._P - PHt @ solved[:, :-1]
        self._P = 0.5 * (P + P.T)


def counted(offset: float, tolerance: float, largest: float) -> float:
    """Return zero for an offset within the tolerance, and nearly all of a large one."""
    if abs(offset) <= tolerance:
        return 0.0
    kept = 1.0 - (tolerance / offset) ** 2
    return min(max(kept * offset, -largest), largest)
