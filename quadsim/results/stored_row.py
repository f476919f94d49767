"""Rows of the list of stored runs and races, which are read without the telemetry.

A field or property of StoredRow that is annotated with a TableColumn is a column of every table
of stored runs: in `race runs`, in notebooks and on the page.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, fields
from datetime import UTC, datetime
from functools import cache
from math import inf
from pathlib import Path
from typing import Annotated, Any, NamedTuple, get_type_hints

import msgspec

from quadsim.files.arrays import read_bytes
from quadsim.files.strict_yaml import FileError
from quadsim.record.archive import HEAT, read_run
from quadsim.record.run import own_parts
from quadsim.record.schema import ListedHeat, ListedRun, ListedSpec, RaceOfRun
from quadsim.report.preset_changes import changed_numbers
from quadsim.results.heat import Heat
from quadsim.results.run import Run
from quadsim.sensing import PERFECT

RECORD = "run.json"
# Largest run.json or heat.json that is read for a list [bytes]; a run of 100 laps takes a tenth
LARGEST_RECORD = 20_000_000
# What a reader of a row raises for a folder that cannot be read
UNREADABLE = (FileError, msgspec.MsgspecError, ValueError, LookupError, RecursionError)


@dataclass(frozen=True)
class TableColumn:
    """A column of the tables of stored runs.

    Attributes:
        title: heading, with the unit.
        digits: decimals of the numbers; None for a column of texts.
        is_long: whether the page shortens the texts to a width.
        is_in_name: whether the name of a run's folder has the value, too.
        is_printed: whether printed tables have it; the page has all columns.
    """

    title: str
    digits: int | None = None
    is_long: bool = False
    is_in_name: bool = False
    is_printed: bool = True

    def text(self, value: object) -> str:
        """Return a value of the column as text; None is empty."""
        if value is None:
            return ""
        if isinstance(value, datetime):
            return f"{value:%Y-%m-%d %H:%M:%S}"
        return str(value) if self.digits is None else f"{value:.{self.digits}f}"


class VehicleFlight(NamedTuple):
    """The flight of one vehicle, whose properties the filters of a list compare.

    Attributes:
        name: name of the entrant, or the folder's name for a run of one vehicle.
        outcome: finished, crashed, stuck, timeout or interrupted.
        time: time of all laps [s]; None if the flight was not finished.
        spec: the keys of the flight's spec that a list shows.
        record: the flight's whole spec as JSON text.
    """

    name: str
    outcome: str
    time: float | None
    spec: ListedSpec
    record: msgspec.Raw

    @classmethod
    def of(cls, name: str, outcome: str, time: float | None, record: msgspec.Raw) -> VehicleFlight:
        """Return a flight with its spec decoded. Raises msgspec.MsgspecError."""
        return cls(name, outcome, time, msgspec.json.decode(record, type=ListedSpec), record)

    @property
    def vehicle(self) -> str:
        """The name of the vehicle."""
        return self.spec.vehicle.name

    @property
    def sampler(self) -> str:
        """The name of the sampler, or the class of the user's own sampler or controller."""
        return self.controller or self.spec.sampler

    @property
    def preset(self) -> str:
        """The name of the preset; empty for a learned pilot, which has no planner."""
        return "" if self.pilot else self.spec.preset

    @property
    def pilot(self) -> str | None:
        """The name of the learned pilot that flew; None if a planner flew."""
        return self.spec.pilot.name if self.spec.pilot else None

    @property
    def controller(self) -> str | None:
        """The class of the user's own controller; None if there is none."""
        return own_parts({"own": msgspec.to_builtins(self.spec.own)}).get("controller")

    @property
    def sensing(self) -> str:
        """The name of the set of sensors."""
        return self.spec.sensing.name if self.spec.sensing else PERFECT

    @property
    def flown_by(self) -> str:
        """The controller, pilot or sampler, as text for a table."""
        if self.controller:
            return f"controller {self.controller}"
        return f"pilot {self.pilot}" if self.pilot else self.sampler

    def whole_spec(self) -> dict[str, Any]:
        """Return the flight's spec with all keys."""
        return msgspec.json.decode(self.record)

    @property
    def numbers(self) -> str:
        """The planner's numbers that differ from the preset; unreadable ones are left out."""
        try:
            found = changed_numbers(self.whole_spec())
        except (AttributeError, TypeError, KeyError, ValueError):
            return ""
        return ", ".join(f"{name} {value}" for name, value in found.items()).replace("_", " ")

    @property
    def other_settings(self) -> str:
        """The plant, and further settings that differ from the usual ones."""
        spec = self.spec
        found = {
            "wall clock": spec.clock == "wall",
            f"deadline {spec.deadline_ms} ms": spec.deadline_ms,
            "betaflight": spec.betaflight,
            f"randomize {spec.randomize}": spec.randomize,
            "penalties": spec.penalties,
            spec.plant: True,
        }
        return ", ".join(text for text, is_so in found.items() if is_so)


