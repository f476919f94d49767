"""Damaged checkpoints, from which `race train` goes on."""

from __future__ import annotations

import random
import shutil
from functools import cache, partial
from pathlib import Path

from tests.fuzz.arrays import damage_place, damaged_npz
from tests.fuzz.base import base
from tests.fuzz.harness import Case, Outcome, forked
from tests.fuzz.learner import train
from tests.fuzz.pilots import sound

NEAR = """
opening: [1.6, 1.6]
start: {position: [0, 0, 1.5], yaw_deg: 0}
gates:
  - {position: [1.5, 0, 1.5], yaw_deg: 0}
"""
SIZES = ("--environments", "64", "--hidden", "8", "--flights", "1", "--randomize", "0")
BEGUN = ("train", "near.yaml", "--out", "p.npz", *SIZES, "--steps", "8192")
GOES_ON = (*BEGUN[:-1], "12288")
CHECKPOINT = "p.checkpoint.npz"


def checkpoints(rng: random.Random) -> Case:
    """Return a case with a training that goes on from a damaged checkpoint.

    It is refused with one line, and both files stay as they are; or the training ends.
    """
    seed = rng.randrange(2**32)
    label = f"checkpoint damaged by seed {seed}: {' '.join(GOES_ON)}"
    prepare = partial(_prepare, seed)
    return Case("checkpoints", label, GOES_ON, prepare, partial(_stays, seed), call=train)


@cache
def begun() -> Path:
    """Return the folder of a training that has ended."""
    folder = base().folder / "training"
    folder.mkdir()
    (folder / "near.yaml").write_text(NEAR)
    outcome = forked(Case("base", "", BEGUN, call=train), folder, patience=10)
    assert outcome.code == 0, outcome
    return folder


def _prepare(seed: int, folder: Path) -> None:
    for path in begun().iterdir():
        if path.name != CHECKPOINT:
            shutil.copy(path, folder)
    damage_place(random.Random(f"place {seed}"), folder / CHECKPOINT, _damaged(seed))


def _damaged(seed: int) -> bytes:
    data = (begun() / CHECKPOINT).read_bytes()
    return damaged_npz(random.Random(seed), data, "state")


def _stays(seed: int, folder: Path, outcome: Outcome) -> str:
    """Claim what pilots claim, and that what was refused is still there."""
    problem = sound(folder, outcome)
    if problem or outcome.code == 0:
        return problem
    checkpoint = folder / CHECKPOINT
    is_whole = not checkpoint.is_symlink() and checkpoint.is_file()
    if is_whole and checkpoint.read_bytes() != _damaged(seed):
        return "the checkpoint that was refused has changed"
    if (folder / "p.npz").read_bytes() != (begun() / "p.npz").read_bytes():
        return "the pilot has changed"
    return ""
