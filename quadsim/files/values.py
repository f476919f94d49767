"""Check values against annotations: their type, their range and their unit.

A setting is given as a number in Python or as text on a command line. It is checked by its
annotation, for example `Annotated[float, setting("control period", unit="s", gt=0)]`.
"""

from __future__ import annotations

from functools import cache
from math import isfinite
from pathlib import Path
from typing import Any, NamedTuple, TypeVar, get_args, get_type_hints

import numpy as np
from msgspec import Meta, inspect

from quadsim.files.scalars import decimal_number, is_in_range, truth_value, whole_number
from quadsim.files.yaml_errors import cut, expected, limits, shown_value, unless_null

Kind = inspect.Type  # type, range and unit of a value, as msgspec reads an annotation
Number = TypeVar("Number", int, float)
NONE = "none"  # text for a setting that is switched off


class SettingError(ValueError):
    """The error of an invalid setting, with its name, the expected and the found value.

    Examples:
        >>> import quadsim
        >>> try:
        ...     quadsim.fly("figure8", horizn=100)
        ... except quadsim.SettingError as error:
        ...     print(error)
        horizn: ...did you mean 'horizon'?...
    """

    def __init__(self, name: str, problem: str):
        super().__init__(f"{name}: {problem}")
        self.name = name
        self.problem = problem

    def __reduce__(self) -> tuple[type[SettingError], tuple[str, str]]:
        return SettingError, (self.name, self.problem)


class FieldProblem(NamedTuple):
    """A key of a file, and the problem with its value."""

    key: str
    problem: str


class _Unfit(Exception):  # noqa: N818 (it never leaves this module)
    """The error of a value that is not of the expected kind."""


def checked(name: str, given: object, kind: Kind, *, may_be_off: bool = False) -> object:
    """Return a value of a setting, checked and converted to the expected type.

    Text is converted to a number if a number is expected, and "none" to None if the number may be
    None. A list, a tuple or an array becomes a tuple.

    Args:
        name: name of the setting, for the error.
        given: the value.
        kind: the expected kind.
        may_be_off: whether None switches the setting off, which the error then says.

    Raises:
        SettingError: the value is of another type or out of range.
    """
    if is_optional(kind) and (given is None or (_is_number(kind) and is_none(given))):
        return None
    try:
        return _read(given, bare(kind))
    except _Unfit:
        text = wanted(kind, may_be_off=may_be_off)
        raise SettingError(name, f"expected {text}, got {_shown(given, kind)}") from None


def check_fields(record: object) -> None:
    """Check the annotated fields of a dataclass, for its `__post_init__`.

    A list or an array becomes a tuple, and a NumPy number a Python number. Text is not accepted
    as a number.

    Args:
        record: an object of a frozen dataclass. Fields without the annotation of a setting are not
            checked.

    Raises:
        SettingError: a field has a wrong type or is out of range.
    """
    for name, kind in kinds_of(type(record)).items():
        given = getattr(record, name)
        value = checked_object(name, given, kind)
        if isinstance(given, list | np.ndarray | np.generic):
            object.__setattr__(record, name, value)


def checked_object(name: str, given: object, kind: Kind) -> Any:
    """Return a checked value as `checked` does, but without accepting text as a number.

    Raises:
        SettingError: the value is of another type or out of range.
    """
    value = checked(name, given, kind)
    # `checked` reads a text as a number, and returns another text as it was.
    items = given if isinstance(given, list | tuple | np.ndarray) else [given]
    if any(isinstance(item, str) for item in items) and value != given:
        raise SettingError(name, f"expected {wanted(kind)}, got {_shown(given, kind)}")
    return value


@cache
def kinds_of(cls: type) -> dict[str, Kind]:
    """Return the kinds of a dataclass's annotated fields by name, in order."""
    hints = get_type_hints(cls, include_extras=True)
    return {name: inspect.type_info(hint) for name, hint in hints.items() if _is_annotated(hint)}


