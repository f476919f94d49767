"""Commands that repeat a recorded flight: a command line and lines of Python.

Both list the settings of the flight, so that they work without the stored run. If these settings do
not reproduce the recorded flight exactly, both name the run's folder instead, from which `race fly
--from` and `quadsim.fly` read the flight.
"""

from __future__ import annotations

import shlex
from collections.abc import Iterator, Mapping
from dataclasses import fields
from pathlib import Path
from typing import Any, NamedTuple

from quadsim.config.settings import FlightNumbers, FlightSettings, values_of
from quadsim.config.spec import Spec
from quadsim.controllers.learned.pilot import pilot_names
from quadsim.record.run import hostless

# The settings of a flight that a Spec holds under the same names. They are worded if they differ
# from a flight with the same course, planner, vehicle and sensing.
FLIGHT = ("view_weight", "timeout", "plant", *(f.name for f in fields(FlightNumbers)))
IMPORT = "import quadsim\n\n"


class Wording(NamedTuple):
    """The commands that repeat a recorded flight."""

    command: str
    python: str


def wording(record: Mapping[str, Any], folder: Path) -> Wording:
    """Return the commands that repeat a recorded flight.

    Args:
        record: the spec of a run.
        folder: the run's folder.
    """
    settings = settings_of(record)
    if settings is None:
        place = str(folder.resolve())
        return Wording(
            command=f"race fly --from {shlex.quote(place)}",
            python=f"{IMPORT}run = quadsim.fly(quadsim.load_run({place!r}).spec)",
        )
    course = settings.pop("course")
    flags = [word for name, value in settings.items() for word in _flag(name, value)]
    keywords = [f"{name}={value!r}" for name, value in settings.items()]
    return Wording(
        command=shlex.join(["race", "fly", course, *flags]),
        python=f"{IMPORT}run = quadsim.fly({', '.join([repr(course), *keywords])})",
    )


def settings_of(record: Mapping[str, Any]) -> dict[str, Any] | None:
    """Return the keywords of `quadsim.fly` that repeat a recorded flight, with its course.

    None is returned if keywords cannot repeat it, because of changes in flight, the user's own
    parts, or files that a record does not name.

    Args:
        record: the spec of a run.

    Examples:
        >>> import quadsim
        >>> from quadsim.tables.wording import settings_of
        >>> run = quadsim.fly("figure8", laps=1, seed=3, samples=256)
        >>> given = settings_of(run.spec)
        >>> given["course"], given["seed"], given["samples"]
        ('figure8', 3, 512)
    """
    try:
        flown = Spec.of_record(record)
        settings = _named(flown)
        settings |= dict(_differing_flight(flown, Spec.of(**settings)))
        # With them, as numbers of a preset may follow from them
        settings |= dict(_differing_numbers(flown, Spec.of(**settings)))
        again = Spec.of(**settings)
    except ValueError:  # a file or a part is missing, or there is no file of a name
        return None
    return settings if hostless(again.record()) == hostless(flown.record()) else None


def _named(spec: Spec) -> dict[str, Any]:
    """Return course, vehicle, preset and similar names, which every command includes."""
    settings: dict[str, Any] = {"course": spec.course.name}
    if spec.pilot:
        known = spec.pilot.name in pilot_names()
        settings["pilot"] = spec.pilot.name if known else spec.pilot.place
    else:
        settings |= {"sampler": spec.sampler, "preset": spec.preset}
    settings |= {"vehicle": spec.vehicle.name, "seed": spec.seed, "laps": spec.laps}
    if spec.sensing:
        settings["sensing"] = spec.sensing.name
    if spec.flight_controller != FlightSettings.flight_controller:
        settings["flight_controller"] = spec.flight_controller
    return settings


def _differing_flight(spec: Spec, usual: Spec) -> Iterator[tuple[str, Any]]:
    """Yield the settings of a flight, and its control period, that differ from another flight's."""
    for name in FLIGHT:
        value = getattr(spec, name)
        if value != getattr(usual, name):
            yield name, value
    dt = spec.planner.mppi.dt
    if dt != usual.planner.mppi.dt and not spec.pilot:
        yield "dt", dt


def _differing_numbers(spec: Spec, usual: Spec) -> Iterator[tuple[str, Any]]:
    """Yield the numbers of planner and model that differ from another flight's."""
    # A pilot does not use the planner's numbers
    if spec.pilot:
        return
    others = values_of(usual.planner, usual.model)
    for name, found in values_of(spec.planner, spec.model).items():
        if name not in others or found.value != others[name].value:
            yield name, found.value


def _flag(name: str, value: Any) -> list[str]:
    """Return a setting as arguments of a command line."""
    flag = name.replace("_", "-")
    match value:
        case True:
            return [f"--{flag}"]
        case False:
            return [f"--no-{flag}"]
        case tuple() if name == "fault":
            # The flag takes one text, and is repeated for several
            return [word for text in value for word in (f"--{flag}", text)]
        case tuple():
            return [f"--{flag}", *map(str, value)]
    return [f"--{flag}", str(value)]


def heat_wording(folder: Path) -> Wording:
    """Return the commands that repeat a stored race of several vehicles from its folder."""
    place = str(folder.resolve())
    return Wording(
        command=f"race heat --from {shlex.quote(place)}",
        python=f"{IMPORT}heat = quadsim.race(quadsim.load_heat({place!r}).spec)",
    )
