"""How far a real vehicle may be from its nominal numbers, and in how much wind it flies."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class VehicleTolerances:
    """Half widths of uniform distributions about the nominal numbers, and a gust.

    Domain randomization draws vehicles from these distributions, and what is learnt of a vehicle in
    flight starts at them. The defaults are those of a careful outdoor flight: a battery more or
    less, which may be half empty, drag as well as it is usually known, 1.25 m/s of wind on a drag
    of 0.4 1/s.
    """

    mass: float = 0.05  # relative; the thrust gain is off by as much
    thrust: float = 0.05  # of the highest thrust, relative
    lag: float = 0.2  # of the body rates and of the rotors, relative
    drag: float = 0.25  # relative
    gust: float = 0.5  # standard deviation per axis [m/s^2]
    gust_tau: float = 0.5  # correlation time of the gust [s]
