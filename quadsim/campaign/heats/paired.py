"""The same races under several settings: every setting is flown from the same starts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

from quadsim.campaign.heats.runner import HeatRunner
from quadsim.campaign.heats.stats import HeatsSummary, summary
from quadsim.config.setting_texts import Place, Settings
from quadsim.console import complain
from quadsim.heat.line_up import Entrants, heats_of, line_up
from quadsim.heat.spec import HeatSpec
from quadsim.record.run import RunError
from quadsim.record.schema import StoredResult
from quadsim.statistics import Mean, clustered_mean, mcnemar, mean_interval


class HeatVariant(NamedTuple):
    """Many races of a line-up under one setting."""

    name: str
    heats: list[HeatSpec]


@dataclass(frozen=True)
class FlownHeats:
    """The races of a variant; a race that was lost with its worker is None."""

    name: str
    # names of the entrants
    entrants: Sequence[str]
    # number of gates of the course
    gates: int
    results: list[StoredResult | None]
    # commits that flew the races
    commits: tuple[str, ...] = ()
    # rules and prediction, for the heading
    setting: str = ""

    @cached_property
    def summary(self) -> HeatsSummary:
        """The numbers of the races that were flown. Raises RunError if none was."""
        flown = [result for result in self.results if result is not None]
        if not flown:
            raise RunError(f"{self.name}: no race was flown")
        return summary(self.entrants, flown, self.gates)


class HeatsDifference(NamedTuple):
    """The numbers compare two settings, by races from the same starts."""

    a: str
    b: str
    races: int
    # numbers of a race under b less the numbers under a
    contacts: Mean
    finished: Mean
    overtakes: Mean
    # time under b less time under a, of the flights that finished under both; by race [s]
    time: Mean
    # races with a contact under one setting alone, and the p-value that both are as likely
    contact_a_only: int
    contact_b_only: int
    p_contact: float


def heat_variants(
    course: Place | None,
    entrants: Entrants,
    variants: Mapping[str, Settings],
    shared: Settings,
    starts: int,
    rotate: bool = True,
) -> list[HeatVariant]:
    """Return the races of a line-up under each of several settings.

    Args:
        course: a name, a FILE.yaml or a Course; None: the default course.
        entrants: the line-up, as `line_up` reads it.
        variants: settings of the race and of all its flights, by name.
        shared: settings of all variants.
        starts: number of races of each variant.
        rotate: whether places rotate, see `heats_of`.

    Raises:
        SettingError: a setting or an entrant is invalid.
        FileError: a file cannot be read.
    """
    made = []
    for name, own in variants.items():
        settings: dict[str, Any] = {**shared, **own}
        flown, of_heat = line_up(course, entrants, settings)
        seed = flown[0].spec.seed if flown else 0
        made.append(HeatVariant(name, heats_of(flown, of_heat, seed, starts, rotate)))
    return made


def fly_variants(variants: Sequence[HeatVariant], runner: HeatRunner) -> list[FlownHeats]:
    """Fly the races that a campaign lacks, one setting after the other.

    Args:
        variants: the races.
        runner: flies what the campaign lacks.

    Raises:
        RunError, SettingError, KeyboardInterrupt: see HeatRunner.
    """
    flown = []
    for variant in variants:
        if len(variants) > 1:
            complain(f"{variant.name}:")
        rows = runner(variant.heats)
        first = variant.heats[0]
        of_race = first.settings
        flown.append(
            FlownHeats(
                name=variant.name,
                entrants=first.names,
                gates=len(first.course.gates),
                results=[row.result if row else None for row in rows],
                commits=tuple(sorted({row.code for row in rows if row})),
                setting=f"rules {of_race.rules}, expect {of_race.expect}",
            )
        )
    return flown


def difference(a: FlownHeats, b: FlownHeats) -> HeatsDifference:
    """Return the differences of setting b from setting a, race by race from the same start."""
    both = [
        (of_a, of_b)
        for of_a, of_b in zip(a.results, b.results, strict=True)
        if of_a is not None and of_b is not None
    ]
    contacts = [(_events(of_a, "contact"), _events(of_b, "contact")) for of_a, of_b in both]
    overtakes = [_events(of_b, "overtake") - _events(of_a, "overtake") for of_a, of_b in both]
    finished = [len(_times(of_b)) - len(_times(of_a)) for of_a, of_b in both]
    a_only = sum(of_a > 0 == of_b for of_a, of_b in contacts)
    b_only = sum(of_b > 0 == of_a for of_a, of_b in contacts)
    return HeatsDifference(
        a=a.name,
        b=b.name,
        races=len(both),
        contacts=mean_interval([float(of_b - of_a) for of_a, of_b in contacts]),
        finished=mean_interval([float(more) for more in finished]),
        overtakes=mean_interval([float(more) for more in overtakes]),
        time=clustered_mean([_later(*pair) for pair in both]),
        contact_a_only=a_only,
        contact_b_only=b_only,
        p_contact=mcnemar(a_only, b_only),
    )


def _events(result: StoredResult, kind: str) -> int:
    """Return the number of events of a kind."""
    return sum(event.kind == kind for event in result.events)


def _times(result: StoredResult) -> dict[str, float]:
    """Return the race time of each entrant that finished [s]."""
    return {placing.name: placing.time for placing in result.order if placing.time is not None}


def _later(a: StoredResult, b: StoredResult) -> list[float]:
    """Return by how much later [s] each entrant finished in b, if it finished in both races."""
    of_a = _times(a)
    of_b = _times(b)
    return [of_b[name] - of_a[name] for name in of_a if name in of_b]
