"""What a person chooses on the page (Choices, Numbers), and what turns it into flights (FlightFactory)."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Protocol

from quadsim.course import Course
from quadsim.race.events import Frame

if TYPE_CHECKING:
    from controllers.sampled_trajectories import SampledTrajectories

RANGES = {  # of Numbers: name -> lowest, highest, step
    "sigma": (0.1, 4.0, 0.05),
    "gamma_rates": (0.0, 6.0, 0.05),
    "gamma_thrust": (0.0, 6.0, 0.05),
    "temperature": (0.01, 10.0, 0.01),
    "target_ess": (0.0, 400.0, 5.0),
    "samples": (256, 8192, 256),
}


@dataclass(frozen=True)
class Numbers:
    """The planner's numbers that can be changed in flight."""

    sigma: float = 1.0  # factor on the preset's standard deviations
    gamma_rates: float = 2.0  # color exponent of the body rates
    gamma_thrust: float = 2.0  # and of the thrust
    temperature: float = 1.0
    target_ess: float = 50.0  # effective sample size that the temperature is steered to; 0: the temperature is fixed
    samples: int = 4096

    def clamped(self) -> Numbers:
        """Each number moved into its range."""
        return Numbers(**{k: type(v)(min(max(v, RANGES[k][0]), RANGES[k][1])) for k, v in asdict(self).items()})


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
    """One live flight, to be used by one thread."""

    spec: dict
    course: Course
    period: float  # [s]
    is_cached: bool  # False: the first plan has to compile, which takes some 20 s
    frames: Iterator[Frame]

    def tune(self, numbers: Numbers) -> None:
        """Use these numbers from the next plan on."""
        ...

    def sampled_trajectories(self) -> SampledTrajectories | None: ...

    def close(self) -> None: ...


class FlightFactory(Protocol):
    def numbers(self, preset: str, sampler: str) -> Numbers:
        """The preset's own."""
        ...

    def flight(self, choices: Choices) -> Flight:
        """Raises ValueError with one line for choices that cannot be flown."""
        ...