def _is_annotated(hint: Any) -> bool:
    """Return whether a type, or a member of a union type, has metadata of a setting."""
    united = (hint, *get_args(hint))
    return any(isinstance(m, Meta) for one in united for m in getattr(one, "__metadata__", ()))


def is_optional(kind: Kind) -> bool:
    """Return whether a setting of this kind may be None."""
    if isinstance(kind, inspect.Metadata):
        return is_optional(kind.type)
    return isinstance(kind, inspect.UnionType)


def is_none(given: object) -> bool:
    """Return whether a value of a setting is the text "none", or this text for each control."""
    texts = given if isinstance(given, list | tuple) else [given]
    return all(isinstance(text, str) and text == NONE for text in texts)


def bare(kind: Kind) -> Kind:
    """Return the kind without its metadata and without its `| None`."""
    while isinstance(kind, inspect.Metadata | inspect.UnionType):
        kind = kind.type if isinstance(kind, inspect.Metadata) else unless_null(kind)
    return kind


def _read(given: object, kind: Kind) -> object:
    """Return a value converted to the expected kind. Raises _Unfit."""
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
            if len(str(given)) < (kind.min_length or 0):
                raise _Unfit
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
    found = truth_value(given) if isinstance(given, str) else given
    if isinstance(found, bool):
        return found
    raise _Unfit


def _whole(given: object) -> int:
    found = whole_number(given) if isinstance(given, str) else given
    if isinstance(found, int) and not isinstance(found, bool):
        return found
    raise _Unfit


def _number(given: object) -> float:
    found = decimal_number(given) if isinstance(given, str) else given
    if isinstance(found, int | float) and not isinstance(found, bool):
        try:
            number = float(found)
        except OverflowError:
            raise _Unfit from None
        if isfinite(number):
            return number
    raise _Unfit


def _one_of(given: object, values: tuple[object, ...]) -> object:
    if not isinstance(given, str | int) or given not in values:
        raise _Unfit
    return given


def _items(given: object) -> list[object]:
    if isinstance(given, np.ndarray):
        given = given.tolist()
    if not isinstance(given, list | tuple):
        raise _Unfit
    return list(given)


def _within(number: Number, kind: inspect.IntType | inspect.FloatType) -> Number:
    """Return a number. Raises _Unfit if it is outside the range of its kind."""
    if not is_in_range(number, kind):
        raise _Unfit
    return number


def wanted(kind: Kind, *, may_be_off: bool = False) -> str:
    """Return a kind as text with its unit and range, such as "4 numbers [m] >= 0, or none".

    Args:
        kind: the kind of a setting.
        may_be_off: whether None, if the kind has it, switches the setting off.
    """
    if not _is_number(kind):
        return expected(kind)
    text = f"{expected(kind)} {limits(_item(kind))}".rstrip()
    return f"{text}, or {NONE}" if may_be_off and is_optional(kind) else text


def _is_number(kind: Kind) -> bool:
    """Return whether a setting of this kind is a number or several."""
    return isinstance(_item(kind), inspect.IntType | inspect.FloatType)


def _item(kind: Kind) -> Kind:
    """Return the bare kind of a setting, or of its items if it has several."""
    one = bare(kind)
    if isinstance(one, inspect.TupleType):
        return bare(one.item_types[0])
    if isinstance(one, inspect.VarTupleType):
        return bare(one.item_type)
    return one


def _shown(given: object, kind: Kind) -> str:
    """Return a value as text for errors; a list of wrong length is shown as its length."""
    bare_kind = bare(kind)
    if not isinstance(given, list | tuple | np.ndarray) or np.ndim(given) == 0:
        return shown_value(given)
    if isinstance(bare_kind, inspect.TupleType) and len(given) != len(bare_kind.item_types):
        return str(len(given))
    return cut(" ".join(f"{x:g}" if isinstance(x, float) else shown_value(x) for x in given))
