"""A run as one JSON object: what `race fly --json` and `race show --json` print."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path

from quadsim.app.model_differences import differences
from quadsim.record.metrics import chatter, missed_deadlines, splits
from quadsim.record.run import INTERACTIVE, Run


def summary(run: Run, folder: Path | None) -> dict:
    """Seconds, metres, m/s; `plan_ms` in milliseconds. run_dir is null when the run could not be kept."""
    spec = run.spec
    return {
        "course": spec["course"],
        "sampler": spec["sampler"],
        "preset": spec["preset"],
        "vehicle": spec["vehicle"]["name"],
        "seed": spec["seed"],
        "outcome": run.outcome,
        "laps": run.laps,
        "penalties": run.penalties,
        "splits": splits(run),
        "gates": run.gates,
        "events": [asdict(e) for e in run.events],
        "chatter": chatter(run),
        "model_differs": differences(spec),
        "clock": spec["clock"],
        INTERACTIVE: spec.get(INTERACTIVE, []),
        "missed_deadlines": missed_deadlines(run),
        **run.wall,
        "digest": run.digest(),
        "run_dir": None if folder is None else str(folder),
    }
