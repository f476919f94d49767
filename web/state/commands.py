"""Commands that change the state of the page, as plain values, and `apply`, which carries them out.

A command names what it changes: the row, not "the edited one". So what a visitor types lands where
it was typed, whatever other visitors do meanwhile.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType
from typing import Annotated, Any, TypeVar

import msgspec
from msgspec import Meta

from quadsim.config.settings import SETTINGS
from quadsim.controllers.presets import PRESETS
from quadsim.files.values import checked
from quadsim.files.yaml_errors import cut
from quadsim.heat.rules import RulesName
from quadsim.heat.settings import Expect, HeatSettings
from quadsim.heat.spec import MOST
from quadsim.web.state.choices import Choices, CompetitorChoices, RaceChoices
from quadsim.web.state.fields import shown_fields
from quadsim.web.state.menu import Menu
from quadsim.web.state.page_state import (
    EVERYBODY,
    GHOSTS,
    NOBODY,
    PageState,
    Playhead,
    RemovedRow,
    Row,
    World,
)
from quadsim.web.state.setting_texts import checked_number, checked_setting
from quadsim.web.state.view import View

MOST_REMOVED = 8  # number of removed rows that can be put back
MOST_LEFT = 32  # number of visitors who have left and may come back
MOST_AGAINST = 8  # number of stored runs beside a flight
OF_RACE_CHOICES = shown_fields(RaceChoices)
OF_RACE = {**OF_RACE_CHOICES, **shown_fields(PageState)}
OF_COMPETITOR = shown_fields(CompetitorChoices)

Name = Annotated[str, Meta(max_length=300)]
OfPlanner = TypeVar("OfPlanner", bound=CompetitorChoices)


class Command(msgspec.Struct, frozen=True, tag=True, forbid_unknown_fields=True):
    """A command; its class names it."""


class Leave(Command, frozen=True):
    """A visitor has closed the page, or its connection is lost."""

    visitor: int
    seat: Name = ""  # under which its own part is kept; empty: nowhere


class ComeBack(Command, frozen=True):
    """A visitor who sat at this seat has connected again."""

    visitor: int
    seat: Name


class ChooseRace(Command, frozen=True):
    """Choose a setting of the whole race by its name."""

    name: Name  # of OF_RACE
    value: Name | int | float
    visitor: int = EVERYBODY  # who chooses it


class ChooseNames(Command, frozen=True):
    """Choose names of a competitor: sampler, preset, vehicle, sensing, flight controller."""

    row: int
    names: dict[str, Name]


class SetNumber(Command, frozen=True):
    """Set the number of a slider of a competitor."""

    row: int
    name: str  # of quadsim.web.state.numbers.SLIDERS
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


class Watch(Command, frozen=True):
    """Show a visitor the numbers in flight of a competitor; empty: of the first one."""

    visitor: int
    of: Name


class SetView(Command, frozen=True):
    """Set a choice of a visitor's display."""

    visitor: int
    name: Name  # of a field of View
    value: bool | Name


class SetPlayhead(Command, frozen=True):
    """Show a visitor another time of the race."""

    visitor: int
    playhead: Playhead


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
    visitor: int = EVERYBODY  # who sets it up


class FlyAgainst(Command, frozen=True):
    """Show stored runs beside the next flight; none: no run."""

    runs: Annotated[tuple[Name, ...], Meta(max_length=MOST_AGAINST)]


AnyCommand = (
    Leave
    | ComeBack
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
    | Watch
    | SetView
    | SetPlayhead
)


def apply(state: PageState, command: AnyCommand | OfferCourse) -> PageState:
    """Return the state after a command.

    Raises:
        ValueError: the command cannot be carried out; the message is one line.
    """
    match command:
        case Leave() | ComeBack() | EditRow() | Watch() | SetView() | SetPlayhead():
            return _with_visitors(state, command)
        case ChooseRace(name, value, visitor):
            chosen = _with_race(state, name, value)
            return replace(chosen, chooser=visitor) if name == "course" else chosen
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


def _with_visitors(
    state: PageState, command: Leave | ComeBack | EditRow | Watch | SetView | SetPlayhead
) -> PageState:
    """Return the state with a visitor who left or looks at something else. Raises ValueError."""
    visitor = state.visitor(command.visitor)
    match command:
        case EditRow(number, row):
            return state.with_visitor(number, replace(visitor, row=state.row(row).number))
        case Watch(number, of):
            return state.with_visitor(number, replace(visitor, of=of))
        case SetPlayhead(number, playhead):
            if number == state.chooser:
                state = replace(state, chooser=NOBODY)
            return state.with_visitor(number, replace(visitor, playhead=playhead))
        case SetView(number, name, value):
            view = _with_choice(visitor.view, name, value)
            return state.with_visitor(number, replace(visitor, view=view))
        case ComeBack(number, seat):
            return state.with_visitor(number, state.left.get(seat, visitor))
        case Leave(number, seat) if seat and number in state.visitors:
            kept = dict([*state.left.items(), (seat, visitor)][-MOST_LEFT:])
            state = replace(state, left=MappingProxyType(kept))
    others = {k: one for k, one in state.visitors.items() if k != command.visitor}
    return replace(state, visitors=MappingProxyType(others))


