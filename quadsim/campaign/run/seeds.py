"""The remark below the tables of a comparison that says what its seeds draw."""

from __future__ import annotations

from collections.abc import Iterable

from quadsim.config.spec import Spec


def seeds_remark(specs: Iterable[Spec], rotated: bool = False) -> str:
    """Return a remark on what seeds draw, if they do not draw start, vehicle and gusts.

    Intervals over such seeds hold for one start, one vehicle and no gusts, and are narrow.

    Args:
        specs: the flights of a comparison, of any seed.
        rotated: whether the places on the grid of a race change from seed to seed.

    Returns:
        One line, "" if every flight is randomized.
    """
    fixed = [spec for spec in specs if not spec.randomize]
    if not fixed:
        return ""
    parts = {
        "the planner's noise": any(spec.has_planner and not spec.controller for spec in fixed),
        "what your own controller draws": any(spec.controller and not spec.hand for spec in fixed),
        "the places on the grid": rotated,
        "the sensors' noise": any(spec.sensing is not None for spec in fixed),
        "the places of gates": any(spec.displace_gates for spec in fixed),
        "the faults": any(spec.fault for spec in fixed),
        "lost frames": any(spec.link_loss for spec in fixed),
    }
    *others, last = [name for name, is_drawn in parts.items() if is_drawn] or ["nothing"]
    drawn = f"{', '.join(others)} and {last}" if others else last
    alone = " alone" if last != "nothing" else ""
    fix = "--randomize 1 also draws start, vehicle and gusts"
    return f"Seeds differ in {drawn}{alone}, so intervals are narrow: {fix}."
