"""LineUp: what the next START flies, in words: names, changed numbers, differences, a problem."""

from __future__ import annotations

from dataclasses import dataclass

from quadsim.sensing import PERFECT
from quadsim.web.state.choices import Choices, CompetitorChoices, HeatChoices, names_of, specs_of
from quadsim.web.state.differences import compared, distinct_names
from quadsim.web.state.numbers import SLIDERS, numbers_of
from quadsim.web.state.page_state import PageState
from quadsim.web.state.setting_texts import HAVE_SLIDERS, shown_value


@dataclass(frozen=True)
class LineUp:
    """The competitors that the next START will fly.

    Attributes:
        names: name of each competitor, as it is called in flight.
        what: what each competitor flies, such as ("race", "swift").
        changes: the numbers of each competitor that differ from its preset, as they are flown.
        compared: one sentence with the differences between competitors; empty for a single one.
        problem: the reason why START cannot fly them, in one line; empty: it can.
    """

    names: tuple[str, ...]
    what: tuple[tuple[str, ...], ...]
    changes: tuple[tuple[str, ...], ...]
    compared: str
    problem: str


def line_up_of(state: PageState) -> LineUp:
    """Return in words what START flies."""
    problem = ""
    names = names_of(state.flights)
    differ = ""
    try:
        specs = specs_of(state.flights)
        for one in state.start:
            if isinstance(one, HeatChoices):
                one.spec()
        records = [spec.record() for spec in specs]
        differ = compared(records)
        # Entrants of a race in one world keep their names in its record.
        names = names if state.is_together else distinct_names(records)
    except ValueError as error:
        problem = str(error)
    competitors = [row.choices for row in state.rows]
    return LineUp(
        names=tuple(names),
        what=tuple(map(_what, competitors)),
        changes=tuple(map(changes_of, state.flights)),
        compared=differ,
        problem=problem,
    )


def changes_of(flight: Choices) -> tuple[str, ...]:
    """Return the numbers that differ from the preset as they are flown, such as "samples 512".

    A number that is flown otherwise than it was asked for is named with both.
    """
    if not flight.has_planner:
        return ()
    idle = flight.idle_settings
    found = [
        f"{name} {shown_value(value)}"
        for name, value in flight.settings.items()
        if name not in idle and name not in HAVE_SLIDERS
    ]
    of_preset, base, chosen = flight.planners()
    flown = numbers_of(chosen, base)
    usual = numbers_of(of_preset, of_preset)
    for name, slider in SLIDERS.items():
        if slider.setting in idle:
            continue
        asked = flight.numbers.get(name, flown[name])
        is_typed = slider.setting in flight.settings and slider.setting not in HAVE_SLIDERS
        if flown[name] == usual[name] and asked == flown[name]:
            continue
        if is_typed and name not in flight.numbers:
            continue  # named above, as it was typed
        but = f" (asked for {asked:g})" if asked != flown[name] else ""
        found.append(f"{slider.label.lower()} {flown[name]:g}{but}")
    return tuple(change.replace("_", " ") for change in found)


def _what(competitor: CompetitorChoices) -> tuple[str, ...]:
    """Return what a competitor flies; usual parts are left out."""
    flies = competitor.preset if competitor.has_planner else competitor.sampler
    parts = [flies, competitor.vehicle]
    if competitor.flight_controller != "ideal":
        parts.append(competitor.flight_controller)
    if competitor.sensing != PERFECT:
        parts.append(competitor.sensing)
    return tuple(parts)