def _with_race(state: PageState, name: str, value: str | float) -> PageState:
    """Return the state with a setting of the race. Raises ValueError."""
    if name not in OF_RACE:
        raise ValueError(f"{cut(name)}: expected one of {', '.join(OF_RACE)}")
    OF_RACE[name].expect_offered(value, state.menu)
    if name not in OF_RACE_CHOICES:
        return replace(state, **{name: value})
    changes: dict[str, Any] = {name: _of_setting(name, value)}
    race: RaceChoices = replace(state.race, **changes)
    return replace(state, race=race)


def _of_setting(name: str, value: Any) -> Any:
    """Return a choice of the race as its setting has it, as far as it is one. Raises ValueError."""
    if name == "laps" and value in ("", "0", 0):
        return 0
    if name == "deadline_ms" and value in ("", "none"):
        return "none"
    if name not in SETTINGS or OF_RACE[name].options(None):
        return value
    return checked(name, value, SETTINGS[name].kind)


def _with_choice(view: View, name: str, value: bool | str) -> View:
    """Return a view with another choice. Raises ValueError."""
    fields = shown_fields(View)
    if name not in fields:
        raise ValueError(f"{cut(name)}: expected one of {', '.join(fields)}")
    fields[name].expect_offered(value, None)
    changes: dict[str, Any] = {name: value}
    return replace(view, **changes)


def _added(state: PageState, visitor: int | None, choices: CompetitorChoices) -> PageState:
    """Return the state with another row, which a visitor edits. Raises ValueError."""
    if len(state.rows) >= MOST:
        raise ValueError(f"competitors: expected {MOST} at most")
    row = Row(state.next_number, choices)
    more = replace(state, rows=(*state.rows, row), next_number=row.number + 1)
    if visitor is None:
        return more
    return more.with_visitor(visitor, replace(more.visitor(visitor), row=row.number))


def _removed(state: PageState, number: int) -> PageState:
    """Return the state without a row; its editors edit the one before. Raises ValueError."""
    index = state.index(number)
    if len(state.rows) == 1:
        raise ValueError("competitors: expected one at least")
    rows = (*state.rows[:index], *state.rows[index + 1 :])
    instead = rows[max(index - 1, 0)].number
    visitors = {
        who: replace(visitor, row=instead) if visitor.row == number else visitor
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
    choices = _changed(Choices.of(state.race, row.choices), command)
    if isinstance(command, ChooseNames):
        _expect_on_menu(choices, state.menu)
    changed = replace(row, choices=_checked(choices).competitor)
    return replace(state, rows=(*state.rows[:index], changed, *state.rows[index + 1 :]))


def _changed(choices: Choices, command: ChooseNames | SetNumber | SetSetting | ResetRow) -> Choices:
    """Return the choices of a flight after a command. Raises ValueError."""
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
    race = replace(asked.race, runs_dir=state.race.runs_dir)
    for name in OF_RACE_CHOICES:
        value = getattr(asked.race, name)
        OF_RACE[name].expect_offered(value, state.menu)
        race = replace(race, **{name: _of_setting(name, value)})
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
        race=race,
        rows=tuple(rows),
        world=asked.world,
        expect=asked.expect,
        rules=asked.rules,
        chooser=asked.visitor,
        next_number=state.next_number + len(rows),
    )


def _expect_on_menu(choices: CompetitorChoices, menu: Menu | None) -> None:
    """Raise ValueError if a name of a competitor is not on the menu."""
    for name, field in OF_COMPETITOR.items():
        field.expect_offered(getattr(choices, name), menu)


def _names(names: Mapping[str, str]) -> dict[str, Any]:
    """Return the names to choose; a preset brings its vehicle. Raises ValueError."""
    unknown = set(names) - set(OF_COMPETITOR)
    if unknown:
        raise ValueError(f"{min(unknown)}: expected one of {', '.join(OF_COMPETITOR)}")
    chosen = dict(names)
    if "preset" in names and "vehicle" not in names and names["preset"] in PRESETS:
        chosen["vehicle"] = PRESETS[names["preset"]]["colored"].vehicle
    return chosen


def _checked(choices: OfPlanner) -> OfPlanner:
    """Return choices if their planner can have the numbers. Raises ValueError."""
    choices.planners()
    return choices
