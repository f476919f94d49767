"""JSON that is read into typed objects, with every number of the kind that it has there."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import fields, is_dataclass, replace
from typing import Any, TypeVar

import msgspec

T = TypeVar("T")


def exactly(raw: Any, kind: type[T]) -> T:
    """Return a value that was read from JSON as an object of this type, with 60 apart from 60.0.

    Where a type asks for a float, msgspec reads 60 as 60.0. They are equal, but a record tells them
    apart, and so does the digest of a run.

    Raises:
        msgspec.ValidationError: the value does not fit the type.
    """
    return _with_whole_numbers(msgspec.convert(raw, kind), raw)


def _with_whole_numbers(value: Any, raw: Any) -> Any:
    """Return a value that was read as floats, with whole numbers if the JSON has them."""
    if isinstance(value, float) and isinstance(raw, int):
        return raw
    if isinstance(value, list | tuple) and isinstance(raw, list):
        items = [_with_whole_numbers(*pair) for pair in zip(value, raw, strict=True)]
        return type(value)(*items) if hasattr(value, "_fields") else type(value)(items)
    if not isinstance(raw, dict):
        return value
    if isinstance(value, msgspec.Struct):
        keys = zip(value.__struct_fields__, value.__struct_encode_fields__, strict=True)
        return msgspec.structs.replace(value, **_whole_fields(value, keys, raw))
    if is_dataclass(value) and not isinstance(value, type):
        keys = ((field.name, field.name) for field in fields(value))
        return replace(value, **_whole_fields(value, keys, raw))
    return value


def _whole_fields(
    value: object, keys: Iterable[tuple[str, str]], raw: dict[str, Any]
) -> dict[str, Any]:
    """Return the fields of an object that a JSON value has.

    keys: pairs (field, key in the JSON).
    """
    return {
        name: _with_whole_numbers(getattr(value, name), raw[key])
        for name, key in keys
        if key in raw
    }
