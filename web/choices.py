"""Choices: what a person chooses on the page before START, and the flight it stands for."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from controllers.presets import Planner, preset
from quadsim.dynamics.quadrotor import ModelParams
from quadsim.sensing import PERFECT
from quadsim.spec.settings import SettingValue, values_of
from quadsim.spec.spec import Spec
from quadsim.vehicle import load_vehicle

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
