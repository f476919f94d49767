"""The archive of runs, one folder for each: `<UTC>_<course>_<sampler>_s<seed>_<hash>/`.

If no sampler flew, the name has "pilot", "hand" or the class of a user's own controller instead.

A folder holds run.json, telemetry.npz and events.csv. It is named `<name>.part` from before the
flight until all files are written, so a folder without `.part` is complete. The process that fills
the folder holds a lock on it, so that the next flight recognises the folders of killed processes. A
race of several vehicles is stored in the same way, see quadsim.heat.archive.
"""

from __future__ import annotations

import os
import re
import shutil
import time
from collections.abc import Callable
from contextlib import suppress
from hashlib import sha256
from pathlib import Path
from typing import Any, Self

from quadsim.files.arrays import read_bytes
from quadsim.files.locks import lock_folder
from quadsim.files.strict_yaml import FileError
from quadsim.record.provenance import provenance
from quadsim.record.run import (
    LearnedDelay,
    LearnedRotor,
    RecordedRun,
    RunError,
    canonical,
    flown_by,
    hostless,
)
from quadsim.record.run_format import (
    read_json,
    read_npz,
    write_csv,
    write_json,
    write_npz,
)
from quadsim.record.whole_files import file_errors, write_whole

PART = ".part"
HEAT = "heat.json"  # the record of a race of several vehicles
# Pattern of how the name of a run begins
STARTED = "[0-9]" * 8 + "T" + "[0-9]" * 6 + "Z_"
# Number of runs that an error lists if several fit
LISTED = 3


class ClaimedFolder:
    """A folder that one process fills, used as `with ClaimedFolder.open(root, name) as folder`.

    Until `finish` it is named `<name>.part` and locked. A folder that stays empty is removed.

    Attributes:
        path: path of the finished folder.
        part: path of the folder until it is finished, in which the files are written.
    """

    def __init__(self, path: Path, lock: int):
        """Use a `.part` folder that exists and is locked by the handle `lock`."""
        self.path = path
        self.part = _part_of(path)
        self._lock = lock

    @classmethod
    def open(cls, root: str | Path, name: str) -> ClaimedFolder:
        """Return a claimed folder with this name; a number is added if the name is taken.

        Raises:
            RunError: the root cannot be written.
        """
        if not str(root):
            raise RunError("expected the name of a folder for runs, got ''")
        root = Path(root)
        with file_errors(root, "cannot make a folder for runs here"):
            root.mkdir(parents=True, exist_ok=True)
        path = root / name
        lock = _claim(path)
        # Other flights of this second may have the name already
        attempt = 1
        while lock is None:
            attempt += 1
            path = root / f"{name}-{attempt}"
            lock = _claim(path)
        return cls(path, lock)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        # After `finish` there is no .part; one with files in it is kept
        with suppress(OSError):
            self.part.rmdir()
        os.close(self._lock)

    def drop(self) -> None:
        """Remove the files that are written so far."""
        shutil.rmtree(self.part, ignore_errors=True)

    def finish(self) -> Path:
        """Give the folder its name without `.part`, and return it. Raises RunError."""
        with file_errors(self.path, "cannot finish the folder"):
            self.part.rename(self.path)
        return self.path


def write_run(folder: Path, run: RecordedRun, flown_by: dict[str, Any]) -> None:
    """Write the files of a run into a folder.

    Args:
        folder: an existing folder.
        run: the run.
        flown_by: provenance of the process that flew.

    Raises:
        RunError: a file cannot be written, for example because the disk is full.
    """
    write_whole(folder / "telemetry.npz", write_npz(run))
    write_whole(folder / "events.csv", write_csv(run))
    write_whole(folder / "run.json", write_json(run, flown_by))


