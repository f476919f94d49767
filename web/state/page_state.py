"""PageState: what the page has besides the race that is flown: the next START, and its visitors.

It is a frozen value. Only the commands of quadsim.web.state.commands make another one of it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import Annotated, Literal

from quadsim.heat.rules import RulesName
from quadsim.heat.settings import Expect, HeatSettings
from quadsim.web.state.choices import Choices, CompetitorChoices, HeatChoices, RaceChoices
from quadsim.web.state.fields import Shown
from quadsim.web.state.menu import Menu
from quadsim.web.state.view import View

PaceName = Literal["0.1 x", "0.25 x", "0.5 x", "1 x", "2 x", "4 x"]
REAL_TIME: PaceName = "1 x"
EVERYBODY = 0  # in place of the number of a visitor
NOBODY = -1
World = Literal["as ghosts", "in one world"]
GHOSTS: World = "as ghosts"
TOGETHER: World = "in one world"


@dataclass(frozen=True)
class Row:
    """A competitor of the next START."""

    number: int  # names the row for as long as it exists, whatever rows are added or removed
    choices: CompetitorChoices


@dataclass(frozen=True)
class RemovedRow:
    """A row that was removed, and its place among the rows."""

    row: Row
    index: int


@dataclass(frozen=True)
class Playhead:
    """The time of a race that a visitor has asked to watch, see quadsim.web.race.playhead.

    Attributes:
        race: number of the race that it is of. Any other race begins anew: live if it is flown,
            from its start if it is a replay.
        is_live: whether the visitor watches the latest time; after the flights, their end.
        is_playing: whether the time goes on.
        t: time of the race [s] at the time `at`.
        at: on the wall clock [s].
        speed: race seconds per second.
    """

    race: int = 0
    is_live: bool = True
    is_playing: bool = True
    t: float = 0.0
    at: float = 0.0
    speed: float = 1.0


@dataclass(frozen=True)
class Visitor:
    """A visitor has chosen these values, independently of the other visitors.

    Attributes:
        row: number of the row that the visitor edits.
        of: competitor whose numbers in flight are shown; empty: the first one.
        view: how the race is drawn.
        playhead: which time of the race is shown.
    """

    row: int
    of: str = ""
    view: View = field(default_factory=View)
    playhead: Playhead = field(default_factory=Playhead)


@dataclass(frozen=True)
class PageState:
    """The next START, and the visitors of the page.

    Attributes:
        race: the choices that are common to all competitors.
        rows: the competitors, at least one.
        world: whether several competitors fly as ghosts or in one world.
        expect, rules: of a race in one world.
        pace: race seconds per second that flights are asked for.
        chooser: number of the visitor who chose the course last, to whom it is shown in place of a
            race; EVERYBODY: to all; NOBODY: to none, as the visitor went back to the race.
        against: names of stored runs that are shown beside the next flight.
        visitors: the visitors by their numbers.
        left: visitors who have left, by the names of their seats, the last one last.
        removed: the rows that were removed, the last one last.
        next_number: number of the next row.
        menu: the names that may be chosen; None: any.
    """

    race: RaceChoices
    rows: tuple[Row, ...]
    world: Annotated[
        World,
        Shown(
            "ghosts: each alone in its world, side by side; in one world they see each other, keep"
            " clear and can touch",
            "Fly",
        ),
    ] = GHOSTS
    expect: Annotated[
        Expect,
        Shown(
            "what a planner expects of the others: plans that they tell, plans of its own for them,"
            " constant velocity, or nothing",
            "Others",
        ),
    ] = HeatSettings.expect
    rules: Annotated[RulesName, Shown("what a contact of two drones costs")] = HeatSettings.rules
    pace: Annotated[
        PaceName,
        Shown("of the flights, for all visitors; each watches at a speed of its own", "Pace"),
    ] = REAL_TIME
    chooser: int = EVERYBODY
    against: tuple[str, ...] = ()
    visitors: Mapping[int, Visitor] = field(default_factory=lambda: MappingProxyType({}))
    left: Mapping[str, Visitor] = field(default_factory=lambda: MappingProxyType({}))
    removed: tuple[RemovedRow, ...] = ()
    next_number: int = 1
    menu: Menu | None = None

    @classmethod
    def of(cls, *flights: Choices, menu: Menu | None = None) -> PageState:
        """Return the state in which START flies these choices; the first one has the race's."""
        rows = tuple(Row(k, flight.competitor) for k, flight in enumerate(flights, 1))
        return cls(race=flights[0].race, rows=rows, next_number=len(rows) + 1, menu=menu)

    @property
    def flights(self) -> list[Choices]:
        """The flights of the next START, each on its own."""
        return [Choices.of(self.race, row.choices) for row in self.rows]

    @property
    def is_together(self) -> bool:
        """Whether the competitors share one world."""
        return self.world == TOGETHER and len(self.rows) > 1

    @property
    def start(self) -> list[Choices | HeatChoices]:
        """The flights that START will begin."""
        if self.is_together:
            return [HeatChoices(tuple(self.flights), self.expect, self.rules)]
        return [*self.flights]

    def row(self, number: int) -> Row:
        """Return the row with this number. Raises ValueError: it was removed."""
        for row in self.rows:
            if row.number == number:
                return row
        raise ValueError(f"competitor: expected one that is there, got row {number}, now removed")

    def index(self, number: int) -> int:
        """Return the place of a row, from 0. Raises ValueError: it was removed."""
        return self.rows.index(self.row(number))

    @property
    def factor(self) -> float:
        """The race seconds per second that flights are asked for."""
        return float(self.pace.removesuffix(" x"))

    def edited(self, visitor: int) -> Row:
        """Return the row that a visitor edits: the first one, until another one is chosen."""
        chosen = self.visitors.get(visitor)
        if chosen is None:
            return self.rows[0]
        found = [row for row in self.rows if row.number == chosen.row]
        return found[0] if found else self.rows[0]

    def visitor(self, number: int) -> Visitor:
        """Return a visitor's own part."""
        return self.visitors.get(number, Visitor(self.rows[0].number))

    def with_visitor(self, number: int, visitor: Visitor) -> PageState:
        """Return the state with a visitor's own part."""
        return replace(self, visitors=MappingProxyType({**self.visitors, number: visitor}))
