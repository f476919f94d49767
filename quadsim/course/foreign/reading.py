"""Values of foreign files with their keys, so that each error names the key."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Callable
from math import hypot, isfinite
from typing import Any

import numpy as np
import yaml

from quadsim.files.scalars import decimal_number
from quadsim.files.strict_yaml import FileError, parse
from quadsim.files.yaml_errors import did_you_mean, shown_value
from quadsim.rotation import Quaternion, Vec3, matrix

# Makes the error of a key and its problem
Fail = Callable[[str, str], FileError]
LARGEST = 1e7  # of a coordinate in any unit
# Length of a quaternion that counts as a unit quaternion with rounded digits
UNIT_LENGTH = 0.05
IDENTITY = np.eye(3)


class Entry:
    """A value of a file, and its key."""

    def __init__(self, value: Any, key: str, fail: Fail):
        """Wrap a plain value.

        Args:
            value: a mapping, list, text, number, truth value or None.
            key: key of the value, "" for the whole file.
            fail: makes the error of a key and a problem.
        """
        self.value = value
        self.key = key
        self.fail = fail

    def error(self, problem: str) -> FileError:
        """Return an error that names this value's key and a problem."""
        return self.fail(self.key, problem)

    def wrong(self, wanted: str) -> FileError:
        """Return an error that says what was expected in place of this value."""
        return self.error(f"expected {wanted}, got {shown_value(self.value)}")

    def get(self, name: str) -> Entry | None:
        """Return the entry under a key of a mapping, None if there is none. Raises FileError."""
        if not isinstance(self.value, dict):
            raise self.wrong("a mapping (key: value)")
        if self.value.get(name) is None:
            return None
        return Entry(self.value[name], f"{self.key}.{name}" if self.key else name, self.fail)

    def first(self, *names: str) -> Entry | None:
        """Return the entry under the first of these keys that exists, or None. Raises FileError."""
        return next((found for found in map(self.get, names) if found), None)

    def at(self, *names: str) -> Entry:
        """Return the entry under the first of these keys. Raises FileError if no key exists."""
        found = self.first(*names)
        if found is None:
            known = ", ".join(map(str, self.value)) or "nothing"
            key = f"{self.key}.{names[0]}" if self.key else names[0]
            wanted = " or ".join(names)
            raise self.fail(key, f"missing, expected {wanted}, got {shown_value(known)}")
        return found

    def items(self) -> list[Entry]:
        """Return the entries of a list. Raises FileError."""
        if not isinstance(self.value, list):
            raise self.wrong("a list")
        return [Entry(v, f"{self.key}[{i}]", self.fail) for i, v in enumerate(self.value)]

    def named(self) -> list[tuple[str, Entry]]:
        """Return entries with their keys in a mapping, or with their numbers, from 1, in a list."""
        if isinstance(self.value, list):
            return [(str(i), entry) for i, entry in enumerate(self.items(), 1)]
        if not isinstance(self.value, dict):
            raise self.wrong("a mapping or a list")
        place = f"{self.key}." if self.key else ""
        pairs = self.value.items()
        return [(str(k), Entry(v, f"{place}{k}", self.fail)) for k, v in pairs]

    def number(self) -> float:
        """Return a number. Raises FileError."""
        value = self.value
        if isinstance(value, int | float) and not isinstance(value, bool):
            try:
                number = float(value)
            except OverflowError:
                number = float("inf")
            if isfinite(number) and abs(number) <= LARGEST:
                return number
        raise self.wrong(f"a number from {-LARGEST:g} to {LARGEST:g}")

    def size(self) -> float:
        """Return a number above 0. Raises FileError."""
        number = self.number()
        if number <= 0.0:
            raise self.wrong("a number > 0")
        return number

    def numbers(self, count: int, names: str) -> tuple[float, ...]:
        """Return a list of numbers.

        Args:
            count: number of values that are expected.
            names: names of the values, for the error.

        Raises:
            FileError: the entry is not a list of this many numbers.
        """
        if not isinstance(self.value, list) or len(self.value) != count:
            raise self.wrong(f"{count} numbers ({names})")
        return tuple(item.number() for item in self.items())

    def vector(self) -> Vec3:
        """Return the three numbers of a list, or of x_val, y_val and z_val. Raises FileError."""
        if isinstance(self.value, dict):
            x, y, z = (self.at(f"{name}_val", name).number() for name in "xyz")
        else:
            x, y, z = self.numbers(3, "x, y, z")
        return x, y, z

    def quaternion(self) -> Quaternion:
        """Return the unit quaternion wxyz of a list, or of w_val to z_val. Raises FileError."""
        if isinstance(self.value, dict):
            w, x, y, z = (self.at(f"{name}_val", name).number() for name in "wxyz")
        else:
            w, x, y, z = self.numbers(4, "w, x, y, z of a quaternion")
        length = hypot(w, x, y, z)
        if abs(length - 1.0) > UNIT_LENGTH:
            raise self.error(f"expected a quaternion of length 1, got the length {length:.3g}")
        return w / length, x / length, y / length, z / length

    def axes(self) -> np.ndarray:
        """Return the rotation matrix of a quaternion.  (3, 3)"""
        return matrix(self.quaternion())


