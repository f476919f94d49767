"""Stored runs by name: a folder, a part of a name that only one run has, or `last`."""

from __future__ import annotations

import os
from pathlib import Path

from quadsim.app.flags import UsageError
from quadsim.record.archive import list_runs


def find_run(wanted: str, root: str) -> Path:
    """The run's folder. Raises UsageError where none or several fit."""
    if os.sep in wanted or (Path(wanted) / "run.json").exists():
        return Path(wanted)
    runs = list_runs(root)
    if not runs:
        raise UsageError(f"no runs in {root!r}: fly one, or say --runs-dir")
    if wanted == "last":
        return max(runs, key=lambda run: (run / "run.json").stat().st_mtime)
    fits = [run for run in runs if wanted in run.name]
    if len(fits) == 1:
        return fits[0]
    if not fits:
        raise UsageError(
            f"no run {wanted!r} in {root!r}: expected a folder, part of a name or 'last'; the last is {runs[-1].name}"
        )
    names = ", ".join(run.name for run in fits[-3:])
    raise UsageError(f"{wanted!r} fits {len(fits)} runs, expected one: {names}{', ...' if len(fits) > 3 else ''}")
