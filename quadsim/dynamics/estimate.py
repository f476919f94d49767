"""The Estimate, which a controller is given when it is asked for its next control."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from quadsim.course import Course
from quadsim.dynamics import System
from quadsim.dynamics.expected_path import OtherVehicle


@dataclass(frozen=True, eq=False)
class Estimate:
    """An estimate of the vehicle and its surroundings.

    It holds the state, the next target, the model, the course and the other vehicles. It shares no
    array that is written to later, so a stored estimate gives a planner the same control again.

    A flight makes one for each control period (quadsim.sensing.navigation). In a loop of one's own
    it is enough to give the time and the state: `mppi.control(Estimate(t, x))`.

    Examples:
        >>> import numpy as np
        >>> from quadsim import Estimate
        >>> estimate = Estimate(t=0.05, x=np.zeros(4))
        >>> estimate.target
        0
    """

    # time at which the control is asked for [s]
    t: float
    # state in which the control will act, later than t if commands act late; with `predict=False`
    # in a flight the state as measured  (n_x,)
    x: np.ndarray
    # gates passed by then since the start: the row of the cost's targets
    target: int = 0
    # the system to plan with as it is estimated; None: the controller's own
    model: System | None = None
    # the course as it is estimated; None: the controller's own map
    course: Course | None = None
    # time at which the control will act [s]; None: at t
    acts: float | None = None
    # the other vehicles of a race; a planner keeps clear of the paths expected of them
    others: tuple[OtherVehicle, ...] = ()
    # when the flight started, in the time of these paths [s]
    start_time: float = 0.0
    # the present state as it is measured or estimated, before any prediction; None: x  (n_x,)
    measured: np.ndarray | None = None
    # whether x is the state at `acts`; False: x is the state as measured
    predicted: bool = True

    @property
    def begins(self) -> float:
        """The time of the state x, from which a plan begins, in the time of the others' paths [s].

        It is when the control will act, unless x is the state as measured.
        """
        acts = self.t if self.acts is None or not self.predicted else self.acts
        return self.start_time + acts
