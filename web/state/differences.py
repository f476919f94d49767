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
SHORT = {
    "temperature": "T",
    "target_ess": "ESS",
    "solved_ess": "ESS",
    "gamma": "γ",
    "crash": "crash cost",  # not a flight that crashed
}
# Settings whose values are names, which need no name before them
NAMES = ("pilot", "preset", "vehicle", "sensing", "plant")
# Settings that are named before all others, and after them
FIRST = ("sampler", "pilot", "preset")
LAST = ("laps", "seed")
MOST_IN_TAG = 3  # settings in the name of a flight, at most
LONGEST = 12  # length of a value in the name of a flight, at most [characters]
LONGEST_IN_WORDS = 24  # length of a value in a sentence, at most [characters]

Record = Mapping[str, Any]


class Difference(NamedTuple):
    """A setting that differs between flights.

    Attributes:
        name: of the setting.
        values: of each flight; empty: it has none.
        usual: whether each flight has the value of its preset, which its name leaves out.
    """

    name: str
    values: tuple[str, ...]
    usual: tuple[bool, ...]


def differences(records: Sequence[Record]) -> list[Difference]:
    """Return the settings that differ between flights.

    Args:
        records: the specs of the flights, as they are recorded.
    """
    settings = [dict(_settings(record)) for record in records]
    changed = [changed_numbers(record) for record in records]
    names = dict.fromkeys(name for numbers in changed for name in numbers)
    numbers = [_numbers(record) for record in records]
    found = []
    for name in names:
        values = tuple(of_flight.get(name, "") for of_flight in numbers)
        usual = tuple(name not in of_flight for of_flight in changed)
        found.append(Difference(name, values, usual))
    for name in dict.fromkeys(name for of_flight in settings for name in of_flight):
        values = tuple(of_flight.get(name, "") for of_flight in settings)
        found.append(Difference(name, values, _usual(values)))
    found.sort(key=lambda difference: _order(difference.name))
    # A setting that a sampler or a person does not have differs among the others alone.
    return [one for one in found if len(set(filter(None, one.values))) > 1]


def _order(name: str) -> int:
    """Return the place of a setting among the differences: parts, the rest, laps and seed."""
    if name in FIRST:
        return 0
    return 2 if name in LAST else 1


def compared(records: Sequence[Record]) -> str:
    """Return one sentence with the differences between flights; empty for fewer than two."""
    if len(records) < 2:
        return ""
    found = [_in_words(difference, records) for difference in differences(records)]
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


def _flew_a_sampler(record: Record) -> bool:
    """Return whether the planner flew, rather than a pilot, a person or a user's controller."""
    return has_planner(record) and flown_by(record) == record["sampler"]


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


def _in_words(difference: Difference, records: Sequence[Record]) -> str:
    """Return a difference with its values, if these are short."""
    if difference.name == "sampler":
        return "sampler" if all(map(_flew_a_sampler, records)) else "controller"
    name = difference.name.replace("_", " ")
    values = list(dict.fromkeys(value or "none" for value in difference.values))
    if any(len(value) > LONGEST_IN_WORDS for value in values):
        return name
    return f"{name} ({' / '.join(values)})"


def _tags(records: Sequence[Record]) -> list[str]:
    """Return what tells flights of one sampler apart, in the fewest words."""
    usable = [
        difference
        for difference in differences(records)
        if all(len(brief(value)) <= LONGEST for value in difference.values)
    ]
    tagged = [
        [_tag(chosen, k) for k in range(len(records))]
        for count in range(1, MOST_IN_TAG + 1)
        for chosen in combinations(usable, count)
    ]
    is_usual = [all(one.usual[k] for one in usable) for k in range(len(records))]

    def told(tags: Sequence[str]) -> tuple[int, int]:
        """Return how many flights differ in name, and how many unusual ones are named."""
        unnamed = sum(not tag and not usual for tag, usual in zip(tags, is_usual, strict=True))
        return len(set(tags)), -unnamed

    # The first of those that tell most
    return max(tagged, key=told, default=[""] * len(records))


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


def _usual(values: Sequence[str]) -> tuple[bool, ...]:
    """Return which flights have the value that most have; without a majority none of them."""
    (value, most), *others = Counter(values).most_common(2)
    is_alone = not others or others[0][1] < most
    return tuple(is_alone and one == value for one in values)


def _tag(chosen: Sequence[Difference], k: int) -> str:
    """Return the values of flight k in a name, without the usual ones; a name is its own value."""
    words = []
    for difference in chosen:
        if difference.usual[k]:
            continue
        value = brief(difference.values[k]) or "none"
        name = SHORT.get(difference.name, difference.name.replace("_", " "))
        words.append(value if difference.name in NAMES else f"{name} {value}")
    return " ".join(words)
