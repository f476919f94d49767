"""Whether what a client says of a control could have come from that control."""

from __future__ import annotations

from math import isfinite
from typing import Any

LONGEST = 200  # characters of a text


def validate_input(handle: Any, updates: Any) -> bool:
    """Only the value, of the control's own type and within its own range; viser itself would take any attribute."""
    if not isinstance(updates, dict) or set(updates) != {"value"}:
        return False
    value, props = updates["value"], handle._impl.props
    if getattr(props, "disabled", False) or not props.visible:
        return False
    if hasattr(props, "options"):
        return isinstance(value, str) and value in props.options
    if isinstance(handle._impl.value, bool):
        return isinstance(value, bool)
    if isinstance(handle._impl.value, int | float):
        return _within(value, props)
    return isinstance(value, str) and len(value) <= LONGEST


def _within(value: Any, props: Any) -> bool:
    if isinstance(value, bool) or not isinstance(value, int | float) or not isfinite(value):
        return False
    low, high = getattr(props, "min", None), getattr(props, "max", None)
    return (low is None or value >= low) and (high is None or value <= high)
