"""Write plain values as YAML, which quadsim.files.strict_yaml reads as equal values."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import MISSING, fields, is_dataclass
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from quadsim.files.atomic import replace_file
from quadsim.files.strict_yaml import FileError
from quadsim.files.values import SettingError
from quadsim.files.yaml_errors import shown_value

LARGEST_WHOLE = 1e15  # floats up to it that are whole are written without a point

T = TypeVar("T")


def dump(entries: Mapping[str, Any]) -> str:
    """Return a mapping as YAML, with a line for each key and each item of a list of mappings.

    Args:
        entries: texts, numbers, truth values, None, lists and mappings, by key.

    Raises:
        SettingError: a value has another type; the error names its key.
    """
    lines: list[str] = []
    for key, value in entries.items():
        if isinstance(value, Mapping) and value:
            lines.append(f"{key}:")
            lines += [f"  {name}: {_flow(inner, key)}" for name, inner in value.items()]
        elif isinstance(value, list | tuple) and value and isinstance(value[0], Mapping):
            lines.append(f"{key}:")
            lines += [f"  - {_flow(item, key)}" for item in value]
        else:
            lines.append(f"{key}: {_flow(value, key)}")
    return "\n".join(lines) + "\n"


def entries_of(record: Any, keys: type | None = None) -> dict[str, Any]:
    """Return the fields of a dataclass as entries of a file, without those at their default.

    Args:
        record: an object of a dataclass, whose fields may be such objects or tuples of them.
        keys: the class whose fields are the keys of the file, if the record has more.
    """
    entries = {
        field.name: getattr(record, field.name)
        for field in fields(keys or record)
        if field.default is MISSING or getattr(record, field.name) != field.default
    }
    return {key: _entry_of(value) for key, value in entries.items()}


def _entry_of(value: Any) -> Any:
    """Return a value in a form that `dump` accepts."""
    if isinstance(value, tuple):
        return [_entry_of(item) for item in value]
    return entries_of(value) if is_dataclass(value) else value


def with_comments(text: str, comments: Mapping[str, str]) -> str:
    """Return the text of `dump` with comments at the ends of lines.

    Args:
        text: result of `dump`.
        comments: comments by the names of keys, which may be keys of inner mappings.
    """
    lines = []
    for line in text.splitlines():
        comment = comments.get(line.partition(":")[0].strip())
        lines.append(f"{line}  # {comment}" if comment else line)
    return "\n".join(lines) + "\n"


def remade(entries: Mapping[str, Any], read: Callable[[str, str], T], name: str) -> T:
    """Return the object that a file with these entries describes.

    Args:
        entries: argument of `dump`.
        read: function that makes the object from a text and the name of its file; raises FileError.
        name: name of the object.

    Raises:
        SettingError: an entry cannot be used; the error names its key.
    """
    try:
        return read(dump(entries), f"{name}.yaml")
    except FileError as error:
        raise SettingError(error.key or name, error.problem or str(error)) from None


def written(text: str, path: str | Path | None) -> str:
    """Return the text, and write it to a file if a path is given.

    Raises:
        FileError: the file cannot be written.
    """
    if path is not None:
        try:
            replace_file(Path(path), text.encode())
        except OSError as error:
            raise FileError(f"{path}: {(error.strerror or str(error)).lower()}") from None
    return text


def _flow(value: Any, key: str) -> str:
    """Return a value as YAML on one line. Raises SettingError with the key."""
    if isinstance(value, np.ndarray | np.generic):
        value = value.tolist()
    match value:
        case None:
            return "null"
        case bool():
            return str(value).lower()
        case int():
            return str(value)
        case float():
            is_short = value.is_integer() and abs(value) < LARGEST_WHOLE
            return f"{value:.0f}" if is_short else repr(value)
        case str():
            return _quoted(value)
        case list() | tuple():
            return f"[{', '.join(_flow(item, key) for item in value)}]"
        case Mapping():
            items = (f"{name}: {_flow(inner, key)}" for name, inner in value.items())
            return f"{{{', '.join(items)}}}"
    raise SettingError(
        key, f"expected numbers, texts, lists or a mapping, got {shown_value(value)}"
    )


def _quoted(text: str) -> str:
    """Return a text in double quotes, with the escapes that YAML needs."""
    return '"' + "".join(map(_escaped, text)) + '"'


def _escaped(character: str) -> str:
    if character in '"\\':
        return "\\" + character
    return character if character.isprintable() else f"\\U{ord(character):08x}"
