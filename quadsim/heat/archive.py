"""The folder of a race: heat.json, and in it a folder for the run of each entrant.

    <UTC>_<course>_heat_s<seed>_<hash>/heat.json
    <UTC>_<course>_heat_s<seed>_<hash>/1_colored/run.json, telemetry.npz, events.csv

A race is written under a name that ends in .part, locked by the process that writes it, and gets
its own name once it is complete.
"""

from __future__ import annotations

import json
import os
import re
import time
from collections.abc import Collection, Mapping, Sequence
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
from quadsim.record.run import CRASHES, RecordedRun, RunError, canonical, hostless
from quadsim.record.schema import HEAT_FORMAT, StoredEntrant, StoredHeatSpec, TitledHeat
from quadsim.record.whole_files import file_errors, write_whole

# Role of a part of the user's own that a text can name -> the form of the text
AS_TEXT = {
    "controller": "controller=package.module:Class",
    "sampler": "sampler=package.module:Class",
    "terms": "term=package.module:function=WEIGHT",
}

# Largest heat.json that is read [bytes]; a race of eight takes a hundredth
LARGEST_HEAT = 20_000_000


class RecordedEntrant(StoredEntrant):
    """An entrant in heat.json, with all that its flight is made from."""

    place: int
    awareness: Awareness


class RecordedHeatSpec(StoredHeatSpec):
    """The specification of a race in heat.json, with all that the race is made from."""

    rotation: int
    settings: HeatSettings
    entrants: list[RecordedEntrant]


class RecordedHeat(msgspec.Struct):
    """The part of heat.json that is read back; the rest follows from the runs."""

    spec: RecordedHeatSpec
    start_times: list[float]
    runs: list[str]
    digest: str
    format: str = ""
    faults: dict[str, str] = {}


class LoadedHeat(NamedTuple):
    """A race from the disk."""

    spec: RecordedHeatSpec
    runs: tuple[RecordedRun, ...]
    start_times: tuple[float, ...]
    # name of an entrant -> what its planner has raised in flight
    faults: Mapping[str, str]

    @property
    def names(self) -> tuple[str, ...]:
        """The entrants' names."""
        return tuple(entrant.name for entrant in self.spec.entrants)

    @property
    def course(self) -> Course:
        """The course."""
        return self.runs[0].course


def heat_name(heat: HeatSpec, record: Mapping[str, Any]) -> str:
    """Return `<UTC>_<course>_heat_s<seed>_<hash>` of a race with this record."""
    utc = time.strftime("%Y%m%dT%H%M%SZ", time.gmtime())
    course = re.sub(r"[^\w.-]+", "-", heat.course.name)
    return f"{utc}_{course}_heat_s{heat.seed}_{heat_key(record)[:8]}"


def heat_key(record: Mapping[str, Any]) -> str:
    """Return the sha256 [hex] of all that decides a race, but for the libraries.

    record: the record of its specification.
    """
    entrants = [entrant | {"spec": hostless(entrant["spec"])} for entrant in record["entrants"]]
    return sha256(canonical({**record, "entrants": entrants})).hexdigest()


def save_heat(
    heat: HeatSpec,
    record: Mapping[str, Any],
    runs: tuple[RecordedRun, ...],
    root: str | Path,
    faults: Mapping[str, str] | None = None,
) -> Path:
    """Write a race, whole or not at all, and return its folder.

    Args:
        heat: its specification.
        record: the record of that, as it was before the race.
        runs: the run of each entrant.
        root: folder of runs.
        faults: name of an entrant -> what its planner has raised in flight.

    Raises:
        RunError: the disk is full, or the like; what was written is removed.
    """
    names = [entrant_folder(k, entrant) for k, entrant in enumerate(heat.names, 1)]
    flown_by = provenance()
    with ClaimedFolder.open(root, heat_name(heat, record)) as folder:
        try:
            for name, run in zip(names, runs, strict=True):
                with file_errors(folder.part, "cannot make a folder for the race"):
                    (folder.part / name).mkdir()
                write_run(folder.part / name, run, flown_by)
            write_whole(folder.part / HEAT, _json(heat, record, runs, names, faults or {}))
            return folder.finish()
        except BaseException:
            folder.drop()
            raise


def entrant_folder(number: int, name: str) -> str:
    """Return the name of the folder of one entrant's run."""
    return f"{number}_{re.sub(r'[^A-Za-z0-9._-]+', '-', name)[:60]}"


