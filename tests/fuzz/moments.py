"""SIGKILL and a full disk at seeded random moments.

    python -m tests.fuzz.moments --moments 20 fly compare tune export train limit

Each command runs once undisturbed. Where it is disturbed and started again, it must end with the
same flights and the same files: nothing lost, nothing twice, nothing left behind. A disk is a tmpfs
with a random part of the room that the command needs; where none may be mounted, full disks are
skipped. The exit code is 1 if anything failed.
"""

from __future__ import annotations

import argparse
import random
import re
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from importlib import import_module
from math import inf
from pathlib import Path

from quadsim.controllers.learned.pilot import load_pilot
from quadsim.limit.limits import load
from tests.fuzz.flags import commands
from tests.fuzz.left import PAGE, State, half, left_behind
from tests.fuzz.undisturbed import (
    COMMANDS,
    LIBRARIES,
    PILOT,
    Reference,
    prepare,
    run,
    temporary_folder,
)

# [bytes] that suffice for every command.
ROOM = 64 << 20
# [s] within which the workers of a killed command end.
ENDS = 20.0
FULL = re.compile(r"^race .*(No space left|disk is full|disk I/O error)")
# A search whose folder was full names where its solution is.
ELSEWHERE = re.compile(r"is kept as (\S+\.npz)")

Disturbance = Callable[[str, random.Random, Path | None, Reference], str]


def kill(command: str, at: random.Random, stored: Path | None, undisturbed: Reference) -> str:
    """Return what is wrong after SIGKILL at a random moment and the same command again, or ""."""
    with temporary_folder() as folder:
        prepare(command, folder, stored)
        child = run(command, folder)
        time.sleep(at.uniform(0.0, undisturbed.seconds))
        if not child.kill(ENDS):
            return "its workers live on"
        return half(folder) or _continues(command, folder, undisturbed)


def full_disk(command: str, at: random.Random, stored: Path | None, undisturbed: Reference) -> str:
    """Return what is wrong after a full disk, room on it, and the same command again, or ""."""
    with temporary_folder() as folder:
        share = at.random() * (undisturbed.room - undisturbed.before)
        _mount(folder, undisturbed.before + PAGE + int(share))
        try:
            prepare(command, folder, stored)
            code, _, err = run(command, folder).finish()
            last = err.rstrip().rpartition("\n")[2]
            if "Traceback" in err or code not in (2, undisturbed.code):
                return f"exit code {code}: {last}"
            if code == 2 and not FULL.search(last):
                return f"does not tell that the disk is full: {last}"
            elsewhere = ELSEWHERE.search(last)
            if elsewhere:
                kept = load(Path(elsewhere[1]))
                shutil.rmtree(Path(elsewhere[1]).parent)
                if kept.time > 1.01 * min(undisturbed.state.limits.values()):
                    return f"the solution that was found is lost: {last}"
            _mount(folder, ROOM, "remount,")
            return half(folder) or _continues(command, folder, undisturbed)
        finally:
            subprocess.run(["umount", "-l", str(folder)], check=True)


def _continues(command: str, folder: Path, undisturbed: Reference) -> str:
    """Run a disturbed command again. Return what differs from the undisturbed one, or ""."""
    kept = State.of(folder)
    lost = _lost(folder, kept, undisturbed.begun)
    if lost:
        return lost
    if command == "export":
        # Killed after its end; it would not write over its own file
        (folder / "new.csv").unlink(missing_ok=True)
    code, _, err = run(command, folder).finish()
    if code != undisturbed.code or "Traceback" in err:
        return f"does not continue: exit code {code}: {err.rstrip()[-200:]}"
    return _differs(State.of(folder), kept, undisturbed.state)


def _lost(folder: Path, kept: State, begun: State) -> str:
    """Return what was there before a command and is not after it was disturbed, or ""."""
    for name, before in begun.limits.items():
        if kept.limits.get(name, inf) > before:
            return "an earlier solution is lost"
    if kept.learnt[: len(begun.learnt)] != begun.learnt:
        return "an earlier training is lost"
    if begun.learnt and not (folder / PILOT).exists():
        return "an earlier pilot is lost"
    if (folder / PILOT).exists():
        load_pilot(folder / PILOT)
    return ""


def _differs(now: State, kept: State, wanted: State) -> str:
    """Return what differs from an undisturbed command, or "".

    Args:
        now: what there is after the command was started again.
        kept: what there was before that.
        wanted: what an undisturbed command leaves.
    """
    if now.twice or now.loose:
        return f"twice {now.twice}, loose {now.loose}"
    if not kept.rows.items() <= now.rows.items():
        return "an attempt that was kept is lost"
    if now.rows != wanted.rows:
        return f"attempts: {len(now.rows)} kept, expected {len(wanted.rows)}"
    if now.trials != wanted.trials:
        return f"{now.trials} trials, expected {wanted.trials}"
    if now.limits != wanted.limits:
        return f"limits {now.limits}, expected {wanted.limits}"
    if now.learnt != wanted.learnt:
        return f"learnt {now.learnt}, expected {wanted.learnt}"
    return left_behind(now.files, wanted.files)


def _mount(folder: Path, size: int, how: str = "") -> None:
    options = f"{how}size={size}"
    subprocess.run(["mount", "-t", "tmpfs", "-o", options, "tmpfs", str(folder)], check=True)


def _may_mount() -> bool:
    with temporary_folder() as folder, suppress(subprocess.CalledProcessError, FileNotFoundError):
        _mount(folder, PAGE)
        subprocess.run(["umount", str(folder)], check=True)
        return True
    return False


def disturbances() -> dict[str, Disturbance]:
    """Return the ways to disturb a command that are possible here."""
    if _may_mount():
        return {"kill": kill, "full disk": full_disk}
    print("full disks are skipped: only root may mount a file system (or: unshare -rm python ...)")
    return {"kill": kill}


def main() -> int:
    """Disturb the commands. Return the exit code."""
    parser = argparse.ArgumentParser(prog="python -m tests.fuzz.moments", description=__doc__)
    parser.add_argument("commands", nargs="*", default=list(COMMANDS))
    parser.add_argument("--moments", type=int, default=3, help="of each kind for each command")
    parser.add_argument("--seed", type=int, default=0)
    args = parser.parse_args()

    signal.signal(signal.SIGTERM, signal.default_int_handler)
    commands()
    for module in LIBRARIES:
        import_module(module)
    ways = disturbances()
    failed = 0
    with temporary_folder() as folder:
        run("fly", folder).finish()
        stored = next((folder / "runs").iterdir())
        for command in args.commands:
            undisturbed = Reference.of(command, stored)
            for way, disturb in ways.items():
                wrong = []
                for i in range(args.moments):
                    moment = random.Random(f"{args.seed} {command} {way} {i}")
                    problem = disturb(command, moment, stored, undisturbed)
                    if problem:
                        wrong.append(f"    moment {i}, seed {args.seed}: {problem}")
                result = f"{command:<8} {way:<10} {args.moments} moments, {len(wrong)} failed"
                print(result, *wrong, sep="\n", flush=True)
                failed += len(wrong)
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
