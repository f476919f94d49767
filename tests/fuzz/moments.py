"""SIGKILL and a full disk at seeded random moments: nothing lost, nothing twice, nothing left behind, and the same
command goes on.

python -m tests.fuzz.moments --moments 20 fly compare tune paper export

Each command runs once undisturbed; where it is disturbed and started again it must end with the same flights and the
same files. A disk is a tmpfs with a random part of the room that the command needs; where none may be mounted, full
disks are skipped. Exit code 1 if anything failed.
"""

from __future__ import annotations

import argparse
import json
import random
import re
import shutil
import signal
import sqlite3
import subprocess
import sys
import tempfile
import time
import zipfile
from collections import Counter
from collections.abc import Iterator
from contextlib import closing, contextmanager, suppress
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path

from tests.fuzz.started import Started, start

NEAR = """
opening: [1.6, 1.6]
start: {position: [0, 0, 1.5], yaw_deg: 0}
gates:
  - {position: [1.5, 0, 1.5], yaw_deg: 0}
"""
SMALL = ("--samples", "128", "--horizon", "20", "--iterations", "1", "--jobs", "1", "--timeout")
OLD = b"an older file, whole"
ROOM = 64 << 20  # [bytes] that suffice for every command
PAGE = 4096  # the smallest part of a tmpfs [bytes]
ENDS = 20.0  # [s] within which the workers of a killed command end
COMMAND_MODULES = ("fly", "campaign.compare", "campaign.tune", "paper.table1")
LIBRARIES = ("controllers.rollout.lanes", "pybullet", "matplotlib.figure", "web.page.export", "optuna")
LOADED = (*(f"quadsim.app.{name}" for name in COMMAND_MODULES), *LIBRARIES)
COMMANDS: dict[str, tuple[str, ...]] = {
    "fly": ("fly", "paper_flat", *SMALL[:-3], "--timeout", ".3"),
    "compare": ("compare", "near.yaml", *SMALL, ".2", "--attempts", "3", "--out", "report"),
    "tune": ("tune", "near.yaml", *SMALL, "2", "--trials", "2", "--attempts", "1", "--floor", "0", "--search", "sigma"),
    "paper": ("paper", "offroad", "--runs", "2"),
    "export": ("export", "last", "--csv", "--out", "old"),
}


@dataclass(frozen=True)
class State:
    """What a command has left in its folder."""

    files: Counter  # names without what differs from flight to flight
    rows: dict[tuple, str]  # (variant, seed) -> digest of each attempt kept
    twice: list[tuple]  # attempts that are there more than once
    loose: list[str]  # folders of telemetry without a row, rows without a folder
    trials: int

    @classmethod
    def of(cls, folder: Path) -> State:
        rows = [row for path in folder.rglob("*.sqlite") for row in _rows(path)]
        counts = Counter(row[:2] for row in rows)
        named = {str(path.parent / row[2]) for path in folder.rglob("*.sqlite") for row in _rows(path) if row[2]}
        there = {str(p) for flights in folder.rglob("*.flights") for p in flights.iterdir()}
        return cls(
            files=Counter(_general(p.relative_to(folder)) for p in folder.rglob("*") if p.is_file()),
            rows={row[:2]: row[3] for row in rows},
            twice=[row for row, n in counts.items() if n > 1],
            loose=sorted(named ^ there),
            trials=sum(p.read_text().count('"state":1') for p in folder.rglob("*.journal")),
        )


def _rows(path: Path) -> list[tuple]:
    try:
        with closing(sqlite3.connect(path)) as db:
            found = db.execute("SELECT variant, seed, folder, result FROM attempts").fetchall()
    except sqlite3.OperationalError:  # no table yet
        return []
    return [(variant, seed, folder, json.loads(result)["digest"]) for variant, seed, folder, result in found]


def _general(path: Path) -> str:
    """Its time and hashes differ from flight to flight; SQLite's own two files come and go with its readers."""
    name = re.sub(r"\d{8}T\d{6}Z_", "", str(path))
    return re.sub(r"\.sqlite-(wal|shm)$", ".sqlite", name) if name.endswith((".sqlite-wal", ".sqlite-shm")) else name


def prepare(command: str, folder: Path, stored: Path | None) -> None:
    (folder / "near.yaml").write_text(NEAR)
    if command == "export" and stored:
        shutil.copytree(stored, folder / "runs" / stored.name)
        (folder / "old").write_bytes(OLD)


def run(command: str, folder: Path) -> Started:
    return start(COMMANDS[command], folder, smaller if command == "paper" else None)


def smaller() -> None:
    """The paper's experiment with a small planner and for a moment only."""
    from functools import partial
    from types import SimpleNamespace

    from quadsim.app.paper import table1

    of = partial(table1.Spec.of, samples=128, horizon=20, iterations=1, timeout=0.3)
    table1.Spec = SimpleNamespace(of=of)


@dataclass(frozen=True)
class Reference:
    """The command undisturbed."""

    code: int
    state: State
    seconds: float
    room: int  # [bytes] that it needs
    before: int  # [bytes] that are there before it begins

    @classmethod
    def of(cls, command: str, stored: Path | None) -> Reference:
        with _folder() as folder:
            prepare(command, folder, stored)
            before, began = _room(folder), time.monotonic()
            code, _, err = run(command, folder).finish()
            assert code in (0, 1), err
            return cls(code, State.of(folder), time.monotonic() - began, _room(folder), before)


