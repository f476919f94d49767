"""Typed dataclasses as command lines: tyro reads the words, the same rules as for files judge the values.

A field's annotation holds its unit and range, its trailing comment is its help. Numbers that are none pass
tyro as texts, so that one place says what was expected: `--sigma: expected 4 numbers > 0 [...], got ...`.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from contextlib import redirect_stderr
from dataclasses import asdict
from functools import reduce
from io import StringIO
from typing import Any, TypeVar

import tyro
import yaml
from msgspec import inspect
from tyro.constructors import ConstructorRegistry, PrimitiveConstructorSpec, PrimitiveTypeInfo

from quadsim.files.strict_yaml import parse
from quadsim.files.yaml_values import DECIMAL, WHOLE, Misfit, value
from quadsim.files.yaml_words import expected

Flags = TypeVar("Flags")
FLAT = ("flight.", "sampling.", "mppi.", "cost.", "workers.")  # groups whose flags carry no prefix

ANSI, RULE = re.compile(r"\x1b\[[0-9;]*m"), re.compile(r"[─-]{3,}")


class UsageError(ValueError):
    """A command line that cannot be used. One line: the flag, what was expected with its unit, what came."""


def read(flags: type[Flags], prog: str, argv: Sequence[str], default: Flags | None = None) -> Flags:
    """argv as an instance of the dataclass. Raises UsageError; `--help` exits after printing."""
    said = StringIO()
    kwargs: dict[str, Any] = {} if default is None else {"default": default}
    try:
        with redirect_stderr(said):
            return tyro.cli(flags, prog=prog, args=argv, registry=_registry(), **kwargs)
    except SystemExit as end:
        if not end.code:
            raise
        raise UsageError(_complaint(said.getvalue(), flags, prog)) from None


def check(config: Any, group: str = "") -> None:
    """Hold every number of a dataclass against its annotation. Raises UsageError that names the flag.

    group: "model." for a dataclass whose flags start with `--model.`
    """
    text = yaml.safe_dump(asdict(config), default_flow_style=True, width=float("inf"))
    try:
        value(parse(text, "flags").root, inspect.type_info(type(config)))
    except Misfit as misfit:
        path, _, item = misfit.path.partition("[")
        problem = misfit.problem
        if item:  # one of several numbers
            numbers = reduce(getattr, path.split("."), config)
            asked = problem.rpartition(", got ")[0].replace("a number", f"{len(numbers)} numbers")
            problem = f"{asked}, got " + " ".join(x if isinstance(x, str) else f"{x:g}" for x in numbers)
        raise UsageError(f"{flag(group + path)}: {problem}") from None


def flag(path: str) -> str:
    """ "mppi.rest_fraction" is set by `--rest-fraction`, "model.drag" by `--model.drag`."""
    for group in FLAT:
        path = path.removeprefix(group)
    return "--" + path.replace("_", "-")


def otherwise(what: str) -> object:
    """What holds where a flag is left out, for its help."""
    return tyro.conf.arg(help_behavior_hint=f"(default: {what})")


def _registry() -> ConstructorRegistry:
    registry = ConstructorRegistry()

    @registry.primitive_rule
    def number(info: PrimitiveTypeInfo) -> PrimitiveConstructorSpec | None:
        rules = {int: (WHOLE, int), float: (DECIMAL, float)}
        if info.type not in rules:
            return None
        pattern, kind = rules[info.type]
        return PrimitiveConstructorSpec(
            nargs=1,
            metavar="N" if kind is int else "X",
            instance_from_str=lambda words: kind(words[0]) if pattern.fullmatch(words[0]) else words[0],
            is_instance=lambda x: isinstance(x, int | float),
            str_from_instance=lambda x: [f"{x:g}" if kind is float else str(x)],
        )

    return registry


def _complaint(box: str, flags: type, prog: str) -> str:
    """What tyro says in a box of several lines, as one line in our words where it is about a known flag."""
    first, rest = _sentences(box)
    kinds = dict(flag_kinds(flags))
    about = next((name for name in re.findall(r"--[a-z][\w.-]*", first) if name in kinds), None)
    if about and not first.startswith("Unrecognized"):
        choice = re.search(r"invalid choice ('.*') for", first)
        came = choice[1] if choice else "too few values"
        return f"{about}: expected {expected(kinds[about])}, got {came} (see {prog} --help)"
    meant = re.search(r"--[a-z][\w.-]*", rest)
    hint = f", did you mean {meant[0]}?" if meant else ""
    said = first[:1].lower() + first[1:].rstrip(".").replace(", ", " ")
    return f"{said}{hint} (see {prog} --help)"


def _sentences(box: str) -> tuple[str, str]:
    """Text of tyro's box before its first rule, and the flags named after it.

    A box in plain ASCII has a rule below its title as well.
    """
    lines = [ANSI.sub("", line).strip("│╭╮╰╯ ") for line in box.splitlines()][1:]
    if lines and RULE.fullmatch(lines[0]):
        lines = lines[1:]
    end = next((i for i, line in enumerate(lines) if RULE.fullmatch(line)), len(lines))
    return " ".join(lines[:end]).strip(), "\n".join(line for line in lines[end:] if line.startswith("--"))


def flag_kinds(flags: type) -> Iterator[tuple[str, Any]]:
    """Every flag of a dataclass and its groups, with what it expects."""
    return _kinds(inspect.type_info(flags))


def _kinds(kind: Any, path: str = "") -> Iterator[tuple[str, Any]]:
    for field in kind.fields:
        inner = f"{path}.{field.name}".lstrip(".")
        if isinstance(field.type, inspect.DataclassType):
            yield from _kinds(field.type, inner)
        else:
            yield flag(inner), field.type
