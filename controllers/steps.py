"""The steps of a planner's rollouts, which may last several control periods.

The plan keeps a control for each control period, so that it is shifted exactly from one period to
the next. A rollout takes the mean of the plan and of the perturbations over each step, and what a
step learns is added to all of its periods.
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
        # The control periods after which the steps end
        self.ends = np.cumsum(self.lengths)
        self._firsts = self.ends - self.lengths
        self._borders = np.append(self._firsts, self.ends[-1])
        self._are_periods = bool((self.lengths == 1).all())
        self._means = np.empty(0, np.float32)

    def mean(self, controls: np.ndarray) -> np.ndarray:
        """Return the mean of controls over each step.

        Args:
            controls: for each control period  (periods, n_u).

        Returns:
            (T, n_u)
        """
        if self._are_periods:
            return controls
        return np.add.reduceat(controls, self._firsts) / self.lengths[:, None]

    def in_periods(self, controls: np.ndarray) -> np.ndarray:
        """Return controls of the steps (T, n_u) for each control period.  (periods, n_u)"""
        return controls if self._are_periods else np.repeat(controls, self.lengths, axis=0)

    def means_of(self, z: np.ndarray) -> np.ndarray:
        """Return the means of perturbations over each step.

        The next call writes to the same memory.

        Args:
            z: perturbations for each control period  (series, n_u, halves * periods, LANES).

        Returns:
            (series, n_u, halves * T, LANES)
        """
        if self._are_periods:
            return z
        # Imported here, as it loads the compiler
        from quadsim.controllers.lanes.reduce import step_means

        series, n_u, periods, lanes = z.shape
        halves = periods // int(self.ends[-1])
        shape = (series, n_u, halves * self.number, lanes)
        size = int(np.prod(shape))
        if self._means.size < size or self._means.dtype != z.dtype:
            self._means = np.empty(size, z.dtype)
        means = self._means[:size].reshape(shape)
        step_means(z, self._borders, means)
        return means
