"""Menu: the names that the page offers."""

from __future__ import annotations

from dataclasses import dataclass

from quadsim.controllers.learned.pilot import pilot_names
from quadsim.controllers.presets import PRESETS
from quadsim.controllers.samplers import SAMPLERS
from quadsim.course import course_names
from quadsim.racing.hand import HAND
from quadsim.sensing import PERFECT, sensing_names
from quadsim.vehicle import vehicle_names

PILOT = "pilot "  # prefix of a learned pilot's name, which takes the place of a sampler


@dataclass(frozen=True)
class Menu:
    """The names that the page offers."""

    courses: tuple[str, ...]
    vehicles: tuple[str, ...]
    presets: tuple[str, ...]
    samplers: tuple[str, ...]  # samplers, HAND and learned pilots, see PILOT
    sensings: tuple[str, ...] = (PERFECT,)

    @classmethod
    def of_everything(cls, course: str) -> Menu:
        """Return the menu of everything that comes with quadsim, and of an additional course.

        course: a name, or a FILE.yaml that is added to the menu.
        """
        pilots = [PILOT + name for name in pilot_names()]
        return cls(
            courses=tuple(dict.fromkeys((*course_names(), course))),
            vehicles=vehicle_names(),
            presets=tuple(PRESETS),
            samplers=(*SAMPLERS, HAND, *pilots),
            sensings=sensing_names(),
        )
