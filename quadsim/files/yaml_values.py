"""A YAML node as the plain value that a msgspec type asks for.

The schema decides what a scalar means, never YAML 1.1: in a number's place `1e-3` is a number and
`yes`, `012` (octal there) and `22:30` (base 60 there) are errors; in a text's place only what YAML
reads as text is text.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from math import isfinite
from typing import Any

import yaml
from msgspec import inspect

from quadsim.files.yaml_words import (
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

DECIMAL = re.compile(r"[-+]?((0|[1-9]\d*)(\.\d*)?|\.\d+)([eE][-+]?\d+)?", re.ASCII)
RENAMED = {"ess": "target_ess"}  # keys of older versions
WHOLE = re.compile(r"[-+]?(0|[1-9]\d*)", re.ASCII)


class Misfit(Exception):  # noqa: N818 (strict_yaml turns it into a FileError, which knows the file's name)
    """What stands at `mark` (line, column), under the key `path`, is not what was asked for."""

    def __init__(self, mark: yaml.Mark, path: str, problem: str) -> None:
        super().__init__(problem)
        self.mark, self.path, self.problem = mark, path, problem


def value(node: yaml.Node, kind: Any, path: str = "", unit: str = "") -> Any:
    """The node as what `kind` (of msgspec.inspect) asks for; a unit is handed down to the items.
    Raises Misfit."""
    text = node.value if isinstance(node, yaml.ScalarNode) else ""
    unquoted = "" if getattr(node, "style", None) else text
    match kind:
        case inspect.Metadata():
            return value(node, kind.type, path, unit_of(kind, unit))
        case inspect.UnionType():
            return None if is_null(node) else value(node, unless_null(kind), path, unit)
        case inspect.StructType() | inspect.DataclassType():
            return _mapping(node, kind, path)
        case inspect.TupleType() | inspect.VarTupleType() if isinstance(node, yaml.SequenceNode):
            return _sequence(node, kind, path, unit)
        case inspect.FloatType() if DECIMAL.fullmatch(unquoted) and isfinite(float(unquoted)):
            return _within_range(float(unquoted), node, kind, path, unit)
        case inspect.IntType() if WHOLE.fullmatch(unquoted) and isfinite(float(unquoted)):
            return _within_range(int(unquoted), node, kind, path, unit)
        case inspect.BoolType() if unquoted.lower() in ("true", "false"):
            return unquoted.lower() == "true"
        case inspect.StrType() if node.tag == TEXT and re.search(kind.pattern or "", text):
            return text
        case inspect.LiteralType() if text in kind.values:
            return text
    raise Misfit(node.start_mark, path, f"expected {expected(kind, unit)}, got {found(node, kind)}")


def descend(node: yaml.Node, path: str) -> yaml.Node:
    """The node at "gates[3].yaw_deg", or the nearest above it where the file leaves that key to its
    default."""
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
    above = (kind.ge is None or number >= kind.ge) and (kind.gt is None or number > kind.gt)
    below = (kind.le is None or number <= kind.le) and (kind.lt is None or number < kind.lt)
    if not (above and below):
        raise Misfit(
            node.start_mark,
            path,
            f"expected {expected(kind, unit)} {limits(kind)}, got {node.value[:60]}",
        )
    return number


def _mapping(node: yaml.Node, kind: Any, path: str) -> dict[str, Any]:
    if not isinstance(node, yaml.MappingNode):
        raise Misfit(node.start_mark, path, f"expected a mapping (key: value), got {found(node)}")
    fields = {f.encode_name: f for f in kind.fields}
    lines: dict[str, int] = {}
    values = {}
    for key_node, value_node in node.value:
        key = _key(key_node, path, fields, lines)
        lines[key] = key_node.start_mark.line + 1
        values[key] = value(value_node, fields[key].type, _join(path, key))
    for name, field in fields.items():
        if field.required and name not in values:
            raise Misfit(
                node.start_mark, _join(path, name), f"missing, expected {expected(field.type)}"
            )
    return values


def _key(node: yaml.Node, path: str, known: Iterable[str], lines: dict[str, int]) -> str:
    """The key, one of `known` and not among the `lines` read so far."""
    if not isinstance(node, yaml.ScalarNode):
        raise Misfit(node.start_mark, path, f"expected a key, got {found(node)}")
    key = node.value
    where = _join(path, key if key.isidentifier() and len(key) <= 60 else shown(key))
    if key not in known:
        new = RENAMED.get(key, "")
        advice = f"renamed to {new}" if new in known else did_you_mean(key, known)
        raise Misfit(node.start_mark, where, f"unknown key, {advice}")
    if key in lines:
        raise Misfit(node.start_mark, where, f"duplicate key, first on line {lines[key]}")
    return key


def _sequence(node: yaml.Node, kind: Any, path: str, unit: str) -> list[Any]:
    if not isinstance(node, yaml.SequenceNode):
        raise Misfit(node.start_mark, path, f"expected {expected(kind, unit)}, got {found(node)}")
    count = len(node.value)
    kinds = kind.item_types if isinstance(kind, inspect.TupleType) else (kind.item_type,) * count
    if count != len(kinds) or count < (getattr(kind, "min_length", None) or 0):
        raise Misfit(node.start_mark, path, f"expected {expected(kind, unit)}, got {count}")
    return [
        value(n, k, f"{path}[{i}]", unit)
        for i, (n, k) in enumerate(zip(node.value, kinds, strict=True))
    ]


def _join(path: str, key: str) -> str:
    return f"{path}.{key}" if path else key
