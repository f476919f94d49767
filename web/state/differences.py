"""What distinguishes flights that are shown together, from their records: in words, and as names.

The same answer stands before START, in flight, in replays and in the table of stored runs.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from itertools import combinations
from typing import Any, NamedTuple

from quadsim.dynamics.quadrotor import Control
from quadsim.record.run import canonical, flown_by, has_planner
from quadsim.report.preset_changes import changed_numbers, number_text
from quadsim.sensing import PERFECT
from quadsim.web.state.plain_text import plain

# Parts of a record that say nothing about the flight itself, or follow from parts that are named
LEFT_OUT = {
    "system",
    "host",
    "timeout",
    "planner",
    "model",
    "heat",
    "interactive",
    "hand",
    "pilot",
    "reference",
    "variation",
}
# Short names of numbers, as in the literature, for the name of a flight
SHORT = {"temperature": "T", "target_ess": "ESS", "solved_ess": "ESS", "gamma": "γ"}
# Settings whose values are names, which need no name before them
NAMES = ("pilot", "preset", "vehicle", "sensing", "plant")
LONGEST = 12  # length of a value in the name of a flight, at most [characters]
LONGEST_IN_WORDS = 24  # length of a value in a sentence, at most [characters]

Record = Mapping[str, Any]


class Difference(NamedTuple):
    """A setting that differs between flights."""

    name: str
    values: tuple[str, ...]  # of each flight; empty: it has none


def differences(records: Sequence[Record]) -> list[Difference]:
    """Return the settings that differ between flights.

    Args:
        records: the specs of the flights, as they are recorded.
    """
    settings = [dict(_settings(record)) for record in records]
    changed = dict.fromkeys(name for record in records for name in changed_numbers(record))
    for record, found in zip(records, settings, strict=True):
        numbers = _numbers(record)
        found |= {name: numbers[name] for name in changed if name in numbers}
    names = dict.fromkeys(name for found in settings for name in found)
    all_values = {name: tuple(found.get(name, "") for found in settings) for name in names}
    # A setting that a sampler or a person does not have differs among the others alone.
    return [
        Difference(name, values)
        for name, values in all_values.items()
        if len(set(filter(None, values))) > 1
    ]


def compared(records: Sequence[Record]) -> str:
    """Return one sentence with the differences between flights; empty for fewer than two."""
    if len(records) < 2:
        return ""
    found = [_in_words(difference) for difference in differences(records)]
    if not found:
        return "They are all alike."
    *others, last = found
    listed = f"{', '.join(others)} and {last}" if others else last
    return f"They differ in {listed}; all else is equal."


def distinct_names(records: Sequence[Record]) -> list[str]:
    """Return distinct names: the samplers, and what tells flights of one sampler apart.

    Examples: "colored" and "gaussian"; "colored T 0.2" and "colored T 1"; of three, "colored",
    "colored seed 5" and "colored T 0.2". Flights that are alike are numbered.
    """
    kinds = [plain(flown_by(record)) for record in records]
    names = list(kinds)
    for kind, count in Counter(kinds).items():
        if count == 1:
            continue
        alike = [k for k, one in enumerate(kinds) if one == kind]
        tags = _tags([records[k] for k in alike])
        for k, tag in zip(alike, tags, strict=True):
            names[k] = f"{kind} {tag}".rstrip()
    return numbered(names)


def numbered(kinds: Sequence[str]) -> list[str]:
    """Return distinct names: the second "colored" becomes "colored 2"."""
    seen: Counter[str] = Counter()
    names = []
    for kind in kinds:
        seen[kind] += 1
        names.append(kind if seen[kind] == 1 else f"{kind} {seen[kind]}")
    return names


def _settings(record: Record) -> Iterator[tuple[str, str]]:
    """Yield the settings of a flight but for the numbers of its planner, as texts by name."""
    yield "sampler", plain(flown_by(record))
    pilot = record.get("pilot")
    if pilot:
        yield "pilot", plain(pilot["name"])
    if has_planner(record):
        yield "preset", plain(record.get("preset", ""))
    for name, value in record.items():
        if name in LEFT_OUT or name in ("sampler", "preset", "sensing"):
            continue
        if isinstance(value, Mapping) and "name" in value:
            yield name, plain(value["name"])
        else:
            yield plain(name.replace("_ms", "")), _value_text(value)
    sensing = record.get("sensing")
    yield "sensing", plain(sensing["name"]) if sensing else PERFECT


def _value_text(value: Any) -> str:
    """Return a value as text; of one that is not set, none."""
    if isinstance(value, str | bool | int | float):
        return plain(number_text(value))
    return "none" if value is None else canonical(value).decode()


def _numbers(record: Record) -> dict[str, str]:
    """Return all numbers of a planner as texts by name."""
    if not has_planner(record):
        return {}
    planner = record.get("planner", {})
    parts = [planner.get(part, {}) for part in ("sampling", "mppi", "cost")]
    return {
        name: number_text(value)
        for part in parts
        if isinstance(part, Mapping)
        for name, value in part.items()
    }


def _in_words(difference: Difference) -> str:
    """Return a difference with its values, if these are short."""
    name = difference.name.replace("_", " ")
    values = list(dict.fromkeys(value or "none" for value in difference.values))
    if difference.name == "sampler" or any(len(value) > LONGEST_IN_WORDS for value in values):
        return name
    return f"{name} ({' / '.join(values)})"


def _tags(records: Sequence[Record]) -> list[str]:
    """Return what tells flights of one sampler apart, in the fewest words."""
    usable = [
        difference
        for difference in differences(records)
        if all(len(brief(value)) <= LONGEST for value in difference.values)
    ]
    candidates = [[one] for one in usable] + [list(two) for two in combinations(usable, 2)]
    tagged = [[_tag(chosen, k) for k in range(len(records))] for chosen in candidates]
    # The first of the candidates that tell most flights apart
    return max(tagged, key=lambda tags: len(set(tags)), default=[""] * len(records))


def brief(value: str) -> str:
    """Return a value in a name: of the four controls, "0.8/2" for equal body rates and the thrust.

    Examples:
        >>> brief("0.8 0.8 0.8 2"), brief("1 1 1 1"), brief("256")
        ('0.8/2', '1', '256')
    """
    parts = value.split()
    if len(parts) != len(Control._fields) or len(set(parts[:-1])) > 1:
        return value
    return parts[0] if parts[0] == parts[-1] else f"{parts[0]}/{parts[-1]}"


def _usual(difference: Difference) -> str | None:
    """Return the value that most flights have, which a name leaves out; None: there is none."""
    (value, most), *others = Counter(difference.values).most_common(2)
    is_alone = not others or others[0][1] < most
    return value if is_alone else None


def _tag(chosen: Sequence[Difference], k: int) -> str:
    """Return the values of flight k in a name, without the usual ones; a name is its own value."""
    words = []
    for difference in chosen:
        if difference.values[k] == _usual(difference):
            continue
        value = brief(difference.values[k]) or "none"
        name = SHORT.get(difference.name, difference.name.replace("_", " "))
        words.append(value if difference.name in NAMES else f"{name} {value}")
    return " ".join(words)