class RunFolder:
    """The folder of one run, used as `with RunFolder.open(root, spec) as folder: ...`.

    `folder.save(run)` writes the run. A folder in which no run was saved is removed.
    """

    def __init__(self, claimed: ClaimedFolder, flown_by: dict[str, Any] | None = None):
        """Use a claimed folder; for `flown_by` see `open`."""
        self._claimed = claimed
        # Read now: it is about the code that is about to fly
        self._provenance = flown_by or provenance()

    @classmethod
    def open(
        cls, root: str | Path, spec: dict[str, Any], flown_by: dict[str, Any] | None = None
    ) -> RunFolder:
        """Return a folder that is claimed before the flight.

        Args:
            root: folder of runs.
            spec: the spec of the flight.
            flown_by: provenance of a flight that another process flew.

        Raises:
            RunError: the root cannot be written.
        """
        return cls(ClaimedFolder.open(root, run_name(spec)), flown_by)

    @property
    def path(self) -> Path:
        """The folder's name once it is finished."""
        return self._claimed.path

    @property
    def part(self) -> Path:
        """The folder's name until it is finished."""
        return self._claimed.part

    def __enter__(self) -> RunFolder:
        return self

    def __exit__(self, *exception: object) -> None:
        self._claimed.__exit__(*exception)

    def save(self, run: RecordedRun) -> Path:
        """Write the run, remove `.part` from the folder's name, and return its path.

        Raises:
            RunError: a file cannot be written; the files written so far are removed.
        """
        self.write(run)
        return self.finish()

    def write(self, run: RecordedRun) -> None:
        """Write all files; the folder keeps its name with `.part`.

        Raises:
            RunError: see `save`.
        """
        try:
            write_run(self.part, run, self._provenance)
        except RunError:
            self.drop()
            raise

    def drop(self) -> None:
        """Remove the files that are written so far."""
        self._claimed.drop()

    def finish(self) -> Path:
        """Give the folder its name without `.part`, and return it. Raises RunError."""
        return self._claimed.finish()


def remove_unfinished(root: str | Path, complete: Callable[[str], bool] | None = None) -> None:
    """Remove the `.part` folders of killed flights, whose lock no process holds.

    Args:
        root: folder of runs.
        complete: function that returns whether the folder of a name is known to be complete. Such a
            folder is not removed, but renamed.
    """
    for part in Path(root).glob(f"{STARTED}*{PART}"):
        with suppress(OSError):
            handle = lock_folder(part)
            try:
                name = part.name.removesuffix(PART)
                if complete and complete(name):
                    part.rename(part.with_name(name))
                else:
                    shutil.rmtree(part)
            finally:
                os.close(handle)


def run_name(spec: dict[str, Any]) -> str:
    """Return `<UTC>_<course>_<flown by>_s<seed>_<hash>`, see `flown_by`.

    The hash is the first 8 hex digits of the sha256 of the settings that decide the flight.
    """
    utc = time.strftime("%Y%m%dT%H%M%SZ", time.gmtime())
    names = (spec["course"]["name"], flown_by(spec), spec["seed"])
    course, flown, seed = (re.sub(r"[^\w.-]+", "-", str(name)) for name in names)
    decided = sha256(canonical(hostless(spec))).hexdigest()
    return f"{utc}_{course}_{flown}_s{seed}_{decided[:8]}"


def list_runs(root: str | Path) -> list[Path]:
    """Return the finished run folders, oldest first."""
    folders = [file.parent for file in Path(root).glob("*/run.json")]
    return sorted(folder for folder in folders if not folder.name.endswith(PART))


def find_run(wanted: str, root: str) -> Path:
    """Return the folder of a run.

    Args:
        wanted: path of a folder, a part of the name of a run, or "last".
        root: folder of runs.

    Raises:
        RunError: no run or several runs fit, or the folder holds a race of several vehicles.
    """
    if (Path(wanted) / HEAT).exists():
        raise _a_heat(Path(wanted))
    if os.sep in wanted or (Path(wanted) / "run.json").exists():
        return Path(wanted)
    runs = list_runs(root)
    heats = list_heats(root)
    if not runs and not heats:
        raise RunError(f"no runs in {root!r}: fly one, or give --runs-dir")
    if wanted == "last":
        last = max([*runs, *heats], key=written_at)
        if last in heats:
            raise _a_heat(last)
        return last
    fits = [run for run in runs if wanted in run.name]
    if len(fits) == 1:
        return fits[0]
    if not fits:
        for heat in heats:
            if wanted in heat.name:
                raise _a_heat(heat)
        if not runs:
            raise RunError(f"no run {wanted!r} in {root!r}, which has races of several alone")
        raise RunError(
            f"no run {wanted!r} in {root!r}: expected a folder, part of a name or 'last'; "
            f"the last is {runs[-1].name}"
        )
    names = ", ".join(run.name for run in fits[-LISTED:])
    more = ", ..." if len(fits) > LISTED else ""
    raise RunError(f"{wanted!r} fits {len(fits)} runs, expected one: {names}{more}")


