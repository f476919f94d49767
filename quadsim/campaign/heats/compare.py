"""Comparisons of settings of heats: the same line-up from the same starts under each setting."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import nullcontext
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

from rich.console import RenderableType
from rich.markup import escape

from quadsim.campaign.document import Table, as_html, as_markdown, as_table
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
from quadsim.campaign.heats.tables import (
    differences_table,
    entrants_table,
    lines_of,
    overtakers_table,
    settings_table,
    tables_of,
    win_matrix,
)
from quadsim.campaign.run.commits import mixed_commits
from quadsim.campaign.run.seeds import seeds_remark
from quadsim.config.setting_texts import Place, Settings
from quadsim.console import as_text
from quadsim.figures import html
from quadsim.figures.style import save_figure
from quadsim.heat.line_up import Entrants, parse_heat_variants
from quadsim.record.run import RunError
from quadsim.report.given_state import conditions

if TYPE_CHECKING:
    from matplotlib.figure import Figure

COLUMNS = 100  # of the text


@dataclass(frozen=True)
class HeatComparison:
    """Many heats of one line-up under several settings; `print` shows it as tables.

    Attributes:
        course: the name of the course.
        settings: the heats of each setting; `.summary` of one has its numbers.
        differences: what changes from the first setting to each other one.

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
    remark: str = ""  # what the seeds do not draw
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

    def renderables(self) -> list[RenderableType]:
        """Return the tables and lines that show the comparison in a terminal."""
        races = len(self.settings[0].results)
        parts: list[RenderableType] = [
            f"[bold]{escape(self.course)}[/]  {races_of(races, len(self.settings))}"
        ]
        for table in self._side_by_side():
            parts += ["", as_table(table)]
        for setting in self.settings:
            parts += [
                "",
                f"[bold]{escape(setting.name)}[/]  {setting.setting}",
                *tables_of(setting.summary),
            ]
        return [*parts, *(f"  [dim]{escape(note)}[/]" for note in self.notes())]

    def notes(self) -> list[str]:
        """Return what has to be read with the tables."""
        commits = mixed_commits({setting.name: setting.commits for setting in self.settings})
        return [*self.conditions, *([self.remark] if self.remark else []), *commits]

    def markdown(self, title: str, picture: str) -> str:
        """Return the report, with a link to the file of its picture."""
        parts = [f"## {title}", *map(as_markdown, self._side_by_side())]
        for setting in self.settings:
            found = setting.summary
            parts += [f"### {setting.name}", *map(as_markdown, _of_setting(setting))]
            parts.append("\n".join(f"* {line}" for line in lines_of(found)))
        parts += [f"* {note}" for note in self.notes()]
        return "\n\n".join([*parts, f"![]({picture})"]) + "\n"

    def _side_by_side(self) -> list[Table]:
        """Return the tables of several settings, none for a single one."""
        if not self.differences:
            return []
        return [settings_table(self.settings), differences_table(self.differences)]

    def _repr_html_(self) -> str:
        """Return what a notebook shows: tables, remarks, and the figure."""
        parts = [f"<h4>{html.text(self.course)}</h4>", *map(as_html, self._side_by_side())]
        for setting in self.settings:
            parts += [html.paragraph(setting.name), *map(as_html, _of_setting(setting))]
            parts += map(html.paragraph, lines_of(setting.summary))
        parts += map(html.paragraph, self.notes())
        described = "Finished flights, contacts, overtakes and times under each setting."
        return html.block(*parts, html.image(self.plot(), described))

    def __str__(self) -> str:
        return as_text(*self.renderables(), columns=COLUMNS)

    def as_json(self) -> dict[str, Any]:
        """Return the numbers as plain_fields dictionaries; a number that is not known is None."""
        return {
            "settings": {one.name: summary_as_json(one.summary) for one in self.settings},
            "differences": [plain_fields(one) for one in self.differences],
        }

    def plot(self, path: str | Path | None = None) -> Figure:
        """Draw finished flights, contacts, overtakes and times of each setting.

        Args:
            path: a file to write: .png, .svg or .pdf; None writes nothing.
        """
        # Imported here, as it loads matplotlib
        from quadsim.campaign.heats.figure import draw_heats, title_of

        figure = draw_heats(self.settings, title_of(self.course, self.settings[0].summary))
        if path is not None:
            save_figure(figure, Path(path))
        return figure


def races_of(races: int, settings: int) -> str:
    """Return how many races there are, of a single setting or of each of several."""
    return f"{races} races" if settings == 1 else f"{races} races of each setting"


def _of_setting(setting: FlownHeats) -> list[Table]:
    """Return the tables of one setting."""
    found = setting.summary
    tables = [entrants_table(found), win_matrix(found)]
    return [*tables, overtakers_table(found)] if found.overtakers else tables


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