def kill(command: str, at: random.Random, stored: Path | None, undisturbed: Reference) -> str:
    """What is wrong after SIGKILL at a random moment and the same command again, or ""."""
    with _folder() as folder:
        prepare(command, folder, stored)
        started = run(command, folder)
        time.sleep(at.uniform(0.0, undisturbed.seconds))
        started.kill()
        if not started.gone(ENDS):
            return "its workers live on"
        return _half(folder) or _goes_on(command, folder, undisturbed)


def full_disk(command: str, at: random.Random, stored: Path | None, undisturbed: Reference) -> str:
    """The same on a disk that has only a part of the room that the command needs."""
    with _folder() as folder:
        size = undisturbed.before + PAGE + int(at.random() * (undisturbed.room - undisturbed.before))
        _mount(folder, size)
        try:
            prepare(command, folder, stored)
            code, _, err = run(command, folder).finish()
            last = err.rstrip().rpartition("\n")[2]
            if "Traceback" in err or code not in (2, undisturbed.code):
                return f"exit code {code}: {last}"
            if code == 2 and not re.search(r"^race .*(No space left|disk is full|disk I/O error)", last):
                return f"does not say that the disk is full: {last}"
            _mount(folder, ROOM, "remount,")
            return _half(folder) or _goes_on(command, folder, undisturbed)
        finally:
            subprocess.run(["umount", "-l", str(folder)], check=True)


def _goes_on(command: str, folder: Path, undisturbed: Reference) -> str:
    kept = State.of(folder)
    code, _, err = run(command, folder).finish()
    if code != undisturbed.code or "Traceback" in err:
        return f"does not go on: exit code {code}: {err.rstrip()[-200:]}"
    now, wanted = State.of(folder), undisturbed.state
    if now.twice or now.loose:
        return f"twice {now.twice}, loose {now.loose}"
    if not kept.rows.items() <= now.rows.items():
        return "an attempt that was kept is lost"
    if command != "tune" and now.rows != wanted.rows:  # a search that is stopped may propose others
        return f"attempts: {len(now.rows)} kept, expected {len(wanted.rows)}"
    if now.trials != wanted.trials:
        return f"{now.trials} trials, expected {wanted.trials}"
    return _left_behind(command, now.files, wanted.files)


def _left_behind(command: str, files: Counter, wanted: Counter) -> str:
    """A flight that was kept just before the kill is there twice; a search that was stopped may propose others."""
    runs = re.compile(r"(^runs|\.flights)/[^/]+/(run|telemetry|events)\.[a-z]+$")
    more = {name for name in files - wanted if not runs.search(name)}
    missing = {name for name in wanted - files if command != "tune" or not runs.search(name)}
    return f"left behind {sorted(more)}, missing {sorted(missing)}" if more or missing else ""


def _half(folder: Path) -> str:
    """What looks finished and is not."""
    for path in folder.rglob("run.json"):
        if not path.parent.name.endswith(".part"):
            try:
                json.loads(path.read_text())
                zipfile.ZipFile(path.with_name("telemetry.npz")).testzip()
            except (ValueError, OSError, zipfile.BadZipFile) as error:
                return f"half a run: {path}: {error}"
    for path in folder.rglob("*.csv"):
        if not path.parent.parent.name.endswith((".flights", "runs")) and not path.read_bytes().endswith(b"\r\n"):
            return f"half a file: {path}"
    old = folder / "old"
    if old.exists() and old.read_bytes() != OLD and not old.read_bytes().endswith(b"\r\n"):
        return "the older file is damaged"
    return ""


def _room(folder: Path) -> int:
    """Whole pages of all files, and one for every folder [bytes]."""
    return sum(-(-max(p.stat().st_size, 1) // PAGE) * PAGE for p in folder.rglob("*"))


@contextmanager
def _folder() -> Iterator[Path]:
    path = Path(tempfile.mkdtemp(prefix="quadsim-moment-"))
    try:
        yield path
    finally:
        shutil.rmtree(path, ignore_errors=True)


def _mount(folder: Path, size: int, how: str = "") -> None:
    subprocess.run(["mount", "-t", "tmpfs", "-o", f"{how}size={size}", "tmpfs", str(folder)], check=True)


def _may_mount() -> bool:
    with _folder() as folder, suppress(subprocess.CalledProcessError, FileNotFoundError):
        _mount(folder, PAGE)
        subprocess.run(["umount", str(folder)], check=True)
        return True
    return False


def main() -> int:
    ask = argparse.ArgumentParser(prog="python -m tests.fuzz.moments", description=__doc__)
    ask.add_argument("commands", nargs="*", default=list(COMMANDS))
    ask.add_argument("--moments", type=int, default=3, help="of each kind for each command")
    ask.add_argument("--seed", type=int, default=0)
    said = ask.parse_args()
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    for module in LOADED:
        import_module(module)
    ways = {"kill": kill} | ({"full disk": full_disk} if _may_mount() else {})
    if len(ways) == 1:
        print("full disks are skipped: no file system may be mounted here (root may, and `unshare -rm python -m ...`)")
    failed = 0
    with _folder() as folder:
        run("fly", folder).finish()
        stored = next((folder / "runs").iterdir())
        for command in said.commands:
            undisturbed = Reference.of(command, stored)
            for way, disturb in ways.items():
                wrong = []
                for i in range(said.moments):
                    if problem := disturb(
                        command, random.Random(f"{said.seed} {command} {way} {i}"), stored, undisturbed
                    ):
                        wrong.append(f"    moment {i}, seed {said.seed}: {problem}")
                print(
                    f"{command:<8} {way:<10} {said.moments} moments, {len(wrong)} failed", *wrong, sep="\n", flush=True
                )
                failed += len(wrong)
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
