"""Choices: the visitor's choices on the page before START, and the resulting flights."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cache
from pathlib import Path
from typing import Annotated, Any, NamedTuple, Self

from quadsim.config.presets import PresetSource
from quadsim.config.resolve import flight_settings, is_seen_late, scale_of, with_numbers
from quadsim.config.settings import SETTINGS, Clock, FlightSettings, Kind, kinds_of, values_of
from quadsim.config.spec import Spec
from quadsim.controllers.derived import Scale
from quadsim.controllers.presets import Planner, preset
from quadsim.course import load_course
from quadsim.dynamics.quadrotor import ModelParams
from quadsim.files.strict_yaml import FileError
from quadsim.firmware import FlightControllerName
from quadsim.firmware.package import built_firmware
from quadsim.firmware.process import FirmwareError
from quadsim.firmware.text import shipped_configuration
from quadsim.heat.rules import RulesName
from quadsim.heat.settings import Expect, HeatSettings
from quadsim.heat.spec import Entrant, HeatSpec
from quadsim.physics.randomization_file import load_randomization
from quadsim.racing.hand import HAND, Hand, HandRates
from quadsim.sensing import PERFECT
from quadsim.vehicle import load_vehicle
from quadsim.web.state.differences import numbered
from quadsim.web.state.fields import Shown
from quadsim.web.state.menu import PILOT as PILOT
from quadsim.web.state.numbers import SLIDERS, Change, with_change

# HAND may take the place of a sampler for a manual flight
OF_THE_PLANNER = {name for name, setting in SETTINGS.items() if setting.group != "flight"}


@dataclass(frozen=True)
class RaceChoices:
    """The choices that are common to all competitors of a race."""

    course: Annotated[
        str, Shown("the gates, and the order in which they are flown", menu="courses")
    ] = "split_s_swift"
    seed: Annotated[
        int | str,
        Shown("of the planner's noise and of all else that is random; the same for all"),
    ] = 0
    randomize: Annotated[
        float | str,
        Shown("how far seeds vary start, vehicle and gusts: 0, not at all; 1, as in the results"),
    ] = FlightSettings.randomize
    # 0: the course's
    laps: Annotated[int, Shown("from a standing start; empty: as many as the course has")] = 0
    clock: Annotated[
        Clock,
        Shown(
            "simulated: planning takes no time; wall: while a plan is made the flight continues on"
            " the last one"
        ),
    ] = "simulated"
    # "none": no deadline
    deadline_ms: Annotated[
        float | str,
        Shown("longest time of a plan, kept by fewer samples; none, or a number", "Deadline", "ms"),
    ] = "none"
    # folder of runs with the solutions of `race limit`
    runs_dir: str = FlightSettings.runs_dir

    @property
    def course_name(self) -> str:
        """The name of the course: of a file, without its folder."""
        return Path(self.course).stem if "/" in self.course else self.course


class Planners(NamedTuple):
    """The planner of a competitor, and what it is made from.

    Attributes:
        of_preset: with the numbers of the preset alone, which may follow from the course.
        base: with the changed settings too.
        chosen: with the numbers of the sliders too, some of which are relative to `base`.
    """

    of_preset: Planner
    base: Planner
    chosen: Planner


@dataclass(frozen=True)
class CompetitorChoices:
    """The choices of one competitor: a row of the table of competitors."""

    # or PILOT with the name of a learned pilot, or HAND
    sampler: Annotated[
        str,
        Shown(
            "how the planner samples; or hand, a person, or a learned pilot in its place",
            menu="samplers",
        ),
    ] = "colored"
    preset: Annotated[str, Shown("source of the planner's numbers", menu="presets")] = "race"
    vehicle: Annotated[str, Shown("the quadrotor that is flown", menu="vehicles")] = "swift"
    sensing: Annotated[
        str,
        Shown(
            "sensors by which the vehicle knows its state; perfect: the true state",
            menu="sensings",
        ),
    ] = PERFECT
    flight_controller: Annotated[
        FlightControllerName,
        Shown("ideal: a first-order rate loop; betaflight: the firmware, if it is built"),
    ] = "ideal"
    # numbers of quadsim.web.state.numbers.SLIDERS that differ from preset and settings
    numbers: Mapping[str, float] = field(default_factory=dict)
    # any other settings of quadsim.fly
    settings: Mapping[str, Any] = field(default_factory=dict)

    @property
    def kind(self) -> str:
        """The name of the sampler, `pilot` or `hand`."""
        return "pilot" if self.sampler.startswith(PILOT) else self.sampler

    @property
    def has_planner(self) -> bool:
        """Whether a planner flies, and not a learned pilot or a person."""
        return is_planner(self.sampler)

    @property
    def kinds(self) -> Mapping[str, Kind]:
        """The kinds of the settings that the planner and its model of the vehicle have, by name."""
        return planner_kinds(self.preset, self.sampler)

    @property
    def known_settings(self) -> dict[str, Any]:
        """The changed settings of the present planner; the rest applies to other samplers."""
        kinds = self.kinds
        return {
            name: value
            for name, value in self.settings.items()
            if name in kinds or name not in OF_THE_PLANNER
        }

    @property
    def idle_settings(self) -> list[str]:
        """The names of changed settings that the present planner lacks."""
        asked = [*self.settings, *(SLIDERS[name].setting for name in self.numbers)]
        return [name for name in dict.fromkeys(asked) if name in OF_THE_PLANNER - set(self.kinds)]

    def planners(self) -> Planners:
        """Return the planner, and what it is made from.

        Raises:
            ValueError: a number is out of its range.
        """
        of_preset = self._of_preset()
        base = with_numbers(of_preset, self.known_settings)
        return Planners(of_preset, base, self._with_numbers(base))

    def _of_preset(self) -> Planner:
        """Return the planner with the numbers of the preset alone. Raises ValueError."""
        sampler = planner_choice(self.sampler)["sampler"]
        is_ideal = self.flight_controller == "ideal"
        source = PresetSource.read(self.preset)
        return source.planner(sampler, firmware=not is_ideal, scale=self._scale(source, sampler))

    def _scale(self, source: PresetSource, sampler: str) -> Scale | None:
        """Return the scale of the flight; None: no course is known, so the preset's holds."""
        return None

    def _with_numbers(self, base: Planner) -> Planner:
        """Return the planner with the numbers of the sliders."""
        planner = base
        for name, value in self.numbers.items():
            planner = with_change(planner, base, Change(name, value))
        return planner

    def with_number(self, name: str, value: float) -> Self:
        """Return the choices with the number of a slider."""
        return replace(self, numbers={**self.numbers, name: value})

    def with_setting(self, name: str, value: Any) -> Self:
        """Return the choices with a changed setting, which overrides its sliders.

        A value equal to the preset's is no change.
        """
        numbers = {n: x for n, x in self.numbers.items() if SLIDERS[n].setting != name}
        settings = {key: x for key, x in self.settings.items() if key != name}
        found = values_of(self._of_preset(), ModelParams.of(load_vehicle(self.vehicle))).get(name)
        if found is None or found.value != value:
            settings[name] = value
        return replace(self, numbers=numbers, settings=settings)


