"""Commands that change the state of the page, as plain values, and `apply`, which carries them out.

A command names what it changes: the row, not "the edited one". So what a visitor types lands where
it was typed, whatever other visitors do meanwhile.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType
from typing import Annotated, Any, Literal, get_args

import msgspec
from msgspec import Meta

from quadsim.config.settings import Clock
from quadsim.controllers.presets import PRESETS
from quadsim.files.yaml_errors import cut
from quadsim.firmware import FlightControllerName
from quadsim.heat.rules import RULES, RulesName
from quadsim.heat.settings import Expect, HeatSettings
from quadsim.heat.spec import MOST
from quadsim.web.choices import CompetitorChoices, RaceChoices
from quadsim.web.menu import Menu
from quadsim.web.setting_texts import checked_number, checked_setting
from quadsim.web.state import GHOSTS, PageState, RemovedRow, Row, Visitor, World

MOST_REMOVED = 8  # number of removed rows that can be put back
MOST_AGAINST = 8  # number of stored runs beside a flight
RACE_OPTIONS = {
    "clock": get_args(Clock),
    "world": get_args(World),
    "expect": get_args(Expect),
    "rules": tuple(RULES),
}
OF_RACE_CHOICES = ("course", "seed", "laps", "clock", "deadline_ms")
COMPETITOR_NAMES = ("sampler", "preset", "vehicle", "sensing", "flight_controller")

Name = Annotated[str, Meta(max_length=300)]
RaceSetting = Literal["course", "seed", "laps", "clock", "deadline_ms", "world", "expect", "rules"]


class Command(msgspec.Struct, frozen=True, tag=True, forbid_unknown_fields=True):
    """A command; its class names it."""


class Arrive(Command, frozen=True):
    """A visitor has opened the page."""

    visitor: int


class Leave(Command, frozen=True):
    """A visitor has closed the page."""

    visitor: int


class ChooseRace(Command, frozen=True):
    """Choose a setting of the whole race by its name."""

    name: RaceSetting
    value: Name | int


class ChooseNames(Command, frozen=True):
    """Choose names of a competitor: sampler, preset, vehicle, sensing, flight controller."""

    row: int
    names: dict[str, Name]


class SetNumber(Command, frozen=True):
    """Set the number of a slider of a competitor."""

    row: int
    name: str  # of quadsim.web.numbers.SLIDERS
    value: float


class SetSetting(Command, frozen=True):
    """Set any setting of a competitor's planner, as a control has it."""

    row: int
    name: Name
    value: Any


class ResetRow(Command, frozen=True):
    """Give a competitor the numbers of its preset."""

    row: int


class AddRow(Command, frozen=True):
    """Add a competitor, a copy of another one; its visitor edits it."""

    visitor: int
    like: int


class TakeOver(Command, frozen=True):
    """Add a competitor with these choices; its visitor, if it is known, edits it."""

    visitor: int | None
    choices: CompetitorChoices


class RemoveRow(Command, frozen=True):
    """Remove a competitor."""

    row: int


class PutBack(Command, frozen=True):
    """Put back the competitor that was removed last."""


class EditRow(Command, frozen=True):
    """Edit a competitor; every visitor edits one of its own choice."""

    visitor: int
    row: int


class OfferCourse(Command, frozen=True):
    """Add a course to the menu. It is the server's own command: no visitor sends it."""

    name: Name


class SetUp(Command, frozen=True):
    """Set up a whole race, as a link names it; the folder of runs stays."""

    race: RaceChoices
    competitors: Annotated[tuple[CompetitorChoices, ...], Meta(min_length=1, max_length=MOST)]
    world: World = GHOSTS
    expect: Expect = HeatSettings.expect
    rules: RulesName = HeatSettings.rules


class FlyAgainst(Command, frozen=True):
    """Show stored runs beside the next flight; none: no run."""

    runs: Annotated[tuple[Name, ...], Meta(max_length=MOST_AGAINST)]


