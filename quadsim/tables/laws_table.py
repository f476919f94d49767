"""The table of docs/derived.md, with the derived numbers of the preset `race` for some flights."""

from __future__ import annotations

from typing import NamedTuple

from quadsim.config.settings import FlightSettings
from quadsim.controllers.costs.race import RaceWeights
from quadsim.controllers.derived import Scale, derived, horizon
from quadsim.controllers.presets import PRESETS
from quadsim.controllers.samplers import Colored
from quadsim.course import load_course
from quadsim.vehicle import load_vehicle

HEADS = (
    "flight",
    "rate [Hz]",
    "$t$ [s]",
    "`horizon` [s]",
    "`samples`",
    "`sigma` of roll and pitch [rad/s]",
    "`cutoff` [Hz]",
    "margin $m$ [m]",
    "`clearance`",
)


class Flight(NamedTuple):
    """A flight of the table."""

    vehicle: str
    course: str
    # control period [s]
    period: float


FLIGHTS = (
    Flight("swift", "split_s_swift", 0.01),
    Flight("flightmare", "alphapilot", 0.01),
    Flight("kolibri", "split_s_swift", 0.01),
    Flight("archer", "aigp_physical", 0.025),
    Flight("crazyflie", "lsy_level2", 0.01),
    Flight("cf21b_500", "lsy_track", 0.02),
)


def laws_table() -> str:
    """Return the table as Markdown."""
    lines = [" | ".join(HEADS), "|".join(["---"] * len(HEADS))]
    lines += [" | ".join(_cells(flight)) for flight in FLIGHTS]
    return "".join(f"| {line} |\n" if line[0] != "-" else f"|{line}|\n" for line in lines)


def _cells(flight: Flight) -> list[str]:
    """Return the row of a flight."""
    course = load_course(flight.course)
    scale = Scale.of(course, load_vehicle(flight.vehicle), flight.period)
    planner = derived(PRESETS["race"][FlightSettings.sampler], scale)
    sampling = planner.sampling
    cost = planner.cost
    assert isinstance(sampling, Colored)
    assert isinstance(cost, RaceWeights)
    assert sampling.cutoff
    margin = min(cost.margin, cost.margin_share * scale.room)
    return [
        f"`{flight.vehicle}` on `{flight.course}`",
        f"{1.0 / flight.period:g}",
        f"{scale.time:.2f}",
        f"{horizon(scale).value:g}",
        f"{planner.mppi.samples}",
        f"{sampling.sigma[0]:g}",
        f"{sampling.cutoff[0]:g}",
        f"{margin:.3f}",
        f"{cost.clearance:g}",
    ]
