"""A controller for manual flight with the sticks of a remote control.

The sticks command body rates by Betaflight's "actual rates" (applyActualRates in fc/rc.c), and a
thrust that grows with the square of the throttle, as the thrust of a rotor grows with the square of
its speed. With the firmware both are converted back to stick positions, see
quadsim.firmware.actuators.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import radians, sqrt
from time import perf_counter
from typing import Any, NamedTuple

import numpy as np

from quadsim.controllers.plan import PlanStats
from quadsim.dynamics.estimate import Estimate
from quadsim.dynamics.quadrotor import Control
from quadsim.vehicle import GRAVITY, Vehicle

HAND = "hand"  # takes the place of the sampler in a record
# Time without stick input after which the failsafe acts [s]
SILENCE = 0.3
# Thrust of the failsafe, with which the vehicle sinks [m/s^2]
SINKING = 0.9 * GRAVITY


class Sticks(NamedTuple):
    """The positions of the sticks."""

    roll: float = 0.0  # -1..1, to the right
    pitch: float = 0.0  # -1..1, forward: the nose goes down
    yaw: float = 0.0  # -1..1, to the right
    throttle: float = 0.0  # 0..1


class Rates(NamedTuple):
    """The map from a stick to the body rate about one axis; the defaults are Betaflight's."""

    center: float = radians(70.0)  # per deflection, around the middle [rad/s]
    most: float = radians(670.0)  # at the end of the stick [rad/s]
    expo: float = 0.0  # 0..1, moves the rate beyond `center` towards the end

    def rate(self, stick: float) -> float:
        """Return the body rate [rad/s] for a stick deflection from -1 to 1."""
        beyond = abs(stick) * (stick**5 * self.expo + stick * (1.0 - self.expo))
        return stick * self.center + (self.most - self.center) * beyond


@dataclass(frozen=True)
class HandRates:
    """The maps from the sticks to body rates and thrust."""

    roll: Rates
    pitch: Rates
    yaw: Rates
    thrust: float  # at full throttle [m/s^2]

    @classmethod
    def of(cls, vehicle: Vehicle) -> HandRates:
        """Return Betaflight's default rates, limited to the vehicle's body rates."""
        roll, pitch, yaw = (
            Rates(center=min(Rates().center, most), most=min(Rates().most, most))
            for most in vehicle.omega_max
        )
        return cls(roll, pitch, yaw, vehicle.thrust_max)

    @property
    def hover(self) -> float:
        """The throttle at which the thrust equals the weight."""
        return sqrt(min(GRAVITY / self.thrust, 1.0))

    def control(self, sticks: Sticks) -> Control:
        """Return the body rates and the thrust that the sticks command.

        Pitch forward turns the nose down, a positive rotation about y. Roll to the right is
        positive about x, yaw to the right negative about z.
        """
        return Control(
            wx=self.roll.rate(sticks.roll),
            wy=self.pitch.rate(sticks.pitch),
            wz=-self.yaw.rate(sticks.yaw),
            thrust=self.thrust * sticks.throttle**2,
        )


class Received(NamedTuple):
    """Stick positions, and the time of their arrival."""

    sticks: Sticks
    at: float  # by the clock of the Hand [s]


class Hand:
    """A Controller that returns the command of the sticks at the moment of the call.

    Any thread may move the sticks during a flight. If there is no stick input for SILENCE seconds,
    the failsafe acts: no rotation, and a thrust below the weight.

    Args:
        rates: maps from the sticks to body rates and thrust.
        clock: function that returns the time on the wall clock [s].

    Examples:
        >>> import quadsim
        >>> from quadsim.racing.hand import Hand, HandRates, Sticks
        >>> hand = Hand(HandRates.of(quadsim.load_vehicle("swift")))
        >>> hand.move(Sticks(roll=1.0, throttle=0.5))
        >>> [round(float(rate), 2) for rate in hand.command()]
        [10.0, 0.0, 0.0, 10.06]
    """

    # hover, which acts until the first control
    rest = np.array([0.0, 0.0, 0.0, GRAVITY])

    def __init__(self, rates: HandRates, clock: Callable[[], float] = perf_counter):
        self.rates = rates
        self._clock = clock
        self._received: Received | None = None
        self._has_begun = False

    def move(self, sticks: Sticks) -> None:
        """Set the sticks' new positions."""
        self._received = Received(sticks, self._clock())

    def begin(self) -> None:
        """Fly by the sticks from now on; until this call the vehicle hovers."""
        self._has_begun = True

    @property
    def sticks(self) -> Sticks | None:
        """The present stick positions; None if there was no input for SILENCE seconds."""
        received = self._received
        if received is None or self._clock() - received.at > SILENCE:
            return None
        return received.sticks

    def command(self) -> Control:
        """Return the present command of the sticks or of the failsafe."""
        sticks = self.sticks
        return self.rates.control(sticks) if sticks else Control(0.0, 0.0, 0.0, SINKING)

    def control(self, estimate: Estimate, /) -> tuple[np.ndarray, PlanStats]:
        """Return the command of this moment; the estimate is not used."""
        u = np.array(self.command()) if self._has_begun else self.rest
        return u, PlanStats(cost=0.0, ess=0.0, temperature=0.0)

    def record(self) -> dict[str, Any]:
        """Return the stick maps as JSON for the record of a run [rad/s, m/s^2]."""
        return {
            name: value._asdict() if isinstance(value, Rates) else value
            for name, value in vars(self.rates).items()
        }
