"""Damaged compiled code on the disk is never loaded: flights stay the same to the last bit."""

from __future__ import annotations

import json
import random
import shutil
from functools import partial
from pathlib import Path

from tests.fuzz.base import FLIGHTS, SHORT, base, small
from tests.fuzz.damage import damaged_bytes
from tests.fuzz.harness import Case, Outcome

FLIGHT = ("fly", *FLIGHTS[0], *SHORT, "--json")
HERE = {"XDG_CACHE_HOME": "{here}/cache"}


def caches(rng: random.Random) -> Case:
    """Return a case with damaged code of a small function, now and then of a whole planner."""
    seed = rng.randrange(2**32)
    if rng.random() < 0.12:
        prepare = partial(_damage, base().cache, seed)
        return Case(
            "caches",
            f"planner, seed {seed}",
            FLIGHT,
            prepare=prepare,
            after=_same_flight,
            codes=frozenset({0, 1}),
            env=HERE,
        )
    prepare = partial(_damage, base().small_cache, seed)
    return Case(
        "caches",
        f"function, seed {seed}",
        ("cache",),
        prepare=prepare,
        after=_nothing_left,
        codes=frozenset({0}),
        env=HERE,
        call=small,
    )


def _damage(source: Path, seed: int, folder: Path) -> None:
    rng = random.Random(seed)
    shutil.copytree(source, folder / "cache")
    files = sorted((folder / "cache").rglob("*.code"))
    for path in rng.sample(files, min(len(files), rng.choice((1, 1, 2)))):
        kind = rng.random()
        data = path.read_bytes()
        path.unlink()
        if kind < 0.08:
            path.mkdir()
        elif kind < 0.12:
            path.symlink_to("/dev/full")
        else:
            path.write_bytes(damaged_bytes(rng, data))


def _same_flight(_: Path, outcome: Outcome) -> str:
    same = json.loads(outcome.out)["digest"] == base().digest
    return "" if same else "another flight than from whole code"


def _nothing_left(folder: Path, _: Outcome) -> str:
    left = list((folder / "cache").rglob("*.tmp"))
    return f"left behind: {left}" if left else ""
