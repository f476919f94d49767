"""Sweeps: flights at several values of one setting, paired by seed with the flights at the first.

Only one setting differs from the others' flights at a time. The flights of a value that is the
setting's default are those of the variant as it is, so that several sweeps share them.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any, NamedTuple

from rich.console import RenderableType
from rich.markup import escape
from rich.padding import Padding

from quadsim.campaign.document import INDENT, Table, as_html, as_markdown, as_table
from quadsim.campaign.flights.attempts import Attempt, attempts_of
from quadsim.campaign.flights.compare import NAME_LENGTH, identity, section_of
from quadsim.campaign.flights.sweep_curves import Curve, SweepPoint
from quadsim.campaign.flights.sweep_tables import sweep_notes, sweep_table
from quadsim.campaign.flights.swept_settings import SweptSetting, swept_settings, swept_variant
from quadsim.campaign.run.runner import Runner
from quadsim.campaign.run.store import Row
from quadsim.campaign.run.variants import Variant, named_variants, told_apart
from quadsim.config.setting_texts import Place, Settings
from quadsim.console import as_text
from quadsim.course import Course
from quadsim.figures import html
from quadsim.figures.style import save_figure, write_figure
from quadsim.files.extras import imported
from quadsim.files.json_values import without_nan
from quadsim.record.run import RunError
from quadsim.record.whole_files import write_whole

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from pandas import DataFrame


@dataclass(frozen=True)
class Sweep:
    """A sweep holds the flights at each value of a setting, and their differences.

    `print` shows it as tables, a notebook also its figure.

    Examples:
        >>> import quadsim
        >>> small = {"attempts": 2, "laps": 1, "samples": 256}
        >>> swept = quadsim.sweep("figure8", {"link_latency": [0, 0.04]}, "colored", **small)
        >>> first, late = swept.points
        >>> late.change.lap_difference.n  # seeds that finish at both
        2
    """

    curves: list[Curve]
    _folder: TemporaryDirectory | None = None  # holds the telemetry where no campaign keeps it

    @property
    def points(self) -> list[SweepPoint]:
        """Return the numbers of each variant at each value, by course, setting and variant."""
        return [point for curve in self.curves for point in curve.points]

    @property
    def attempts(self) -> list[Attempt]:
        """Return the flights of all points; one that belongs to several is there several times."""
        return [attempt for curve in self.curves for attempt in attempts_of(curve.section)]

    def to_pandas(self) -> DataFrame:
        """Return the flights as a DataFrame, one row each.

        The columns are the setting, its value, and those of an Attempt.

        Raises:
            ModuleNotFoundError: pandas is not installed; the message says what to do.
        """
        pandas = imported("pandas", "pandas", "pandas")
        rows = []
        for curve in self.curves:
            for attempt in attempts_of(curve.section):
                place = {"setting": curve.swept.name, "value": attempt.variant}
                rows.append({**place, **asdict(attempt), "variant": curve.variant})
        columns = ["setting", "value", *Attempt.__dataclass_fields__]
        return pandas.DataFrame(rows, columns=columns)

    def as_json(self) -> dict[str, list[dict[str, Any]]]:
        """Return the numbers of all points as plain dictionaries; None for unknown numbers."""
        return without_nan({"points": [asdict(point) for point in self.points]})

    def plot(self, path: str | Path | None = None) -> Figure:
        """Draw success and lap differences over the values of each setting.

        Args:
            path: a file to write: .png, .svg or .pdf; None writes nothing.
        """
        from quadsim.campaign.flights.sweep_figure import draw_sweep  # here: it loads matplotlib

        figure = draw_sweep(self.curves)
        if path is not None:
            save_figure(figure, Path(path))
        return figure

    def renderables(self) -> list[RenderableType]:
        """Return the tables and lines that show the sweep in a terminal."""
        parts: list[RenderableType] = []
        for group in self._groups():
            notes = [f"  [dim]{escape(note)}[/]" for note in group.notes]
            head = (
                f"[bold]{escape(group.course)}: {escape(group.title)}[/]  {escape(group.setting)}"
            )
            table = Padding(as_table(group.table), (1, 0, 0, INDENT), expand=False)
            parts += [head, table, "", *notes, ""]
        return parts

    def markdown(self, picture: str) -> str:
        """Return the report, with a link to the file of its picture."""
        parts = []
        for group in self._groups():
            setting = f"{group.setting[0].upper()}{group.setting[1:]}."
            parts += [f"## {group.course}: {group.title}", setting, as_markdown(group.table)]
            parts.append("\n".join(f"* {note}" for note in group.notes))
        return "\n\n".join([*parts, f"![]({picture})"]) + "\n"

    def _groups(self) -> Iterator[_Group]:
        """Yield what is shown of each setting on each course."""
        by_setting: dict[tuple[str, str], list[Curve]] = {}
        for curve in self.curves:
            place = (curve.section.course.name, curve.swept.name)
            by_setting.setdefault(place, []).append(curve)
        for (course, _), curves in by_setting.items():
            points = [point for curve in curves for point in curve.points]
            sections = [curve.section for curve in curves]
            yield _Group(
                course=course,
                title=curves[0].swept.title,
                setting=sections[0].setting,
                table=sweep_table(curves[0].swept.title, points),
                notes=list(sweep_notes(points, sections)),
            )

    def __repr__(self) -> str:
        """Return one line: courses, settings, variants and the number of points."""
        courses = ", ".join(dict.fromkeys(curve.section.course.name for curve in self.curves))
        settings = ", ".join(dict.fromkeys(curve.swept.name for curve in self.curves))
        variants = ", ".join(dict.fromkeys(curve.variant for curve in self.curves))
        return f"<Sweep {courses}: {settings}; {variants}; {len(self.points)} points>"

    def _repr_html_(self) -> str:
        """Return what a notebook shows: the tables, their remarks, and the figure."""
        parts = []
        for group in self._groups():
            parts += [f"<h4>{html.text(f'{group.course}: {group.title}')}</h4>"]
            parts += [html.paragraph(group.setting), as_html(group.table)]
            parts += map(html.paragraph, group.notes)
        if self.curves:
            parts.append(html.image(self.plot(), "Success and laps over the values of settings."))
        return html.block(*parts)

    def __str__(self) -> str:
        return as_text(*self.renderables())


class _Group(NamedTuple):
    """The table and notes of one setting on one course."""

    course: str
    title: str
    setting: str  # the conditions of the flights
    table: Table
    notes: list[str]


class PlannedCurve(NamedTuple):
    """One variant at all values of one setting, before it flies."""

    swept: SweptSetting
    variant: str
    at_values: list[Variant]


def plan_sweep(
    courses: Sequence[Place],
    over: Mapping[str, Sequence[Any]],
    variants: Mapping[str, Settings],
    settings: Settings,
) -> list[PlannedCurve]:
    """Return the curves of a sweep, course by course and setting by setting.

    Args:
        courses: names, files or courses.
        over: the values of each setting, see `swept_settings`.
        variants: the settings of each variant by name.
        settings: settings of all variants.

    Raises:
        SettingError: a setting is invalid.
        FileError: a file cannot be read.
        ValueError: course, laps and vehicle do not fit together.
    """
    planned = []
    for course in courses:
        for swept in swept_settings(over):
            for name, own in variants.items():
                made = [
                    swept_variant(course, name, own, settings, swept, value)
                    for value in swept.values
                ]
                planned.append(PlannedCurve(swept, name, made))
    # Own parts of all flights are told apart together.
    everything = iter(told_apart([each for curve in planned for each in curve.at_values]))
    return [
        curve._replace(at_values=[next(everything) for _ in curve.at_values]) for curve in planned
    ]


def fly_sweep(
    planned: Sequence[PlannedCurve],
    attempts: int,
    runner: Runner,
    home: Path,
    folder: TemporaryDirectory | None = None,
) -> Sweep:
    """Fly what a campaign lacks, and return the sweep.

    Args:
        planned: the curves.
        attempts: flights at each value.
        runner: flies them.
        home: the folder to which the paths of the telemetry are relative.
        folder: temporary folder of the telemetry, kept as long as the sweep exists.

    Raises:
        RunError: no attempt was flown; or see Runner.
    """
    rows = iter(runner([each for curve in planned for each in curve.at_values], attempts))
    curves = []
    for curve in planned:
        flown: list[tuple[Variant, Sequence[Row]]] = []
        for variant, value in zip(curve.at_values, curve.swept.values, strict=True):
            of_value = next(rows)
            if of_value:
                flown.append((replace(variant, name=value.label), of_value))
        if flown:
            section = section_of(flown, home, curve.swept.values[0].label)
            curves.append(Curve(curve.swept, curve.variant, section))
    if not curves:
        raise RunError("no attempt was flown: nothing to show")
    return Sweep(curves, folder)


def sweep(
    courses: Place | Sequence[Place],
    over: Mapping[str, Sequence[Any]],
    variants: Mapping[str, Settings | str] | Sequence[str] | str,
    attempts: int,
    jobs: int | None,
    campaign: str | Path | None,
    settings: Settings,
) -> Sweep:
    """Sweep settings; `quadsim.sweep` describes the arguments."""
    several = [courses] if isinstance(courses, str | Path | Course) else list(courses)
    planned = plan_sweep(several, over, named_variants(variants), settings)
    folder = None if campaign else TemporaryDirectory(prefix="quadsim-")
    path = Path(folder.name) / "campaign.sqlite" if folder else Path(campaign or "")
    with Runner(path, jobs or 0, temporary=folder is not None) as runner:
        return fly_sweep(planned, attempts, runner, path.parent, folder)


def write_sweep_report(
    sweep: Sweep, planned: Sequence[PlannedCurve], attempts: int, folder: Path
) -> list[Path]:
    """Write a sweep as Markdown, PNG and SVG, named after courses, settings and variants.

    Args:
        sweep: the sweep.
        planned: what was to be flown, which ends the files' names.
        attempts: flights at each value.
        folder: folder for the files.

    Raises:
        RunError: the folder cannot be written.
    """
    courses = dict.fromkeys(curve.section.course.name for curve in sweep.curves)
    settings = dict.fromkeys(curve.swept.name for curve in sweep.curves)
    variants = dict.fromkeys(curve.variant for curve in sweep.curves)
    names = re.sub("[/=:+]", "-", "_".join([*courses, *settings, *variants])[:NAME_LENGTH])
    digits = identity([each for curve in planned for each in curve.at_values], attempts)
    stem = f"sweep_{names}_{digits}"
    figures = write_figure(sweep.plot(), folder, stem)
    text = folder / f"{stem}.md"
    write_whole(text, sweep.markdown(figures[0].name).encode())
    return [text, *figures]
