"""Damaged pilots, flown and compared."""

from __future__ import annotations

import random
from functools import partial
from pathlib import Path

import numpy as np

from quadsim.controllers.learned.pilot import PILOTS
from quadsim.record.archive import list_runs, read_run
from quadsim.record.run import RunError
from tests.fuzz.arrays import damage_place, damaged_npz
from tests.fuzz.harness import Case, Outcome

SHORT = ("split_s_swift", "--laps", "1", "--timeout", "0.2")
FLY = ("fly", *SHORT, "--pilot", "p.npz")
COMPARE = ("compare", *SHORT, "--variants", "p=p.npz", "--attempts", "1", "--jobs", "1")


def pilots(rng: random.Random) -> Case:
    """Return a case with a damaged pilot.

    It is refused with one line, or it flies with finite numbers.
    """
    seed = rng.randrange(2**32)
    argv = COMPARE if rng.random() < 0.15 else FLY
    label = f"pilot damaged by seed {seed}: {' '.join(argv)}"
    return Case("pilots", label, argv, partial(_prepare, seed), sound)


def _prepare(seed: int, folder: Path) -> None:
    rng = random.Random(seed)
    data = (PILOTS / "split_s_swift.npz").read_bytes()
    damage_place(rng, folder / "p.npz", damaged_npz(rng, data, "about"))


def sound(folder: Path, outcome: Outcome) -> str:
    """Claim that errors are one line, that nothing was executed, and that telemetry is finite."""
    if (folder / "pwned").exists():
        return "a file was executed"
    if "Warning" in outcome.err or "unsafe" in outcome.err:
        return f"a library's warning: {outcome.err[:200]!r}"
    if outcome.code == 2 and outcome.err.count("\n") != 1:
        return f"expected one line, got {outcome.err[:300]!r}"
    longest = max(map(len, outcome.err.splitlines()), default=0)
    if longest > 1000:
        return f"a line of {longest} characters"
    return _finite(folder / "runs")


def _finite(runs: Path) -> str:
    """Return what is not finite in the runs that were stored, or ""."""
    for path in list_runs(runs) if runs.exists() else ():
        try:
            telemetry = read_run(path).telemetry
        except RunError as error:
            return f"a run that cannot be read: {error}"
        for name, column in telemetry.items():
            if not np.isfinite(column).all():
                return f"{path.name}: {name} is not finite"
    return ""