@dataclass(frozen=True, kw_only=True)
class StoredRow:
    """A row of the list of stored runs and races. Adding a column is one field or property.

    Attributes:
        name: name of the folder.
        path: path of the folder.
        when: local time of the flight.
        course: name of the course.
        flown_by: the sampler, `pilot NAME` or `controller CLASS`; for a race, the entrants.
        time: time of all laps from the standing start, penalties included; for a race, the winner's
            time [s]. None if the run, or every entrant, did not finish.
        outcome: finished, crashed, stuck, timeout or interrupted; for a race, the number of
            entrants that finished, and the winner.
        seed: the seed.
        laps: times of the completed laps, penalties included [s]; empty for a race.
        laps_wanted: number of laps of the race.
        entrants: names of the entrants; empty for a run.
        winner: name of the winner; None for a run.
        flights: the flight of each vehicle.

    Examples:
        >>> import quadsim
        >>> folder = quadsim.fly("figure8", laps=1, samples=256).save()
        >>> row = quadsim.runs()[0]
        >>> row.progress, row.vehicle, row.numbers
        ('1/1', 'swift', 'samples 256')
    """

    name: str
    path: Path
    when: Annotated[datetime, TableColumn("flown", is_in_name=True)]
    course: Annotated[str, TableColumn("course", is_long=True, is_in_name=True)]
    flown_by: Annotated[str, TableColumn("flown by", is_long=True)]
    time: Annotated[float | None, TableColumn("time [s]", digits=3)]
    outcome: Annotated[str, TableColumn("outcome", is_long=True)]
    seed: Annotated[int, TableColumn("seed", digits=0, is_in_name=True)]
    laps: tuple[float, ...] = ()
    laps_wanted: int
    entrants: tuple[str, ...] = ()
    winner: str | None = None
    flights: tuple[VehicleFlight, ...] = field(repr=False)

    @property
    def progress(self) -> Annotated[str, TableColumn("laps")]:
        """The completed and the required laps of a run, or the required laps of a race."""
        return str(self.laps_wanted) if self.entrants else f"{len(self.laps)}/{self.laps_wanted}"

    @property
    def vehicle(self) -> Annotated[str, TableColumn("vehicle", is_long=True)]:
        """The names of the vehicles, each once."""
        return _each(flight.vehicle for flight in self.flights)

    @property
    def preset(self) -> Annotated[str, TableColumn("preset", is_long=True)]:
        """The names of the presets, each once; a pilot's flight has none."""
        return _each(flight.preset for flight in self.flights)

    @property
    def sensing(self) -> Annotated[str, TableColumn("sensing", is_long=True, is_printed=False)]:
        """The names of the sets of sensors, each once; "perfect" stands for the true state."""
        return _each(flight.sensing for flight in self.flights)

    @property
    def numbers(
        self,
    ) -> Annotated[str, TableColumn("changed numbers", is_long=True, is_printed=False)]:
        """The planner's numbers that differ from the preset, for each entrant of a race."""
        numbers = {flight.name: flight.numbers for flight in self.flights}
        if not self.entrants:
            return _each(numbers.values())
        return _each(f"{name}: {changed}" for name, changed in numbers.items() if changed)

    @property
    def changes(self) -> Annotated[int, TableColumn("changes", digits=0, is_printed=False)]:
        """The number of changes of planner parameters in flight, over all vehicles."""
        return sum(len(flight.spec.interactive) for flight in self.flights)

    @property
    def sampler(self) -> str:
        """The names of the samplers, or the classes of the user's own parts, each once."""
        return _each(flight.sampler for flight in self.flights)

    @property
    def pilot(self) -> str | None:
        """The names of the learned pilots that flew, each once; None if there are none."""
        return _each(flight.pilot for flight in self.flights) or None

    @property
    def controller(self) -> str | None:
        """The classes of the user's own controllers, each once; None if there are none."""
        return _each(flight.controller for flight in self.flights) or None

    @property
    def other_settings(self) -> str:
        """The plants, and other unusual settings: clock, deadline, firmware, rules."""
        return _each(flight.other_settings for flight in self.flights)

    @property
    def finished(self) -> int:
        """The number of vehicles that finished."""
        return sum(flight.time is not None for flight in self.flights)

    def values(self) -> dict[str, Any]:
        """Return the values of the row by the names of its fields and properties."""
        return {name: getattr(self, name) for name in value_names()}

    def as_json(self) -> dict[str, Any]:
        """Return `values` as JSON."""
        return self.values() | {"path": str(self.path), "when": self.when.isoformat()}

    def cells(self) -> dict[str, str]:
        """Return the text of each printed column, by the column's field."""
        return {
            name: column.text(getattr(self, name))
            for name, column in columns().items()
            if column.is_printed
        }


