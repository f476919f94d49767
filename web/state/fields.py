"""Fields of records as the page shows them: label, help, unit and options, from an annotation.

    course: Annotated[str, Shown("gates in their order", menu="courses")]

is all that the page, its messages and the checks need to offer this choice.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any, Literal, get_args, get_origin, get_type_hints

from quadsim.files.yaml_errors import cut
from quadsim.web.state.menu import Menu


@dataclass(frozen=True)
class Shown:
    """How the page shows a field of a record.

    Attributes:
        help: what the field does, in some words.
        label: its name on the page; empty: the name of the field.
        unit: of its number.
        menu: attribute of Menu with the names that may be chosen; empty: the names of its type.
    """

    help: str
    label: str = ""
    unit: str = ""
    menu: str = ""


@dataclass(frozen=True)
class ShownField:
    """A field of a record with its annotation."""

    name: str
    shown: Shown
    type: Any

    @property
    def label(self) -> str:
        """The name on the page."""
        return self.shown.label or self.name.replace("_", " ").capitalize()

    @property
    def is_flag(self) -> bool:
        """Whether the field is true or false."""
        return self.type is bool

    def options(self, menu: Menu | None) -> tuple[str, ...]:
        """Return the names that may be chosen; empty: any value, which is checked elsewhere."""
        if get_origin(self.type) is Literal:
            return get_args(self.type)
        if menu is not None and self.shown.menu:
            return tuple(getattr(menu, self.shown.menu))
        return ()

    def expect_offered(self, value: object, menu: Menu | None) -> None:
        """Raise ValueError if a value is not one of the options."""
        options = self.options(menu)
        if options and value not in options:
            wanted = f"expected one of {', '.join(options)}"
            raise ValueError(f"{self.name}: {wanted}, got {cut(repr(value))}")
        if self.is_flag and not isinstance(value, bool):
            raise ValueError(f"{self.name}: expected true or false, got {cut(repr(value))}")


@cache
def shown_fields(cls: type) -> Mapping[str, ShownField]:
    """Return the annotated fields of a record by name, in their order."""
    found = {}
    for name, hint in get_type_hints(cls, include_extras=True).items():
        for shown in getattr(hint, "__metadata__", ()):
            if isinstance(shown, Shown):
                found[name] = ShownField(name, shown, get_args(hint)[0])
    return found
