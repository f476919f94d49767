"""Read YAML files strictly: every error is one line with the place and the expected unit.

    paper_flat.yaml:14:12: gates[3].yaw_deg: expected a number [deg], got 'north'

A schema is any msgspec Struct or dataclass of numbers, texts, literals, tuples, `X | None` and
further schemas; `unit("m", gt=0)` inside Annotated gives a number its unit and its range.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

import msgspec
import yaml

from quadsim.files.yaml_values import Misfit, descend, misfits, value

Schema = TypeVar("Schema")
DEPTH = 12  # deepest nesting allowed; the deepest schema here has 5
EXCERPT = 100  # columns of a source line worth showing


class FileError(ValueError):
    """The error of a file that cannot be used; its text is one line.

    Attributes:
        excerpt: the source line with a caret below it, or "".
        key: the key with the problem, such as "gates[3].yaw_deg", or "".
        problem: the problem without the place, or "".
        others: further errors of the file.

    Examples:
        >>> import quadsim
        >>> try:
        ...     quadsim.load_course("figure9")
        ... except quadsim.FileError as error:
        ...     print(error)
        no course 'figure9': did you mean 'figure8'? ...
    """

    def __init__(self, message: str, excerpt: str = "", key: str = "", problem: str = "") -> None:
        super().__init__(message)
        self.excerpt = excerpt
        self.key = key
        self.problem = problem
        self.others: tuple[FileError, ...] = ()


def unit(name: str, **bounds: Any) -> msgspec.Meta:
    """Return the metadata of a schema's number for Annotated: its unit and its range.

    Args:
        name: the unit, for errors.
        bounds: msgspec's bounds gt, ge, lt, le or min_length.
    """
    return msgspec.Meta(extra={"unit": name}, **bounds)


def setting(text: str, unit: str = "", **bounds: Any) -> msgspec.Meta:
    """Return the metadata of a setting for Annotated: its help, its unit and its range.

    Args:
        text: the help of a flag, a slider or a page of the documentation.
        unit: unit of the number, for errors.
        bounds: msgspec's bounds gt, ge, lt or le.
    """
    extra = {"unit": unit} if unit else None
    return msgspec.Meta(description=text, extra=extra, **bounds)


@dataclass(frozen=True)
class Document:
    """A parsed file, with the places of all its values.

    Checks after loading can therefore name the line and column of a problem, too.
    """

    text: str
    file: str  # as the user gave it
    root: yaml.Node

    def fill(self, schema: type[Schema]) -> Schema:
        """Return the document as an instance of the schema.

        Raises:
            FileError: the first error; its `others` has the following ones.
        """
        kind = msgspec.inspect.type_info(schema)
        try:
            return value(self.root, kind)
        except Misfit as misfit:
            found = misfits(self.root, kind) or [misfit]
        raise _first([_error(self.text, self.file, m.mark, m.path, m.problem) for m in found])

    def check(self, problems: Iterable[tuple[str, str]]) -> None:
        """Raise an error if checks beyond the schema have found problems.

        Args:
            problems: keys and their problems; only the first problem of a key is reported.

        Raises:
            FileError: the first problem; its `others` has the problems of other keys.
        """
        by_key: dict[str, str] = {}
        for path, problem in problems:
            by_key.setdefault(path, problem)
        if by_key:
            raise _first([self.error(path, problem) for path, problem in by_key.items()])

    def error(self, path: str, problem: str) -> FileError:
        """Return an error at a key such as "gates[3].opening", for checks beyond the schema."""
        mark = descend(self.root, path).start_mark
        return _error(self.text, self.file, mark, path, problem)


def _first(errors: Sequence[FileError]) -> FileError:
    """Return the first error, with the others in its attribute `others`."""
    first, *others = errors
    first.others = tuple(others)
    return first


def load(text: str, file: str, schema: type[Schema]) -> Schema:
    """Return the YAML text as an instance of the schema.

    Args:
        text: a YAML document.
        file: name of the file, for errors.
        schema: a msgspec Struct or a dataclass.

    Raises:
        FileError: the text does not fit the schema.
    """
    return parse(text, file).fill(schema)


def parse(text: str, file: str) -> Document:
    """Return a text as a document without aliases, anchors and tags. Raises FileError."""
    try:
        root = _Composer(text).get_single_node()
    except Misfit as misfit:
        raise _error(text, file, misfit.mark, misfit.path, misfit.problem) from None
    except yaml.MarkedYAMLError as error:
        raise _error(text, file, error.problem_mark, "", _problem(error)) from None
    except yaml.reader.ReaderError as error:
        before = text[: error.position]
        line = before.count("\n")
        column = len(before) - before.rfind("\n") - 1
        mark = yaml.Mark(file, 0, line, column, None, 0)
        problem = f"unprintable character {chr(error.character)!r}"
        raise _error(text, file, mark, "", problem) from None
    if root is None:
        raise FileError(f"{file}:1:1: empty file, expected a mapping (key: value)")
    return Document(text, file, root)


class _Composer(yaml.SafeLoader):
    """The part of PyYAML that makes a tree of nodes, without constructing Python objects.

    It rejects aliases, tags and the like, which can hide or repeat values or nest without end.
    """

    depth = 0

    def compose_node(self, parent: Any, index: Any) -> Any:
        """Return the node of the next parser events. Raises Misfit."""
        event = self.peek_event()
        if event.anchor:
            raise Misfit(event.start_mark, "", "aliases are not allowed")
        if getattr(event, "tag", None):
            raise Misfit(event.start_mark, "", "tags are not allowed")
        self.depth += 1
        if self.depth > DEPTH:
            problem = f"expected at most {DEPTH} levels of nesting, got more"
            raise Misfit(event.start_mark, "", problem)
        node = super().compose_node(parent, index)
        self.depth -= 1
        return node


def _problem(error: yaml.MarkedYAMLError) -> str:
    """Return PyYAML's error message on one line."""
    if error.problem == "but found another document":
        return "expected one document, found a second one"
    if r"'\t'" in str(error.problem):
        return "expected spaces, got a tab"
    since = ""
    if error.context and error.context_mark:
        since = f" ({error.context}, line {error.context_mark.line + 1})"
    return f"not YAML: {error.problem}{since}"


def _error(text: str, file: str, mark: Any, path: str, problem: str) -> FileError:
    """Return an error with its line of text, and an excerpt of the file for a terminal."""
    # PyYAML breaks lines here
    lines = re.split(r"\r\n|[\n\r\x85\u2028\u2029]", text)
    line = lines[mark.line] if mark.line < len(lines) else ""
    first = max(0, mark.column - EXCERPT // 2)
    # a terminal gets no escape codes
    seen = "".join(c if c.isprintable() else " " for c in line[first : first + EXCERPT])
    excerpt = f"{seen}\n{' ' * (mark.column - first)}^"
    key = f"{path}: " if path else ""
    # lines and columns count from 1
    place = f"{file}:{mark.line + 1}:{mark.column + 1}"
    return FileError(f"{place}: {key}{problem}", excerpt, path, problem)
