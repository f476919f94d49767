"""RacePanel: the controls that choose the race of the next START, which all visitors share."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple, get_args
from urllib.parse import urlencode

import viser

from quadsim.config.settings import Clock
from quadsim.course import Course, load_course
from quadsim.files.strict_yaml import FileError
from quadsim.heat.rules import RULES
from quadsim.heat.settings import Expect
from quadsim.web.choices import Choices, HeatChoices
from quadsim.web.commands import (
    AnyCommand,
    ChooseRace,
    FlyAgainst,
    OfferCourse,
    RaceSetting,
    TakeOver,
)
from quadsim.web.desk import Desk
from quadsim.web.line_up_link import line_up_text, set_up_of
from quadsim.web.menu import Menu
from quadsim.web.page.html import box, div, small, text
from quadsim.web.page.set_values import SetValues
from quadsim.web.state import TOGETHER, PageState, World
from quadsim.web.stored_runs import runs_at
from quadsim.web.take_over import TakenOver, taken_over

LAPS = (1, 2, 3, 5, 10, 20, 50, 100)
NOTICE = 6.0  # duration of a notice [s]


class LoadedCourse(NamedTuple):
    """A course, read when it was chosen; None: its file cannot be read."""

    name: str
    course: Course | None


class RacePanel:
    """The controls of the race; they show the state of the desk and send commands.

    Args:
        desk: the owner of the state.
        menu: the available choices.
        root: the folder of runs.
    """

    def __init__(self, gui: viser.GuiApi, desk: Desk, menu: Menu, root: str):
        self._desk = desk
        self._root = Path(root)
        self._loaded = LoadedCourse("", None)
        self._shown: object = None
        self._set_values = SetValues()
        self._refused_shown = 0
        self._refused = 0  # number of refused commands, after which the controls are set again
        state = desk.state
        race = state.race
        self.folder = gui.add_folder("Race")
        with self.folder:
            self.world = gui.add_dropdown(
                "Fly",
                get_args(World),
                initial_value=state.world,
                hint="ghosts: each alone in its world, side by side; in one world they see each"
                " other, keep clear and can touch",
            )
            self.expect = gui.add_dropdown(
                "Others",
                get_args(Expect),
                initial_value=state.expect,
                hint="what a planner expects of the others: plans that they tell, plans of its own"
                " for them, constant velocity, or nothing",
            )
            self.rules = gui.add_dropdown(
                "Rules",
                tuple(RULES),
                initial_value=state.rules,
                hint="what a contact of two drones costs",
            )
            self.course = gui.add_dropdown("Course", menu.courses, initial_value=race.course)
            self.seed = gui.add_text(
                "Seed",
                str(race.seed),
                hint="of the planner's noise and of all else that is random; the same for all",
            )
            own = self._own_laps()
            counts = sorted({*LAPS, race.laps} - {0})
            laps = str(race.laps) if race.laps else own
            self.laps = gui.add_dropdown("Laps", (own, *map(str, counts)), initial_value=laps)
            self.clock = gui.add_dropdown(
                "Clock",
                get_args(Clock),
                initial_value=race.clock,
                hint="simulated: planning takes no time; wall: while a plan is made the flight "
                "continues on the last one",
            )
            self.deadline = gui.add_text(
                "Deadline [ms]",
                str(race.deadline_ms),
                hint="longest time of a plan, kept by fewer samples; none, or a number",
            )
            self._against = gui.add_html("")
            self.alone = gui.add_button("Fly without stored runs", color="gray")
        for name, control in self._controls.items():
            control.on_update(partial(self._chosen, name))
        self.alone.on_click(self._fly_alone)
        self._show(state)

    @property
    def choices(self) -> list[Choices | HeatChoices]:
        """What START flies."""
        return self._desk.state.start

    @property
    def runs(self) -> list[Path]:
        """The stored runs beside the next flight."""
        names = self._desk.state.against
        return [run for name in names for run in runs_at(self._root / name)]

    @property
    def first_vehicle(self) -> str:
        """The vehicle of the first competitor."""
        return self._desk.state.rows[0].choices.vehicle

    def update(self, state: PageState) -> None:
        """Enable and label the controls for the present state of the page."""
        own = self._own_laps()
        # viser sends options even if they have not changed.
        if self.laps.options[0] != own:
            self.laps.options = (own, *self.laps.options[1:])
            self._set_values.forget("laps")
            self._shown = None
        shown = (state, self._refused)
        if shown != self._shown:
            self._shown = shown
            if self._refused != self._refused_shown:
                self._refused_shown = self._refused
                self._set_values.forget()
            self._show(state)

    def chosen_course(self) -> Course | None:
        """Return the chosen course; None if its file cannot be read, which START reports."""
        name = self._desk.state.race.course
        if self._loaded.name != name:
            self._loaded = LoadedCourse(name, None)
            with suppress(FileError):
                self._loaded = LoadedCourse(name, load_course(name))
        return self._loaded.course

    def offer_course(self, name: str, chosen: bool = False) -> None:
        """Add a course to the menu.

        Args:
            name: a name or a path.
            chosen: whether START flies it next; its file is then read again.
        """
        self._desk.do(OfferCourse(name))
        if name not in self.course.options:
            self.course.options = (*self.course.options, name)
        if chosen:
            self._loaded = LoadedCourse("", None)
            self._desk.do(ChooseRace("course", name))

    def fly_against(self, runs: Sequence[str], course: str) -> None:
        """Show stored runs beside the next flight, on their course if the menu has it."""
        if course in self.course.options:
            self._desk.do(ChooseRace("course", course))
        self._desk.do(FlyAgainst(tuple(runs)))

    def set_up(self, line_up: str) -> None:
        """Set up the race of an address, see quadsim.web.line_up_link. Raises ValueError."""
        self._desk.do(set_up_of(line_up))

    @property
    def line_up_link(self) -> str:
        """The part of an address that sets up this race. Raises ValueError: it is too long."""
        return "?" + urlencode({"line_up": line_up_text(self._desk.state)})

    def take_over(self, record: Mapping[str, Any]) -> TakenOver:
        """Add a competitor that is set up like a run. Raises ValueError. record: its spec."""
        found = taken_over(record, self._desk.state.race)
        self._desk.do(TakeOver(None, found.choices))
        return found

    @property
    def _controls(self) -> dict[RaceSetting, Any]:
        """The controls by the names of their choices."""
        return {
            "world": self.world,
            "expect": self.expect,
            "rules": self.rules,
            "course": self.course,
            "seed": self.seed,
            "laps": self.laps,
            "clock": self.clock,
            "deadline_ms": self.deadline,
        }

    def _show(self, state: PageState) -> None:
        """Show the state."""
        race = state.race
        laps = str(race.laps) if race.laps else self._own_laps()
        shown = {
            "world": state.world,
            "expect": state.expect,
            "rules": state.rules,
            "course": race.course,
            "seed": str(race.seed),
            "laps": laps,
            "clock": race.clock,
            "deadline_ms": str(race.deadline_ms),
        }
        if laps not in self.laps.options:
            self.laps.options = (*self.laps.options, laps)
        for name, control in self._controls.items():
            self._set_values(name, control, shown[name])
        several = len(state.rows) > 1
        for control in (self.expect, self.rules):
            control.visible = several and state.world == TOGETHER
        beside = bool(state.against)
        self._against.visible = self.alone.visible = beside
        if beside:
            names = "".join(div(text(name), word_break="break-all") for name in state.against)
            self._against.content = box("against", small(names))

    def _own_laps(self) -> str:
        """Return the option for the course's own number of laps."""
        course = self.chosen_course()
        return f"course ({course.laps})" if course else "course"

    async def _chosen(self, name: RaceSetting, event: viser.GuiEvent) -> None:
        """Choose a setting of the race."""
        if event.client_id is None:  # by update(), not by a visitor
            return
        value = self._controls[name].value
        if name == "laps":
            value = int(value) if value.isdigit() else 0
        self._do(ChooseRace(name, value.strip() if isinstance(value, str) else value), event)

    async def _fly_alone(self, event: viser.GuiEvent) -> None:
        """Show no stored runs beside the next flight."""
        self._do(FlyAgainst(()), event)

    def _do(self, command: AnyCommand, event: viser.GuiEvent) -> None:
        """Carry out a command; notify the visitor if that is not possible."""
        try:
            self._desk.do(command)
        except ValueError as error:
            self._refused += 1
            if event.client is not None:
                event.client.add_notification(
                    "Not taken", str(error), auto_close_seconds=NOTICE, color="red"
                )