class StoredRun(StoredRow):
    """A stored run of one vehicle, see StoredRow.

    Examples:
        >>> import quadsim
        >>> folder = quadsim.fly("figure8", laps=1, samples=256).save()
        >>> (row,) = quadsim.runs()
        >>> row.course, row.seed, row.outcome
        ('figure8', 0, 'finished')
    """

    def load(self) -> Run:
        """Read the whole run, with its telemetry.

        Raises:
            RunError: the run is damaged.
        """
        return Run.of(read_run(self.path))


class StoredHeat(StoredRow):
    """A stored race of several vehicles, see StoredRow.

    Examples:
        >>> import quadsim
        >>> heat = quadsim.race(["colored", "gaussian"], "figure8", laps=1, samples=256)
        >>> folder = heat.save()
        >>> (row,) = quadsim.runs().races
        >>> row.entrants, row.course
        (('colored', 'gaussian'), 'figure8')
        >>> row.load().digest() == heat.digest()
        True
    """

    def load(self) -> Heat:
        """Read the whole race, with its telemetry.

        Raises:
            RunError: the race is damaged.
        """
        return Heat.load(self.path)


@cache
def columns() -> dict[str, TableColumn]:
    """Return the columns by the fields and properties of StoredRow."""
    hints = get_type_hints(StoredRow, include_extras=True)
    for name, read in _properties().items():
        hints[name] = get_type_hints(read.fget, include_extras=True)["return"]
    return {
        name: column
        for name, hint in hints.items()
        for column in getattr(hint, "__metadata__", ())
        if isinstance(column, TableColumn)
    }


@cache
def value_names() -> tuple[str, ...]:
    """Return the names of a row's values: its fields except `flights`, and its properties."""
    named = (one.name for one in fields(StoredRow) if one.name != "flights")
    return (*named, *_properties())


def _properties() -> dict[str, property]:
    """Return the properties of StoredRow by name."""
    return {name: read for name, read in vars(StoredRow).items() if isinstance(read, property)}


def read_row(path: Path) -> StoredRun | StoredHeat:
    """Return the row of a folder, from a race's heat.json or a run's run.json.

    Raises:
        FileError: the file is missing, too large, or not a regular file.
        msgspec.MsgspecError, LookupError: the file is not a record.
    """
    return _read_heat(path) if os.path.lexists(path / HEAT) else _read_run(path)


