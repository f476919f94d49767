"""The commands that are disturbed, each of a few seconds, and what they do undisturbed."""

from __future__ import annotations

import shutil
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from tests.fuzz.children import Child, start
from tests.fuzz.left import OLD, State, room

NEAR = """
opening: [1.6, 1.6]
start: {position: [0, 0, 1.5], yaw_deg: 0}
gates:
  - {position: [1.5, 0, 1.5], yaw_deg: 0}
"""
PLANNER = ("--samples", "128", "--horizon", "20", "--iterations", "1")
CAMPAIGN = ("near.yaml", *PLANNER, "--jobs", "1")
SEARCH = ("--trials", "2", "--attempts", "1", "--floor", "0", "--search", "sigma")
COMMANDS: dict[str, tuple[str, ...]] = {
    "fly": ("fly", "paper_flat", *PLANNER, "--timeout", ".3"),
    "compare": ("compare", *CAMPAIGN, "--timeout", ".2", "--attempts", "3", "--out", "report"),
    "tune": ("tune", *CAMPAIGN, "--timeout", "2", *SEARCH),
    "export": ("export", "last", "--csv", "--out", "old"),
}
LIBRARIES = (
    "controllers.lanes.lanes",
    "pybullet",
    "matplotlib.figure",
    "web.page.export",
    "optuna",
)


def prepare(command: str, folder: Path, stored: Path | None) -> None:
    """Make the files that a command reads."""
    (folder / "near.yaml").write_text(NEAR)
    if command == "export" and stored:
        shutil.copytree(stored, folder / "runs" / stored.name)
        (folder / "old").write_bytes(OLD)


def run(command: str, folder: Path) -> Child:
    """Start a command."""
    return start(COMMANDS[command], folder)


@dataclass(frozen=True)
class Reference:
    """A command undisturbed."""

    code: int
    state: State
    seconds: float
    room: int  # [bytes] that it needs
    before: int  # [bytes] that are there before it begins

    @classmethod
    def of(cls, command: str, stored: Path | None) -> Reference:
        """Run a command to its end."""
        with temporary_folder() as folder:
            prepare(command, folder, stored)
            before = room(folder)
            began = time.monotonic()
            code, _, err = run(command, folder).finish()
            seconds = time.monotonic() - began
            assert code in (0, 1), err
            return cls(code, State.of(folder), seconds, room(folder), before)


@contextmanager
def temporary_folder() -> Iterator[Path]:
    """Yield a new folder, which is removed in the end."""
    path = Path(tempfile.mkdtemp(prefix="quadsim-moment-"))
    try:
        yield path
    finally:
        shutil.rmtree(path, ignore_errors=True)
