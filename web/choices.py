"""What a person chooses on the page, and what the page is given: who builds flights, what a flight can do."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

from quadsim.course import Course
from quadsim.race.events import Frame

if TYPE_CHECKING:
    from controllers.sampled_trajectories import SampledTrajectories


@dataclass(frozen=True)
class Numbers:
    """The planner's numbers that act at the next plan."""

    sigma: float = 1.0  # factor on the preset's standard deviations
    gamma_rates: float = 2.0  # colour exponent of the body rates
    gamma_thrust: float = 2.0  # and of the thrust
    temperature: float = 1.0
    target_ess: float = 50.0  # effective sample size the temperature is steered to; 0: the temperature stays
    samples: int = 4096


RANGES = {  # name -> lowest, highest, step
    "sigma": (0.1, 4.0, 0.05),
    "gamma_rates": (0.0, 6.0, 0.05),
    "gamma_thrust": (0.0, 6.0, 0.05),
    "temperature": (0.01, 10.0, 0.01),
    "target_ess": (0.0, 400.0, 5.0),
    "samples": (256, 8192, 256),
}


@dataclass(frozen=True)
class Choices:
    course: str = "split_s_swift"
    vehicle: str = "swift"
    preset: str = "race"
    sampler: str = "colored"
    seed: int = 0
    laps: int = 0  # 0: the course's
    numbers: Numbers | None = None  # None: the preset's


class Flight(Protocol):
    """One live flight. Not for two threads."""

    spec: dict
    course: Course
    period: float  # [s]
    is_cached: bool  # else the first plan has to compile, some 20 s
    frames: Iterator[Frame]

    def tune(self, numbers: Numbers) -> None:
        """Plan with these from the next plan on."""
        ...

    def sampled_trajectories(self) -> SampledTrajectories | None: ...

    def close(self) -> None: ...


class FlightFactory(Protocol):
    """Where flights come from."""

    def numbers(self, preset: str, sampler: str) -> Numbers: ...

    def flight(self, choices: Choices) -> Flight:
        """Raises ValueError with one line for what cannot be flown."""
        ...
