"""Choices: what a person chooses on the page before START, and the flight it stands for."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from controllers.presets import Planner, preset
from quadsim.campaign.line_ups import line_up
from quadsim.dynamics.quadrotor import ModelParams
from quadsim.heat.settings import Expect
from quadsim.heat.spec import HeatSpec
from quadsim.racing.rules import RulesName
from quadsim.sensing import PERFECT
from quadsim.spec.settings import SettingValue, values_of
from quadsim.spec.spec import Spec
from quadsim.vehicle import load_vehicle
from web.numbers import Change, with_change

PILOT = "pilot "  # stands before the name of a learned pilot, where a sampler may stand


@dataclass(frozen=True)
class Choices:
    """One flight, as it is chosen on the page."""

    course: str = "split_s_swift"
    vehicle: str = "swift"
    preset: str = "race"
    sampler: str = "colored"  # or PILOT with the name of a learned pilot
    sensing: str = PERFECT
    seed: int = 0
    laps: int = 0  # 0: the course's
    # numbers of web.numbers.SLIDERS that differ from the preset's
    numbers: Mapping[str, float] = field(default_factory=dict)
    # any other settings of quadsim.fly
    settings: Mapping[str, Any] = field(default_factory=dict)

    def spec(self) -> Spec:
        """Return the flight that is chosen, without the numbers of the sliders.

        Raises:
            ValueError: the choices do not fit together; one line says why.
        """
        return Spec.of(
            self.course,
            **planner_choice(self.sampler),
            preset=self.preset,
            vehicle=self.vehicle,
            seed=self.seed,
            sensing=self.sensing,
            laps=self.laps or None,
            **self.settings,
        )


@dataclass(frozen=True)
class HeatChoices:
    """A race of several vehicles in one world, as it is chosen on the page."""

    # what all entrants have; its sampler is not used
    flight: Choices
    # as in `race heat --entrants`
    entrants: tuple[str, ...]
    expect: Expect = "own"
    rules: RulesName = "elimination"

    def spec(self) -> HeatSpec:
        """Return the race that is chosen.

        Raises:
            ValueError: the choices do not fit together; one line says why.
        """
        shared = {
            "preset": self.flight.preset,
            "vehicle": self.flight.vehicle,
            "seed": self.flight.seed,
            "sensing": self.flight.sensing,
            "laps": self.flight.laps or None,
            "expect": self.expect,
            "rules": self.rules,
        }
        given = {name: value for name, value in shared.items() if value is not None}
        settings = {**given, **self.flight.settings}
        entrants, of_race = line_up(self.flight.course, self.entrants, settings)
        moved = tuple(replace(one, spec=self._with_numbers(one.spec)) for one in entrants)
        return HeatSpec(moved, of_race, self.flight.seed)

    def _with_numbers(self, spec: Spec) -> Spec:
        """Return a flight with the numbers of the sliders; a learned pilot has none of them."""
        if spec.pilot:
            return spec
        planner = spec.planner
        for name, value in self.flight.numbers.items():
            planner = with_change(planner, spec.planner, Change(name, value))
        return replace(spec, planner=planner)


def planner_choice(sampler: str) -> dict[str, str]:
    """Return the settings of quadsim.fly that a sampler or a learned pilot stands for."""
    if sampler.startswith(PILOT):
        return {"sampler": "colored", "pilot": sampler.removeprefix(PILOT)}
    return {"sampler": sampler}


def preset_of(name: str, sampler: str) -> Planner:
    """Return the preset's planner for a sampler; that of a pilot, for colored sampling."""
    return preset(name, planner_choice(sampler)["sampler"])


def planner_settings(preset_name: str, vehicle: str, sampler: str) -> dict[str, SettingValue]:
    """Return every setting of the planner and of its model of the vehicle, by name.

    A learned pilot has none.
    """
    if sampler.startswith(PILOT):
        return {}
    model = ModelParams.of(load_vehicle(vehicle))
    return values_of(preset(preset_name, sampler), model)