@dataclass(frozen=True)
class Choices(CompetitorChoices, RaceChoices):
    """The choices of one flight: of its race, and of its competitor."""

    @classmethod
    def of(cls, race: RaceChoices, competitor: CompetitorChoices) -> Choices:
        """Return the flight of a competitor in a race."""
        return cls(**vars_of(race, RaceChoices), **vars_of(competitor, CompetitorChoices))

    @property
    def race(self) -> RaceChoices:
        """The choices that are common to all competitors."""
        return RaceChoices(**vars_of(self, RaceChoices))

    def _scale(self, source: PresetSource, sampler: str) -> Scale | None:
        """Return the scale of the flight on its course; None: there is no such course."""
        flight = flight_settings(self.settings)
        try:
            course = load_course(self.course)
        except FileError:
            return None
        base = source.planner(sampler)
        seen_late = is_seen_late(flight, load_randomization(flight.randomization))
        return scale_of(course, load_vehicle(self.vehicle), self.settings, base, seen_late)

    @property
    def competitor(self) -> CompetitorChoices:
        """The choices of the competitor alone."""
        return CompetitorChoices(**vars_of(self, CompetitorChoices))

    def base_spec(self) -> Spec:
        """Return the chosen flight without the numbers of the sliders.

        Raises:
            ValueError: the choices do not fit together; the message is one line.
        """
        # A competitor's own setting comes before the one of the race.
        settings: dict[str, Any] = {"randomize": self.randomize, **self.known_settings}
        spec = Spec.of(
            self.course,
            **planner_choice(self.sampler),
            preset=self.preset,
            vehicle=self.vehicle,
            flight_controller=self.flight_controller,
            seed=self.seed,  # pyright: ignore[reportArgumentType]
            sensing=self.sensing,
            laps=self.laps or None,
            clock=self.clock,
            deadline_ms=self._deadline,  # pyright: ignore[reportArgumentType]
            runs_dir=self.runs_dir,
            **settings,
        )
        return flown_by_hand(spec) if self.sampler == HAND else spec

    @property
    def _deadline(self) -> float | str | None:
        """The deadline as a setting of quadsim.fly, which only a planner has."""
        return None if not self.has_planner or self.deadline_ms == "none" else self.deadline_ms

    def flown(self, base: Spec) -> Spec:
        """Return the flight with the numbers of the sliders, which only a planner has.

        base: result of `base_spec`.
        """
        if not base.has_planner:
            return base
        return replace(base, planner=self._with_numbers(base.planner))

    def spec(self) -> Spec:
        """Return the chosen flight. Raises ValueError, as base_spec does."""
        return self.flown(self.base_spec())


