"""The results of a sweep: curves, and their points."""

from __future__ import annotations

from dataclasses import dataclass

from quadsim.campaign.flights.stats import PairStats, Section, VariantStats
from quadsim.campaign.flights.swept_settings import SweptSetting


@dataclass(frozen=True)
class SweepPoint:
    """The flights of one variant at one value of a setting.

    Examples:
        >>> import quadsim
        >>> small = {"attempts": 2, "laps": 1, "samples": 256}
        >>> swept = quadsim.sweep("figure8", {"link_latency": [0, 0.04]}, "colored", **small)
        >>> [(point.value, point.stats.finished) for point in swept.points]
        [('0', 2), ('0.04', 2)]
    """

    course: str
    setting: str
    value: str
    variant: str
    stats: VariantStats
    change: PairStats | None  # from the first value to this; None at the first


@dataclass(frozen=True)
class Curve:
    """One variant at all values of one setting on one course."""

    swept: SweptSetting
    variant: str
    section: Section  # its variants are the values; the first is the baseline
    remarks: tuple[str, ...] = ()  # on what the values mean

    @property
    def points(self) -> list[SweepPoint]:
        """Return the points in the order of the values."""
        changes = {pair.b: pair for pair in self.section.pairs}
        return [
            SweepPoint(
                course=stats.course,
                setting=self.swept.name,
                value=stats.name,
                variant=self.variant,
                stats=stats,
                change=changes.get(stats.name),
            )
            for stats in self.section.variants
        ]
