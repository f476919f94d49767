"""Stored runs with damage in one of their files, read by every command that reads runs."""

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
    ("show",), ("show", "--json"), ("plot",), ("export", "--csv"), ("export", "--zip"), ("export", "--html"),
    ("export", "last", "good", "--html", "--out", "two.html"),
)  # fmt: skip


def runs(rng: random.Random) -> Case:
    """A run with one damaged file: its readers refuse it with one line, or read what was not
    damaged."""
    name = rng.choice(
        ("run.json", "run.json", "run.json", "telemetry.npz", "telemetry.npz", "events.csv")
    )
    seed, argv = rng.randrange(2**32), rng.choice(READERS)
    return Case(
        "runs",
        f"{name} damaged by seed {seed}: {' '.join(argv)}",
        argv,
        partial(_damage, name, seed),
    )


def _damage(name: str, seed: int, folder: Path) -> None:
    rng = random.Random(seed)
    source = rng.choice(base().runs)
    shutil.copytree(source, folder / "runs" / "good")
    run = folder / "runs" / f"9{source.name}"  # the last by its time too
    shutil.copytree(source, run)
    path = run / name
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
    """A whole npz with one column lost, renamed, of another length, type, shape or of other
    numbers."""
    with np.load(io.BytesIO(data)) as loaded:
        arrays: dict = {k: loaded[k] for k in loaded.files}
    name = rng.choice(sorted(arrays))
    column = arrays.pop(name)
    made = (
        dict, lambda: {"x": column}, lambda: {name: column[:-1]}, lambda: {name: column.astype(np.float32)},
        lambda: {name: column[None]}, lambda: {name: column * np.nan}, lambda: {name: np.array(["x"] * len(column))},
        lambda: {name: column + 1}, lambda: {name: np.zeros(0)},
    )  # fmt: skip
    buffer = io.BytesIO()
    np.savez(buffer, **arrays | rng.choice(made)())
    return buffer.getvalue()
