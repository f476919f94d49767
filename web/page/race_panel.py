"""RacePanel: the controls that choose what to fly or to replay."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple, get_args

import viser

from quadsim.config.settings import Clock
from quadsim.course import Course, load_course
from quadsim.files.strict_yaml import FileError
from quadsim.heat.rules import RULES
from quadsim.heat.settings import Expect, HeatSettings
from web.choices import Choices, HeatChoices, specs_of
from web.page.competitor_table import CompetitorTable, announced, table_of
from web.page.menu import Menu
from web.race import Snapshot
from web.run_table import FolderWatch
from web.session import Session
from web.stored_runs import runs_at, titled_runs

LIVE = "live"
AGAINST = "live against a run"
REPLAY = "replay"
MODES = (LIVE, AGAINST, REPLAY)
GHOSTS = "as ghosts"
TOGETHER = "in one world"
NONE: str = "none"
RUNS = 200  # number of the latest runs that are offered
LAPS = (1, 2, 3, 5, 10, 20, 50, 100)


class LoadedCourse(NamedTuple):
    """A course, read when it was chosen; None: its file cannot be read."""

    name: str
    course: Course | None


class RacePanel:
    """The controls that choose a race.

    Args:
        menu: the available choices.
        first: the initial competitors, with the choices of the whole race.

    Attributes:
        table: the competitors.
        coming: description of the next START, as HTML.
    """

    def __init__(self, gui: viser.GuiApi, session: Session, menu: Menu, first: Sequence[Choices]):
        self._session = session
        self._loaded = LoadedCourse("", None)
        self._folder = FolderWatch(Path(session.root))
        self._paths: dict[str, Path] = {}  # title of a stored run -> its folder
        self.coming = ""
        self._shown: object = None  # what the table of competitors shows
        race = first[0]
        self.folder = gui.add_folder("Race")
        with self.folder:
            self.mode = gui.add_dropdown("Mode", MODES, initial_value=LIVE)
            self._competitors = gui.add_html("")
            self.world = gui.add_dropdown(
                "Fly",
                (GHOSTS, TOGETHER),
                initial_value=GHOSTS,
                hint="ghosts: each alone in its world, side by side; in one world they see each"
                " other, keep clear and can touch",
            )
            self.expect = gui.add_dropdown(
                "Others",
                get_args(Expect),
                initial_value=HeatSettings.expect,
                hint="what a planner expects of the others: plans that they tell, plans of its own"
                " for them, constant velocity, or nothing",
            )
            self.rules = gui.add_dropdown(
                "Rules",
                tuple(RULES),
                initial_value=HeatSettings.rules,
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
            self.run = gui.add_dropdown("Run", (NONE,), initial_value=NONE)
            self.second_run = gui.add_dropdown("Second run", (NONE,), initial_value=NONE)
            self.start = gui.add_button("START", icon=viser.Icon.FLAG, color="orange")
            stop = viser.Icon.PLAYER_STOP
            self.stop = gui.add_button("STOP", icon=stop, color="red", disabled=True)
        self.table = CompetitorTable(gui, menu, first)
        self.mode.on_update(self._show_controls)
        self.world.on_update(self._show_controls)
        self.run.on_update(self._choose_course)
        self.refresh()
        self._show_controls()

    @property
    def is_replay(self) -> bool:
        """Whether only stored runs are chosen."""
        return self.mode.value == REPLAY

    @property
    def is_together(self) -> bool:
        """Whether the competitors share one world."""
        return self.world.value == TOGETHER and len(self.table.rows) > 1

    @property
    def flights(self) -> list[Choices]:
        """The chosen flights of the competitors."""
        laps = self.laps.value
        race = Choices(
            course=self.course.value,
            seed=self.seed.value.strip(),
            laps=int(laps) if laps.isdigit() else 0,
            clock=self.clock.value,
            deadline_ms=self.deadline.value.strip(),
            runs_dir=str(self._session.root),
        )
        return self.table.flights(race)

    @property
    def choices(self) -> list[Choices | HeatChoices]:
        """The choices of the next START."""
        if self.is_replay:
            return []
        if self.is_together:
            return [HeatChoices(tuple(self.flights), self.expect.value, self.rules.value)]
        return [*self.flights]

    @property
    def runs(self) -> list[Path]:
        """The chosen stored runs."""
        titles = []
        if self.mode.value in (AGAINST, REPLAY):
            titles.append(self.run.value)
        if self.mode.value == REPLAY:
            titles.append(self.second_run.value)
        chosen = [self._paths[title] for title in titles if title in self._paths]
        return [run for path in chosen for run in runs_at(path)]

    def show_replay(self, runs: Sequence[Path]) -> None:
        """Show that these runs are being replayed."""
        self.mode.value = REPLAY
        titles = {path: title for title, path in self._paths.items()}
        for control, path in zip((self.run, self.second_run), runs, strict=False):
            if path in titles:
                control.value = titles[path]

    def refresh(self) -> None:
        """Offer the presets that can fly the race, and list the stored runs.

        The list of runs, the latest first, is updated if the runs have changed.
        """
        self._offer_presets()
        if not self._folder.has_changed():
            return
        self._paths = titled_runs(self._session.root, RUNS)
        options = (NONE, *self._paths)
        for control in (self.run, self.second_run):
            if control.options != options:
                control.options = options  # a run that is gone becomes NONE
        if self.run.value == NONE and len(options) > 1:
            self.run.value = options[1]

    def _offer_presets(self) -> None:
        """Offer the presets that can fly the chosen race."""
        course = self._course()
        if course is not None:
            laps = int(self.laps.value) if self.laps.value.isdigit() else course.laps
            self.table.offer_presets(course, laps, str(self._session.root))

    def update(self, s: Snapshot) -> None:
        """Enable and label the controls for the present state of the race."""
        self.stop.disabled = not s.flying
        self._show_competitors()
        own = self._own_laps()
        # viser sends options even if they have not changed.
        if self.laps.options[0] != own:
            self.laps.options = (own, *self.laps.options[1:])

    def _show_competitors(self) -> None:
        """Show the table of competitors, with an error if they cannot fly, after a change."""
        asked = (self.choices, self.table.edited)
        if asked == self._shown:
            return
        self._shown = asked
        problem = problem_of(self.choices)
        self._competitors.content = table_of(self.flights, self.table.edited, problem)
        self.coming = "" if self.is_replay else announced(self.flights, self.world.value)

    def preview(self) -> Course | None:
        """Return the course of the next START, None if stored runs are chosen instead."""
        return None if self.is_replay else self._course()

    def chosen_course(self) -> Course | None:
        """Return the chosen course; None if its file cannot be read."""
        return self._course()

    @property
    def first_vehicle(self) -> str:
        """The vehicle of the first competitor."""
        return self.flights[0].vehicle

    def offer_course(self, name: str, chosen: bool = False) -> None:
        """Add a course to the menu.

        Args:
            name: a name or a path.
            chosen: whether START flies it next; its file is then read again.
        """
        if name not in self.course.options:
            self.course.options = (*self.course.options, name)
        if chosen:
            self._loaded = LoadedCourse("", None)
            self.course.value = name
            if self.is_replay:
                self.mode.value = LIVE

    def _course(self) -> Course | None:
        """Return the chosen course; None if its file cannot be read, which START reports."""
        name = self.course.value
        if self._loaded.name != name:
            self._loaded = LoadedCourse(name, None)
            with suppress(FileError):
                self._loaded = LoadedCourse(name, load_course(name))
        return self._loaded.course

    def _own_laps(self) -> str:
        """Return the option for the course's own number of laps."""
        course = self._course()
        return f"course ({course.laps})" if course else "course"

    def _show_controls(self, _: viser.GuiEvent | None = None) -> None:
        """Show the controls of the mode."""
        mode = self.mode.value
        live = mode != REPLAY
        of_the_race = (self.world, self.course, self.seed, self.laps, self.clock, self.deadline)
        for control in (self._competitors, *of_the_race):
            control.visible = live
        self.table.folder.visible = live
        for control in (self.expect, self.rules):
            control.visible = live and self.world.value == TOGETHER
        self.run.visible = mode in (AGAINST, REPLAY)
        self.second_run.visible = mode == REPLAY
        self.start.label = "REPLAY" if mode == REPLAY else "START"

    def _choose_course(self, _: viser.GuiEvent) -> None:
        """Choose the run's course, for a live flight together with the run."""
        path = self._paths.get(self.run.value)
        if path is None or self.mode.value != AGAINST:
            return
        found = [course for course in self.course.options if f"_{course}_" in path.name]
        if found:
            self.course.value = max(found, key=len)


def problem_of(choices: Sequence[Choices | HeatChoices]) -> str:
    """Return one line with the reason why choices cannot be flown, "" if they can."""
    try:
        specs_of([one for one in choices if isinstance(one, Choices)])
        for one in choices:
            if isinstance(one, HeatChoices):
                one.spec()
    except ValueError as error:
        return str(error)
    return ""
