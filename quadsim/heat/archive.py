"""The folder of a race, which has heat.json and a folder for the run of each entrant.

    <UTC>_<course>_heat_s<seed>_<hash>/heat.json
    <UTC>_<course>_heat_s<seed>_<hash>/1_colored/run.json, telemetry.npz, events.csv

heat.json has the settings of the race, its entrants, their places on the grid and their folders.
The order and the events in it follow from the runs; they serve people and lists. A race is written
to a folder whose name ends in .part, which is locked by the writing process and renamed once it is
complete.
"""

from __future__ import annotations

import json
import os
import re
import time
from collections.abc import Mapping, Sequence
from hashlib import sha256
from pathlib import Path
from shlex import quote
from typing import Any, NamedTuple, TypeGuard

import msgspec

from quadsim.config.recorded import (
    MissingPartError,
    RecordError,
    sorted_settings,
)
from quadsim.config.settings import SETTINGS
from quadsim.config.spec import Spec
from quadsim.course import Course
from quadsim.files.arrays import read_bytes
from quadsim.files.strict_yaml import FileError
from quadsim.files.values import SettingError, checked
from quadsim.heat.result import heat_digest, heat_events, placings, run_records
from quadsim.heat.settings import Awareness, HeatSettings
from quadsim.heat.spec import Entrant, HeatSpec
from quadsim.record.archive import (
    HEAT,
    ClaimedFolder,
    find_run,
    list_heats,
    list_runs,
    read_run,
    write_run,
    written_at,
)
from quadsim.record.provenance import provenance
from quadsim.record.run import RecordedRun, RunError, canonical, hostless
from quadsim.record.schema import HEAT_FORMAT
from quadsim.record.whole_files import file_errors, write_whole

# Role of a part of the user's own that a text can name -> the form of the text
AS_TEXT = {
    "controller": "controller=package.module:Class",
    "sampler": "sampler=package.module:Class",
    "terms": "term=package.module:function=WEIGHT",
}

# Largest heat.json that is read [bytes]; a race of eight takes a hundredth
LARGEST_HEAT = 20_000_000


class RecordedEntrant(msgspec.Struct):
    """An entrant of a recorded race, with everything from which its flight is made."""

    name: str
    place: int
    awareness: Awareness
    spec: dict[str, Any]


class RecordedHeatSpec(msgspec.Struct):
    """The specification of a recorded race, with everything from which the race is made."""

    seed: int
    rotation: int
    settings: HeatSettings
    entrants: list[RecordedEntrant]


class HeatFile(msgspec.Struct):
    """The keys of heat.json that are read; the other keys follow from the runs."""

    spec: dict[str, Any]  # as HeatSpec.record, without the specs of the entrants
    runs: list[str]
    digest: str
    format: str = ""


class LoadedHeat(NamedTuple):
    """A race that was read from its folder."""

    # The record of its specification, see HeatSpec.record
    record: dict[str, Any]
    spec: RecordedHeatSpec
    runs: tuple[RecordedRun, ...]

    @property
    def names(self) -> tuple[str, ...]:
        """The entrants' names."""
        return tuple(entrant.name for entrant in self.spec.entrants)

    @property
    def course(self) -> Course:
        """The course."""
        return self.runs[0].course

    @property
    def start_times(self) -> tuple[float, ...]:
        """The time at which each entrant started [s]."""
        stagger = self.spec.settings.stagger
        return tuple(stagger * (entrant.place - 1) for entrant in self.spec.entrants)

    @property
    def faults(self) -> dict[str, str]:
        """The errors of controllers in flight, by the name of the entrant."""
        of_each = zip(self.names, self.runs, strict=True)
        return {name: run.fault for name, run in of_each if run.fault}


def heat_name(heat: HeatSpec, record: Mapping[str, Any]) -> str:
    """Return `<UTC>_<course>_heat_s<seed>_<hash>` of a race with this record."""
    utc = time.strftime("%Y%m%dT%H%M%SZ", time.gmtime())
    course = re.sub(r"[^\w.-]+", "-", heat.course.name)
    return f"{utc}_{course}_heat_s{heat.seed}_{heat_key(record)[:8]}"


