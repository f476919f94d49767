"""What is damaged: stored runs, a campaign, a search, compiled code; made once, by undamaged
commands."""

from __future__ import annotations

import json
import os
import shutil
import tempfile
from atexit import register
from dataclasses import dataclass
from functools import cache, cached_property
from pathlib import Path

from quadsim.campaign.store import Store
from tests.fuzz.flags import TINY
from tests.fuzz.harness import Case, forked

SMALL = """
from numba import njit
from controllers.lanes.compiled import kept
@kept
@njit
def twice(x):
    return 2 * x
"""

SHORT = tuple(word for pair in TINY.items() for word in pair)
FLIGHTS = (("paper_flat", "--sampler", "colored"),)
CAMPAIGN = ("paper_flat", *SHORT, "--attempts", "2", "--jobs", "1")
COMPARE = ("compare", *CAMPAIGN)
TUNE = (
    "tune",
    "paper_flat",
    *SHORT,
    "--trials",
    "2",
    "--attempts",
    "1",
    "--jobs",
    "1",
    "--search",
    "sigma",
)


@dataclass(frozen=True)
class Base:
    """Folders that cases copy."""

    folder: Path

    @property
    def runs(self) -> list[Path]:
        return sorted((self.folder / "runs").iterdir())

    @property
    def digest(self) -> str:
        """Of the first flight."""
        (run,) = [r for r in self.runs if FLIGHTS[0][0] in r.name]
        return json.loads((run / "run.json").read_text())["digest"]

    @cached_property
    def cache(self) -> Path:
        """Compiled code of the first flight: takes some 20 s."""
        _do(
            self.folder / "flown",
            ("fly", *FLIGHTS[0], *SHORT),
            {"XDG_CACHE_HOME": str(self.folder / "cache")},
        )
        return self.folder / "cache"

    @cached_property
    def small_cache(self) -> Path:
        """Compiled code of a small function."""
        said = forked(
            Case("base", "", (), env={"XDG_CACHE_HOME": str(self.folder / "small")}, call=small),
            self.folder,
        )
        assert said.code == 0, said
        return self.folder / "small"

    @property
    def campaign(self) -> Path:
        """With a comparison and a search."""
        return self.folder / "campaigns"

    @cached_property
    def variants(self) -> list[str]:
        """The stored variants that were compared."""
        with Store(self.campaign / "race.sqlite", create=False) as store:
            return sorted(
                {row.variant[:12] for row in store.rows() if not row.name.startswith("trial")}
            )


def small() -> int:
    """Compile a function and call it. The exit code says whether it computes what it should."""
    from controllers.lanes.compiled import load_module

    return 0 if load_module("fuzz_small", SMALL).twice(21) == 42 else 1


@cache
def base() -> Base:
    """Removed when the process ends that asked first."""
    folder = Path(tempfile.mkdtemp(prefix="quadsim-fuzz-base-"))
    register(_remove, folder, os.getpid())
    for flight in FLIGHTS:
        _do(folder, ("fly", *flight, *SHORT))
    return Base(folder)


@cache
def campaign_base() -> Base:
    made = base()
    _do(made.folder, COMPARE)
    _do(made.folder, TUNE)
    return made


def _do(folder: Path, argv: tuple[str, ...], env: dict[str, str] | None = None) -> None:
    folder.mkdir(exist_ok=True)
    said = forked(Case("base", "", argv, env=env or {}), folder, patience=10)
    assert said.code in (0, 1), (argv, said)


def _remove(folder: Path, owner: int) -> None:
    if os.getpid() == owner:  # not in a child
        shutil.rmtree(folder, ignore_errors=True)
