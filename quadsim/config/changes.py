"""Changes of a planner's numbers in flight, which are made on the page and recorded."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import msgspec

from quadsim.controllers.presets import Planner
from quadsim.controllers.samplers import is_registered
from quadsim.files.plain_values import plain
from quadsim.record.schema import ChangedPlanner, NumberChange


def changeable_numbers(planner: Planner) -> dict[str, Any]:
    """Return the numbers of a planner that may change in flight, in the form of a NumberChange."""
    return {"sampling": plain(planner.sampling), "mppi": plain(planner.mppi)}


def planner_after(change: NumberChange, planner: Planner) -> Planner:
    """Return a planner with its numbers after a change.

    Raises:
        msgspec.ValidationError: the change comes from a damaged file.
    """
    numbers = msgspec.convert(change.planner, ChangedPlanner)
    sampling = planner.sampling
    if is_registered(sampling):
        sampling = msgspec.convert(numbers.sampling, type(sampling))
    return replace(planner, sampling=sampling, mppi=numbers.mppi)