def heat_key(record: Mapping[str, Any]) -> str:
    """Return the sha256 [hex] of everything that decides a race, except the libraries.

    Args:
        record: record of the race's specification.
    """
    entrants = [entrant | {"spec": hostless(entrant["spec"])} for entrant in record["entrants"]]
    return sha256(canonical({**record, "entrants": entrants})).hexdigest()


def save_heat(
    heat: HeatSpec,
    record: Mapping[str, Any],
    runs: tuple[RecordedRun, ...],
    root: str | Path,
) -> Path:
    """Write a race completely or not at all, and return its folder.

    Args:
        heat: specification of the race.
        record: record of the specification, made before the race.
        runs: the run of each entrant.
        root: folder of runs.

    Raises:
        RunError: a file cannot be written; the files written so far are removed.
    """
    names = [entrant_folder(k, entrant) for k, entrant in enumerate(heat.names, 1)]
    flown_by = provenance()
    with ClaimedFolder.open(root, heat_name(heat, record)) as folder:
        try:
            for name, run in zip(names, runs, strict=True):
                with file_errors(folder.part, "cannot make a folder for the race"):
                    (folder.part / name).mkdir()
                write_run(folder.part / name, run, flown_by)
            write_whole(folder.part / HEAT, _json(heat, record, runs, names))
            return folder.finish()
        except BaseException:
            folder.drop()
            raise


def entrant_folder(number: int, name: str) -> str:
    """Return the name of the folder of one entrant's run."""
    return f"{number}_{re.sub(r'[^A-Za-z0-9._-]+', '-', name)[:60]}"


def _json(
    heat: HeatSpec,
    record: Mapping[str, Any],
    runs: tuple[RecordedRun, ...],
    folders: list[str],
) -> bytes:
    """Return the content of heat.json."""
    start_times = [heat.start_time(k) for k in range(len(runs))]
    # The spec of an entrant is in its run
    entrants = [_without(entrant, "spec") for entrant in record["entrants"]]
    found = {
        "format": HEAT_FORMAT,
        "course": heat.course.name,
        "order": [placing._asdict() for placing in placings(heat.names, runs, heat.course)],
        "events": [event._asdict() for event in heat_events(heat.names, runs, start_times)],
        "spec": {**record, "entrants": entrants},
        "runs": folders,
        **provenance(),
        "digest": heat_digest(runs),
    }
    return json.dumps(found, indent=1, allow_nan=False).encode()


def _without(record: Mapping[str, Any], key: str) -> dict[str, Any]:
    """Return a record without one of its keys."""
    return {name: value for name, value in record.items() if name != key}


def is_heat(path: str | Path) -> bool:
    """Return whether a folder holds a race of several vehicles."""
    return (Path(path) / HEAT).is_file()


def runs_of_heat(path: str | Path) -> list[Path]:
    """Return the folders of a race's runs, in the order of the entrants. Raises RunError."""
    folders = [file.parent for file in Path(path).glob("*_*/run.json")]
    numbered = [folder for folder in folders if folder.name.partition("_")[0].isdecimal()]
    if not numbered:
        raise RunError(f"{path}: expected the runs of a race, found none")
    return sorted(numbered, key=lambda folder: int(folder.name.partition("_")[0]))


def find_heat(wanted: str, root: str) -> Path:
    """Return the folder of a race.

    Args:
        wanted: path of a folder, a part of the name of a race, or "last".
        root: folder of runs.

    Raises:
        RunError: no race or several races fit.
    """
    if is_heat(wanted):
        return Path(wanted)
    heats = list_heats(root)
    if not heats:
        raise RunError(f"no races in {root!r}: fly one with race heat, or give --runs-dir")
    if wanted == "last":
        return max(heats, key=written_at)
    fits = [heat for heat in heats if wanted in heat.name]
    if len(fits) != 1:
        found = f"fits {len(fits)} races, expected one" if fits else f"is no race in {root!r}"
        raise RunError(f"{wanted!r} {found}: expected a folder, part of a name or 'last'")
    return fits[0]