def vars_of(choices: object, of: type) -> dict[str, Any]:
    """Return the fields of a part of choices by name. of: RaceChoices or CompetitorChoices."""
    return {one.name: getattr(choices, one.name) for one in fields(of)}


@dataclass(frozen=True)
class HeatChoices:
    """The choices of a race of several vehicles in one world."""

    flights: tuple[Choices, ...]
    expect: Expect = HeatSettings.expect
    rules: RulesName = HeatSettings.rules

    def spec(self) -> HeatSpec:
        """Return the chosen race.

        Raises:
            ValueError: the choices do not fit together; the message is one line.
        """
        specs = specs_of(self.flights)
        names = names_of(self.flights)
        entrants = tuple(map(Entrant, names, specs))
        return HeatSpec(entrants, HeatSettings(expect=self.expect, rules=self.rules), specs[0].seed)


def names_of(flights: Sequence[Choices]) -> list[str]:
    """Return the names of competitors: "colored", "colored 2" and so on."""
    return numbered([flight.kind for flight in flights])


def specs_of(flights: Sequence[Choices]) -> list[Spec]:
    """Return the chosen flights.

    Raises:
        ValueError: a flight cannot be flown; the message names it in one line.
    """
    expect_one_hand(flights)
    specs = []
    for name, flight in zip(names_of(flights), flights, strict=True):
        try:
            specs.append(flight.spec())
        except ValueError as error:
            raise ValueError(f"{name}: {error}" if len(flights) > 1 else str(error)) from None
    return specs


def expect_one_hand(flights: Sequence[Choices]) -> None:
    """Raise ValueError if more than one vehicle is flown by hand."""
    hands = [flight for flight in flights if flight.sampler == HAND]
    if len(hands) > 1:
        raise ValueError(f"sampler: expected one competitor by hand at most, got {len(hands)}")


def planner_choice(sampler: str) -> dict[str, str]:
    """Return the settings of quadsim.fly for a sampler or a learned pilot."""
    if sampler.startswith(PILOT):
        return {"sampler": "colored", "pilot": sampler.removeprefix(PILOT)}
    return {"sampler": "colored" if sampler == HAND else sampler}


def is_planner(sampler: str) -> bool:
    """Return whether a choice is a sampler: neither a learned pilot nor a person."""
    return sampler != HAND and not sampler.startswith(PILOT)


@cache
def planner_kinds(preset_name: str, sampler: str) -> Mapping[str, Kind]:
    """Return the kinds of the settings of a planner and its model of the vehicle, by name.

    A learned pilot and a person have none.
    """
    return kinds_of(preset(preset_name, sampler)) if is_planner(sampler) else {}


def flight_controller_of(vehicle: str) -> FlightControllerName:
    """Return "betaflight" if it is built and there is a configuration for the vehicle.

    vehicle: a name or a FILE.yaml.
    """
    try:
        built_firmware()
    except FirmwareError:
        return "ideal"
    loaded = load_vehicle(vehicle)
    has_configuration = loaded.rotors is not None and shipped_configuration(loaded) is not None
    return "betaflight" if has_configuration else "ideal"


def flown_by_hand(spec: Spec) -> Spec:
    """Return the flight with manual sticks instead of the planner."""
    return replace(spec, controller=Hand(HandRates.of(spec.vehicle)))
