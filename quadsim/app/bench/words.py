"""One text of step() and terms() for every library: only the words sqrt and where are bound to each one's own."""

from __future__ import annotations

from collections.abc import Callable
from types import FunctionType


def speaking(function: Callable, words: dict[str, object]) -> FunctionType:
    """The same function with its words bound anew."""
    assert isinstance(function, FunctionType)
    return FunctionType(function.__code__, {**function.__globals__, **words})
