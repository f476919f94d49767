"""Read numbers from the text of a file or of a command line, and check their range."""

from __future__ import annotations

import re
from math import isfinite

from msgspec import inspect

DECIMAL = re.compile(r"[-+]?((0|[1-9]\d*)(\.\d*)?|\.\d+)([eE][-+]?\d+)?", re.ASCII)
WHOLE = re.compile(r"[-+]?(0|[1-9]\d*)", re.ASCII)


def whole_number(text: str) -> int | None:
    """Return the integer in a text, None if the text is not an integer."""
    return int(text) if WHOLE.fullmatch(text) and isfinite(float(text)) else None


def decimal_number(text: str) -> float | None:
    """Return the finite number in a text, None if the text is not a finite number."""
    return float(text) if DECIMAL.fullmatch(text) and isfinite(float(text)) else None


def truth_value(text: str) -> bool | None:
    """Return the truth value in a text, None if the text is neither true nor false."""
    return {"true": True, "false": False}.get(text.lower())


def is_in_range(number: float, kind: inspect.IntType | inspect.FloatType) -> bool:
    """Return whether a number is in the range of its annotation."""
    above = (kind.ge is None or number >= kind.ge) and (kind.gt is None or number > kind.gt)
    below = (kind.le is None or number <= kind.le) and (kind.lt is None or number < kind.lt)
    return above and below