def _json(
    heat: HeatSpec,
    of_heat: Mapping[str, Any],
    runs: tuple[RecordedRun, ...],
    folders: list[str],
    faults: Mapping[str, str],
) -> bytes:
    """Return heat.json."""
    start_times = [heat.start_time(k) for k in range(len(runs))]
    record = {
        "format": HEAT_FORMAT,
        "course": heat.course.name,
        "order": [placing._asdict() for placing in placings(heat.names, runs, heat.course)],
        "events": [event._asdict() for event in heat_events(heat.names, runs, start_times)],
        "spec": of_heat,
        "start_times": start_times,
        "runs": folders,
        **provenance(),
        "digest": heat_digest(runs),
    }
    if faults:
        record["faults"] = dict(faults)
    return json.dumps(record, indent=1, allow_nan=False).encode()


def is_heat(path: str | Path) -> bool:
    """Return whether a folder holds a race of several."""
    return (Path(path) / HEAT).is_file()


def runs_of_heat(path: str | Path) -> list[Path]:
    """Return the folders of a race's runs, in the order of the entrants. Raises RunError."""
    folders = [file.parent for file in Path(path).glob("*_*/run.json")]
    numbered = [folder for folder in folders if folder.name.partition("_")[0].isdecimal()]
    if not numbered:
        raise RunError(f"{path}: expected the runs of a race, found none")
    return sorted(numbered, key=lambda folder: int(folder.name.partition("_")[0]))


def heat_title(path: str | Path) -> str:
    """Return a stored race in a few words: course, the number of entrants, the winner.

    It is the folder's name if the race is not readable.
    """
    try:
        data = read_bytes(Path(path) / HEAT, "the record of a race", LARGEST_HEAT)
        stored = msgspec.json.decode(data, type=TitledHeat)
        winner = stored.order[0]
    except (FileError, msgspec.DecodeError, ValueError, RecursionError, IndexError):
        return Path(path).name
    ended = f"{winner.time:.3f} s" if winner.time is not None else winner.outcome
    return f"{stored.course} race of {len(stored.order)}: {winner.name} {ended}"


def find_heat(wanted: str, root: str) -> Path:
    """Return the folder of a race.

    Args:
        wanted: a folder, a part of the name of a race, or "last".
        root: folder of runs.

    Raises:
        RunError: no race fits, or several do.
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
    """Return the folder of a stored race that is meant as a whole; None if a run is meant.

    Args:
        wanted: a folder, a part of the name of a race, or "last": the last that was flown.
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
        wanted: a folder, a part of a name, or "last": the last flight or race.
        root: folder of runs.

    Raises:
        RunError: nothing fits, or several things do.
    """
    heat = heat_folder(wanted, root)
    return [find_run(wanted, root)] if heat is None else runs_of_heat(heat)


def export_name(folder: Path) -> str:
    """Return the name under which a run or a race is exported, which is of one flight alone.

    The folder of an entrant, such as 1_colored, has the name of its race before its own.
    """
    place = folder.absolute()
    return f"{place.parent.name}_{place.name}" if is_heat(place.parent) else place.name


def named_runs(folders: Sequence[Path]) -> list[tuple[str, RecordedRun]]:
    """Return runs with the names that they have in one table.

    The name is that of the folder; where two folders have one name, see `export_name`.

    Raises:
        RunError: a run is damaged.
    """
    different = len({folder.name for folder in folders}) == len(folders)
    return [(f.name if different else export_name(f), read_run(f)) for f in folders]


def with_whole_races(folders: Sequence[Path]) -> list[Path]:
    """Return folders of runs, with the folder of a race in place of all of its runs.

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
        stored = msgspec.json.decode(data, type=RecordedHeat)
    except FileError as error:
        raise RunError(str(error)) from None
    except (msgspec.DecodeError, ValueError, RecursionError) as error:
        raise RunError(f"{file}: damaged: {error}") from None
    if stored.format != HEAT_FORMAT:
        raise RunError(f"{file}: expected format {HEAT_FORMAT!r}, got {stored.format!r}")
    count = len(stored.spec.entrants)
    if not count or len(stored.runs) != count or len(stored.start_times) != count:
        raise RunError(f"{file}: damaged: expected a run and a start time for each entrant")
    for name in stored.runs:
        if Path(name).name != name or name == "..":
            raise RunError(f"{file}: damaged: expected the name of a folder, got {name!r}")
    runs = tuple(read_run(path / name) for name in stored.runs)
    if heat_digest(runs) != stored.digest:
        raise RunError(f"{file}: the runs do not give the stored digest; changed after the race")
    differs = _differs(msgspec.json.decode(data)["spec"], stored, runs)
    if differs is not None:
        wanted = "expected what the runs of the race have"
        raise RunError(f"{file}: {differs}: {wanted}; changed after the race")
    return LoadedHeat(stored.spec, runs, tuple(stored.start_times), stored.faults)


