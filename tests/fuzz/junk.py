"""Values that no part of a program expects, and functions that answer for a case."""

from __future__ import annotations

import random
import sys
from collections.abc import Callable

import numpy as np

NAN = float("nan")
JUNK: tuple[object, ...] = (
    None,
    True,
    0,
    -1,
    3,
    2**31,
    2**63,
    2**70,
    10**400,
    1.5,
    -0.0,
    1e-300,
    1e300,
    NAN,
    float("inf"),
    "",
    "x",
    "3",
    "a\nb\x1b[31m",
    "x" * 5000,
    b"\0\xff",
    (),
    [],
    {},
    {"a": 1},
    [1, [2, 3]],
    (1, 2),
    {1, 2},
    object(),
    object,
    len,
    lambda *arguments: None,
    np.zeros(0),
    np.zeros(3),
    np.zeros(4),
    np.full(4, NAN),
    np.zeros((2, 2)),
    np.zeros(4, complex),
    np.full(4, "1"),
    np.array(None),
    np.float32(1.5),
    np.int64(-7),
    np.datetime64("2020"),
    range(3),
    Ellipsis,
)


def junk(rng: random.Random) -> object:
    """Return one of the values."""
    return rng.choice(JUNK)


def reported(action: Callable[[], object]) -> int:
    """Do what a case does. Return 0, or 2 after a line for an error that a user is told of.

    Another error is a traceback, and an error of several lines shows as several lines with `race`.
    """
    try:
        action()
    except ValueError as error:
        if not str(error).strip():
            raise
        for line in str(error).splitlines():
            print(f"race: {line}", file=sys.stderr)
        return 2
    return 0
