"""Convert YAML nodes to plain values of msgspec types.

The schema decides the meaning of a scalar, not YAML 1.1. If a number is expected, `1e-3` is a
number, and `yes`, `012` (octal in YAML 1.1) and `22:30` (base 60 there) are errors. If a text is
expected, only a scalar that YAML reads as text is accepted.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping, Sequence
from typing import Any

import yaml
from msgspec import inspect

from quadsim.files.scalars import decimal_number, is_in_range, truth_value, whole_number
from quadsim.files.yaml_errors import (
    LONGEST,
    TEXT,
    did_you_mean,
    expected,
    found,
    is_null,
    limits,
    shown,
    unit_of,
    unless_null,
)


class Misfit(Exception):  # noqa: N818 (strict_yaml makes a FileError of it, with the file's name)
    """The error of a node that does not fit its type, with its place (line, column) and its key."""

    def __init__(self, mark: yaml.Mark, path: str, problem: str) -> None:
        super().__init__(problem)
        self.mark = mark
        self.path = path
        self.problem = problem


def value(node: yaml.Node, kind: Any, path: str = "", unit: str = "") -> Any:
    """Return a node as a value of a type.

    Args:
        node: a node of PyYAML's tree.
        kind: a type of msgspec.inspect.
        path: the key of the node, such as "gates[3].yaw_deg".
        unit: unit of the numbers; the items of a list inherit the list's unit.

    Raises:
        Misfit: the node does not fit the type.
    """
    text = node.value if isinstance(node, yaml.ScalarNode) else ""
    is_quoted = isinstance(node, yaml.ScalarNode) and node.style
    unquoted = "" if is_quoted else text
    match kind:
        case inspect.Metadata():
            return value(node, kind.type, path, unit_of(kind, unit))
        case inspect.UnionType():
            return None if is_null(node) else value(node, unless_null(kind), path, unit)
        case inspect.StructType() | inspect.DataclassType():
            return _mapping(node, kind, path)
        case inspect.TupleType() | inspect.VarTupleType() if isinstance(node, yaml.SequenceNode):
            return _sequence(node, kind, path, unit)
        case inspect.FloatType() if (number := decimal_number(unquoted)) is not None:
            return _within_range(number, node, kind, path, unit)
        case inspect.IntType() if (number := whole_number(unquoted)) is not None:
            return _within_range(number, node, kind, path, unit)
        case inspect.BoolType() if (truth := truth_value(unquoted)) is not None:
            return truth
        case inspect.StrType() if node.tag == TEXT and re.search(kind.pattern or "", text):
            return text
        case inspect.LiteralType() if text in kind.values:
            return text
    raise Misfit(node.start_mark, path, f"expected {expected(kind, unit)}, got {found(node, kind)}")


def misfits(node: yaml.Node, kind: Any, path: str = "", unit: str = "") -> list[Misfit]:
    """Return all misfits of a node with a type; `value` raises the first of them.

    Args:
        node, kind, path, unit: see `value`.
    """
    found: list[Misfit] = []
    match kind:
        case inspect.Metadata():
            return misfits(node, kind.type, path, unit_of(kind, unit))
        case inspect.UnionType():
            return [] if is_null(node) else misfits(node, unless_null(kind), path, unit)
        case inspect.StructType() | inspect.DataclassType() if isinstance(node, yaml.MappingNode):
            found = _misfits_of_mapping(node, kind, path)
        case inspect.TupleType() if isinstance(node, yaml.SequenceNode):
            if len(node.value) == len(kind.item_types):
                found = _misfits_of_items(node, kind.item_types, path, unit)
        case inspect.VarTupleType() if isinstance(node, yaml.SequenceNode):
            found = _misfits_of_items(node, (kind.item_type,) * len(node.value), path, unit)
    if not found:
        try:
            value(node, kind, path, unit)
        except Misfit as misfit:
            return [misfit]
    return found


def _misfits_of_mapping(node: yaml.MappingNode, kind: Any, path: str) -> list[Misfit]:
    """Return the misfits of a mapping: wrong keys, wrong values, and missing keys."""
    fields = {f.encode_name: f for f in kind.fields}
    lines: dict[str, int] = {}
    found: list[Misfit] = []
    for key_node, value_node in node.value:
        try:
            key = _key(key_node, path, fields, lines)
        except Misfit as misfit:
            found.append(misfit)
            continue
        lines[key] = key_node.start_mark.line + 1
        found += misfits(value_node, fields[key].type, _join(path, key))
    return found + _missing(node, fields, lines, path)


def _misfits_of_items(
    node: yaml.SequenceNode, kinds: Sequence[Any], path: str, unit: str
) -> list[Misfit]:
    """Return the misfits of the items of a list, whose length is right."""
    items = enumerate(zip(node.value, kinds, strict=True))
    return [m for i, (item, of) in items for m in misfits(item, of, f"{path}[{i}]", unit)]


def _missing(
    node: yaml.Node, fields: Mapping[str, Any], given: Collection[str], path: str
) -> list[Misfit]:
    """Return a misfit for each required key that a mapping lacks."""
    return [
        Misfit(node.start_mark, _join(path, name), f"missing, expected {expected(field.type)}")
        for name, field in fields.items()
        if field.required and name not in given
    ]


def descend(node: yaml.Node, path: str) -> yaml.Node:
    """Return the node at a key such as "gates[3].yaw_deg".

    If the file lacks the key, the nearest node above it is returned.
    """
    for part in re.findall(r"[^.\[\]]+", path):
        if isinstance(node, yaml.MappingNode):
            children = {key.value: child for key, child in node.value}
        else:
            children = {str(i): child for i, child in enumerate(node.value)}
        if part not in children:
            break
        node = children[part]
    return node


def _within_range(number: float, node: yaml.Node, kind: Any, path: str, unit: str) -> float:
    """Return a number. Raises Misfit if it is out of range."""
    if not is_in_range(number, kind):
        wanted = f"expected {expected(kind, unit)} {limits(kind)}"
        raise Misfit(node.start_mark, path, f"{wanted}, got {node.value[:LONGEST]}")
    return number


def _mapping(node: yaml.Node, kind: Any, path: str) -> Any:
    """Return a mapping as an instance of its schema. Raises Misfit."""
    if not isinstance(node, yaml.MappingNode):
        raise Misfit(node.start_mark, path, f"expected a mapping (key: value), got {found(node)}")
    fields = {f.encode_name: f for f in kind.fields}
    lines: dict[str, int] = {}
    values: dict[str, Any] = {}
    for key_node, value_node in node.value:
        key = _key(key_node, path, fields, lines)
        lines[key] = key_node.start_mark.line + 1
        values[key] = value(value_node, fields[key].type, _join(path, key))
    for misfit in _missing(node, fields, values, path):
        raise misfit
    try:
        return kind.cls(**values)
    except ValueError as error:  # a check of the schema's own
        raise Misfit(node.start_mark, path, str(error)) from None


def _key(node: yaml.Node, path: str, known: Mapping[str, Any], lines: dict[str, int]) -> str:
    """Return a key, which must be one of `known` and not in `lines`, the keys read so far.

    Raises:
        Misfit: the key is unknown or duplicate.
    """
    if not isinstance(node, yaml.ScalarNode):
        raise Misfit(node.start_mark, path, f"expected a key, got {found(node)}")
    key = node.value
    is_plain = key.isidentifier() and len(key) <= LONGEST
    where = _join(path, key if is_plain else shown(key))
    if key not in known:
        home = _home(key, known)
        advice = f"it belongs under '{home}'" if home else did_you_mean(key, known)
        raise Misfit(node.start_mark, where, f"unknown key, {advice}")
    if key in lines:
        raise Misfit(node.start_mark, where, f"duplicate key, first on line {lines[key]}")
    return key


def _home(key: str, known: Mapping[str, Any]) -> str:
    """Return the key of the inner mapping that has a key of this name, "" if there is none."""
    for name, field in known.items():
        kind: Any = field.type
        while isinstance(kind, inspect.Metadata | inspect.UnionType):
            kind = kind.type if isinstance(kind, inspect.Metadata) else unless_null(kind)
        has_keys = isinstance(kind, inspect.StructType | inspect.DataclassType)
        if has_keys and key in {f.encode_name for f in kind.fields}:
            return name
    return ""


def _sequence(node: yaml.SequenceNode, kind: Any, path: str, unit: str) -> tuple[Any, ...]:
    """Return the items of a list. Raises Misfit."""
    count = len(node.value)
    if isinstance(kind, inspect.TupleType):
        kinds = kind.item_types
        fits = count == len(kinds)
    else:
        kinds = (kind.item_type,) * count
        fits = count >= (kind.min_length or 0)
    if not fits:
        raise Misfit(node.start_mark, path, f"expected {expected(kind, unit)}, got {count}")
    items = enumerate(zip(node.value, kinds, strict=True))
    return tuple(value(item, of_item, f"{path}[{i}]", unit) for i, (item, of_item) in items)


def _join(path: str, key: str) -> str:
    return f"{path}.{key}" if path else key
