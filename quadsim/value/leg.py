"""The time of a point mass on its way from one state to another, with a price on thrust.

    p' = v,    v' = u - g e_z - k v

In place of |u| <= f the mean square of the thrust is limited, which has a closed form. With the
displacement d and the change of velocity w = v_1 - v_0, the least mean square in a time T is

    P(T) = |w / T + g e_z + k d / T|^2 + 12 |d / T - (v_0 + v_1) / 2|^2 / T^2

The first part is the mean thrust, in which the drag's share is k d / T whatever the path. The
second part is the least change of the thrust along the leg that also ends at the right place. That
the drag of a leg is constant is the only approximation.

The least time with P <= f^2 jumps: at speed a leg is possible in a narrow window of times only, or
not before the vehicle has turned back. So the limit has a price, as in a Lagrangian function:

    least over T of  (1 - a) T + a T P(T) / f^2

A leg that needs P = f^2 has its time, and no leg has more than the least time under the limit. The
sum over legs is smooth in all states.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from quadsim.vehicle import GRAVITY, Vehicle

# The largest number of steps of Newton's method, and the relative change at which it ends
STEPS = 60
ACCURACY = 1e-12
# Least number in a denominator
TINY = 1e-12
# a, the price of thrust: with it a leg from rest to rest has the least time under the limit
THRUST_SHARE = 0.25


class PointMass(NamedTuple):
    """A vehicle as a point mass."""

    thrust: float  # f, largest thrust, mass-normalised [m/s^2]
    drag: float  # k, linear drag [1/s]

    @classmethod
    def of(cls, vehicle: Vehicle) -> PointMass:
        """Return the point mass of a vehicle, with its mean drag."""
        return cls(vehicle.thrust_max, float(np.mean(vehicle.drag)))


class States(NamedTuple):
    """Positions [m] and velocities [m/s] in the world frame.  (..., 3) each"""

    position: np.ndarray
    velocity: np.ndarray


class _Leg(NamedTuple):
    """A leg as a polynomial: P = c4 s^4 + c3 s^3 + c2 s^2 + c1 s + g^2 with s = 1 / T."""

    c4: np.ndarray
    c3: np.ndarray
    c2: np.ndarray
    c1: np.ndarray
    # 1 / T at the mean velocity, near which little thrust does; 0 if that leads away
    coasting: np.ndarray


def leg_time(start: States, end: States, mass: PointMass) -> np.ndarray:
    """Return the times of legs from one state to another, with the price on thrust [s].

    Args:
        start: states at the start  (..., 3) each.
        end: states at the end; the shapes are broadcast  (..., 3) each.
        mass: the point mass.

    Returns:
        (...)
    """
    leg = _leg(start, end, mass)
    per = THRUST_SHARE / mass.thrust**2
    rest = 1.0 - THRUST_SHARE + per * GRAVITY**2
    # The derivative by s, times s^2
    s = _largest_root(
        3.0 * per * leg.c4, 2.0 * per * leg.c3, per * leg.c2, 0.0 * leg.c1, -rest, leg.coasting
    )
    return rest / s + per * (((leg.c4 * s + leg.c3) * s + leg.c2) * s + leg.c1)


def _leg(start: States, end: States, mass: PointMass) -> _Leg:
    """Return the polynomials of legs from one state to another."""
    way = end.position - start.position
    change = end.velocity - start.velocity + mass.drag * way
    middle = (start.velocity + end.velocity) / 2.0
    along = _dot(way, middle)
    square = _dot(middle, middle)
    coasting = np.where(along > TINY, square / np.maximum(along, TINY), 0.0)
    return _Leg(
        c4=12.0 * _dot(way, way) + TINY,
        c3=-24.0 * along,
        c2=12.0 * square + _dot(change, change),
        c1=2.0 * GRAVITY * change[..., 2],
        coasting=coasting,
    )


def _largest_root(
    c4: np.ndarray,
    c3: np.ndarray,
    c2: np.ndarray,
    c1: np.ndarray,
    c0: float,
    coasting: np.ndarray,
) -> np.ndarray:
    """Return the largest root of polynomials of degree four, which are negative at 0.

    At speed little thrust does only in a narrow window of times, around the time at the mean
    velocity. Without a look at it a search from above finds the slow way that turns back.

    Args:
        c4, c3, c2, c1, c0: coefficients, c4 > 0 > c0  (...).
        coasting: the place to look at  (...).
    """

    def value(s: np.ndarray) -> np.ndarray:
        return (((c4 * s + c3) * s + c2) * s + c1) * s + c0

    def slope(s: np.ndarray) -> np.ndarray:
        return ((4.0 * c4 * s + 3.0 * c3) * s + 2.0 * c2) * s + c1

    # No root is larger than Fujiwara's bound.
    ratios = (
        np.abs(c3) / c4,
        np.sqrt(np.abs(c2) / c4),
        np.cbrt(np.abs(c1) / c4),
        np.sqrt(np.sqrt(np.abs(c0) / (2.0 * c4))),
    )
    bound = 2.0 * np.maximum.reduce(ratios)
    look = np.minimum(coasting, bound)
    below = value(look) <= 0.0
    low = np.where(below, look, 0.0)
    high = np.where(below, bound, look)

    # Newton's method from above, by halves if it leaves the bracket
    s = high
    for _ in range(STEPS):
        found = value(s)
        low = np.where(found <= 0.0, s, low)
        high = np.where(found > 0.0, s, high)
        by_slope = s - found / slope(s)
        inside = (by_slope > low) & (by_slope < high)
        new = np.where(inside, by_slope, (low + high) / 2.0)
        done = np.all(np.abs(new - s) <= ACCURACY * s)
        s = new
        if done:
            break
    return s


def mean_square(start: States, end: States, drag: float, times: np.ndarray) -> np.ndarray:
    """Return P, the least mean square of the thrust of legs in given times [(m/s^2)^2].

    Args:
        start, end: states  (..., 3) each.
        drag: k [1/s].
        times: of the legs [s]  (...).
    """
    T = np.asarray(times)[..., None]
    way = end.position - start.position
    mean = (end.velocity - start.velocity + drag * way) / T
    mean[..., 2] += GRAVITY
    off = way / T - (start.velocity + end.velocity) / 2.0
    return _dot(mean, mean) + 12.0 * _dot(off, off) / np.asarray(times) ** 2


def _dot(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return the scalar products of vectors  (..., 3) each."""
    return np.einsum("...i,...i->...", a, b)
