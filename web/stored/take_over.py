"""A stored run as a competitor of the next START, with all its numbers."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from quadsim.config.settings import FlightSettings
from quadsim.record.run import flown_by
from quadsim.sensing import PERFECT
from quadsim.tables.wording import settings_of
from quadsim.web.state.choices import PILOT, CompetitorChoices, RaceChoices


@dataclass(frozen=True)
class TakenOver:
    """A competitor that is set up like a stored run.

    Attributes:
        choices: the choices of the competitor.
        differs: the parts of the run's race that the next race has otherwise, in words.
    """

    choices: CompetitorChoices
    differs: tuple[str, ...]


def taken_over(record: Mapping[str, Any], race: RaceChoices) -> TakenOver:
    """Return a competitor that is set up like a run.

    Args:
        record: the spec of the run.
        race: the choices of the next race, which are common to all its competitors.

    Raises:
        ValueError: no choices of the page give the flight, such as one of the user's own parts.
    """
    settings = settings_of(record)
    if settings is None:
        raise ValueError(
            f"{flown_by(record)}: expected a flight that settings describe, got one with changes in"
            " flight, own parts or files: `fly again` repeats it"
        )
    course = settings.pop("course")
    of_race = {
        "course": course,
        "seed": settings.pop("seed"),
        "randomize": settings.pop("randomize", FlightSettings.randomize),
        "laps": settings.pop("laps"),
        "clock": settings.pop("clock", FlightSettings.clock),
        "deadline_ms": settings.pop("deadline_ms", None) or "none",
    }
    pilot = settings.pop("pilot", None)
    sampler = f"{PILOT}{pilot}" if pilot else settings.pop("sampler")
    choices = CompetitorChoices(
        sampler=sampler,
        preset=settings.pop("preset", CompetitorChoices.preset),
        vehicle=settings.pop("vehicle"),
        sensing=settings.pop("sensing", PERFECT),
        flight_controller=settings.pop("flight_controller", "ideal"),
        settings=settings,
    )
    differs = tuple(
        f"{name.replace('_ms', '')} {value}"
        for name, value in of_race.items()
        if str(getattr(race, name)) != str(value) and not (name == "laps" and not race.laps)
    )
    return TakenOver(choices, differs)