def heat_folder(wanted: str, root: str) -> Path | None:
    """Return the folder of a stored race; None if `wanted` names a run.

    Args:
        wanted: path of a folder, a part of the name of a race, or "last" for the last flight.
        root: folder of runs.
    """
    if is_heat(wanted):
        return Path(wanted)
    if os.sep in wanted:
        return None
    heats = list_heats(root)
    if wanted == "last":
        newest_run = max(map(written_at, list_runs(root)), default=0.0)
        last = max(heats, key=written_at, default=None)
        return last if last and written_at(last) > newest_run else None
    fits = [heat for heat in heats if wanted == heat.name]
    if fits:
        return fits[0]
    fits = [heat for heat in heats if wanted in heat.name]
    is_run = any(wanted in run.name for run in list_runs(root))
    return fits[0] if len(fits) == 1 and not is_run else None


def run_folders(wanted: str, root: str) -> list[Path]:
    """Return the folder of a run, or the folders of all runs of a race of several vehicles.

    Args:
        wanted: path of a folder, a part of a name, or "last" for the last flight or race.
        root: folder of runs.

    Raises:
        RunError: no run or race fits, or several do.
    """
    heat = heat_folder(wanted, root)
    return [find_run(wanted, root)] if heat is None else runs_of_heat(heat)


def export_name(folder: Path) -> str:
    """Return a unique name under which a run or a race is exported.

    The name of an entrant's folder, such as 1_colored, follows the name of its race.
    """
    place = folder.absolute()
    return f"{place.parent.name}_{place.name}" if is_heat(place.parent) else place.name


def named_runs(folders: Sequence[Path]) -> list[tuple[str, RecordedRun]]:
    """Return runs with distinct names, for one table.

    The name of a run is its folder's name, or `export_name` if two folders have the same name.

    Raises:
        RunError: a run is damaged.
    """
    different = len({folder.name for folder in folders}) == len(folders)
    return [(f.name if different else export_name(f), read_run(f)) for f in folders]


def with_whole_races(folders: Sequence[Path]) -> list[Path]:
    """Return folders of runs, in which the folder of a race replaces the folders of all its runs.

    Raises:
        RunError: the folder of a race has no runs.
    """
    given = {folder.absolute() for folder in folders}
    found: dict[Path, None] = {}
    for folder in folders:
        race = folder.absolute().parent
        whole = is_heat(race) and {run.absolute() for run in runs_of_heat(race)} <= given
        found[folder.parent if whole else folder] = None
    return list(found)


def read_heat(path: str | Path) -> LoadedHeat:
    """Return a stored race, equal to the last bit.

    Raises:
        RunError: the folder is missing or damaged, or was changed after the race.
    """
    path = Path(path)
    file = path / HEAT
    try:
        data = read_bytes(file, "the record of a race", LARGEST_HEAT)
        stored = msgspec.json.decode(data, type=HeatFile)
    except FileError as error:
        raise RunError(str(error)) from None
    except (msgspec.DecodeError, ValueError, RecursionError) as error:
        raise RunError(f"{file}: damaged: {error}") from None
    if stored.format != HEAT_FORMAT:
        raise RunError(f"{file}: expected format {HEAT_FORMAT!r}, got {stored.format!r}")
    for name in stored.runs:
        if Path(name).name != name or name == "..":
            raise RunError(f"{file}: damaged: expected the name of a folder, got {name!r}")
    runs = tuple(read_run(path / name) for name in stored.runs)
    if heat_digest(runs) != stored.digest:
        raise RunError(f"{file}: the runs do not give the stored digest; changed after the race")
    try:
        record = _with_specs(stored.spec, runs)
        spec = msgspec.convert(record, RecordedHeatSpec)
        expected = run_records(record)
    except (LookupError, TypeError, ValueError) as error:
        wanted = "expected a race, with an entrant for each of its runs"
        raise RunError(f"{file}: damaged: {wanted}: {error}") from None
    # Each run has the settings of its race, and a hash of the specs of all entrants
    if not spec.entrants or expected != [run.spec for run in runs]:
        wanted = "expected the race that its runs were flown in"
        raise RunError(f"{file}: spec: {wanted}, got another; changed after the race")
    return LoadedHeat(record, spec, runs)


