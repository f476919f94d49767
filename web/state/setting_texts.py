"""A setting's value as a control shows it, and a control's value as a setting, which is checked."""

from __future__ import annotations

from typing import Any

from msgspec import inspect

from quadsim.config.settings import SETTINGS, Kind, bare
from quadsim.files.values import checked, is_optional
from quadsim.files.yaml_errors import cut
from quadsim.web.state.choices import CompetitorChoices
from quadsim.web.state.numbers import SLIDERS

# Settings with a slider for the whole number; sliders of sigma and gamma control a part of one
HAVE_SLIDERS = {
    slider.setting for slider in SLIDERS.values() if SETTINGS[slider.setting].group != "sampling"
}


def shown_value(value: Any) -> Any:
    """Return a setting's value for its control, numbers as a text."""
    if isinstance(value, bool | str):
        return value
    numbers = value if isinstance(value, tuple) else (value,)
    return " ".join("none" if x is None else f"{x:.10g}" for x in numbers)


def read_value(value: Any, kind: Kind) -> Any:
    """Return a control's value as a setting of quadsim.fly, which reports invalid values."""
    if not isinstance(value, str):
        return value
    if isinstance(bare(kind), inspect.TupleType):
        return value.split()
    return None if value.strip().lower() == "none" else value


def checked_number(name: str, value: float, competitor: CompetitorChoices) -> float:
    """Return the value of a slider if its setting can have it.

    Raises:
        ValueError: there is no such slider, or its setting cannot have the value.
    """
    if name not in SLIDERS:
        raise ValueError(f"{cut(name)}: expected one of {', '.join(SLIDERS)}")
    setting = SLIDERS[name].setting
    if setting not in HAVE_SLIDERS:
        return value
    kind = competitor.kinds.get(setting)
    if kind is None:
        return value  # kept for a sampler that has it
    if value == 0 and is_optional(kind):
        return value
    whole = int(value) if float(value).is_integer() else value
    checked(setting, whole, kind)
    return whole if isinstance(bare(kind), inspect.IntType) else value


def checked_setting(name: str, value: Any, competitor: CompetitorChoices) -> Any:
    """Return the value of a control if its setting can have it.

    Raises:
        ValueError: the planner has no such setting, or it cannot have the value.
    """
    kind = competitor.kinds.get(name)
    if kind is None:
        raise ValueError(f"{name}: expected a setting of {competitor.kind} sampling")
    return checked(name, read_value(value, kind), kind)
