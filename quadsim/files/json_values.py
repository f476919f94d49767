"""Convert values to values that JSON can represent."""

from __future__ import annotations

from math import isfinite
from typing import Any


def without_nan(value: Any) -> Any:
    """Return a value with nan and infinity replaced by None, because JSON does not have them.

    Values within dictionaries, lists and tuples are replaced, too.
    """
    if isinstance(value, dict):
        return {key: without_nan(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [without_nan(item) for item in value]
    if isinstance(value, float) and not isfinite(value):
        return None
    return value
