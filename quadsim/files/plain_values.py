"""Convert Python objects to values that JSON can represent, for records."""

from __future__ import annotations

from dataclasses import fields, is_dataclass
from functools import partial
from math import isfinite
from pathlib import Path
from types import FunctionType
from typing import Any

import numpy as np

Json = Any  # a value that JSON can hold
DEEPEST = 12  # levels of objects within each other that `plain` shows
LARGE = 1000  # `plain` shows only the shape of an array of more numbers than this


def plain(value: object, depth: int = DEEPEST) -> Json:
    """Return a value as JSON: a large array as its shape, an object as its class.

    Args:
        value: the value.
        depth: number of levels of nested objects that are converted.
    """
    if depth == 0:
        return "..."
    if isinstance(value, float) and not isfinite(value):
        return str(value)  # which JSON does not know
    if isinstance(value, str | int | float | bool) or value is None:
        return value
    if isinstance(value, Path):
        return str(value)
    if isinstance(value, dict):
        return {str(k): plain(v, depth - 1) for k, v in value.items()}
    if isinstance(value, list | tuple):
        return [plain(v, depth - 1) for v in value]
    if isinstance(value, np.ndarray | np.generic):
        return plain(value.tolist()) if value.size <= LARGE else f"array {value.shape}"
    if is_dataclass(value) and not isinstance(value, type):
        return {f.name: plain(getattr(value, f.name), depth - 1) for f in fields(value)}
    return qualified_name(value if isinstance(value, type | FunctionType) else type(value))


def qualified_name(kind: Any) -> str:
    """Return the module and name of a class or function.

    For a functools.partial the names of its function are returned, for any other object the names
    of its class. The module of a script is "__main__" in every process.
    """
    while isinstance(kind, partial):
        kind = kind.func
    if not hasattr(kind, "__qualname__"):
        kind = type(kind)
    module = "__main__" if kind.__module__ == "__mp_main__" else kind.__module__
    return f"{module}.{kind.__qualname__}"
