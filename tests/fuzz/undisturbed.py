"""The commands that are disturbed, each small enough to run in seconds, and what they do
undisturbed."""

from __future__ import annotations

import shutil
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

from tests.fuzz.children import Child, start
from tests.fuzz.left import OLD, State, room

NEAR = """
opening: [1.6, 1.6]
start: {position: [0, 0, 1.5], yaw_deg: 0}
gates:
  - {position: [1.5, 0, 1.5], yaw_deg: 0}
"""
SMALL = ("--samples", "128", "--horizon", "20", "--iterations", "1", "--jobs", "1", "--timeout")
COMMAND_MODULES = ("fly", "campaign.compare", "campaign.tune", "paper")
LIBRARIES = (
    "controllers.lanes.lanes",
    "pybullet",
    "matplotlib.figure",
    "web.page.export",
    "optuna",
)
LOADED = (*(f"quadsim.cli.{name}" for name in COMMAND_MODULES), *LIBRARIES)
COMMANDS: dict[str, tuple[str, ...]] = {
    "fly": ("fly", "paper_flat", *SMALL[:-3], "--timeout", ".3"),
    "compare": ("compare", "near.yaml", *SMALL, ".2", "--attempts", "3", "--out", "report"),
    "tune": (
        "tune",
        "near.yaml",
        *SMALL,
        "2",
        "--trials",
        "2",
        "--attempts",
        "1",
        "--floor",
        "0",
        "--search",
        "sigma",
    ),
    "paper": ("paper", "offroad", "--runs", "2"),
    "export": ("export", "last", "--csv", "--out", "old"),
}


def prepare(command: str, folder: Path, stored: Path | None) -> None:
    (folder / "near.yaml").write_text(NEAR)
    if command == "export" and stored:
        shutil.copytree(stored, folder / "runs" / stored.name)
        (folder / "old").write_bytes(OLD)


def run(command: str, folder: Path) -> Child:
    return start(COMMANDS[command], folder, smaller if command == "paper" else lambda: None)


def smaller() -> None:
    """The paper's experiment with a small planner and for a moment only."""
    from quadsim.paper import offroad

    offroad.CONFIG = replace(offroad.CONFIG, samples=128, horizon=20, iterations=1)
    offroad.COLD = replace(offroad.CONFIG, temperature=0.02)
    offroad.TIMEOUT = 0.3


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
        with temporary_folder() as folder:
            prepare(command, folder, stored)
            before, began = room(folder), time.monotonic()
            code, _, err = run(command, folder).finish()
            assert code in (0, 1), err
            return cls(code, State.of(folder), time.monotonic() - began, room(folder), before)


@contextmanager
def temporary_folder() -> Iterator[Path]:
    path = Path(tempfile.mkdtemp(prefix="quadsim-moment-"))
    try:
        yield path
    finally:
        shutil.rmtree(path, ignore_errors=True)
