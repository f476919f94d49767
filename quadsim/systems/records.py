"""Records: NamedTuples of numbers, of other records too. Their fields give every table its names and its order."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, get_type_hints


def is_record(kind: Any) -> bool:
    """Return whether this type is a NamedTuple."""
    return isinstance(kind, type) and issubclass(kind, tuple) and hasattr(kind, "_fields")


def field_types(kind: type) -> dict[str, Any]:
    """Return the type of each field of a NamedTuple, in order; `float` where none is annotated."""
    hints = get_type_hints(kind)
    return {name: hints.get(name, float) for name in kind._fields}  # pyright: ignore[reportAttributeAccessIssue]


def units_of(kind: type) -> dict[str, str]:
    """Return the unit of each field of a NamedTuple of `Annotated[float, unit]`, in order."""
    hints = get_type_hints(kind, include_extras=True)
    return {name: hints[name].__metadata__[0] for name in kind._fields}  # pyright: ignore[reportAttributeAccessIssue]


def flat(value: Any) -> Iterator[Any]:
    """Yield the numbers of a record in order, those of inner records in their place; a number itself."""
    if isinstance(value, tuple):
        for inner in value:
            yield from flat(inner)
    else:
        yield value


def unflat(kind: type, numbers: Iterator[Any]) -> Any:
    """Return a record of this type of the next numbers, the inverse of `flat`."""
    fields = (unflat(t, numbers) if is_record(t) else next(numbers) for t in field_types(kind).values())
    return kind(*fields)


def flat_names(kind: type, between: str = "_") -> Iterator[str]:
    """Yield a name for each number of a record, in the order of `flat`: outer and inner field, joined."""
    for field, inner in field_types(kind).items():
        if is_record(inner):
            for name in flat_names(inner, between):
                yield f"{field}{between}{name}"
        else:
            yield field