def yaml_entry(text: str, file: str) -> Entry:
    """Return the value of a YAML or JSON text. Raises FileError."""
    document = parse(text, file)

    def fail(key: str, problem: str) -> FileError:
        return document.error(key, problem)

    return Entry(_plain(document.root, "", fail), "", fail)


def toml_entry(text: str, file: str) -> Entry:
    """Return the value of a TOML text. Raises FileError."""
    try:
        value = tomllib.loads(text)
    except (ValueError, RecursionError) as error:
        raise FileError(f"{file}: not TOML: {' '.join(str(error).split())}") from None
    return Entry(value, "", lambda key, problem: file_error(file, key, problem))


def file_error(file: str, key: str, problem: str) -> FileError:
    """Return the error of a key of a file, without a line number."""
    place = f"{file}: {key}: " if key else f"{file}: "
    return FileError(f"{place}{problem}", "", key, problem)


def _plain(node: yaml.Node, key: str, fail: Fail) -> Any:
    """Return a node as a plain value. Raises FileError for a duplicate key."""
    if isinstance(node, yaml.SequenceNode):
        return [_plain(item, f"{key}[{i}]", fail) for i, item in enumerate(node.value)]
    if isinstance(node, yaml.MappingNode):
        found: dict[str, Any] = {}
        for name, item in node.value:
            if not isinstance(name, yaml.ScalarNode):
                raise fail(key, "expected keys that are texts, got a list or a mapping as a key")
            inner = f"{key}.{name.value}" if key else name.value
            if name.value in found:
                raise fail(inner, "expected each key once, got it twice")
            found[name.value] = _plain(item, inner, fail)
        return found
    return _scalar(node)


def _scalar(node: yaml.Node) -> str | float | bool | None:
    text = node.value
    if isinstance(node, yaml.ScalarNode) and node.style in ("'", '"'):
        return text
    number = decimal_number(text)
    if number is not None:
        return number
    return {"yes": True, "true": True, "no": False, "false": False, "null": None, "": None}.get(
        text.lower(), text
    )


def in_order(names: list[str], wanted: tuple[str, ...], fail: Fail) -> list[tuple[int, bool]]:
    """Return the index of each gate in the order of flight, and whether it is flown in reverse.

    If no order is given, gates whose names all end in a number are flown in the order of these
    numbers, and others in the order of the file.

    Args:
        names: names of the gates in the order of the file.
        wanted: names, or numbers from 1; a "-" in front reverses the passage; () for all gates.
        fail: makes the error of a key and a problem.

    Raises:
        FileError: no gate has one of the wanted names.
    """
    if not wanted:
        # AirSim adds its own number: Gate11_23 is gate 11.
        found = [re.fullmatch(r"\D*(\d{1,9})(_\d+)?", name) for name in names]
        order = list(range(len(names)))
        if all(found):
            order.sort(key=lambda k: int(found[k][1]))  # pyright: ignore[reportOptionalSubscript]
        return [(k, False) for k in order]
    numbers = [str(k + 1) for k in range(len(names))]
    chosen = []
    for each in wanted:
        reverse = each.startswith("-")
        name = each.removeprefix("-").strip()
        if name in names:
            chosen.append((names.index(name), reverse))
        elif name in numbers:
            chosen.append((numbers.index(name), reverse))
        else:
            raise fail("gates", f"no gate {name!r}, {did_you_mean(name, names)}")
    return chosen
