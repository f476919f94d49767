"""Ratings of entrants from how often each came in before each other (Bradley and Terry 1952)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.optimize import minimize

# Points of a rating by which one entrant beats another ten times as often as it loses
RATING_SCALE = 400.0
MEAN_RATING = 1500.0
# Draws that each pair is credited with, so that ratings are finite if one of them always wins
PRIOR_DRAWS = 1.0
Z = 1.959963984540054  # of a 95 % interval


class HeadToHead(NamedTuple):
    """How often entrant a came in before entrant b."""

    a: str
    b: str
    races: int
    a_first: int
    ci: tuple[float, float]


def bradley_terry(
    names: Sequence[str], pairs: Sequence[HeadToHead]
) -> dict[str, tuple[float, float]]:
    """Return a rating of each entrant and half of its 95 % interval.

    By the model of Bradley and Terry (1952) entrant a comes in before b with the probability
    1 / (1 + exp(s_b - s_a)). The strengths s are those of the greatest likelihood, with PRIOR_DRAWS
    added to each pair. Their mean is zero. A rating is MEAN_RATING + RATING_SCALE s / log(10), the
    scale of Elo. The interval is that of the likelihood's curvature.

    Args:
        names: names of the entrants.
        pairs: how often one came in before another.
    """
    index = {name: k for k, name in enumerate(names)}
    n = len(names)
    wins = np.zeros((n, n))
    for pair in pairs:
        a, b = index[pair.a], index[pair.b]
        wins[a, b] += pair.a_first + 0.5 * PRIOR_DRAWS
        wins[b, a] += pair.races - pair.a_first + 0.5 * PRIOR_DRAWS
    games = wins + wins.T

    def cost(s: np.ndarray) -> float:
        """Return the negative log likelihood, and a term that keeps the mean at zero."""
        ahead = s[:, None] - s[None, :]
        return float((wins * np.logaddexp(0.0, -ahead)).sum() + 0.5 * s.sum() ** 2)

    found = minimize(cost, np.zeros(n), method="BFGS")
    s = found.x - found.x.mean()

    # The curvature of the likelihood, whose direction of equal strengths is taken out
    p = 1.0 / (1.0 + np.exp(s[None, :] - s[:, None]))
    information = games * p * (1.0 - p)
    curvature = np.diag(information.sum(axis=1)) - information
    covariance = np.linalg.pinv(curvature)
    scale = RATING_SCALE / np.log(10.0)
    return {
        name: (MEAN_RATING + scale * float(s[k]), Z * scale * float(np.sqrt(covariance[k, k])))
        for name, k in index.items()
    }
