"""The table of a sweep: a row for each variant at each value of a setting."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from math import isfinite

from quadsim.campaign.document import Table
from quadsim.campaign.flights.stats import FEWEST_PAIRS, CrashRate, PairStats, Section
from quadsim.campaign.flights.sweep_curves import SweepPoint
from quadsim.campaign.flights.tables import (
    notes_of_faults,
    number,
    paired,
    shown_p,
    success_interval,
)
from quadsim.campaign.run.commits import mixed_commits


def sweep_table(title: str, points: Sequence[SweepPoint]) -> Table:
    """Return the table of one setting on one course.

    Args:
        title: head of the column of values.
        points: each variant at each value.
    """
    of_one_variant = len({point.variant for point in points}) == 1

    # One column for both, as a table that is too wide repeats its first column.
    def first(point: SweepPoint) -> str:
        return point.value if of_one_variant else f"{point.value}, {point.variant}"

    return Table.of(points, {title: first, **COLUMNS})


def sweep_notes(points: Sequence[SweepPoint], sections: Sequence[Section]) -> Iterator[str]:
    """Yield the remarks on the table of one setting.

    Args:
        points: each variant at each value.
        sections: the flights of each variant.
    """
    shared = [set(section.conditions) for section in sections]
    yield from sorted(set.intersection(*shared))
    remarks = dict.fromkeys(section.remark for section in sections if section.remark)
    yield from remarks
    yield (
        "Crashes per 100 gates: of the gates that flights came to, the share at which one ended in "
        "a crash, with the 95 % interval of independent gates (Wilson)."
    )
    yield (
        "Changes: from the first value, over the seeds that finish at both, with 95 % intervals. "
        "Only here, only first: seeds that finish at one of both alone. p: corrected for the "
        "number of values (Holm); paired t-test of laps, exact test of finished. Intervals are not "
        "corrected."
    )
    yield "Thrust: total variation of the commanded thrust; its ratio is to the first value's."
    yield from notes_of_faults([point.stats for point in points])
    yield from mixed_commits(
        {f"{point.variant} {point.value}": point.stats.commits for point in points}
    )


def _of_change(cell: Callable[[PairStats], str]) -> Callable[[SweepPoint], str]:
    """Return the cell of a point's change, a dash at the first value."""
    return lambda point: cell(point.change) if point.change else "-"


def _lap_change(pair: PairStats) -> str:
    return paired(pair.lap_difference, "+.3f")


def _thrust_ratio(pair: PairStats) -> str:
    return f"x {paired(pair.thrust_tv_ratio, '.2f')}"


def _lap_p(pair: PairStats) -> str:
    enough = pair.corrected is not None and pair.lap_difference.n >= FEWEST_PAIRS
    return shown_p(pair.corrected.laps) if enough and pair.corrected else "-"


def _success_p(pair: PairStats) -> str:
    return shown_p(pair.corrected.success) if pair.corrected else "-"


def _crash_rate(rate: CrashRate) -> str:
    """Return crashes per 100 gates with their interval, a dash if gates were not counted."""
    if not isfinite(rate.per_100):
        return "-"
    return f"{rate.per_100:.1f} [{rate.low:.1f}, {rate.high:.1f}]"


COLUMNS: dict[str, Callable[[SweepPoint], str]] = {
    "done": lambda point: f"{point.stats.finished}/{point.stats.attempts}",
    "CI\n[%]": lambda point: success_interval(point.stats),
    "crashes per\n100 gates": lambda point: _crash_rate(point.stats.crash_rate),
    "lap\n[s]": lambda point: number(point.stats.lap_mean),
    "change of the lap\n[s]": _of_change(_lap_change),
    "pairs": _of_change(lambda pair: str(pair.lap_difference.n)),
    "p of\nlaps": _of_change(_lap_p),
    "only here :\nonly first": _of_change(lambda pair: f"{pair.only_b} : {pair.only_a}"),
    "p of\nfinished": _of_change(_success_p),
    "thrust\n[m/s^2/s]": lambda point: number(point.stats.thrust_tv, ".1f"),
    "thrust variation\n[ratio]": _of_change(_thrust_ratio),
}
