"""Sentences on the numbers, beside the sampler, in which compared planners differ."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any


def planner_differences(specs: Mapping[str, dict[str, Any]]) -> list[str]:
    """Return a line on the numbers that differ beside the sampler, if any do.

    A preset has numbers of its own for each sampler.

    Args:
        specs: the spec of each run by the name of its variant.
    """
    presets = {spec["preset"] for spec in specs.values()}
    samplers = {spec["sampler"] for spec in specs.values()}
    if len(presets) != 1 or len(samplers) < 2 or not all("planner" in s for s in specs.values()):
        return []
    planners = {name: _numbers(spec) for name, spec in specs.items()}
    first = next(iter(planners.values()))
    differing = [
        f"{key} ({', '.join(f'{name} {_shown(own.get(key))}' for name, own in planners.items())})"
        for key in first
        if any(own.get(key) != first[key] for own in planners.values())
    ]
    if not differing:
        return []
    return [f"Beside the sampler, these numbers of the preset differ: {'; '.join(differing)}."]


def _numbers(spec: Mapping[str, Any]) -> dict[str, Any]:
    """Return the numbers of a planner without those of its sampler."""
    planner = spec["planner"]
    return {**planner["mppi"], **planner["cost"]}


def _shown(value: Any) -> str:
    """Return a number of a planner as text."""
    if isinstance(value, Sequence) and not isinstance(value, str):
        return ":".join(map(_shown, value))
    return f"{value:g}" if isinstance(value, float) else str(value)