def _differs(
    record: Mapping[str, Any], stored: RecordedHeat, runs: Sequence[RecordedRun]
) -> str | None:
    """Return what of heat.json is not as the runs have it, whose digest the file holds.

    Args:
        record: the specification in heat.json, with the keys that it has there.
        stored: the same file.
        runs: the runs, whose digest is right.

    Returns:
        The name of a key; None: all is as in the runs.
    """
    count = len(runs)
    try:
        expected = run_records(record)
    except (KeyError, TypeError):
        return "spec"
    for k, (asked, run) in enumerate(zip(expected, runs, strict=True)):
        of_race = run.spec.get("heat", {})
        # The hash follows from the other keys
        apart = {"host", "heat", "sha256"}
        name = _first_difference(asked, run.spec, apart)
        name = name or _first_difference(asked.get("heat", {}), of_race, apart)
        if name is not None:
            return name
        if stored.start_times[k] != of_race.get("start_time", 0.0):
            return "start_times"
        if stored.spec.entrants[k].place != (k + stored.spec.rotation) % count + 1:
            return "rotation"
    if stored.spec.seed != runs[0].spec["seed"]:
        return "seed"
    out = {e.name for e, run in zip(stored.spec.entrants, runs, strict=True) if failed(run)}
    return None if stored.faults.keys() <= out else "faults"


def failed(run: RecordedRun) -> bool:
    """Return whether a flight has crashed without an event of a crash: its planner has failed."""
    return run.outcome == "crashed" and not any(event.kind in CRASHES for event in run.events)


def _first_difference(
    a: Mapping[str, Any], b: Mapping[str, Any], apart: Collection[str]
) -> str | None:
    """Return the first key, but for some, that two mappings do not have alike; None: there is none.

    apart: the keys that do not count.
    """
    keys = sorted({*a, *b} - {*apart})
    return next((key for key in keys if a.get(key, ...) != b.get(key, ...)), None)


def spec_of_heat(
    loaded: LoadedHeat,
    runs_dir: str | None = None,
    parts: Mapping[str, Mapping[str, Any]] | None = None,
    seed: str | int | None = None,
) -> HeatSpec:
    """Return the specification of a stored race, which flies the same again.

    Args:
        loaded: the race.
        runs_dir: folder of runs in place of the recorded one.
        parts: see `recorded_heat`.
        seed: seed in place of the recorded one, for another race of the same entrants.

    Raises:
        RecordError, SettingError: see `recorded_heat`.
    """
    settings = {"runs_dir": runs_dir, "seed": seed}
    given = {name: value for name, value in settings.items() if value is not None}
    return _heat_spec(loaded.spec, parts or {}, given)


def is_record_of_heat(value: object) -> TypeGuard[Mapping[str, Any]]:
    """Return whether a value is the record of a race, `spec` of a Heat."""
    return isinstance(value, Mapping) and isinstance(value.get("entrants"), list | tuple)


def recorded_heat(
    record: Mapping[str, Any],
    parts: Mapping[str, Mapping[str, Any]] | None = None,
    settings: Mapping[str, Any] | None = None,
) -> HeatSpec:
    """Return the specification of a recorded race, which flies the same again.

    Args:
        record: `spec` of a Heat.
        parts: {entrant: {role: part}} of the user's own parts that flew, such as
            {"mine": {"controller": controller}}.
        settings: runs_dir, the folder of runs in place of the recorded one; seed, which makes it
            another race of the same entrants.

    Raises:
        RecordError: a file or a part is missing or differs, or the record is not one of a race.
        SettingError: parts of an entrant that did not race, or a setting that would change the
            race.
    """
    try:
        stored = msgspec.convert(record, RecordedHeatSpec)
    except msgspec.ValidationError as error:
        raise RecordError(f"expected the record of a race: {error}") from None
    for name in settings or {}:
        if name not in ("runs_dir", "seed"):
            wanted = "expected nothing but parts, runs_dir, seed and threads beside a recorded race"
            raise SettingError(name, wanted)
    return _heat_spec(stored, parts or {}, settings or {})


def _heat_spec(
    stored: RecordedHeatSpec,
    parts: Mapping[str, Mapping[str, Any]],
    settings: Mapping[str, Any],
) -> HeatSpec:
    """Return the specification that a record holds, with another seed if one is given."""
    of_flights = dict(settings)
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
        parts: the user's own parts of its flight, by role.
        settings: see `recorded_heat`.

    Raises:
        RecordError: a file or a part is missing or differs.
        SettingError: the parts have a setting that would change the flight.
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
