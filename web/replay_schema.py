"""What a stored run must say of itself to be shown. A run may have been made by hand, or by a later version."""

from __future__ import annotations

from typing import Annotated

import msgspec


class ShownMPPI(msgspec.Struct):
    samples: int
    target_ess: float | None = None
    ess: float | None = None  # the name of the same in older runs


class ShownPlanner(msgspec.Struct):
    mppi: ShownMPPI


class ShownChange(msgspec.Struct):
    t: float
    name: str
    before: float = msgspec.field(name="from")
    after: float = msgspec.field(name="to")


class ReplaySchema(msgspec.Struct):
    """What a spec must hold to be shown; a run may have been made by hand."""

    course: str
    sampler: str
    preset: str
    seed: int
    laps: Annotated[int, msgspec.Meta(ge=1)]
    vehicle: dict
    planner: ShownPlanner
    interactive: list[ShownChange] = []
