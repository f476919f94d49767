"""The numbers of a recorded planner that differ from those of its preset, as text."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import asdict
from typing import Any

from quadsim.controllers.presets import PRESETS

# Numbers that are shown, at most
MOST = 4


def preset_changes(spec: dict[str, Any]) -> str:
    """Return the numbers that differ from the preset, such as "samples 256, horizon 60".

    It is empty where none does, and where the preset is a file or no preset of this version.

    Args:
        spec: the record of a Spec, see Spec.record.
    """
    found = [f"{name} {value}" for name, value in changed_numbers(spec).items()]
    shown = found[:MOST]
    if len(found) > MOST:
        shown.append(f"and {len(found) - MOST} more")
    return ", ".join(shown)


def changed_numbers(spec: Mapping[str, Any]) -> dict[str, str]:
    """Return the numbers that differ from the preset, as texts by name.

    It is empty in the cases in which `preset_changes` is.

    Args:
        spec: the record of a Spec, see Spec.record.
    """
    return dict(_changes(spec))


def _changes(spec: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    """Yield the name and the value of each number that differs."""
    of_samplers = PRESETS.get(spec.get("preset", ""), {})
    base = of_samplers.get(spec.get("sampler", ""))
    parts = ("sampling", "mppi", "cost")
    if base is None:
        # A sampler of the user's own flies with the numbers of colored sampling, but for its own.
        base = of_samplers.get("colored")
        parts = ("mppi", "cost")
    if base is None:
        return
    recorded = spec.get("planner", {})
    for part in parts:
        numbers = recorded.get(part, {})
        for name, usual in asdict(getattr(base, part)).items():
            value = numbers.get(name)
            # A JSON record has lists in place of tuples, and leaves out what was not set
            usual = list(usual) if isinstance(usual, tuple) else usual
            value = list(value) if isinstance(value, tuple) else value
            if name in numbers and value != usual:
                yield name, number_text(value)


def number_text(value: Any) -> str:
    """Return a number, or numbers, as text."""
    if isinstance(value, list | tuple):
        return " ".join(map(number_text, value))
    return f"{value:g}" if isinstance(value, float) else str(value).lower()
