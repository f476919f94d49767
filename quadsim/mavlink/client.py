"""The client as a controller: its last setpoint is the law by which the vehicle flies."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from quadsim.controllers.plan import PlanStats
from quadsim.dynamics.estimate import Estimate
from quadsim.dynamics.quadrotor import Control, State
from quadsim.mavlink.served import Served
from quadsim.sensing import Sensing
from quadsim.vehicle import GRAVITY


class MavlinkClient:
    """The client at the other end of the link, as a Controller of the flight.

    Attributes:
        round, lock_step, baro_wash: as served.
        sensing: the sensors whose measurements the client was sent; None: the truth.
        law: the control that the last setpoint asks for at a state; None: none has come, and the
            vehicle hovers.
    """

    # hover, which acts until the first setpoint
    rest = np.array([0.0, 0.0, 0.0, GRAVITY])

    def __init__(self, served: Served, sensing: Sensing | None):
        """Keep what the record of a flight says of the client."""
        self.round = served.round
        self.lock_step = served.lock_step
        self.baro_wash = served.baro_wash
        self.sensing = sensing
        self.law: Callable[[State], Control] | None = None

    def control(self, estimate: Estimate, /) -> tuple[np.ndarray, PlanStats]:
        """Return the control that the last setpoint asks for at the true state."""
        u = self.rest if self.law is None else np.array(self.law(State(*estimate.x.tolist())))
        return u, PlanStats(cost=0.0, ess=0.0, temperature=0.0)