AnyCommand = (
    Arrive
    | Leave
    | ChooseRace
    | ChooseNames
    | SetNumber
    | SetSetting
    | ResetRow
    | AddRow
    | TakeOver
    | RemoveRow
    | PutBack
    | EditRow
    | FlyAgainst
    | SetUp
)


def apply(state: PageState, command: AnyCommand | OfferCourse) -> PageState:
    """Return the state after a command.

    Raises:
        ValueError: the command cannot be carried out; the message is one line.
    """
    match command:
        case Arrive() | Leave() | EditRow():
            return _with_visitors(state, command)
        case ChooseRace(name, value):
            return _with_race(state, name, value)
        case FlyAgainst(runs):
            return replace(state, against=tuple(dict.fromkeys(runs)))
        case AddRow(visitor, like):
            return _added(state, visitor, state.row(like).choices)
        case TakeOver(visitor, choices):
            _expect_on_menu(choices, state.menu)
            return _added(state, visitor, _checked(choices))
        case RemoveRow(row):
            return _removed(state, row)
        case PutBack():
            return _put_back(state)
        case OfferCourse(name):
            return _offering(state, name)
        case SetUp():
            return _set_up(state, command)
    return _with_row(state, command)


def _with_visitors(state: PageState, command: Arrive | Leave | EditRow) -> PageState:
    """Return the state with a visitor who came, left or edits another row. Raises ValueError."""
    match command:
        case Arrive(visitor):
            return state.with_visitor(visitor, Visitor(state.rows[0].number))
        case EditRow(visitor, row):
            return state.with_visitor(visitor, Visitor(state.row(row).number))
    others = {k: one for k, one in state.visitors.items() if k != command.visitor}
    return replace(state, visitors=MappingProxyType(others))


def _with_race(state: PageState, name: str, value: str | int) -> PageState:
    """Return the state with a setting of the race. Raises ValueError."""
    if name in RACE_OPTIONS and value not in RACE_OPTIONS[name]:
        raise ValueError(f"{name}: expected one of {', '.join(RACE_OPTIONS[name])}, got {value!r}")
    if name == "laps" and not (isinstance(value, int) and value >= 0):
        raise ValueError(f"laps: expected a whole number, 0 for the course's own, got {value!r}")
    if name == "course" and state.menu:
        expect_offered("course", str(value), state.menu.courses)
    if name in OF_RACE_CHOICES:
        changes: dict[str, Any] = {name: value}
        race: RaceChoices = replace(state.race, **changes)
        return replace(state, race=race)
    return replace(state, **{name: value})


def _added(state: PageState, visitor: int | None, choices: CompetitorChoices) -> PageState:
    """Return the state with another row, which a visitor edits. Raises ValueError."""
    if len(state.rows) >= MOST:
        raise ValueError(f"competitors: expected {MOST} at most")
    row = Row(state.next_number, choices)
    more = replace(state, rows=(*state.rows, row), next_number=row.number + 1)
    return more if visitor is None else more.with_visitor(visitor, Visitor(row.number))


def _removed(state: PageState, number: int) -> PageState:
    """Return the state without a row; its editors edit the one before. Raises ValueError."""
    index = state.index(number)
    if len(state.rows) == 1:
        raise ValueError("competitors: expected one at least")
    rows = (*state.rows[:index], *state.rows[index + 1 :])
    instead = Visitor(rows[max(index - 1, 0)].number)
    visitors = {
        who: instead if visitor.row == number else visitor
        for who, visitor in state.visitors.items()
    }
    removed = (*state.removed, RemovedRow(state.rows[index], index))[-MOST_REMOVED:]
    return replace(state, rows=rows, visitors=MappingProxyType(visitors), removed=removed)


def _put_back(state: PageState) -> PageState:
    """Return the state with the row that was removed last. Raises ValueError."""
    if not state.removed:
        raise ValueError("competitors: none was removed")
    if len(state.rows) >= MOST:
        raise ValueError(f"competitors: expected {MOST} at most")
    *earlier, last = state.removed
    rows = (*state.rows[: last.index], last.row, *state.rows[last.index :])
    return replace(state, rows=rows, removed=tuple(earlier))