def _read_run(path: Path) -> StoredRun:
    """Return the row of a run, see `read_row`."""
    found = _listed_run(path)
    flight = _flight(path.name, found)
    return StoredRun(
        name=path.name,
        path=path,
        when=flown_at(path),
        course=flight.spec.course.name,
        flown_by=flight.flown_by,
        time=flight.time,
        outcome=found.outcome,
        seed=flight.spec.seed,
        laps=tuple(found.laps),
        laps_wanted=flight.spec.laps,
        flights=(flight,),
    )


def _listed_run(path: Path) -> ListedRun:
    """Return the record in the folder of a run, see `read_row`."""
    data = read_bytes(path / RECORD, "the record of a flight", LARGEST_RECORD)
    return msgspec.json.decode(data, type=ListedRun)


def _flight(name: str, found: ListedRun) -> VehicleFlight:
    """Return the flight of a record."""
    time = sum(found.laps) if found.outcome == "finished" else None
    return VehicleFlight.of(name, found.outcome, time, found.spec)


def _read_heat(path: Path) -> StoredHeat:
    """Return the row of a race, see `read_row`."""
    data = read_bytes(path / HEAT, "the record of a race", LARGEST_RECORD)
    found = msgspec.json.decode(data, type=ListedHeat)
    entrants = tuple(entrant.name for entrant in found.spec.entrants)
    flights = tuple(
        _flight(name, _listed_run(path / Path(folder).name))
        for name, folder in zip(entrants, found.runs, strict=True)
    )
    _check_heat(found, flights)
    finished = sum(flight.time is not None for flight in flights)
    winner = found.order[0]
    return StoredHeat(
        name=path.name,
        path=path,
        when=flown_at(path),
        course=found.course,
        flown_by=f"race: {', '.join(entrants)}",
        time=winner.time,
        outcome=f"{finished} of {len(entrants)} finished, {winner.name} first",
        seed=found.spec.seed,
        laps_wanted=flights[0].spec.laps,
        entrants=entrants,
        winner=winner.name,
        flights=flights,
    )


def _check_heat(found: ListedHeat, flights: Sequence[VehicleFlight]) -> None:
    """Check that heat.json describes the race in which its runs were flown.

    The order of entrants without a time is not checked: it follows from the telemetry.

    Raises:
        ValueError: the course, the seed, an entrant or a result is another one.
    """
    names = [flight.name for flight in flights]
    for number, flight in enumerate(flights, 1):
        spec = flight.spec
        # The run of a single entrant is stored as a flight without others, and names no race.
        own = spec.heat or RaceOfRun(number=1, names=names, seed=spec.seed)
        if (found.course, found.spec.seed) != (spec.course.name, own.seed):
            raise _another_race("course and seed")
        if (number, names) != (own.number, own.names):
            raise _another_race("entrants")
    # Those with a time stand first, the fastest in front.
    told = [(placing.name, placing.outcome, placing.time) for placing in found.order]
    flown = [(flight.name, flight.outcome, flight.time) for flight in flights]
    times = [inf if time is None else time for _, _, time in told]
    if not told or set(told) != set(flown) or len(told) != len(flown) or times != sorted(times):
        raise _another_race("results")


def _another_race(what: str) -> ValueError:
    """Return the error of a heat.json that does not describe the race of its runs."""
    return ValueError(
        f"{HEAT}: expected the {what} of its runs, got others; changed after the race"
    )


def flown_at(path: Path) -> datetime:
    """Return the local time in a folder's name, or else the time at which it was written."""
    stamp = path.name.partition("_")[0]
    try:
        return datetime.strptime(stamp + "+0000", "%Y%m%dT%H%M%SZ%z").astimezone()
    except ValueError:
        written = path.stat().st_mtime if path.exists() else 0.0
        return datetime.fromtimestamp(written, UTC).astimezone()


def _each(names: Iterable[str | None]) -> str:
    """Return distinct names as text, without empty ones."""
    return ", ".join(dict.fromkeys(filter(None, names)))
