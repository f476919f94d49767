"""Typed dataclasses as command lines: tyro reads the words, the same rules as for files judge the values.

A field's annotation holds its unit and range, its trailing comment is its help. Numbers that are none pass
tyro as texts, so that one place says what was expected: `--sigma: expected 4 numbers > 0 [...], got ...`.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from contextlib import redirect_stderr
from dataclasses import asdict
from functools import reduce
from io import StringIO
from typing import Any, TypeVar

import tyro
import yaml
from msgspec import inspect
from tyro.constructors import ConstructorRegistry, PrimitiveConstructorSpec, PrimitiveTypeInfo

from quadsim.strict_yaml import parse
from quadsim.yaml_values import DECIMAL, WHOLE, Misfit, value
from quadsim.yaml_words import expected

Flags = TypeVar("Flags")
FLAT = ("flight.", "sampling.", "mppi.", "cost.")  # groups whose flags carry no prefix
RULE = re.compile(r"^[─-]{3,}$")  # tyro draws one below its first sentence


class UsageError(ValueError):
    """A command line that cannot be used. One line: the flag, what was expected with its unit, what came."""


def read(flags: type[Flags], prog: str, argv: Sequence[str], default: Flags | None = None) -> Flags:
    """argv as an instance of the dataclass. Raises UsageError; `--help` exits after printing."""
    said = StringIO()
    kwargs = {} if default is None else {"default": default}
    try:
        with redirect_stderr(said):
            return tyro.cli(flags, prog=prog, args=argv, registry=_registry(), **kwargs)
    except SystemExit as end:
        if not end.code:
            raise
        raise UsageError(f"{_sentence(said.getvalue())} (see {prog} --help)") from None


def check(config: Any, group: str = "") -> None:
    """Hold every number of a dataclass against its annotation. Raises UsageError that names the flag.

    group: "model." for a dataclass whose flags start with `--model.`
    """
    text = yaml.safe_dump(asdict(config), default_flow_style=True, width=float("inf"))
    kind = inspect.type_info(type(config))
    try:
        value(parse(text, "flags").root, kind)
    except Misfit as misfit:
        path, _, item = misfit.path.partition("[")
        problem = misfit.problem
        if item:  # of several numbers: show them all, each with its unit
            problem = f"expected {_expected(kind, path)}, got {_shown(config, path)}"
        raise UsageError(f"{flag(group + path)}: {problem}") from None


def flag(path: str) -> str:
    """ "mppi.rest_fraction" is set by `--rest-fraction`, "model.drag" by `--model.drag`."""
    for group in FLAT:
        path = path.removeprefix(group)
    return "--" + path.replace("_", "-")


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


def _sentence(box: str) -> str:
    """What tyro says in a box, on one line: the first sentence and the flag that may have been meant."""
    lines = [line.strip("│╭╮╰╯─ ") for line in box.splitlines()]
    rules = [i for i, line in enumerate(box.splitlines()) if RULE.match(line.strip("│ "))] or [len(lines)]
    first = " ".join(line for line in lines[1 : rules[0]] if line)
    meant = next((m for line in lines[rules[0] :] if (m := re.match(r"--[\w.-]+", line))), None)
    hint = f", did you mean {meant[0]}?" if meant and first.startswith("Unrecognized") else ""
    return (first[:1].lower() + first[1:]).rstrip(".") + hint


def _expected(kind: Any, path: str) -> str:
    for name in path.split("."):
        kind = next(f.type for f in kind.fields if f.name == name)
    return expected(kind)


def _shown(config: Any, path: str) -> str:
    numbers = reduce(getattr, path.split("."), config)
    return " ".join(x if isinstance(x, str) else f"{x:g}" for x in numbers)
