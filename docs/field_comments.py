"""Descriptions of fields for the API page."""

from __future__ import annotations

import re
import textwrap
from pathlib import Path
from typing import Any, TypeGuard

import griffe

SETTING = re.compile(r"setting\(\s*['\"](.*?)['\"][,)]", re.DOTALL)
# "Attributes:" of a docstring, with its indented lines
ATTRIBUTES = re.compile(r"^Attributes:\n((?: .*\n|\n(?= ))+)", re.MULTILINE)
# "name: text", whose further lines are indented more
ITEM = re.compile(r"^(\w+): (.*(?:\n +.*)*)", re.MULTILINE)


class FieldComments(griffe.Extension):
    """List the fields of a record in its docstring, each with its type and description.

    A field is described by the docstring of its class, by the help in its annotation, or by the
    comment at the end of its line: `mass: float  # [kg]` is documented as "[kg]"; a setting as
    `race fly --help` shows it.
    """

    def __init__(self) -> None:
        """Know no types of fields yet."""
        super().__init__()
        self._types: dict[str, str] = {}  # path of a field -> its type

    def on_attribute_instance(self, *, attr: griffe.Attribute, **_: Any) -> None:
        """Give the attribute a docstring, and keep the type alone of an annotation with help."""
        if attr.parent is None or not attr.parent.is_class:
            return
        text = _help(str(attr.annotation)) or _comment(attr)
        if text and attr.docstring is None:
            attr.docstring = griffe.Docstring(text, parent=attr, parser="google")
        attr.annotation = _type(attr.annotation)

    def on_class(self, *, cls: griffe.Class, **_: Any) -> None:
        """Move the fields of a record from its members into its docstring.

        A member takes a heading and a block of code, a field one line.
        """
        fields = {name: member for name, member in cls.members.items() if _is_field(member)}
        self._types |= {field.path: str(field.annotation) for field in fields.values()}
        if cls.docstring is None:
            return
        docstring = cls.docstring.value + "\n"
        found = ATTRIBUTES.search(docstring)
        described = dict(ITEM.findall(textwrap.dedent(found[1]))) if found else {}
        texts = {name: _text(field) for name, field in fields.items()} | described
        if not texts:
            return
        section = "".join(
            f"    {name}{self._type_of(cls, name)}: {' '.join(text.split())}\n"
            for name, text in texts.items()
        )
        if found:
            docstring = docstring.replace(found[0], "")
        text, heading, examples = docstring.partition("Examples:\n")
        text = f"{text.rstrip()}\n\nAttributes:\n{section}\n{heading}{examples}"
        cls.docstring.value = text.rstrip()
        for name in fields:
            cls.del_member(name)

    def _type_of(self, cls: griffe.Class, name: str) -> str:
        """Return " (type)" of a field that the class has itself or inherits, "" if it has none."""
        member = cls.all_members.get(name)
        if isinstance(member, griffe.Attribute | griffe.Alias):
            found = str(member.annotation or "")
        else:
            paths = (f"{base.path}.{name}" for base in cls.mro())
            found = next((self._types[path] for path in paths if path in self._types), "")
        return f" ({found})" if found else ""


def _is_field(member: griffe.Object | griffe.Alias) -> TypeGuard[griffe.Attribute]:
    """Return whether a member of a class is a public field of a record."""
    return (
        isinstance(member, griffe.Attribute)
        and member.annotation is not None
        and "property" not in member.labels
        and not member.name.startswith("_")
    )


def _text(field: griffe.Attribute) -> str:
    return "" if field.docstring is None else field.docstring.value


def _type(annotation: Any) -> Any:
    """Return T of Annotated[T, ...], and any other annotation as it is."""
    if not isinstance(annotation, griffe.ExprSubscript) or str(annotation.left) != "Annotated":
        return annotation
    assert isinstance(annotation.slice, griffe.ExprTuple)
    return annotation.slice.elements[0]


def _help(annotation: str) -> str:
    """Return the help of a setting, "" for another annotation."""
    found = SETTING.search(annotation)
    return found[1] if found else ""


def _comment(attr: griffe.Attribute) -> str:
    """Return the comment at the end of the attribute's line, "" where there is none."""
    if not attr.lineno or not isinstance(attr.filepath, Path):
        return ""
    _, _, comment = attr.lines_collection[attr.filepath][attr.lineno - 1].partition("  # ")
    return "" if comment.startswith(("noqa", "type:", "pyright")) else comment.strip()
