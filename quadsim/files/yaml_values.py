"""A YAML node as the plain value that a msgspec type asks for.

The schema decides what a scalar means, never YAML 1.1. Where a number belongs, `1e-3` is a number,
and `yes`, `012` (octal there) and `22:30` (base 60 there) are errors. Where a text belongs, only a
scalar that YAML reads as text is text.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
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

MOST_KEYS = 12  # that an error names beside the first


class Misfit(Exception):  # noqa: N818 (strict_yaml makes a FileError of it, with the file's name)
    """The node at `mark` (line, column), under the key `path`, is not what was asked for."""

    def __init__(self, mark: yaml.Mark, path: str, problem: str) -> None:
        super().__init__(problem)
        self.mark = mark
        self.path = path
        self.problem = problem


def value(node: yaml.Node, kind: Any, path: str = "", unit: str = "") -> Any:
    """Return the node as the value that a type asks for.

    Args:
        node: a node of PyYAML's tree.
        kind: a type of msgspec.inspect.
        path: the key of the node, such as "gates[3].yaw_deg".
        unit: the unit of its numbers; that of a list is handed down to its items.

    Raises:
        Misfit: the node is none of this type.
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


def descend(node: yaml.Node, path: str) -> yaml.Node:
    """Return the node at a key such as "gates[3].yaw_deg".

    Where the file leaves that key to its default, it is the nearest node above.
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
    """Return the number. Raises Misfit where it is out of its range."""
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
    unknown = _unknown(node, fields)
    for key_node, value_node in node.value:
        key = _key(key_node, path, fields, lines, unknown)
        lines[key] = key_node.start_mark.line + 1
        values[key] = value(value_node, fields[key].type, _join(path, key))
    for name, field in fields.items():
        if field.required and name not in values:
            problem = f"missing, expected {expected(field.type)}"
            raise Misfit(node.start_mark, _join(path, name), problem)
    try:
        return kind.cls(**values)
    except ValueError as error:  # a check of the schema's own
        raise Misfit(node.start_mark, path, str(error)) from None


def _unknown(node: yaml.MappingNode, known: Iterable[str]) -> list[str]:
    """Return the keys of a mapping that are not known, as an error shows them."""
    keys = [key.value for key, _ in node.value if isinstance(key, yaml.ScalarNode)]
    return [_plain(key) for key in dict.fromkeys(keys) if key not in known]


def _plain(key: str) -> str:
    """Return a key as an error shows it."""
    return key if key.isidentifier() and len(key) <= LONGEST else shown(key)


def _key(
    node: yaml.Node,
    path: str,
    known: Iterable[str],
    lines: dict[str, int],
    unknown: Sequence[str],
) -> str:
    """Return the key, which is one of `known` and not among the `lines` read so far.

    unknown: all keys of the mapping that are not known.
    """
    if not isinstance(node, yaml.ScalarNode):
        raise Misfit(node.start_mark, path, f"expected a key, got {found(node)}")
    key = node.value
    where = _join(path, _plain(key))
    if key not in known:
        problem = f"unknown key, {did_you_mean(key, known)}"
        others = [other for other in unknown if other != _plain(key)]
        if others:
            more = ", ..." if len(others) > MOST_KEYS else ""
            problem += f"; also unknown: {', '.join(others[:MOST_KEYS])}{more}"
        raise Misfit(node.start_mark, where, problem)
    if key in lines:
        raise Misfit(node.start_mark, where, f"duplicate key, first on line {lines[key]}")
    return key


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
