"""Search: nonlinear least squares over the numbers, with robust loss, prior and several starts.

Residuals are divided by the noise of their kind, which is estimated from them. The prior is one
more residual for each number, (number - mean) / std. It decides only what the log does not tell.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from quadsim.files.values import SettingError
from quadsim.identify.descent import NumberLimits, descend
from quadsim.identify.geometry import Geometry
from quadsim.identify.numbers import FitNumbers, Prior
from quadsim.identify.prepared import Prepared
from quadsim.identify.problem import CHANNELS, ROTOR_NUMBERS, Block, blocks_of, single_thrusts

MAD = 1.4826  # standard deviation of a normal distribution over its median absolute deviation
LEAST_NOISE = 1e-9
STEP = 1e-4  # of the finite differences, in standard deviations of the prior
ROUNDS = 3  # of noise and numbers in turn
SETTLED = 0.03  # relative change of the noise at which the rounds end
LEAST_GAIN = 1e-6  # relative decrease of the cost at which a search ends
COARSE_GAIN = 1e-3  # the same of a search that has to tell good starts from bad ones


class Linearized(NamedTuple):
    """Residuals over their noise, and their derivatives by the searched numbers."""

    jacobian: np.ndarray  # (m, k)
    values: np.ndarray  # (m,)
    cluster: np.ndarray  # residuals of one number are not independent  (m,)
    prior_precision: np.ndarray  # 1 / std^2 of each searched number  (k,)


class Solution(NamedTuple):
    """The numbers that fit best, and the derivatives there."""

    numbers: FitNumbers
    searched: tuple[str, ...]  # names of the numbers that were searched
    noise: dict[str, float]  # standard deviation of each kind of residual
    # share of the variance of each kind of signal, within its pieces, that is explained
    explained: dict[str, float]
    linearized: Linearized
    channel: np.ndarray  # index of each residual's channel in CHANNELS  (m,)

    def by_channel(self) -> dict[str, np.ndarray]:
        """Return the residuals of each channel over their noise."""
        found = {}
        for k, channel in enumerate(CHANNELS):
            mine = self.linearized.values[self.channel == k]
            if len(mine):
                found[channel.name] = mine
        return found


# Thrusts of the rotors by the identity of a stretch, and whether they are late
Singles = dict[tuple[int, bool], np.ndarray]


class Problem:
    """The residuals of some stretches as a function of the searched numbers."""

    def __init__(
        self,
        parts: Sequence[Prepared],
        geometry: Geometry,
        prior: Mapping[str, Prior],
        searched: Sequence[str],
        turning: Sequence[int],
    ):
        """See `solve`."""
        self._geometry = geometry
        self._blocks = blocks_of(parts, turning)
        if not self._blocks:
            wanted = "expected a second or more of flight without holes in its signals"
            raise SettingError("logs", f"{wanted}, got none")
        self.searched = tuple(searched)
        self.std = np.array([prior[name].std for name in searched])
        self.mean = np.array([prior[name].mean for name in searched])
        self.low = np.array([prior[name].low for name in searched])
        self.high = np.array([prior[name].high for name in searched])
        self.cluster = np.concatenate([block.cluster for block in self._blocks])
        numbers = [CHANNELS.index(block.channel) for block in self._blocks]
        self.channel = np.repeat(numbers, [len(block.cluster) for block in self._blocks])
        self._ends = np.cumsum([len(block.cluster) for block in self._blocks])

    def residuals(self, numbers: FitNumbers) -> np.ndarray:
        """Return all residuals, in their units  (m,)."""
        singles = self._singles(numbers)
        return np.concatenate([self._of(block, numbers, singles) for block in self._blocks])

    def derivatives(self, numbers: FitNumbers, here: np.ndarray | None = None) -> np.ndarray:
        """Return the derivatives of the residuals by the searched numbers  (m, k).

        Differences, of those blocks alone that depend on a number.

        Args:
            numbers: where.
            here: the residuals there, for forward differences at half the cost; None: central ones.
        """
        result = np.zeros((len(self.cluster), len(self.searched)), order="F")
        unchanged = self._singles(numbers)
        for k, name in enumerate(self.searched):
            step = STEP * self.std[k]
            value = getattr(numbers, name)
            ahead = numbers._replace(**{name: value + step})
            behind = numbers._replace(**{name: value - step})
            singles_ahead = singles_behind = unchanged
            # Thrusts that do not change are not computed again.
            if name in ROTOR_NUMBERS or name == "force_lag":
                is_late_alone = name == "force_lag"
                singles_ahead = self._singles(ahead, is_late_alone=is_late_alone)
                if here is None:
                    singles_behind = self._singles(behind, is_late_alone=is_late_alone)
            for block, end in zip(self._blocks, self._ends, strict=True):
                if name in ROTOR_NUMBERS or name in block.channel.numbers:
                    rows = slice(end - len(block.cluster), end)
                    after = self._of(block, ahead, singles_ahead)
                    if here is None:
                        before = self._of(block, behind, singles_behind)
                        result[rows, k] = (after - before) / (2.0 * step)
                    else:
                        result[rows, k] = (after - here[rows]) / step
        return result

    def noise(self, residuals: np.ndarray) -> dict[str, float]:
        """Return the noise of each kind of residual, such as "force_x", in its unit.

        It is the standard deviation, estimated from the median absolute residual.
        """
        by_kind: dict[str, list[np.ndarray]] = {}
        for kind, rows in self._kinds():
            by_kind.setdefault(kind, []).append(np.abs(residuals[rows]))
        return {
            kind: max(MAD * float(np.median(np.concatenate(sizes))), LEAST_NOISE)
            for kind, sizes in by_kind.items()
        }

    def explained(self, residuals: np.ndarray) -> dict[str, float]:
        """Return the share of the variance of each kind that the prediction explains."""
        lost: dict[str, float] = {}
        moved: dict[str, float] = {}
        sizes = [variance for block in self._blocks for variance in block.variances()]
        for (kind, rows), variance in zip(self._kinds(), sizes, strict=True):
            count = rows.stop - rows.start
            lost[kind] = lost.get(kind, 0.0) + count * float(np.var(residuals[rows]))
            moved[kind] = moved.get(kind, 0.0) + count * float(variance)
        return {kind: 1.0 - lost[kind] / max(moved[kind], LEAST_NOISE) for kind in lost}

    def scale(self, noise: Mapping[str, float]) -> np.ndarray:
        """Return the noise of each residual  (m,)."""
        scale = np.zeros(len(self.cluster))
        for kind, rows in self._kinds():
            scale[rows] = noise[kind]
        return scale

    def _singles(self, numbers: FitNumbers, *, is_late_alone: bool = False) -> Singles:
        """Return the thrusts of the rotors in each stretch, with and without the force's lag.

        Args:
            numbers: the numbers, with delay and lags.
            is_late_alone: whether to return only the thrusts with the lag.
        """
        wanted = {(id(block.part), block.channel.is_late): block.part for block in self._blocks}
        return {
            key: single_thrusts(part, numbers, numbers.force_lag if key[1] else 0.0)
            for key, part in wanted.items()
            if key[1] or not is_late_alone
        }

    def _of(self, block: Block, numbers: FitNumbers, singles: Singles) -> np.ndarray:
        single = singles[id(block.part), block.channel.is_late]
        return block.residuals(numbers, self._geometry, single)

    def _kinds(self) -> list[tuple[str, slice]]:
        """Return the kind of each part of the residuals, such as "force_x", and its rows."""
        found = []
        for block, end in zip(self._blocks, self._ends, strict=True):
            each = len(block.cluster) // len(block.axes)
            begin = end - len(block.cluster)
            for k, axis in enumerate(block.axes):
                rows = slice(begin + k * each, begin + (k + 1) * each)
                found.append((f"{block.channel.name}_{'xyz'[axis]}", rows))
        return found


def solve(
    parts: Sequence[Prepared],
    geometry: Geometry,
    prior: Mapping[str, Prior],
    searched: Sequence[str],
    starts: Sequence[FitNumbers],
    turning: Sequence[int] = (0, 1, 2),
    least_gain: float = LEAST_GAIN,
) -> Solution:
    """Return the numbers that fit best.

    Args:
        parts: what is fitted.
        geometry: what is not fitted.
        prior: of each number.
        searched: names of the numbers that are searched; the others stay at the start.
        starts: where the search begins; the best end is searched on with the noise that is found.
        turning: axes of the body rates that are compared.
        least_gain: relative decrease of the cost at which a search ends.

    Raises:
        SettingError: the logs have no whole piece that can be compared.
    """
    problem = Problem(parts, geometry, prior, searched, turning)
    found = starts[0]
    noise = problem.noise(problem.residuals(found))
    for round_ in range(ROUNDS):
        begins = starts if round_ == 0 else (found,)
        ends = [_descend(problem, start, noise, least_gain) for start in begins]
        found = min(ends, key=lambda end: end[1])[0]
        before = noise
        noise = problem.noise(problem.residuals(found))
        if all(abs(noise[kind] - before[kind]) < SETTLED * noise[kind] for kind in noise):
            break
    scale = problem.scale(noise)
    return Solution(
        numbers=found,
        searched=problem.searched,
        noise=noise,
        explained=problem.explained(problem.residuals(found)),
        linearized=Linearized(
            jacobian=problem.derivatives(found) / scale[:, None],
            values=problem.residuals(found) / scale,
            cluster=problem.cluster,
            prior_precision=problem.std**-2.0,
        ),
        channel=problem.channel,
    )


def _descend(
    problem: Problem, start: FitNumbers, noise: Mapping[str, float], least_gain: float
) -> tuple[FitNumbers, float]:
    """Return the numbers at the end of one search, and their cost."""
    scale = problem.scale(noise)
    std = problem.std

    # The search is in standard deviations of the prior.
    def numbers(x: np.ndarray) -> FitNumbers:
        values = map(float, x * std)
        return start._replace(**dict(zip(problem.searched, values, strict=True)))

    def residuals(x: np.ndarray) -> np.ndarray:
        return problem.residuals(numbers(x)) / scale

    def derivatives(x: np.ndarray, r: np.ndarray) -> np.ndarray:
        J = problem.derivatives(numbers(x), r * scale)
        J *= std
        J /= scale[:, None]
        return J

    begin = np.array([getattr(start, name) for name in problem.searched]) / std
    limits = NumberLimits(problem.mean / std, problem.low / std, problem.high / std)
    x, cost = descend(residuals, derivatives, begin, limits, least_gain)
    return numbers(x), cost
