"""Numbers of the planner that were changed in flight, as the tables of a run have them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import msgspec
import numpy as np

from quadsim.record.run import INTERACTIVE, RunError

# columns of events.csv that only runs with changes have
CHANGE_COLUMNS = ("number", "from", "to")
SAME_TIME = 1e-9  # [s] by which times of one control step may differ


class NumberChange(msgspec.Struct):
    """A number of the planner that was changed in flight."""

    t: float  # of the first plan with the number [s]
    name: str
    before: float = msgspec.field(name="from")
    after: float = msgspec.field(name="to")

    def row(self) -> dict[str, object]:
        """Return the change as a row of events.csv; it has no gate and no place."""
        values = (self.t, "change", self.name, self.before, self.after)
        return dict(zip(("t", "kind", *CHANGE_COLUMNS), values, strict=True))


def changes_of(spec: dict[str, Any]) -> list[NumberChange]:
    """Return the changes of a run, in the order of their times.

    Raises:
        RunError: the spec was written by hand, and wrongly.
    """
    try:
        changes = msgspec.convert(spec.get(INTERACTIVE, []), list[NumberChange])
    except msgspec.ValidationError as error:
        raise RunError(f"{INTERACTIVE}: {error}") from error
    return sorted(changes, key=lambda change: change.t)


def values_in_flight(changes: Sequence[NumberChange], name: str, t: np.ndarray) -> np.ndarray:
    """Return the value of a number at each control step.

    Args:
        changes: those of the run, in the order of their times.
        name: the number.
        t: times of the steps [s]  (frames,)

    Returns:
        The values; nan where the number was not changed in this flight.  (frames,)
    """
    own = [change for change in changes if change.name == name]
    values = np.full(len(t), own[0].before if own else np.nan)
    for change in own:
        values[t > change.t - SAME_TIME] = change.after
    return values
