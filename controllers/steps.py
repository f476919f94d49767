"""The steps of a planner's rollouts, which may last several control periods.

The plan keeps a control for each control period, so that it is shifted exactly from one period to
the next. A rollout takes the mean of the plan over each step, and what a step learns is added to
all of its periods.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np


class Steps:
    """The steps of rollouts.

    Args:
        lengths: of the steps, in control periods.

    Examples:
        >>> import numpy as np
        >>> from quadsim.controllers.steps import Steps
        >>> steps = Steps((1, 1, 2))
        >>> steps.mean(np.array([[1.0], [2.0], [3.0], [5.0]])).ravel().tolist()
        [1.0, 2.0, 4.0]
        >>> steps.in_periods(np.array([[1.0], [2.0], [4.0]])).ravel().tolist()
        [1.0, 2.0, 4.0, 4.0]
    """

    def __init__(self, lengths: Sequence[int]):
        self.lengths = np.array(lengths)
        self.number = len(lengths)
        self.periods = sum(lengths)
        # The control periods after which the steps end, and with which they begin
        self.ends = np.cumsum(self.lengths)
        self.firsts = self.ends - self.lengths
        self.are_longer = bool((self.lengths > 1).any())

    def mean(self, controls: np.ndarray) -> np.ndarray:
        """Return the mean of controls over each step.

        Args:
            controls: for each control period  (..., periods, n_u).

        Returns:
            (..., T, n_u)
        """
        if not self.are_longer:
            return controls
        return np.add.reduceat(controls, self.firsts, axis=-2) / self.lengths[:, None]

    def in_periods(self, controls: np.ndarray) -> np.ndarray:
        """Return controls of the steps (T, n_u) for each control period.  (periods, n_u)"""
        return np.repeat(controls, self.lengths, axis=0) if self.are_longer else controls
