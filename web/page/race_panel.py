"""RacePanel: the controls that choose what to fly or to replay."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple, get_args

import viser

from controllers.learned.pilot import pilot_names
from controllers.presets import PRESETS
from controllers.samplers import SAMPLERS
from quadsim.course import Course, course_names, load_course
from quadsim.files.strict_yaml import FileError
from quadsim.heat.settings import Expect, HeatSettings
from quadsim.racing.rules import RULES
from quadsim.sensing import PERFECT, sensing_names
from quadsim.vehicle import vehicle_names
from web.choices import PILOT, Choices, HeatChoices
from web.race import Snapshot
from web.session import Session
from web.stored_runs import runs_at, titled_runs

LIVE = "live"
GHOSTS = "live: two samplers"
AGAINST = "live against a run"
TOGETHER = "live: several in one world"
REPLAY = "replay"
MODES = (LIVE, GHOSTS, TOGETHER, AGAINST, REPLAY)
FOUR = "colored gaussian colored gaussian"  # entrants that are offered
NONE: str = "none"
RUNS = 200  # number of the latest runs that are offered
LAPS = (1, 2, 3, 5, 10, 20, 50, 100)


@dataclass(frozen=True)
class Menu:
    """The names that the page offers."""

    courses: tuple[str, ...]
    vehicles: tuple[str, ...]
    presets: Mapping[str, str]  # name -> the vehicle it is meant for
    samplers: tuple[str, ...]  # samplers and learned pilots, see web.choices.PILOT
    sensings: tuple[str, ...] = (PERFECT,)

    @classmethod
    def of_everything(cls, course: str) -> Menu:
        """Return the menu of everything that comes with quadsim, and of one more course.

        course: a name, or a FILE.yaml that is added to the menu.
        """
        pilots = [PILOT + name for name in pilot_names()]
        return cls(
            courses=tuple(dict.fromkeys((*course_names(), course))),
            vehicles=vehicle_names(),
            presets={name: planners["colored"].vehicle for name, planners in PRESETS.items()},
            samplers=(*SAMPLERS, *pilots),
            sensings=sensing_names(),
        )


class LoadedCourse(NamedTuple):
    """A course as it was when it was chosen; None: its file cannot be read."""

    name: str
    course: Course | None


class RacePanel:
    """The controls that choose a race.

    Args:
        first: the flight that the controls show at first.
    """

    def __init__(self, gui: viser.GuiApi, session: Session, menu: Menu, first: Choices):
        self._session = session
        self._menu = menu
        self._loaded = LoadedCourse("", None)
        self._paths: dict[str, Path] = {}  # title of a stored run -> its folder
        with gui.add_folder("Race"):
            self.mode = gui.add_dropdown("Mode", MODES, initial_value=LIVE)
            self.course = gui.add_dropdown("Course", menu.courses, initial_value=first.course)
            presets = tuple(menu.presets)
            self.preset = gui.add_dropdown("Preset", presets, initial_value=first.preset)
            self.vehicle = gui.add_dropdown("Vehicle", menu.vehicles, initial_value=first.vehicle)
            self.sampler = gui.add_dropdown("Sampler", menu.samplers, initial_value=first.sampler)
            second = "Second sampler"
            self.second = gui.add_dropdown(second, menu.samplers, initial_value="gaussian")
            self.entrants = gui.add_text(
                "Entrants",
                FOUR,
                hint="two to eight: samplers, or NAME=part+part as in race heat --entrants",
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
            self.sensing = gui.add_dropdown(
                "Sensing",
                menu.sensings,
                initial_value=first.sensing,
                hint="sensors by which the vehicle knows its state; perfect: the true state",
            )
            self.seed = gui.add_number("Seed", first.seed, min=0, max=10**9, step=1)
            own = self._own_laps()
            counts = sorted({*LAPS, first.laps} - {0})
            laps = str(first.laps) if first.laps else own
            self.laps = gui.add_dropdown("Laps", (own, *map(str, counts)), initial_value=laps)
            self.run = gui.add_dropdown("Run", (NONE,), initial_value=NONE)
            self.second_run = gui.add_dropdown("Second run", (NONE,), initial_value=NONE)
            self.start = gui.add_button("START", icon=viser.Icon.FLAG, color="orange")
            stop = viser.Icon.PLAYER_STOP
            self.stop = gui.add_button("STOP", icon=stop, color="red", disabled=True)
        self.mode.on_update(self._show_controls)
        self.preset.on_update(self._choose_vehicle)
        self.run.on_update(self._choose_course)
        self.refresh()
        self._show_controls()

    @property
    def is_replay(self) -> bool:
        """Whether only stored runs are to be shown."""
        return self.mode.value == REPLAY

    @property
    def is_together(self) -> bool:
        """Whether several are to fly in one world."""
        return self.mode.value == TOGETHER

    @property
    def samplers(self) -> list[str]:
        """The samplers that are to be flown."""
        if self.is_replay or self.is_together:
            return []
        if self.mode.value == GHOSTS:
            return [self.sampler.value, self.second.value]
        return [self.sampler.value]

    @property
    def runs(self) -> list[Path]:
        """The stored runs that are to be shown."""
        titles = []
        if self.mode.value in (AGAINST, REPLAY):
            titles.append(self.run.value)
        if self.mode.value == REPLAY:
            titles.append(self.second_run.value)
        chosen = [self._paths[title] for title in titles if title in self._paths]
        return [run for path in chosen for run in runs_at(path)]

    def choices(self, sampler: str) -> Choices:
        """Return the chosen flight; the planner's numbers are chosen elsewhere."""
        laps = self.laps.value
        return Choices(
            course=self.course.value,
            vehicle=self.vehicle.value,
            preset=self.preset.value,
            sampler=sampler,
            sensing=self.sensing.value,
            seed=int(self.seed.value),
            laps=int(laps) if laps.isdigit() else 0,
        )

    def heat(self, flight: Choices) -> HeatChoices:
        """Return the chosen race of several.

        flight: what all entrants have.
        """
        return HeatChoices(
            flight=flight,
            entrants=tuple(self.entrants.value.split()),
            expect=self.expect.value,
            rules=self.rules.value,
        )

    def show_replay(self, runs: Sequence[Path]) -> None:
        """Show that these runs are being replayed."""
        self.mode.value = REPLAY
        titles = {path: title for title, path in self._paths.items()}
        for control, path in zip((self.run, self.second_run), runs, strict=False):
            if path in titles:
                control.value = titles[path]

    def refresh(self) -> None:
        """List the stored runs, the latest first."""
        self._paths = titled_runs(self._session.root, RUNS)
        options = (NONE, *self._paths)
        for control in (self.run, self.second_run):
            if control.options != options:
                control.options = options  # a run that is gone becomes NONE
        if self.run.value == NONE and len(options) > 1:
            self.run.value = options[1]

    def update(self, s: Snapshot) -> None:
        """Enable and label the controls for the present state of the race."""
        self.stop.disabled = not s.flying
        own = self._own_laps()
        # viser sends options even if they have not changed.
        if self.laps.options[0] != own:
            self.laps.options = (own, *self.laps.options[1:])

    def preview(self) -> Course | None:
        """Return the course that START will fly, None where stored runs are shown instead."""
        return None if self.is_replay else self._course()

    def _course(self) -> Course | None:
        """Return the chosen course; None if its file cannot be read, which START reports."""
        name = self.course.value
        if self._loaded.name != name:
            self._loaded = LoadedCourse(name, None)
            with suppress(FileError):
                self._loaded = LoadedCourse(name, load_course(name))
        return self._loaded.course

    def _own_laps(self) -> str:
        """Return the option that stands for the course's own number of laps."""
        course = self._course()
        return f"course ({course.laps})" if course else "course"

    def _show_controls(self, _: viser.GuiEvent | None = None) -> None:
        """Show the controls that the mode needs."""
        mode = self.mode.value
        flight_controls = (
            self.course,
            self.preset,
            self.vehicle,
            self.sampler,
            self.sensing,
            self.seed,
            self.laps,
        )
        for control in flight_controls:
            control.visible = mode != REPLAY
        self.sampler.visible = mode not in (TOGETHER, REPLAY)
        self.second.visible = mode == GHOSTS
        for control in (self.entrants, self.expect, self.rules):
            control.visible = mode == TOGETHER
        self.run.visible = mode in (AGAINST, REPLAY)
        self.second_run.visible = mode == REPLAY
        self.start.label = "REPLAY" if mode == REPLAY else "START"

    # It is a coroutine so that it runs before the other callbacks of a new preset.
    async def _choose_vehicle(self, _: viser.GuiEvent) -> None:
        """Choose the vehicle that the preset is meant for."""
        self.vehicle.value = self._menu.presets[self.preset.value]

    def _choose_course(self, _: viser.GuiEvent) -> None:
        """Choose the course in the run's name, for a live flight beside the run."""
        path = self._paths.get(self.run.value)
        if path is None or self.mode.value != AGAINST:
            return
        found = [course for course in self.course.options if f"_{course}_" in path.name]
        if found:
            self.course.value = max(found, key=len)
