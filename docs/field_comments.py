"""Descriptions of fields for the API page."""

from __future__ import annotations

import re
from typing import Any

import griffe

SETTING = re.compile(r"setting\(\s*['\"](.*?)['\"][,)]", re.DOTALL)


class FieldComments(griffe.Extension):
    """Describe a field by the help in its annotation, or by the comment at the end of its line.

    `mass: float  # [kg]` is documented as "[kg]"; a setting as `race fly --help` shows it.
    """

    def on_attribute_instance(self, *, attr: griffe.Attribute, **_: Any) -> None:
        """Give the attribute a docstring."""
        if attr.docstring is not None or attr.parent is None or not attr.parent.is_class:
            return
        text = _help(str(attr.annotation)) or _comment(attr)
        if text:
            attr.docstring = griffe.Docstring(text, parent=attr, parser="google")


def _help(annotation: str) -> str:
    """Return the help of a setting, "" for another annotation."""
    found = SETTING.search(annotation)
    return found[1] if found else ""


def _comment(attr: griffe.Attribute) -> str:
    """Return the comment at the end of the attribute's line, "" where there is none."""
    if not attr.lineno:
        return ""
    _, _, comment = attr.lines_collection[attr.filepath][attr.lineno - 1].partition("  # ")
    return "" if comment.startswith(("noqa", "type:", "pyright")) else comment.strip()
