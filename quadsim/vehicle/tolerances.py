"""Tolerances: how far a real vehicle may be from its nominal numbers, and the wind it flies in."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class VehicleTolerances:
    """The half widths of uniform distributions about the nominal numbers, and a gust.

    Domain randomization draws vehicles from these distributions, and what is learnt of a vehicle in
    flight starts at them. The defaults are those of a careful outdoor flight: a battery more or
    less, which may be half empty, drag as well as it is usually known, 1.25 m/s of wind on a drag
    of 0.4 1/s.
    """

    # relative; the thrust gain is off by as much
    mass: float = 0.05
    # highest thrust, relative
    thrust: float = 0.05
    # lags of the body rates and of the rotors, relative
    lag: float = 0.2
    # relative
    drag: float = 0.25
    # standard deviation per axis [m/s^2]
    gust: float = 0.5
    # correlation time of the gust [s]
    gust_tau: float = 0.5