def read_run(path: str | Path) -> RecordedRun:
    """Return a stored run, equal to the last bit.

    Raises:
        RunError: the folder is missing, unfinished, damaged, or was changed after the flight.
    """
    path = Path(path)
    if path.name.endswith(PART):
        raise RunError(f"{path}: a flight that was never written to its end (.part); fly it again")
    if not path.is_dir():
        found = "a file" if path.exists() else "nothing"
        raise RunError(f"{path}: expected a run folder, found {found}")
    record = read_json(_read(path / "run.json"), path / "run.json")
    late = record.learned_delay
    stored = _read(path / "telemetry.npz")
    arrays = read_npz(stored, record.spec, path / "telemetry.npz")
    run = RecordedRun(
        spec=record.spec,
        telemetry=arrays.telemetry,
        events=record.events,
        outcome=record.outcome,
        fault=record.fault,
        learned=tuple(LearnedRotor(r.rotor, r.share, r.since) for r in record.learned),
        learned_delay=LearnedDelay(late.delay, late.since) if late else None,
        wall={"plan_ms": record.plan_ms, "real_time_factor": record.real_time_factor},
        snapshots=arrays.snapshots,
        measurements=arrays.measurements,
    )
    if _digest(run) != record.digest:
        raise RunError(
            f"{path}: run.json and telemetry.npz do not give the stored digest; "
            "changed after the flight"
        )
    return run


def _digest(run: RecordedRun) -> str | None:
    """Return the digest of a run, None if its laps do not fit or its spec has a nan."""
    try:
        return run.digest()
    except (KeyError, ValueError):
        return None


def written_at(folder: Path) -> float:
    """Return the time at which a run or a heat was written [s since 1970].

    It orders runs whose names have the same second.
    """
    file = folder / HEAT
    return (file if file.exists() else folder / "run.json").stat().st_mtime


def list_heats(root: str | Path) -> list[Path]:
    """Return the folders of complete races of several vehicles, oldest first."""
    folders = [file.parent for file in Path(root).glob(f"*/{HEAT}")]
    return sorted(folder for folder in folders if not folder.name.endswith(PART))


def _a_heat(folder: Path) -> RunError:
    """Return the error that a folder holds a race of several vehicles rather than one run."""
    runs = sorted(file.parent.name for file in folder.glob("*/run.json"))
    named = f"name one of its runs, such as {folder / runs[0]}, or " if runs else ""
    return RunError(
        f"{folder} is a race of several vehicles: {named}use race heat --from or quadsim.load_heat"
    )


def _part_of(path: Path) -> Path:
    """Return the path of a folder until it is finished."""
    return path.with_name(path.name + PART)


def _claim(path: Path) -> int | None:
    """Make the `.part` folder of a name and return the handle of its lock, None if it is taken.

    A name belongs to the flight that made its `.part` folder and holds the lock.
    """
    part = _part_of(path)
    with file_errors(part, "cannot make a run folder"):
        try:
            part.mkdir()
        except FileExistsError:
            return None
        # Another flight of this second has just finished
        if path.exists():
            part.rmdir()
            return None
        try:
            return lock_folder(part)
        except (FileNotFoundError, BlockingIOError):
            # Another process has just taken it for unfinished
            return None
        except OSError:
            # On a file system without locks, nothing is taken for unfinished
            return os.open(part, os.O_RDONLY)


def _read(path: Path) -> bytes:
    """Return the content of a regular file. Raises RunError."""
    try:
        return read_bytes(path, "a file of a run")
    except FileError as error:
        raise RunError(f"{error}") from None
