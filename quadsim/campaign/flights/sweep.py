"""Sweeps: flights at several values of one setting, paired by seed with the flights at the first.

One setting at a time differs from the variant's own settings. Flights at a value that is the
setting's default are the variant's own flights, which several sweeps share.
"""

from __future__ import annotations

import csv
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from io import StringIO
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any, NamedTuple

from quadsim.campaign.document import Block, Document, Documented, Heading, Note, Picture, file_stem
from quadsim.campaign.flights.attempts import Attempt, attempts_of
from quadsim.campaign.flights.compare import identity, section_of
from quadsim.campaign.flights.sweep_curves import Curve, SweepPoint
from quadsim.campaign.flights.sweep_tables import sweep_notes, sweep_table
from quadsim.campaign.flights.swept_settings import (
    SweptSetting,
    remarks_on_gamma,
    swept_settings,
    swept_variant,
)
from quadsim.campaign.run.runner import Runner
from quadsim.campaign.run.store import AttemptRow
from quadsim.campaign.run.variants import Variant, named_variants, told_apart
from quadsim.config.setting_texts import Place, Settings
from quadsim.course import Course
from quadsim.files.extras import imported
from quadsim.files.json_values import without_nan
from quadsim.record.run import RunError
from quadsim.record.whole_files import write_whole

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from pandas import DataFrame


@dataclass(frozen=True)
class Sweep(Documented):
    """A sweep holds the flights at each value of a setting, and their differences.

    `print` shows it as tables, a notebook also its figure: success and lap differences over the
    values of each setting.

    Examples:
        >>> import quadsim
        >>> small = {"attempts": 1, "laps": 1, "samples": 256}
        >>> swept = quadsim.sweep("figure8", {"link_latency": [0, 0.04]}, "colored", **small)
        >>> first, late = swept.points
        >>> late.change.lap_difference.n  # seeds that finish at both
        1
    """

    curves: list[Curve]
    _folder: TemporaryDirectory | None = None  # holds the telemetry if no campaign keeps it

    @property
    def points(self) -> list[SweepPoint]:
        """Return the numbers of each variant at each value, by course, setting and variant."""
        return [point for curve in self.curves for point in curve.points]

    @property
    def attempts(self) -> list[Attempt]:
        """Return the flights of all points; a flight of several points is listed at each."""
        return [attempt for curve in self.curves for attempt in attempts_of(curve.section)]

    def to_pandas(self) -> DataFrame:
        """Return the flights as a DataFrame, one row each.

        The columns are the setting, its value, and the fields of an Attempt.

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

    def save(self, folder: Path, stem: str) -> list[Path]:
        """Write the result as Markdown, JSON, PNG, SVG and CSV, and return the files.

        The CSV file has a row for each variant at each value, with the names of `points`, such as
        stats.lap_mean and change.lap_difference.mean.

        Args:
            folder: folder for the files.
            stem: name of the files without its ending.

        Raises:
            RunError: the folder cannot be written.
        """
        table = folder / f"{stem}.csv"
        files = super().save(folder, stem)
        write_whole(table, _csv(self.points).encode())
        return [*files, table]

    def _drawn(self) -> Figure:
        """Draw success and lap differences over the values of each setting."""
        from quadsim.campaign.flights.sweep_figure import draw_sweep  # here: it loads matplotlib

        return draw_sweep(self.curves)

    def document(self) -> Document:
        """Return a table of each setting on each course, its remarks, and the figure's place."""
        by_setting: dict[tuple[str, str], list[Curve]] = {}
        for curve in self.curves:
            place = (curve.section.course.name, curve.swept.name)
            by_setting.setdefault(place, []).append(curve)
        blocks = [block for curves in by_setting.values() for block in _blocks(curves)]
        if blocks:
            blocks.append(Picture("Success and laps over the values of settings."))
        return Document(tuple(blocks))

    def __repr__(self) -> str:
        """Return one line: courses, settings, variants and the number of points."""
        courses = ", ".join(dict.fromkeys(curve.section.course.name for curve in self.curves))
        settings = ", ".join(dict.fromkeys(curve.swept.name for curve in self.curves))
        variants = ", ".join(dict.fromkeys(curve.variant for curve in self.curves))
        return f"<Sweep {courses}: {settings}; {variants}; {len(self.points)} points>"


def _csv(points: Sequence[SweepPoint]) -> str:
    """Return the numbers of points as CSV; a number that is not known is empty."""
    rows = [dict(_flat("", asdict(point))) for point in points]
    names = dict.fromkeys(name for row in rows for name in row)
    text = StringIO()
    table = csv.DictWriter(text, list(names), lineterminator="\n")
    table.writeheader()
    table.writerows(without_nan(rows))
    return text.getvalue()


def _flat(name: str, value: Any) -> Iterator[tuple[str, Any]]:
    """Yield the numbers and texts within a value with their names, joined by dots."""
    if isinstance(value, Mapping):
        for key, inner in value.items():
            yield from _flat(f"{name}.{key}" if name else str(key), inner)
    elif isinstance(value, tuple | list) and all(isinstance(one, str) for one in value):
        yield name, " ".join(value)
    elif isinstance(value, tuple | list):
        for number, inner in enumerate(value):
            yield from _flat(f"{name}.{number}", inner)
    elif value is not None:
        yield name, value


def _blocks(curves: Sequence[Curve]) -> list[Block]:
    """Return the table and the remarks of one setting on one course.

    Args:
        curves: a curve of each variant.
    """
    first = curves[0]
    points = [point for curve in curves for point in curve.points]
    sections = [curve.section for curve in curves]
    return [
        Heading(f"{first.section.course.name}: {first.swept.title}", first.section.setting),
        sweep_table(first.swept.title, points),
        *map(Note, dict.fromkeys(remark for curve in curves for remark in curve.remarks)),
        *map(Note, sweep_notes(points, sections)),
    ]


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
        flown: list[tuple[Variant, Sequence[AttemptRow]]] = []
        for variant, value in zip(curve.at_values, curve.swept.values, strict=True):
            of_value = next(rows)
            if of_value:
                flown.append((replace(variant, name=value.label), of_value))
        if flown:
            section = section_of(flown, home, curve.swept.values[0].label)
            remarks = tuple(remarks_on_gamma(curve.swept, [each for each, _ in flown]))
            curves.append(Curve(curve.swept, curve.variant, section, remarks))
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


def sweep_stem(found: Sweep, planned: Sequence[PlannedCurve], attempts: int) -> str:
    """Return the name of a sweep's files without its ending: courses, settings and variants.

    Args:
        found: the sweep.
        planned: the planned curves, from which the last part of the name is made.
        attempts: flights at each value.
    """
    courses = dict.fromkeys(curve.section.course.name for curve in found.curves)
    settings = dict.fromkeys(curve.swept.name for curve in found.curves)
    variants = dict.fromkeys(curve.variant for curve in found.curves)
    digits = identity([each for curve in planned for each in curve.at_values], attempts)
    return file_stem(["sweep", *courses, *settings, *variants], digits)
