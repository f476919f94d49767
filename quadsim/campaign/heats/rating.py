"""Ratings of entrants from how often each came in before each other (Bradley and Terry 1952)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
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
    names: Sequence[str], races: Sequence[Mapping[str, int]]
) -> dict[str, tuple[float, float]]:
    """Return a rating of each entrant and half of its 95 % interval.

    By the model of Bradley and Terry (1952) entrant a comes in before b with the probability
    1 / (1 + exp(s_b - s_a)). The strengths s have the greatest likelihood, with PRIOR_DRAWS
    added to each pair. Their mean is zero. A rating is MEAN_RATING + RATING_SCALE s / log(10), the
    scale of Elo.

    The pairs of one race are not independent: the first of four entrants is ahead of three.
    The likelihood's curvature takes them as independent, and gives too small a variance. The
    cluster-robust variance, that of the races' scores, replaces it if it is larger.

    Args:
        names: names of the entrants.
        races: rank of each entrant in each race, by name.
    """
    n = len(names)
    ranks = np.array([[race[name] for name in names] for race in races])  # (races, n)
    ahead_of = (ranks[:, :, None] < ranks[:, None, :]).astype(float)  # (races, n, n)
    others = 1.0 - np.eye(n)
    wins = ahead_of.sum(axis=0) + 0.5 * PRIOR_DRAWS * others
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
    variances = np.maximum(np.diag(covariance), _variances_by_race(ahead_of, p, covariance))
    scale = RATING_SCALE / np.log(10.0)
    return {
        name: (MEAN_RATING + scale * float(s[k]), Z * scale * float(np.sqrt(variances[k])))
        for k, name in enumerate(names)
    }


def _variances_by_race(ahead_of: np.ndarray, p: np.ndarray, covariance: np.ndarray) -> np.ndarray:
    """Return the cluster-robust variance of each strength  (n,).

    Args:
        ahead_of: 1 where one entrant came in before another  (races, n, n).
        p: the probability of that by the model  (n, n).
        covariance: inverse of the likelihood's curvature  (n, n).
    """
    races = len(ahead_of)
    if races < 2:
        return np.zeros(len(p))
    either = ahead_of + ahead_of.transpose(0, 2, 1)  # 0 on the diagonal and for a dead heat
    scores = (ahead_of - either * p).sum(axis=2)  # (races, n)
    meat = races / (races - 1) * scores.T @ scores
    return np.diag(covariance @ meat @ covariance)
