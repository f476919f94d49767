"""What is damaged: stored runs, a campaign, a search, compiled code; made once, by undamaged commands."""

from __future__ import annotations

import os
import tempfile
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from tests.fuzz.flags import TINY
from tests.fuzz.harness import Case, forked

SHORT = tuple(word for pair in TINY.items() for word in pair)
FLIGHTS = (("paper_flat", "--sampler", "colored"), ("zigzag",), ("table2",))
CAMPAIGN = ("paper_flat", *SHORT, "--attempts", "2", "--jobs", "1")
COMPARE = ("compare", *CAMPAIGN)
TUNE = ("tune", "paper_flat", *SHORT, "--trials", "2", "--attempts", "1", "--jobs", "1", "--search", "sigma")


@dataclass(frozen=True)
class Base:
    """Folders that cases copy."""

    folder: Path

    @property
    def runs(self) -> list[Path]:
        return sorted((self.folder / "runs").iterdir())

    @property
    def campaign(self) -> Path:
        """With a comparison and a search."""
        return self.folder / "campaigns"


@cache
def base() -> Base:
    folder = Path(os.environ.get("QUADSIM_FUZZ_BASE") or tempfile.mkdtemp(prefix="quadsim-fuzz-base-"))
    for flight in FLIGHTS:
        _do(folder, ("fly", *flight, *SHORT))
    return Base(folder)


@cache
def campaign_base() -> Base:
    made = base()
    _do(made.folder, COMPARE)
    _do(made.folder, TUNE)
    return made


def _do(folder: Path, argv: tuple[str, ...]) -> None:
    said = forked(Case("base", "", argv), folder)
    assert said.code in (0, 1), (argv, said)
