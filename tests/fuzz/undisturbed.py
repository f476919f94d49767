"""The commands that are disturbed, each of a few seconds, and what they do undisturbed."""

from __future__ import annotations

import shutil
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from tests.fuzz import learner
from tests.fuzz.children import Child, start
from tests.fuzz.left import OLD, State, room
from tests.fuzz.solutions import faster

NEAR = """
opening: [1.6, 1.6]
start: {position: [0, 0, 1.5], yaw_deg: 0}
gates:
  - {position: [1.5, 0, 1.5], yaw_deg: 0}
"""
PLANNER = ("--samples", "128", "--horizon", "20", "--iterations", "1")
CAMPAIGN = ("near.yaml", *PLANNER, "--jobs", "1")
SEARCH = ("--trials", "2", "--attempts", "1", "--floor", "0", "--search", "sigma")
# The file of a training's pilot
PILOT = "p.npz"
TRAINING = (
    "near.yaml",
    *("--out", PILOT, "--environments", "64", "--hidden", "8"),
    *("--flights", "1", "--randomize", "0"),
)
COMMANDS: dict[str, tuple[str, ...]] = {
    "fly": ("fly", "paper_flat", *PLANNER, "--timeout", ".3"),
    "compare": ("compare", *CAMPAIGN, "--timeout", ".2", "--attempts", "3", "--out", "report"),
    "tune": ("tune", *CAMPAIGN, "--timeout", "2", *SEARCH),
    "export": ("export", "last", "--csv", "--out", "new.csv"),
    "train": ("train", *TRAINING, "--steps", "65536"),
    "limit": ("limit", "near.yaml", "--nodes", "8"),
}
# A training and a search find this in their folder: an earlier, shorter training, and the solution
# of an earlier search that was slower by this share.
BEGUN = ("train", *TRAINING, "--steps", "16384")
SLOWER = 0.05
LIBRARIES = (
    "quadsim.controllers.lanes.lanes",
    "pybullet",
    "matplotlib.figure",
    "quadsim.web.page.forms.export",
    "optuna",
    "quadsim.limit.search",
    "quadsim.learn.training",
)


def prepare(command: str, folder: Path, stored: Path | None) -> None:
    """Make the files that a command reads."""
    (folder / "near.yaml").write_text(NEAR)
    if command == "export" and stored:
        shutil.copytree(stored, folder / "runs" / stored.name)
        (folder / "old").write_bytes(OLD)
    if command in ("train", "limit"):
        for name, data in earlier(command).items():
            path = folder / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(data)


@cache
def earlier(command: str) -> dict[str, bytes]:
    """Return the files of an earlier training or search by their names."""
    with temporary_folder() as folder:
        (folder / "near.yaml").write_text(NEAR)
        argv = BEGUN if command == "train" else COMMANDS[command]
        code, _, err = _start(argv, folder).finish()
        assert code == 0, err
        (folder / "near.yaml").unlink()
        # a picture is drawn at the end only
        found = [path for path in folder.rglob("*.npz") if path.is_file()]
        if command == "limit":
            for path in found:
                path.write_bytes(faster(path, -SLOWER))
        return {str(path.relative_to(folder)): path.read_bytes() for path in found}


def run(command: str, folder: Path) -> Child:
    """Start a command."""
    return _start(COMMANDS[command], folder)


def _start(argv: tuple[str, ...], folder: Path) -> Child:
    """Start `race`, with a learner that takes no time."""
    return start(argv, folder, call=learner.train if argv[0] == "train" else None)


@dataclass(frozen=True)
class Reference:
    """A command undisturbed."""

    code: int
    state: State
    seconds: float
    room: int  # [bytes] that it needs
    before: int  # [bytes] that are there before it begins
    begun: State  # what is there before it begins

    @classmethod
    def of(cls, command: str, stored: Path | None) -> Reference:
        """Run a command to its end."""
        with temporary_folder() as folder:
            prepare(command, folder, stored)
            before = room(folder)
            begun = State.of(folder)
            began = time.monotonic()
            code, _, err = run(command, folder).finish()
            seconds = time.monotonic() - began
            assert code in (0, 1), err
            # A file that is replaced is there twice for a moment
            largest = max(path.stat().st_size for path in folder.rglob("*"))
            return cls(
                code=code,
                state=State.of(folder),
                seconds=seconds,
                room=room(folder) + largest,
                before=before,
                begun=begun,
            )


@contextmanager
def temporary_folder() -> Iterator[Path]:
    """Yield a new folder, which is removed in the end."""
    path = Path(tempfile.mkdtemp(prefix="quadsim-moment-"))
    try:
        yield path
    finally:
        shutil.rmtree(path, ignore_errors=True)
