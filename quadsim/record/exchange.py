"""Write telemetry as a CSV table, for other programs."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from math import isnan

from quadsim.record.number_changes import changes_of, values_in_flight
from quadsim.record.run import RecordedRun, RunError, columns_of


def telemetry_csv(runs: Sequence[tuple[str, RecordedRun]]) -> bytes:
    """Return the telemetry of runs as a CSV table with a row for each control step.

    The header has names with units, such as `px [m]`. If there are several runs, the first column
    has the run's name. For each number of the planner that was changed in flight, the column
    `changed NAME` has its value at each step; it is empty for runs in which the number was not
    changed.

    Args:
        runs: pairs of a run's name and the run, at least one.

    Raises:
        RunError: a run has other columns than the first run, or its changes in flight are invalid.
    """
    first_name, first = runs[0]
    columns = columns_of(first.spec)
    has_names = len(runs) > 1
    lines = io.StringIO(newline="")
    out = csv.writer(lines)
    head = [f"{name} [{unit}]" for name, unit in columns.items()]
    changes = [changes_of(run.spec) for _, run in runs]
    changed = list(dict.fromkeys(change.name for own in changes for change in own))
    head += [f"changed {name}" for name in changed]
    out.writerow(["run", *head] if has_names else head)
    for (run_name, run), own in zip(runs, changes, strict=True):
        if columns_of(run.spec) != columns:
            raise RunError(f"{run_name}: expected the columns of {first_name}, got others")
        table = [run.telemetry[name].tolist() for name in columns]
        for name in changed:
            values = values_in_flight(own, name, run.telemetry["t"]).tolist()
            table.append(["" if isnan(value) else value for value in values])
        for row in zip(*table, strict=True):
            out.writerow([run_name, *row] if has_names else row)
    return lines.getvalue().encode()
