"""Stored runs with one damaged file, read by every command that reads runs."""

from __future__ import annotations

import io
import random
import shutil
from functools import partial
from pathlib import Path

import numpy as np

from tests.fuzz.base import base
from tests.fuzz.damage import damaged_bytes, damaged_json
from tests.fuzz.harness import Case

READERS = (
    ("show",), ("show", "--json"), ("plot",), ("export", "--csv"), ("export", "--zip"),
    ("export", "--html"), ("export", "last", "good", "--html", "--out", "two.html"),
)  # fmt: skip

FILES = ("run.json", "run.json", "run.json", "telemetry.npz", "telemetry.npz", "events.csv")


def runs(rng: random.Random) -> Case:
    """Return a case with one damaged file of a run.

    Its readers refuse it with one line, or read the part that was not damaged.
    """
    name = rng.choice(FILES)
    seed = rng.randrange(2**32)
    argv = rng.choice(READERS)
    label = f"{name} damaged by seed {seed}: {' '.join(argv)}"
    return Case("runs", label, argv, partial(_damage_one, name, seed))


def _damage_one(name: str, seed: int, folder: Path) -> None:
    rng = random.Random(seed)
    source = rng.choice(base().runs)
    shutil.copytree(source, folder / "runs" / "good")
    # The command reads the latest run: names begin with the time.
    run = folder / "runs" / f"9{source.name}"
    shutil.copytree(source, run)
    damage(rng, run / name)


def damage(rng: random.Random, path: Path) -> None:
    """Damage one file of a run."""
    name = path.name
    if rng.random() < 0.1:
        path.unlink()
        path.mkdir()
    elif name == "run.json" and rng.random() < 0.85:
        path.write_text(damaged_json(rng, path.read_text()))
    elif name == "telemetry.npz" and rng.random() < 0.5:
        path.write_bytes(_other_arrays(rng, path.read_bytes()))
    else:
        path.write_bytes(damaged_bytes(rng, path.read_bytes()))


def _other_arrays(rng: random.Random, data: bytes) -> bytes:
    """Return a whole npz in which one column is lost, renamed, or of another kind."""
    with np.load(io.BytesIO(data)) as loaded:
        arrays: dict = {k: loaded[k] for k in loaded.files}
    name = rng.choice(sorted(arrays))
    column = arrays.pop(name)
    replacements: list[dict] = [
        {},
        {"x": column},
        {name: column[:-1]},
        {name: column.astype(np.float32)},
        {name: column[None]},
        {name: column * np.nan},
        {name: np.array(["x"] * len(column))},
        {name: column + 1},
        {name: np.zeros(0)},
    ]
    buffer = io.BytesIO()
    np.savez(buffer, **arrays | rng.choice(replacements))
    return buffer.getvalue()
