"""Tolerances: deviations of a real vehicle from its nominal parameters, and wind gusts."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class VehicleTolerances:
    """Half widths of uniform distributions about the nominal numbers, and the size of gusts.

    Domain randomization draws vehicles from these distributions, and they are the prior of the
    estimation of vehicle parameters. The defaults describe a careful outdoor flight: a different
    battery, which may be half empty; drag to the usual accuracy; wind of 1.25 m/s at a drag of
    0.4 1/s.
    """

    # mass, relative; the thrust gain has the same tolerance
    mass: float = 0.05
    # highest thrust, relative
    thrust: float = 0.05
    # lags of the body rates and of the rotors, relative
    lag: float = 0.2
    # drag, relative
    drag: float = 0.25
    # standard deviation of the gust per axis [m/s^2]
    gust: float = 0.5
    # correlation time of the gust [s]
    gust_tau: float = 0.5
