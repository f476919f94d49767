"""For the API page: the comment at the end of a dataclass field's line is the field's description."""

from __future__ import annotations

from typing import Any

import griffe


class FieldComments(griffe.Extension):
    """`mass: float  # [kg]` is documented as "[kg]", as `race fly --help` shows it."""

    def on_attribute_instance(self, *, attr: griffe.Attribute, **_: Any) -> None:
        if attr.docstring is None and attr.parent is not None and attr.parent.is_class and attr.lineno:
            _, found, comment = attr.lines_collection[attr.filepath][attr.lineno - 1].partition("  # ")
            if found and not comment.startswith(("noqa", "type:", "pyright")):
                attr.docstring = griffe.Docstring(comment.strip(), parent=attr, parser="google")
