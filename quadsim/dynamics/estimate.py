"""The Estimate, which a controller is given when it is asked for its next control."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from quadsim.course import Course
from quadsim.dynamics import System


@dataclass(frozen=True, eq=False)
class Estimate:
    """An estimate of the vehicle and its surroundings: state, next target, model and course.

    A flight makes one for each control period (quadsim.sensing.navigation). In a loop of one's own
    it is enough to give the time and the state: `mppi.control(Estimate(t, x))`.
    """

    t: float  # time at which the control is asked for [s]
    # state in which the control will act, later than t where commands act late  (n_x,)
    x: np.ndarray
    target: int = 0  # gates passed by then since the start: the row of the cost's targets
    # the system to plan with as it is estimated; None: the controller's own
    model: System | None = None
    course: Course | None = None  # the course as it is estimated; None: the controller's own map
