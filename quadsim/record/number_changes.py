"""Numbers of the planner that were changed in flight, for the tables of a run."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import msgspec
import numpy as np

from quadsim.record.run import INTERACTIVE, RunError
from quadsim.record.schema import NumberChange

SAME_TIME = 1e-9  # [s] by which times of one control step may differ


def changes_of(spec: dict[str, Any]) -> list[NumberChange]:
    """Return the changes of a run, in the order of their times.

    Raises:
        RunError: the spec was edited by hand, and its changes are invalid.
    """
    try:
        changes = msgspec.convert(spec.get(INTERACTIVE, []), list[NumberChange])
    except msgspec.ValidationError as error:
        raise RunError(f"{INTERACTIVE}: {error}") from error
    return sorted(changes, key=lambda change: change.t)


def values_in_flight(changes: Sequence[NumberChange], name: str, t: np.ndarray) -> np.ndarray:
    """Return the value of a number at each control step.

    Args:
        changes: the changes of the run, in the order of their times.
        name: name of the number.
        t: times of the steps [s]  (frames,)

    Returns:
        The values, nan if the number was not changed in this flight  (frames,).
    """
    own = [change for change in changes if change.name == name]
    values = np.full(len(t), own[0].before if own else np.nan)
    for change in own:
        values[t > change.t - SAME_TIME] = change.after
    return values
