"""Competitions: files that prescribe a course, a vehicle, randomization, sensors and rates.

    source: learnsyslab/lsy_drone_racing, config/level2.toml
    course: lsy_level2
    vehicle: cf21b_500
    randomize: 1
    dt: 0.02

All keys except `source` and `course` are settings of `race fly` that the organiser prescribes. They
are the defaults of a flight; settings that are given with the competition take precedence.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, get_type_hints

from msgspec import defstruct

from quadsim.config.settings import FlightSettings, SettingError
from quadsim.controllers.config import MPPIConfig
from quadsim.files.data_files import locate, names, read_text
from quadsim.files.strict_yaml import parse, setting
from quadsim.files.yaml_errors import shown_value

COMPETITIONS = Path(__file__).parent / "competitions"
# The settings that a competition may prescribe
PRESCRIBED = (
    "vehicle",
    "thrust_to_weight",
    "laps",
    "timeout",
    "sensing",
    "randomization",
    "randomize",
    "displace_gates",
    "known_from",
    "penalties",
    "plant_dt",
    "flight_controller",
    "link_hz",
    "link_latency",
    "dt",
)
# The classes whose annotations the keys have
OWNERS = (FlightSettings, MPPIConfig)


@dataclass(frozen=True)
class Competition:
    """The course of a competition, and the settings that it prescribes.

    Examples:
        >>> from quadsim.config.competition import load_competition
        >>> level = load_competition("lsy_level2")
        >>> level.course, level.settings["vehicle"], level.settings["dt"]
        ('lsy_level2', 'cf21b_500', 0.02)
    """

    name: str
    source: str
    course: str
    settings: Mapping[str, Any]


def competition_names() -> tuple[str, ...]:
    """Return the names of the competitions that come with the project."""
    return names(COMPETITIONS)


def load_competition(name_or_path: str | Path) -> Competition:
    """Return a competition by name ("lsy_level2") or path ("mine.yaml").

    Raises:
        FileError: there is no such competition, or the file is not a competition.

    Examples:
        >>> from quadsim.config.competition import load_competition
        >>> load_competition("lsy_level0").settings["randomization"]
        'lsy_level0'
    """
    path = locate(name_or_path, COMPETITIONS, "competition")
    return parse_competition(read_text(path), str(path))


def parse_competition(text: str, file: str) -> Competition:
    """Return the competition of a YAML text, named after `file`, which errors mention.

    Raises:
        FileError: the text is not a competition.
    """
    entry = parse(text, file).fill(competition_schema())
    given = {name: getattr(entry, name) for name in PRESCRIBED}
    settings = {name: value for name, value in given.items() if value is not None}
    return Competition(Path(file).stem, entry.source, entry.course, settings)


def given_competition(given: Mapping[str, Any]) -> Competition | None:
    """Return the competition among settings, None if there is none.

    Raises:
        SettingError: the value is neither a name nor a Competition.
        FileError: the competition cannot be read.
    """
    found = given.get("competition")
    if found is None or isinstance(found, Competition):
        return found
    if isinstance(found, str | Path):
        return load_competition(found)
    wanted = "expected a name, a FILE.yaml or a Competition"
    raise SettingError("competition", f"{wanted}, got {shown_value(found)}")


def with_competition(
    given: Mapping[str, Any], competition: Competition | None
) -> Mapping[str, Any]:
    """Return the settings of a flight, completed by its competition.

    Args:
        given: the given settings, which take precedence.
        competition: the competition.
    """
    if competition is None:
        return given
    own = {name: value for name, value in given.items() if value is not None}
    return {"course": competition.course, **competition.settings, **own}


def prescribed_courses(given: Mapping[str, Any] | None) -> tuple[str, ...]:
    """Return the course of the competition among settings, () without a competition.

    Args:
        given: settings, in which a competition is a name or the path of a YAML file.

    Raises:
        FileError: the competition cannot be read.
    """
    name = (given or {}).get("competition")
    return (load_competition(name).course,) if name else ()


def competition_schema() -> type[Any]:
    """Return the schema of a competition file, whose keys have the annotations of settings."""
    hints: dict[str, Any] = {}
    for owner in OWNERS:
        hints |= get_type_hints(owner, include_extras=True)
    keys: list[Any] = [
        ("course", Annotated[str, setting("a course: a name or a FILE.yaml")]),
        ("source", Annotated[str, setting("origin of the numbers")], ""),
    ]
    keys += [(name, hints[name] | None, None) for name in PRESCRIBED]
    return defstruct("CompetitionFile", keys, kw_only=True)
