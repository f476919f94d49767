"""Estimate in flight a delay of the commands that the planner was not told of.

The delay is one of 0, 1, 2, ... control periods. Under each of them another command acts, of which
the rate loop makes another angular acceleration. With body rates that are a control period apart,

    beta_k+1 = (omega_k+1 - omega_k) / dt
    e_d = beta_k+1 - beta_k - k_beta (k_omega (omega_cmd(t - d) - omega_k) - beta_k)

with the model's gains k (quadsim.dynamics.quadrotor). The delay with the least mean square of e
about roll and pitch is the estimate, if it explains the turning much better than the delay in use
for some time. A constant torque adds to e under each delay, so it changes no comparison much. A lag
of the rate loop that is longer than the model's looks like a short delay, which does not count.
"""

from __future__ import annotations

from collections import deque

import numpy as np

from quadsim.dynamics.first_order import response
from quadsim.dynamics.quadrotor import ModelParams
from quadsim.rotation import Vec3

# [s] longest delay, and the longest one that is compared: if a delay between them is the best one,
# the commands are lost rather than late
LONGEST = 0.1
LONGEST_COMPARED = 0.2
# [s] and control periods; a shorter delay counts as none. One of a single period cannot be told
# from the age of a gyroscope's samples.
LEAST = 0.025
LEAST_PERIODS = 2
# weight of the newest error in the mean squares, per second
RATE = 4.0
# A delay that is taken up has an error of at most this share of that in use.
BETTER = 0.6
# [rad^2/s^4] mean square of the errors below which there is nothing to explain
NOTHING = 4.0
# [s] for which a delay, or one a period longer or shorter, has to be the best one
HOLD = 0.15


class DelayLearner:
    """Estimates the delay of the commands, once each control period."""

    def __init__(self, model: ModelParams, dt: float):
        """Begin without a delay.

        Args:
            model: the nominal model.
            dt: control period [s].
        """
        self._dt = dt
        # about roll and pitch  (2,)
        self._responses = np.array([response(lag, dt) for lag in model.rate_lags[:2]])
        # [1/s]  (2,)
        self._gains = np.array([response(tau, dt) / dt for tau in model.rate_tau[:2]])
        periods = round(LONGEST_COMPARED / dt)
        self._least = max(LEAST, LEAST_PERIODS * dt)
        # roll and pitch rates that were commanded, the newest first [rad/s]  (periods + 1, 2)
        self._commanded = deque([np.zeros(2)] * (periods + 1), periods + 1)
        # mean square of the errors under each delay [rad^2/s^4]  (periods + 1,)
        self._errors = np.zeros(periods + 1)
        # another delay, in control periods, and for how long it has been the best one [s]
        self._candidate = 0
        self._better = 0.0
        # the last roll and pitch rates [rad/s], and angular acceleration [rad/s^2]  (2,)
        self._rates: np.ndarray | None = None
        self._acceleration: np.ndarray | None = None
        # the delay in use, in control periods
        self._periods = 0

    @property
    def delay(self) -> float:
        """The delay beside what the planner was told [s]."""
        return self._periods * self._dt

    def interrupt(self) -> None:
        """Note that the next rates are not one control period after the last ones."""
        self._rates = self._acceleration = None

    def learn(self, rates: Vec3, commanded: Vec3) -> bool:
        """Learn from one control period.

        Args:
            rates: body rates at its end [rad/s].
            commanded: body rates that would have been commanded in it without a delay [rad/s].

        Returns:
            Whether the delay has changed.
        """
        self._commanded.appendleft(np.array(commanded[:2]))
        before = self._rates
        self._rates = np.array(rates[:2])
        if before is None:
            return False
        last = self._acceleration
        self._acceleration = (self._rates - before) / self._dt
        if last is None:
            return False

        # The error of the angular acceleration under each delay, and its mean square
        asked = self._gains * (np.array(self._commanded) - before)
        error = self._acceleration - last - self._responses * (asked - last)
        self._errors += RATE * self._dt * ((error * error).sum(axis=1) - self._errors)
        return self._choose()

    def _choose(self) -> bool:
        """Change to the best delay if it has been much better for some time."""
        # The delay with the least error; one beyond the longest delay means lost commands
        best = int(self._errors.argmin())
        is_lost = best > round(LONGEST / self._dt)
        if best * self._dt < self._least:
            best = 0

        # Is it much better than the delay in use, and about the same as a period before?
        used = self._errors[self._periods]
        is_better = used > NOTHING and self._errors[best] < BETTER * used
        # While commands are lost, the last one becomes older and older, and so does the best delay.
        is_steady = abs(best - self._candidate) <= 1 and not is_lost
        if not (is_better and is_steady):
            self._candidate = best
            self._better = 0.0
            return False

        # Take it up after some time
        self._better += self._dt
        if self._better < HOLD:
            return False
        self._periods = best
        self._better = 0.0
        return True
