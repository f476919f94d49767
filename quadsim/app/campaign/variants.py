"""Variants: what a comparison compares. Each is a command line of `race fly`, said once and changed a little.

gaussian                      a sampler, with the preset's numbers for it
soft=race+target-ess=200      a name; then presets, samplers and flags of `race fly`, joined by +
wild=gaussian+sigma=3:3:.6:6  several numbers are joined by colons
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

from msgspec import inspect

from controllers.samplers import SAMPLERS
from quadsim.app.campaign.attempt import variant_key
from quadsim.app.flags import UsageError, flag_kinds, read
from quadsim.app.flight_flags import FlightFlags
from quadsim.files.yaml_words import unless_null
from quadsim.race.referee import Referee
from quadsim.race.spec import Spec


@dataclass(frozen=True)
class Variant:
    """One planner on one course, for any seed."""

    name: str
    spec: Spec

    @property
    def key(self) -> str:
        return variant_key(self.spec)

    def attempts(self, number: int) -> list[Spec]:
        """Seeds in a row, from the one on the command line on."""
        return [replace(self.spec, seed=self.spec.seed + i) for i in range(number)]


def parse_variants(said: str, courses: Sequence[str], flight: Sequence[str], prog: str) -> list[Variant]:
    """Every variant on every course, course by course; `flight`: flags of `race fly` for all. Raises UsageError."""
    named = [_argv(text.strip()) for text in said.split(",")]
    names = [name for name, _ in named]
    twice = next((name for name in names if names.count(name) > 1), None)
    if twice is not None:
        raise UsageError(f"--variants: expected different names, got {twice!r} twice; say NAME=...")
    return [Variant(name, resolve([course, *flight, *argv], prog)) for course in courses for name, argv in named]


def resolve(argv: Sequence[str], prog: str) -> Spec:
    """What `race fly` would fly. Raises UsageError, FileError."""
    if any(word.startswith("--threads") for word in argv):
        raise UsageError("--threads: attempts fly on one thread each; --jobs says how many at once")
    spec = read(FlightFlags, prog, argv, FlightFlags.defaults(argv)).spec()
    try:
        Referee(spec.course, spec.vehicle.radius, spec.laps, spec.timeout)
    except ValueError as error:  # laps on an open course, a gate too small for the vehicle
        raise UsageError(str(error)) from None
    return spec


def _argv(text: str) -> tuple[str, list[str]]:
    """One variant's name and flags."""
    name, named, parts = text.partition("=")
    if not name or (named and not parts):
        raise UsageError(f"--variants: expected a sampler or NAME=part+part, got {text!r}")
    return name, [word for part in (parts if named else name).split("+") for word in _words(part)]


def _words(part: str) -> list[str]:
    key, has_value, values = part.partition("=")
    if has_value and _counts().get(f"--{key}") == 0:
        if values not in ("yes", "no"):
            raise UsageError(f"--variants: {key}: expected yes or no, got {values!r}")
        return [f"--{key}" if values == "yes" else f"--no-{key}"]
    if has_value:
        return [f"--{key}", *values.split(":")]
    return ["--sampler" if part in SAMPLERS else "--preset", part]


def split(argv: Sequence[str]) -> tuple[list[str], list[str]]:
    """(the rest, flags of `race fly` with their values): so that a command can hand the latter on."""
    counts, own, flight = _counts(), [], []
    words = list(argv)
    while words:
        word = words.pop(0)
        name, has_value, _ = word.partition("=")
        count = counts.get(name.replace("_", "-"))
        if count is None:
            own.append(word)
            continue
        flight.append(word)
        for _ in range(0 if has_value else count):
            if words:
                flight.append(words.pop(0))
    return own, flight


def _counts() -> dict[str, int]:
    """Flag of `race fly` -> how many values follow it."""
    counts = {}
    for name, kind in flag_kinds(FlightFlags):
        counts[name] = _values(kind)
        if counts[name] == 0:
            counts[f"--no-{name[2:]}"] = 0
    return counts


def _values(kind: Any) -> int:
    while isinstance(kind, inspect.Metadata | inspect.UnionType):
        kind = kind.type if isinstance(kind, inspect.Metadata) else unless_null(kind)
    if isinstance(kind, inspect.TupleType):
        return len(kind.item_types)
    return 0 if isinstance(kind, inspect.BoolType) else 1
