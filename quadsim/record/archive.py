"""Archive: one folder a run, `<UTC>_<course>_<sampler>_s<seed>_<hash>/` with run.json,
telemetry.npz, events.csv.

It is named `<name>.part` from before the flight until all is on disk: what looks finished is
finished. Its process holds a lock on it, so that the next flight can tell what a killed one left
behind.
"""

from __future__ import annotations

import fcntl
import os
import re
import shutil
import time
from collections.abc import Callable
from contextlib import suppress
from hashlib import sha256
from itertools import count
from pathlib import Path

from quadsim.record.provenance import provenance
from quadsim.record.run import Run, RunError, canonical, hostless
from quadsim.record.run_format import read_json, read_npz, write_csv, write_json, write_npz
from quadsim.record.whole_files import one_line, sync, write_whole

PART = ".part"
STARTED = "[0-9]" * 8 + "T" + "[0-9]" * 6 + "Z_"  # how the name of a run begins


class RunFolder:
    """`with RunFolder.open(root, spec) as folder: ... folder.save(run)`. Leaving without a save
    drops what is empty."""

    def __init__(self, path: Path, lock: int, flown_by: dict | None = None):
        self.path = path  # once finished
        self.part = path.with_name(path.name + PART)
        self._lock = lock  # handle of the .part, locked until this process ends
        self._provenance = flown_by or provenance()  # of the code that is about to fly

    @classmethod
    def open(cls, root: str | Path, spec: dict, flown_by: dict | None = None) -> RunFolder:
        """Claim a folder before the flight: a root that cannot be written is one RunError before
        anything has flown.

        flown_by: provenance of a flight that another process flew.
        """
        name = run_name(spec)
        with one_line(root, "cannot make a folder for runs here"):
            Path(root).mkdir(parents=True, exist_ok=True)
        paths = (
            Path(root) / (name if attempt == 1 else f"{name}-{attempt}") for attempt in count(1)
        )
        path, lock = next((path, lock) for path in paths if (lock := _claim(path)) is not None)
        return cls(path, lock, flown_by)

    def __enter__(self) -> RunFolder:
        return self

    def __exit__(self, *_: object) -> None:
        with suppress(OSError):  # gone after save()
            self.part.rmdir()
        os.close(self._lock)

    def save(self, run: Run) -> Path:
        """Write all, then take `.part` off the name. A full disk is a RunError, and what was
        written is removed."""
        self.write(run)
        return self.finish()

    def write(self, run: Run) -> None:
        """All of it, still under the name that says it is not finished. Raises RunError."""
        try:
            write_whole(self.part / "telemetry.npz", write_npz(run))
            write_whole(self.part / "events.csv", write_csv(run.events))
            write_whole(self.part / "run.json", write_json(run, self._provenance))
            with one_line(self.path, "cannot finish the run folder"):
                sync(self.part)
        except RunError:
            self.drop()
            raise

    def drop(self) -> None:
        """Remove what is written."""
        shutil.rmtree(self.part, ignore_errors=True)

    def finish(self) -> Path:
        """What is written gets its name."""
        with one_line(self.path, "cannot finish the run folder"):
            self.part.rename(self.path)
            sync(self.path.parent)
        return self.path


def remove_unfinished(root: str | Path, kept: Callable[[str], bool] = lambda name: False) -> None:
    """Remove the `.part` folders of flights that were killed: no process holds their lock any more.

    kept: whether the folder of this name is known to be complete; then it gets its name instead.
    """
    for part in Path(root).glob(f"{STARTED}*{PART}"):
        with suppress(OSError):
            handle = _lock(part)
            try:
                if kept(part.name.removesuffix(PART)):
                    part.rename(part.with_suffix(""))
                else:
                    shutil.rmtree(part)
            finally:
                os.close(handle)


def run_name(spec: dict) -> str:
    """<UTC>_<course>_<sampler>_s<seed>_<first 8 hex digits of the sha256 of what decides the
    flight>."""
    utc = time.strftime("%Y%m%dT%H%M%SZ", time.gmtime())
    course, sampler, seed = (
        re.sub(r"[^\w.-]+", "-", str(spec[key])) for key in ("course", "sampler", "seed")
    )
    return f"{utc}_{course}_{sampler}_s{seed}_{sha256(canonical(hostless(spec))).hexdigest()[:8]}"


def list_runs(root: str | Path) -> list[Path]:
    """Finished run folders, oldest first."""
    return sorted(
        p.parent for p in Path(root).glob("*/run.json") if not p.parent.name.endswith(PART)
    )


def find_run(wanted: str, root: str) -> Path:
    """The run's folder. Raises RunError where none or several fit."""
    if os.sep in wanted or (Path(wanted) / "run.json").exists():
        return Path(wanted)
    runs = list_runs(root)
    if not runs:
        raise RunError(f"no runs in {root!r}: fly one, or say --runs-dir")
    if wanted == "last":
        return max(runs, key=lambda run: (run / "run.json").stat().st_mtime)
    fits = [run for run in runs if wanted in run.name]
    if len(fits) == 1:
        return fits[0]
    if not fits:
        raise RunError(
            f"no run {wanted!r} in {root!r}: expected a folder, part of a name or 'last'; the last is {runs[-1].name}"
        )
    names = ", ".join(run.name for run in fits[-3:])
    raise RunError(
        f"{wanted!r} fits {len(fits)} runs, expected one: {names}{', ...' if len(fits) > 3 else ''}"
    )


def load_run(path: str | Path) -> Run:
    """What was saved, to the last bit, or a RunError."""
    path = Path(path)
    if path.name.endswith(PART):
        raise RunError(f"{path}: a flight that was never written to its end (.part); fly it again")
    if not path.is_dir():
        raise RunError(
            f"{path}: expected a run folder, found {'a file' if path.exists() else 'nothing'}"
        )
    record = read_json(_read(path / "run.json"), path / "run.json")
    telemetry, snapshots = read_npz(
        _read(path / "telemetry.npz"), record.spec, path / "telemetry.npz"
    )
    wall = {"plan_ms": record.plan_ms, "real_time_factor": record.real_time_factor}
    run = Run(record.spec, telemetry, record.events, record.outcome, wall, snapshots)
    if _digest(run) != record.digest:
        raise RunError(
            f"{path}: run.json and telemetry.npz do not give the stored digest; changed after the flight"
        )
    return run


def _digest(run: Run) -> str | None:
    try:
        return run.digest()
    except (KeyError, ValueError):  # laps that no event ends, numbers that are none
        return None


def _claim(path: Path) -> int | None:
    """Where the name was free, it belongs to the flight that makes the .part and holds its lock: a
    handle."""
    part = path.with_name(path.name + PART)
    with one_line(part, "cannot make a run folder"):
        try:
            part.mkdir()
        except FileExistsError:
            return None
        if path.exists():  # another flight of this second has just finished
            part.rmdir()
            return None
        try:
            return _lock(part)
        # another process has just taken it for unfinished
        except (FileNotFoundError, BlockingIOError):
            return None
        except OSError:  # a file system without locks, where nothing is taken for unfinished
            return os.open(part, os.O_RDONLY)


def _lock(folder: Path) -> int:
    """A handle that holds the folder's lock. Raises OSError; BlockingIOError where another process
    has it."""
    handle = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        os.stat(folder)
    except BaseException:
        os.close(handle)
        raise
    return handle


def _read(path: Path) -> bytes:
    with one_line(path, "cannot read"):
        return path.read_bytes()
