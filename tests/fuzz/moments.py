"""SIGKILL and a full disk at seeded random moments: nothing lost, nothing twice, nothing left
behind, and the same command goes on.

python -m tests.fuzz.moments --moments 20 fly compare tune paper export

Each command runs once undisturbed; where it is disturbed and started again it must end with the
same flights and the same files. A disk is a tmpfs with a random part of the room that the command
needs; where none may be mounted, full disks are skipped. Exit code 1 if anything failed.
"""

from __future__ import annotations

import argparse
import random
import re
import signal
import subprocess
import sys
import time
from contextlib import suppress
from importlib import import_module
from pathlib import Path

from tests.fuzz.left import PAGE, State, half, left_behind
from tests.fuzz.undisturbed import COMMANDS, LOADED, Reference, prepare, run, temporary_folder

ROOM = 64 << 20  # [bytes] that suffice for every command
ENDS = 20.0  # [s] within which the workers of a killed command end


def kill(command: str, at: random.Random, stored: Path | None, undisturbed: Reference) -> str:
    """What is wrong after SIGKILL at a random moment and the same command again, or ""."""
    with temporary_folder() as folder:
        prepare(command, folder, stored)
        started = run(command, folder)
        time.sleep(at.uniform(0.0, undisturbed.seconds))
        if not started.kill(ENDS):
            return "its workers live on"
        return half(folder) or _goes_on(command, folder, undisturbed)


def full_disk(command: str, at: random.Random, stored: Path | None, undisturbed: Reference) -> str:
    """The same on a disk that has only a part of the room that the command needs."""
    with temporary_folder() as folder:
        size = (
            undisturbed.before + PAGE + int(at.random() * (undisturbed.room - undisturbed.before))
        )
        _mount(folder, size)
        try:
            prepare(command, folder, stored)
            code, _, err = run(command, folder).finish()
            last = err.rstrip().rpartition("\n")[2]
            if "Traceback" in err or code not in (2, undisturbed.code):
                return f"exit code {code}: {last}"
            if code == 2 and not re.search(
                r"^race .*(No space left|disk is full|disk I/O error)", last
            ):
                return f"does not say that the disk is full: {last}"
            _mount(folder, ROOM, "remount,")
            return half(folder) or _goes_on(command, folder, undisturbed)
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
    if now.rows != wanted.rows:
        return f"attempts: {len(now.rows)} kept, expected {len(wanted.rows)}"
    if now.trials != wanted.trials:
        return f"{now.trials} trials, expected {wanted.trials}"
    return left_behind(now.files, wanted.files)


def _mount(folder: Path, size: int, how: str = "") -> None:
    subprocess.run(
        ["mount", "-t", "tmpfs", "-o", f"{how}size={size}", "tmpfs", str(folder)], check=True
    )


def _may_mount() -> bool:
    with temporary_folder() as folder, suppress(subprocess.CalledProcessError, FileNotFoundError):
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
        print(
            "full disks are skipped: no file system may be mounted here (root may, and `unshare -rm python -m ...`)"
        )
    failed = 0
    with temporary_folder() as folder:
        run("fly", folder).finish()
        stored = next((folder / "runs").iterdir())
        for command in said.commands:
            undisturbed = Reference.of(command, stored)
            for way, disturb in ways.items():
                wrong = []
                for i in range(said.moments):
                    if problem := disturb(
                        command,
                        random.Random(f"{said.seed} {command} {way} {i}"),
                        stored,
                        undisturbed,
                    ):
                        wrong.append(f"    moment {i}, seed {said.seed}: {problem}")
                print(
                    f"{command:<8} {way:<10} {said.moments} moments, {len(wrong)} failed",
                    *wrong,
                    sep="\n",
                    flush=True,
                )
                failed += len(wrong)
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
