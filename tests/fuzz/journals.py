"""The journal of a search with damage: the same command goes on, or one line names file and
line."""

from __future__ import annotations

import random
import shutil
from functools import partial
from pathlib import Path

from tests.fuzz.base import TUNE, campaign_base
from tests.fuzz.damage import damaged_bytes, damaged_json
from tests.fuzz.harness import Case


def journals(rng: random.Random) -> Case:
    seed = rng.randrange(2**32)
    return Case("journals", f"seed {seed}: {' '.join(TUNE)}", TUNE, partial(_damage, seed))


def _damage(seed: int, folder: Path) -> None:
    """A torn tail, as of a full disk; a line that is no JSON, or other JSON; other bytes."""
    rng = random.Random(seed)
    shutil.copytree(campaign_base().campaign, folder / "campaigns")
    path = folder / "campaigns" / "race.journal"
    data = path.read_bytes()
    kind = rng.random()
    if kind < 0.4:
        path.write_bytes(data[: rng.randrange(len(data))])
    elif kind < 0.7:
        lines = data.decode().splitlines()
        i = rng.randrange(len(lines))
        lines[i] = damaged_json(rng, lines[i])
        path.write_text("\n".join(lines) + "\n")
    else:
        path.write_bytes(damaged_bytes(rng, data))
