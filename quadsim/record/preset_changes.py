"""The numbers of a recorded planner that differ from those of its preset, as text."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict
from typing import Any

from controllers.presets import PRESETS

# Numbers that are shown, at most
MOST = 4


def preset_changes(spec: dict[str, Any]) -> str:
    """Return the numbers that differ from the preset, such as "samples 256, horizon 60".

    It is empty where none does, and where the preset is a file or no preset of this version.

    Args:
        spec: the record of a Spec, see Spec.record.
    """
    found = list(_changes(spec))
    shown = found[:MOST]
    if len(found) > MOST:
        shown.append(f"and {len(found) - MOST} more")
    return ", ".join(shown)


def _changes(spec: dict[str, Any]) -> Iterator[str]:
    """Yield each number that differs, as its name and value."""
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
            if name in numbers and value != usual:
                yield f"{name} {_text(value)}"


def _text(value: Any) -> str:
    """Return a number, or numbers, as text."""
    if isinstance(value, list):
        return " ".join(map(_text, value))
    return f"{value:g}" if isinstance(value, float) else str(value).lower()