def _with_row(
    state: PageState, command: ChooseNames | SetNumber | SetSetting | ResetRow
) -> PageState:
    """Return the state with a changed row. Raises ValueError."""
    index = state.index(command.row)
    row = state.rows[index]
    choices = _changed(row.choices, command)
    if isinstance(command, ChooseNames):
        _expect_on_menu(choices, state.menu)
    changed = replace(row, choices=_checked(choices))
    return replace(state, rows=(*state.rows[:index], changed, *state.rows[index + 1 :]))


def _changed(
    choices: CompetitorChoices, command: ChooseNames | SetNumber | SetSetting | ResetRow
) -> CompetitorChoices:
    """Return a competitor's choices after a command. Raises ValueError."""
    match command:
        case ChooseNames(_, names):
            return replace(choices, **_names(names))
        case SetNumber(_, name, value):
            return choices.with_number(name, checked_number(name, value, choices))
        case SetSetting(_, name, value):
            return choices.with_setting(name, checked_setting(name, value, choices))
        case ResetRow():
            return replace(choices, numbers={}, settings={})


def _offering(state: PageState, course: str) -> PageState:
    """Return the state with another course on the menu."""
    if state.menu is None or course in state.menu.courses:
        return state
    return replace(state, menu=replace(state.menu, courses=(*state.menu.courses, course)))


def _set_up(state: PageState, asked: SetUp) -> PageState:
    """Return the state with another race; the rows before can be put back. Raises ValueError."""
    if state.menu:
        expect_offered("course", asked.race.course, state.menu.courses)
    rows = []
    for number, choices in enumerate(asked.competitors, state.next_number):
        _expect_on_menu(choices, state.menu)
        # What a link says is checked like what is typed: it may name no file and no code.
        settings = {
            name: checked_setting(name, value, choices) for name, value in choices.settings.items()
        }
        numbers = {
            name: checked_number(name, value, choices) for name, value in choices.numbers.items()
        }
        rows.append(Row(number, _checked(replace(choices, settings=settings, numbers=numbers))))
    before = (*state.removed, *(RemovedRow(row, k) for k, row in enumerate(state.rows)))
    return replace(
        state,
        removed=before[-MOST_REMOVED:],
        race=replace(asked.race, runs_dir=state.race.runs_dir),
        rows=tuple(rows),
        world=asked.world,
        expect=asked.expect,
        rules=asked.rules,
        next_number=state.next_number + len(rows),
    )


def _expect_on_menu(choices: CompetitorChoices, menu: Menu | None) -> None:
    """Raise ValueError if a name of a competitor is not on the menu."""
    if menu is None:
        return
    expect_offered("sampler", choices.sampler, menu.samplers)
    expect_offered("preset", choices.preset, tuple(menu.presets))
    expect_offered("vehicle", choices.vehicle, menu.vehicles)
    expect_offered("sensing", choices.sensing, menu.sensings)


def expect_offered(what: str, name: str, offered: Sequence[str]) -> None:
    """Raise ValueError if a name is not offered."""
    if name not in offered:
        raise ValueError(f"{what}: expected one of {', '.join(offered)}, got {cut(repr(name))}")


def _names(names: Mapping[str, str]) -> dict[str, Any]:
    """Return the names to choose; a preset brings its vehicle. Raises ValueError."""
    unknown = set(names) - set(COMPETITOR_NAMES)
    if unknown:
        wanted = ", ".join(COMPETITOR_NAMES)
        raise ValueError(f"{min(unknown)}: expected one of {wanted}")
    behind = names.get("flight_controller")
    if behind is not None and behind not in get_args(FlightControllerName):
        raise ValueError(f"flight_controller: expected ideal or betaflight, got {behind!r}")
    chosen = dict(names)
    if "preset" in names and "vehicle" not in names and names["preset"] in PRESETS:
        chosen["vehicle"] = PRESETS[names["preset"]]["colored"].vehicle
    return chosen


def _checked(choices: CompetitorChoices) -> CompetitorChoices:
    """Return a competitor's choices if its planner can have the numbers. Raises ValueError."""
    _ = choices.planner
    return choices
