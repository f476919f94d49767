"""The report of a run: printed after a flight and, from the disk, by `race show`."""

from __future__ import annotations

from pathlib import Path

from quadsim.app.console import emit, emit_json
from quadsim.app.summary import summary
from quadsim.metrics import splits
from quadsim.run import Run


def present(run: Run, folder: Path | None, as_json: bool) -> None:
    """folder: where the run was stored, None if it could not be."""
    if as_json:
        emit_json(summary(run, folder))
    else:
        emit(*report(run, folder))


def report(run, folder):
    yield f"{run.outcome} {run.laps} {splits(run)}"
