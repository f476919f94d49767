"""Texts for errors in a file: the expected type, the found YAML node, and similar names."""

from __future__ import annotations

import re
from collections.abc import Iterable
from difflib import get_close_matches
from typing import Any

import yaml
from msgspec import inspect

TEXT = "tag:yaml.org,2002:str"
NULL = "tag:yaml.org,2002:null"
TRAPS = (
    (re.compile(r"[-+]?0\d+"), "YAML reads it as octal: drop the leading zero"),
    (re.compile(r"[-+]?\d+(:\d+)+(\.\d*)?"), "YAML reads it in base 60"),
    (re.compile(r"(?i)[-+]?\.(inf|nan)"), "not finite"),
    (re.compile(r"(?i)yes|no|on|off|true|false"), "YAML reads it as true or false"),
)
LONGEST = 60  # characters of a text that an error shows


def expected(kind: Any, unit: str = "", count: str = "") -> str:
    """Return a text for the values that a type expects, such as "3 numbers [m]".

    Args:
        kind: a type of msgspec.inspect.
        unit: unit of the numbers.
        count: number of values as text; "" for a single value.
    """
    noun = "mapping"
    rest = ""
    match kind:
        case inspect.Metadata():
            return expected(kind.type, unit_of(kind, unit), count)
        case inspect.UnionType():
            return expected(unless_null(kind), unit, count)
        case inspect.TupleType():
            inner = expected(kind.item_types[0], unit, str(len(kind.item_types)))
            return f"{count} lists of {inner}" if count else inner
        case inspect.VarTupleType():
            return expected(kind.item_type, unit, f"{kind.min_length or 0} or more")
        case inspect.BoolType():
            return "true or false"
        case inspect.LiteralType():
            return " or ".join(map(repr, kind.values))
        case inspect.StrType():
            rest = _which_text(kind)
            return f"{count} texts{rest}" if count else f"text{rest}"
        case inspect.FloatType():
            noun = "number"
            rest = f" [{unit}]" if unit else ""
        case inspect.IntType():
            noun = "whole number"
            rest = f" [{unit}]" if unit else ""
        case inspect.StructType() | inspect.DataclassType():
            required = ", ".join(f.encode_name for f in kind.fields if f.required)
            rest = f" with {required}" if required else ""
    return f"{count} {noun}s{rest}" if count else f"a {noun}{rest}"


def _which_text(kind: inspect.StrType) -> str:
    """Return the restriction of a text type, such as " like [0-9]+", "" if there is none."""
    if kind.pattern:
        return f" like {kind.pattern}"
    return " that is not empty" if kind.min_length else ""


def limits(kind: Any) -> str:
    """Return the range of a number as text, such as "> 0 and <= 100"."""
    signs = ((">=", kind.ge), (">", kind.gt), ("<=", kind.le), ("<", kind.lt))
    return " and ".join(f"{sign} {bound:g}" for sign, bound in signs if bound is not None)


def found(node: yaml.Node, kind: Any = None) -> str:
    """Return a text for the value of a node, with a hint if YAML 1.1 reads it unexpectedly."""
    if isinstance(node, yaml.SequenceNode):
        return f"a list of {len(node.value)}"
    if not isinstance(node, yaml.ScalarNode):
        return "a mapping"
    if is_null(node):
        return "nothing"
    if node.style:
        return f"the quoted text {shown(node.value)}"
    traps = [why for pattern, why in TRAPS if pattern.fullmatch(node.value)]
    if isinstance(kind, inspect.StrType) and node.tag != TEXT:
        if not traps:
            traps = [f"YAML reads it as {node.tag.rpartition(':')[2]}"]
        traps.append("put it in quotes")
    remark = f" ({'; '.join(traps)})" if traps else ""
    return shown(node.value) + remark


def shown(text: str) -> str:
    """Return a text in quotes, on one line, with escaped control characters and shortened."""
    return repr(cut(text))


def shown_value(value: object) -> str:
    """Return the repr of a value on one line, shortened, or the name of a function."""
    name = getattr(value, "__qualname__", None)
    if isinstance(name, str):
        return cut(f"{getattr(value, '__module__', '')}.{name}")
    return cut(" ".join(repr(value).split()))


def cut(text: str, longest: int = LONGEST) -> str:
    """Return the text, shortened to `longest` characters if it has more."""
    return text if len(text) <= longest else text[: longest - 3] + "..."


def did_you_mean(word: str, known: Iterable[str]) -> str:
    """Return "did you mean 'laps'?", or the list of all known names if none is similar.

    A name that lacks its unit counts as similar, "did you mean 'yaw_deg' (in degrees)?", and so
    does the beginning of a name.
    """
    names = list(known)
    if f"{word}_deg" in names:
        return f"did you mean '{word}_deg' (in degrees)?"
    longer = [name for name in names if word and name.startswith(word)]
    near = get_close_matches(word, names, n=1, cutoff=0.5) or longer
    return f"did you mean {near[0]!r}?" if near else f"known are {', '.join(names)}"


def unit_of(kind: inspect.Metadata, outer: str) -> str:
    """Return the unit of an annotation, or the outer unit if it has none."""
    return (kind.extra or {}).get("unit", outer)


def unless_null(kind: inspect.UnionType) -> Any:
    """Return X of the type `X | None`, the only union that schemas use."""
    (inner,) = (k for k in kind.types if not isinstance(k, inspect.NoneType))
    return inner


def is_null(node: yaml.Node) -> bool:
    """Return whether the node is YAML's null, written without quotes."""
    return isinstance(node, yaml.ScalarNode) and not node.style and node.tag == NULL
