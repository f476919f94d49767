"""NextStart: what the next START flies, as the parts of the page ask for it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple
from urllib.parse import urlencode

from msgspec.structs import replace

from quadsim.course import Course, load_course
from quadsim.files.strict_yaml import FileError
from quadsim.web.race.stored_competitor import runs_at
from quadsim.web.state.choices import Choices, HeatChoices
from quadsim.web.state.commands import OF_RACE, ChooseRace, FlyAgainst, OfferCourse, TakeOver
from quadsim.web.state.desk import Desk
from quadsim.web.state.line_up_link import line_up_text, set_up_of
from quadsim.web.stored.take_over import TakenOver, taken_over


class LoadedCourse(NamedTuple):
    """A course, read when it was chosen; None: its file cannot be read."""

    name: str
    course: Course | None


class NextStart:
    """The flights that the next START will begin. Any thread may call the methods.

    Args:
        desk: the owner of the state.
        root: the folder of runs.
    """

    def __init__(self, desk: Desk, root: str):
        self.desk = desk
        self._root = Path(root)
        self._loaded = LoadedCourse("", None)

    @property
    def choices(self) -> list[Choices | HeatChoices]:
        """The flights that START will begin."""
        return self.desk.state.start

    @property
    def runs(self) -> list[Path]:
        """The folders of the stored runs that are shown beside the next flight."""
        names = self.desk.state.against
        return [run for name in names for run in runs_at(self._root / name)]

    @property
    def first_vehicle(self) -> str:
        """The vehicle of the first competitor."""
        return self.desk.state.rows[0].choices.vehicle

    def course(self) -> Course | None:
        """Return the chosen course; None if its file cannot be read, which START reports."""
        name = self.desk.state.race.course
        loaded = self._loaded
        if loaded.name != name:
            loaded = LoadedCourse(name, None)
            with suppress(FileError):
                loaded = LoadedCourse(name, load_course(name))
            self._loaded = loaded
        return loaded.course

    def offer_course(self, name: str, chosen: bool = False) -> None:
        """Add a course to the menu.

        Args:
            name: a name or a path.
            chosen: whether START flies it next; its file is then read again.
        """
        self.desk.do(OfferCourse(name))
        if chosen:
            self._loaded = LoadedCourse("", None)
            self.desk.do(ChooseRace("course", name))

    def fly_against(self, runs: Sequence[str], course: str, visitor: int) -> None:
        """Show stored runs beside the next flight, on their course if the menu has it."""
        if course in OF_RACE["course"].options(self.desk.state.menu):
            self.desk.do(ChooseRace("course", course, visitor))
        self.desk.do(FlyAgainst(tuple(runs)))

    def set_up(self, line_up: str, visitor: int) -> None:
        """Set up the race of an address, see quadsim.web.state.line_up_link. Raises ValueError."""
        self.desk.do(replace(set_up_of(line_up), visitor=visitor))

    @property
    def link(self) -> str:
        """The part of an address that sets up this race. Raises ValueError: it is too long."""
        return "?" + urlencode({"line_up": line_up_text(self.desk.state)})

    def take_over(self, record: Mapping[str, Any]) -> TakenOver:
        """Add a competitor that is set up like a run. Raises ValueError. record: its spec."""
        found = taken_over(record, self.desk.state.race)
        self.desk.do(TakeOver(None, found.choices))
        return found