def _with_specs(of_heat: Mapping[str, Any], runs: Sequence[RecordedRun]) -> dict[str, Any]:
    """Return the record of a race: heat.json, with the spec of the run of each entrant.

    Raises:
        LookupError, TypeError, ValueError: heat.json has no entrants, or not one for each run.
    """
    entrants = [
        {**entrant, "spec": _without(run.spec, "heat")}
        for entrant, run in zip(of_heat["entrants"], runs, strict=True)
    ]
    return {**of_heat, "entrants": entrants}


def is_record_of_heat(value: object) -> TypeGuard[Mapping[str, Any]]:
    """Return whether a value is the record of a race, as in `Heat.spec`."""
    return isinstance(value, Mapping) and isinstance(value.get("entrants"), list | tuple)


def recorded_heat(
    record: Mapping[str, Any],
    parts: Mapping[str, Mapping[str, Any]] | None = None,
    settings: Mapping[str, Any] | None = None,
) -> HeatSpec:
    """Return the specification that repeats a recorded race.

    Args:
        record: `spec` of a Heat.
        parts: {entrant: {role: part}} of the user's own parts that flew, such as
            {"mine": {"controller": controller}}.
        settings: `runs_dir`, another folder of runs; `seed`, which makes another race of the same
            entrants.

    Raises:
        RecordError: a file or a part is missing or differs, or the record is not of a race.
        SettingError: parts of an unknown entrant are given, or a setting that would change the
            race.
    """
    try:
        stored = msgspec.convert(record, RecordedHeatSpec)
    except msgspec.ValidationError as error:
        raise RecordError(f"expected the record of a race: {error}") from None
    of_flights = {name: value for name, value in (settings or {}).items() if value is not None}
    for name in of_flights:
        if name not in ("runs_dir", "seed"):
            wanted = "expected nothing but parts, runs_dir, seed and threads beside a recorded race"
            raise SettingError(name, wanted)
    parts = parts or {}
    seed = of_flights.pop("seed", None)
    if seed is None:
        seed = stored.seed
    else:
        seed = msgspec.convert(checked("seed", seed, SETTINGS["seed"].kind), int)
    names = [entrant.name for entrant in stored.entrants]
    for name in parts:
        if name not in names:
            raise SettingError("parts", f"expected one of {', '.join(names)}, got {name!r}")
    entrants = [
        Entrant(
            name=one.name,
            spec=_entrant_spec(one, parts.get(one.name, {}), of_flights),
            awareness=one.awareness,
        )
        for one in stored.entrants
    ]
    return HeatSpec(tuple(entrants), stored.settings, seed, stored.rotation)


def _entrant_spec(
    one: RecordedEntrant, parts: Mapping[str, Any], settings: Mapping[str, Any]
) -> Spec:
    """Return the spec of a recorded entrant.

    Args:
        one: the entrant.
        parts: the user's own parts of the entrant's flight, by role.
        settings: see `recorded_heat`.

    Raises:
        RecordError: a file or a part is missing or differs.
        SettingError: the parts include a setting that would change the flight.
    """
    for name in sorted_settings(one.spec, parts).changed:
        wanted = f"expected parts of your own that flew as {one.name!r}"
        raise SettingError("parts", f"{wanted}, got {name!r}")
    try:
        return Spec.of_record(one.spec, **settings, **parts)
    except MissingPartError as error:
        how = f"give it again as parts={{{one.name!r}: {{{error.role!r}: ...}}}}"
        if error.role in AS_TEXT:
            how += f", or --parts {quote(f'{one.name}={AS_TEXT[error.role]}')}"
        raise RecordError(f"{one.name}: {error.what}; {how}") from None
