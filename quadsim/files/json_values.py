"""Values that JSON can hold."""

from __future__ import annotations

from math import isfinite
from typing import Any


def without_nan(value: Any) -> Any:
    """Return the value with None for nan and infinity, which JSON does not have.

    Dictionaries, lists and tuples are searched.
    """
    if isinstance(value, dict):
        return {key: without_nan(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [without_nan(item) for item in value]
    if isinstance(value, float) and not isfinite(value):
        return None
    return value
