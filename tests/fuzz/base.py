"""The undamaged originals: stored runs, a campaign with a search, compiled code.

Undamaged commands make them once; each case damages a copy.
"""

from __future__ import annotations

import json
import os
import shutil
import tempfile
from atexit import register
from dataclasses import dataclass
from functools import cache, cached_property
from pathlib import Path

from quadsim.campaign.run.store import Store
from tests.fuzz.flags import TINY
from tests.fuzz.harness import Case, forked

SMALL = """
from numba import njit
from quadsim.controllers.lanes.compiled import kept
@kept
@njit
def twice(x):
    return 2 * x
"""

SHORT = tuple(word for pair in TINY.items() for word in pair)
FLIGHTS = (("paper_flat", "--sampler", "colored"), ("figure8",))
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
    """The folders that cases copy."""

    folder: Path

    @property
    def runs(self) -> list[Path]:
        """Return the folders of the stored runs."""
        return sorted((self.folder / "runs").iterdir())

    @property
    def digest(self) -> str:
        """Return the digest of the first flight."""
        (run,) = [run for run in self.runs if FLIGHTS[0][0] in run.name]
        return json.loads((run / "run.json").read_text())["digest"]

    @cached_property
    def cache(self) -> Path:
        """Return the compiled code of the first flight; making it takes some 15 s."""
        _do(
            self.folder / "flown",
            ("fly", *FLIGHTS[0], *SHORT),
            {"XDG_CACHE_HOME": str(self.folder / "cache")},
        )
        return self.folder / "cache"

    @cached_property
    def small_cache(self) -> Path:
        """Return the compiled code of a small function."""
        env = {"XDG_CACHE_HOME": str(self.folder / "small")}
        outcome = forked(Case("base", "", (), env=env, call=small), self.folder)
        assert outcome.code == 0, outcome
        return self.folder / "small"

    @property
    def campaign(self) -> Path:
        """Return the folder of a campaign with a comparison and a search."""
        return self.folder / "campaigns"

    @cached_property
    def variants(self) -> list[str]:
        """Return the stored variants that were compared."""
        with Store(self.campaign / "race.sqlite", create=False) as store:
            compared = [row for row in store.rows() if not row.name.startswith("trial")]
        return sorted({row.variant[:12] for row in compared})


def small() -> int:
    """Compile a function and call it. Return 0 if it computes what it should."""
    from quadsim.controllers.lanes.compiled import load_module

    return 0 if load_module("fuzz_small", SMALL).twice(21) == 42 else 1


@cache
def base() -> Base:
    """Return the originals. They are removed when the process ends that asked first."""
    folder = Path(tempfile.mkdtemp(prefix="quadsim-fuzz-base-"))
    register(_remove, folder, os.getpid())
    for flight in FLIGHTS:
        _do(folder, ("fly", *flight, *SHORT))
    return Base(folder)


@cache
def campaign_base() -> Base:
    """Return the originals, a campaign among them."""
    made = base()
    _do(made.folder, COMPARE)
    _do(made.folder, TUNE)
    return made


def _do(folder: Path, argv: tuple[str, ...], env: dict[str, str] | None = None) -> None:
    folder.mkdir(exist_ok=True)
    outcome = forked(Case("base", "", argv, env=env or {}), folder, patience=10)
    assert outcome.code in (0, 1), (argv, outcome)


def _remove(folder: Path, owner: int) -> None:
    # Children end too, with the same functions registered.
    if os.getpid() == owner:
        shutil.rmtree(folder, ignore_errors=True)
