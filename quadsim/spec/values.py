"""Check the value of a setting, given as a number in Python or as text on a command line."""

from __future__ import annotations

from math import isfinite
from pathlib import Path
from typing import TypeVar

import numpy as np
from msgspec import inspect

from quadsim.files.yaml_errors import expected, limits
from quadsim.files.yaml_values import DECIMAL, WHOLE
from quadsim.spec.settings import Kind, SettingError, bare, is_optional

Number = TypeVar("Number", int, float)


class _Unfit(Exception):  # noqa: N818 (it never leaves this module)
    """A value is not of the expected kind."""


def checked(name: str, given: object, kind: Kind) -> object:
    """Return the value as a setting holds it.

    Text is read as a number where one is asked for. A list, a tuple or an array becomes a tuple.

    Args:
        name: name of the setting, for the error.
        given: the value.
        kind: the expected kind.

    Raises:
        SettingError: the value is of another type or out of range.
    """
    if given is None and is_optional(kind):
        return None
    try:
        return _read(given, bare(kind))
    except _Unfit:
        raise SettingError(name, f"expected {_wanted(kind)}, got {_shown(given, kind)}") from None


def _read(given: object, kind: Kind) -> object:
    """Return the value as `kind` asks for it. Raises _Unfit."""
    if isinstance(given, np.generic):
        given = given.item()
    match kind:
        case inspect.BoolType():
            return _truth(given)
        case inspect.IntType():
            return _within(_whole(given), kind)
        case inspect.FloatType():
            return _within(_number(given), kind)
        case inspect.LiteralType():
            return _one_of(given, kind.values)
        case inspect.StrType() if isinstance(given, str | Path):
            return str(given)
        case inspect.TupleType():
            items = _items(given)
            if len(items) != len(kind.item_types):
                raise _Unfit
            return tuple(_read(x, bare(k)) for x, k in zip(items, kind.item_types, strict=True))
        case inspect.VarTupleType():
            return tuple(_read(x, bare(kind.item_type)) for x in _items(given))
    raise _Unfit


def _truth(given: object) -> bool:
    if isinstance(given, bool):
        return given
    if isinstance(given, str) and given.lower() in ("true", "false"):
        return given.lower() == "true"
    raise _Unfit


def _whole(given: object) -> int:
    if isinstance(given, str) and WHOLE.fullmatch(given) and isfinite(float(given)):
        return int(given)
    if isinstance(given, int) and not isinstance(given, bool):
        return given
    raise _Unfit


def _number(given: object) -> float:
    if isinstance(given, str) and DECIMAL.fullmatch(given):
        given = float(given)
    if isinstance(given, int | float) and not isinstance(given, bool) and isfinite(given):
        return float(given)
    raise _Unfit


def _one_of(given: object, values: tuple[object, ...]) -> object:
    if given not in values:
        raise _Unfit
    return given


def _items(given: object) -> list[object]:
    if isinstance(given, np.ndarray):
        given = given.tolist()
    if not isinstance(given, list | tuple):
        raise _Unfit
    return list(given)


def _within(number: Number, kind: inspect.IntType | inspect.FloatType) -> Number:
    """Return the number. Raises _Unfit where it lies outside the range of its kind."""
    above = (kind.ge is None or number >= kind.ge) and (kind.gt is None or number > kind.gt)
    below = (kind.le is None or number <= kind.le) and (kind.lt is None or number < kind.lt)
    if not (above and below):
        raise _Unfit
    return number


def _wanted(kind: Kind) -> str:
    """Return a kind in words with its unit and range, e.g. "4 numbers [m] >= 0"."""
    number = bare(kind)
    if isinstance(number, inspect.TupleType):
        number = bare(number.item_types[0])
    bounded = isinstance(number, inspect.IntType | inspect.FloatType)
    return f"{expected(kind)} {limits(number)}".rstrip() if bounded else expected(kind)


def _shown(given: object, kind: Kind) -> str:
    """Return the value as an error shows it: a list of the wrong length as its length."""
    bare_kind = bare(kind)
    if not isinstance(given, list | tuple | np.ndarray):
        text = repr(given)
        return text if len(text) <= 60 else text[:57] + "..."
    if isinstance(bare_kind, inspect.TupleType) and len(given) != len(bare_kind.item_types):
        return str(len(given))
    return " ".join(f"{x:g}" if isinstance(x, float) else str(x) for x in given)
