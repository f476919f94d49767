"""Comparisons of settings of heats: the same line-up from the same starts under each setting."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import nullcontext
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

from quadsim.campaign.document import Block, Document, Documented, Heading, Note, Picture, file_stem
from quadsim.campaign.heats.paired import (
    FlownHeats,
    HeatsDifference,
    HeatVariant,
    difference,
    fly_variants,
    heat_variants,
)
from quadsim.campaign.heats.runner import HeatRunner
from quadsim.campaign.heats.stats import plain_fields, summary_as_json
from quadsim.campaign.heats.store import key_of
from quadsim.campaign.heats.tables import differences_table, settings_table, summary_blocks
from quadsim.campaign.run.commits import mixed_commits
from quadsim.campaign.run.seeds import seeds_remark
from quadsim.config.setting_texts import Place, Settings
from quadsim.heat.line_up import Entrants, parse_heat_variants
from quadsim.record.run import RunError
from quadsim.report.given_state import conditions

if TYPE_CHECKING:
    from matplotlib.figure import Figure

ID_DIGITS = 6  # hex digits that tell reports with other flags apart


@dataclass(frozen=True)
class HeatComparison(Documented):
    """Many heats of one line-up under several settings; `print` shows it as tables.

    The figure has finished flights, contacts, overtakes and times of each setting.

    Attributes:
        course: the name of the course.
        settings: the heats of each setting; `.summary` of one has its numbers.
        differences: differences of each other setting from the first.

    Examples:
        >>> import quadsim
        >>> pair = ["colored", "gaussian"]
        >>> small = {"laps": 1, "samples": 256, "timeout": 1.0}
        >>> found = quadsim.compare_heats(pair, "figure8", starts=2, **small)
        >>> [setting.summary.races for setting in found.settings]
        [2]
    """

    course: str
    settings: list[FlownHeats]
    differences: list[HeatsDifference]
    remark: str = ""  # on what the seeds draw
    # the links of the entrants, and which states their controllers were given
    conditions: tuple[str, ...] = ()

    def __getitem__(self, name: str) -> FlownHeats:
        """Return the heats of a setting. Raises KeyError."""
        return {setting.name: setting for setting in self.settings}[name]

    def __repr__(self) -> str:
        """Return one line: course, settings and number of heats."""
        names = ", ".join(setting.name for setting in self.settings)
        heats = sum(setting.summary.races for setting in self.settings)
        return f"<HeatComparison {self.course}: {names}, {heats} heats>"

    def document(self) -> Document:
        """Return the tables and remarks of all settings, and a placeholder for the figure."""
        blocks: list[Block] = [Heading(self.course, self._races())]
        if self.differences:
            blocks += [settings_table(self.settings), differences_table(self.differences)]
        for setting in self.settings:
            blocks += [
                Heading(setting.name, setting.setting, level=2),
                *summary_blocks(setting.summary),
            ]
        blocks += map(Note, self.notes())
        described = "Finished flights, contacts, overtakes and times under each setting."
        return Document((*blocks, Picture(described)))

    def _races(self) -> str:
        """Return the number of races of the only setting, or of each setting, as text."""
        number = len(self.settings[0].results)
        races = f"{number} race" + "s" * (number != 1)
        return races if len(self.settings) == 1 else f"{races} of each setting"

    def notes(self) -> list[str]:
        """Return the remarks on the tables: conditions, seeds and commits."""
        commits = mixed_commits({setting.name: setting.commits for setting in self.settings})
        return [*self.conditions, *([self.remark] if self.remark else []), *commits]

    def as_json(self) -> dict[str, Any]:
        """Return the numbers as plain dictionaries; a number that is not known is None."""
        return {
            "settings": {one.name: summary_as_json(one.summary) for one in self.settings},
            "differences": [plain_fields(one) for one in self.differences],
        }

    def _drawn(self) -> Figure:
        """Draw finished flights, contacts, overtakes and times of each setting."""
        # Imported here, as it loads matplotlib
        from quadsim.campaign.heats.figure import draw_heats

        names = ", ".join(self.settings[0].entrants)
        return draw_heats(self.settings, f"{self.course}: {names}; {self._races()}")


def fly_comparison(variants: Sequence[HeatVariant], runner: HeatRunner) -> HeatComparison:
    """Fly what a campaign lacks, and return the comparison.

    Raises:
        RunError: no heat of a setting was flown; or see HeatRunner.
    """
    flown = fly_variants(variants, runner)
    for setting in flown:
        if not any(setting.results):
            raise RunError(f"{setting.name}: no race was flown")
    first, *others = flown
    course = variants[0].heats[0].course.name
    specs = [entrant.spec for variant in variants for entrant in variant.heats[0].entrants]
    rotated = len({heat.rotation for variant in variants for heat in variant.heats}) > 1
    differences = [difference(first, other) for other in others]
    remark = seeds_remark(specs, rotated)
    return HeatComparison(course, flown, differences, remark, _conditions(variants))


def heats_stem(found: HeatComparison, variants: Sequence[HeatVariant]) -> str:
    """Return the name of a comparison's files without its ending: course, settings, hex digits.

    Args:
        found: the comparison.
        variants: the planned races.
    """
    keys = [key_of(heat) for variant in variants for heat in variant.heats]
    digits = sha256("".join(keys).encode()).hexdigest()[:ID_DIGITS]
    return file_stem([found.course, *(one.name for one in found.settings)], digits)


def _conditions(variants: Sequence[HeatVariant]) -> tuple[str, ...]:
    """Return the conditions of all settings, each with the name of its setting if they differ."""
    of_settings = {}
    for variant in variants:
        entrants = variant.heats[0].entrants
        of_settings[variant.name] = conditions({e.name: e.spec.record() for e in entrants})
    if len(set(map(tuple, of_settings.values()))) < 2:
        return tuple(next(iter(of_settings.values())))
    return tuple(f"{name}: {line}" for name, lines in of_settings.items() for line in lines)


def compare_heats(
    entrants: Entrants,
    course: Place | None,
    variants: Mapping[str, Settings] | str | None,
    starts: int,
    rotate: bool,
    jobs: int | None,
    campaign: str | Path | None,
    settings: Settings,
) -> HeatComparison:
    """Compare settings of heats; `quadsim.compare_heats` describes the arguments."""
    if isinstance(variants, str):
        variants = parse_heat_variants(variants)
    made = heat_variants(course, entrants, variants or {"race": {}}, settings, starts, rotate)
    folder = nullcontext(campaign) if campaign else TemporaryDirectory(prefix="quadsim-")
    with folder as place:
        path = Path(campaign) if campaign else Path(str(place)) / "heats.sqlite"
        with HeatRunner(path, jobs or 0, temporary=not campaign) as runner:
            return fly_comparison(made, runner)
