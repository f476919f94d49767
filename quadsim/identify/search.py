"""Search: nonlinear least squares over the numbers, with robust loss, prior and several starts.

Residuals are divided by the noise of their kind, which is estimated from them. The prior is one more
residual for each number, (number - mean) / std. It decides only what the log does not tell.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from scipy.optimize import least_squares

from quadsim.identify.numbers import Numbers, Prior
from quadsim.identify.problem import Geometry, Prepared, residuals

LOSS_SCALE = 2.5  # residuals of more standard deviations than this count less
MAD = 1.4826  # standard deviation of a normal distribution over its median absolute deviation
LEAST_NOISE = 1e-9
STEP = 1e-4  # of the finite differences, in standard deviations of the prior
ROUNDS = 3  # of noise and numbers in turn


class Stacked(NamedTuple):
    """The residuals of all stretches in a row."""

    values: np.ndarray  # (m,)
    kinds: tuple[str, ...]  # of each block
    sizes: tuple[int, ...]  # number of residuals of each block
    cluster: np.ndarray  # (m,)

    @classmethod
    def of(cls, parts: Sequence[Prepared], numbers: Numbers, geometry: Geometry) -> Stacked:
        """Return the residuals of some stretches."""
        values, kinds, cluster, offset = [], [], [], 0
        for part in parts:
            highest = 0
            for block in residuals(part, numbers, geometry):
                values.append(block.values)
                kinds.append(block.kind)
                cluster.append(offset + block.cluster)
                highest = max(highest, int(block.cluster.max(initial=0)))
            offset += highest + 1
        sizes = tuple(len(block) for block in values)
        if not values:
            return cls(np.zeros(0), (), (), np.zeros(0, int))
        return cls(np.concatenate(values), tuple(kinds), sizes, np.concatenate(cluster))

    def noise(self) -> dict[str, float]:
        """Return the standard deviation of each kind, by the median of the absolute residuals."""
        by_kind: dict[str, list[np.ndarray]] = {}
        for kind, block in zip(self.kinds, self._blocks(), strict=True):
            by_kind.setdefault(kind, []).append(block)
        return {
            kind: max(MAD * float(np.median(np.abs(np.concatenate(blocks)))), LEAST_NOISE)
            for kind, blocks in by_kind.items()
        }

    def scale(self, noise: Mapping[str, float]) -> np.ndarray:
        """Return the noise of each residual  (m,)."""
        return np.repeat([noise[kind] for kind in self.kinds], self.sizes)

    def _blocks(self) -> list[np.ndarray]:
        return np.split(self.values, np.cumsum(self.sizes)[:-1])


class Linearized(NamedTuple):
    """Residuals over their noise, and their derivatives by the searched numbers."""

    jacobian: np.ndarray  # (m, k)
    values: np.ndarray  # (m,)
    cluster: np.ndarray  # residuals of one number are not independent  (m,)
    prior_precision: np.ndarray  # 1 / std^2 of each searched number  (k,)


class Solution(NamedTuple):
    """The numbers that fit best, and the derivatives there."""

    numbers: Numbers
    searched: tuple[str, ...]  # names of the numbers that were searched
    noise: dict[str, float]  # standard deviation of each kind of residual
    linearized: Linearized


def solve(
    parts: Sequence[Prepared],
    geometry: Geometry,
    prior: Mapping[str, Prior],
    searched: Sequence[str],
    starts: Sequence[Numbers],
) -> Solution:
    """Return the numbers that fit best.

    Args:
        parts: what is fitted.
        geometry: what is not fitted.
        prior: of each number.
        searched: names of the numbers that are searched; the others stay at the start.
        starts: where the search begins; the best end is searched on with the noise that is found.
    """
    noise = Stacked.of(parts, starts[0], geometry).noise()
    found = starts[0]
    for round_ in range(ROUNDS):
        begins = starts if round_ == 0 else (found,)
        ends = [_descend(parts, geometry, prior, searched, start, noise) for start in begins]
        found = min(ends, key=lambda end: end[1])[0]
        before = noise
        noise = Stacked.of(parts, found, geometry).noise()
        if all(abs(noise[kind] - before[kind]) < 0.02 * noise[kind] for kind in noise):
            break
    return _described(parts, geometry, prior, searched, found, noise)


def _descend(
    parts: Sequence[Prepared],
    geometry: Geometry,
    prior: Mapping[str, Prior],
    searched: Sequence[str],
    start: Numbers,
    noise: Mapping[str, float],
) -> tuple[Numbers, float]:
    """Return the numbers at the end of one search, and their cost."""
    errors = _errors(parts, geometry, prior, searched, start, noise)
    std = np.array([prior[name].std for name in searched])
    low = np.array([prior[name].low for name in searched])
    high = np.array([prior[name].high for name in searched])
    first = np.clip([getattr(start, name) for name in searched], low + 1e-6 * std, high - 1e-6 * std)
    end = least_squares(
        errors,
        first / std,
        bounds=(low / std, high / std),
        loss="soft_l1",
        f_scale=LOSS_SCALE,
        x_scale="jac",
        diff_step=STEP,
        max_nfev=60,
        xtol=1e-7,
        ftol=1e-9,
    )
    return _with(start, searched, end.x * std), float(end.cost)


def _errors(
    parts: Sequence[Prepared],
    geometry: Geometry,
    prior: Mapping[str, Prior],
    searched: Sequence[str],
    start: Numbers,
    noise: Mapping[str, float],
) -> Callable[[np.ndarray], np.ndarray]:
    """Return the function from the searched numbers, over their prior's std, to all residuals."""
    std = np.array([prior[name].std for name in searched])
    mean = np.array([prior[name].mean for name in searched])

    def errors(x: np.ndarray) -> np.ndarray:
        stacked = Stacked.of(parts, _with(start, searched, x * std), geometry)
        return np.concatenate([stacked.values / stacked.scale(noise), x - mean / std])

    return errors


def _with(numbers: Numbers, names: Sequence[str], values: np.ndarray) -> Numbers:
    """Return the numbers with some of them replaced."""
    return numbers._replace(**dict(zip(names, map(float, values), strict=True)))


def _described(
    parts: Sequence[Prepared],
    geometry: Geometry,
    prior: Mapping[str, Prior],
    searched: Sequence[str],
    found: Numbers,
    noise: dict[str, float],
) -> Solution:
    """Return the solution with its derivatives, by central differences."""
    stacked = Stacked.of(parts, found, geometry)
    scale = stacked.scale(noise)
    columns = []
    for name in searched:
        step = STEP * prior[name].std
        value = getattr(found, name)
        ahead, behind = (
            Stacked.of(parts, found._replace(**{name: value + h}), geometry).values for h in (step, -step)
        )
        columns.append((ahead - behind) / (2.0 * step) / scale)
    values = stacked.values / scale
    return Solution(
        numbers=found,
        searched=tuple(searched),
        noise=noise,
        linearized=Linearized(
            jacobian=np.stack(columns, axis=1),
            values=values,
            cluster=stacked.cluster,
            prior_precision=np.array([prior[name].std ** -2 for name in searched]),
        ),
    )
