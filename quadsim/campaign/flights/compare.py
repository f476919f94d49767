"""Comparisons of variants on courses: flights paired by seed, differences with intervals."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from hashlib import sha256
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

from quadsim.campaign.document import Block, Document, Documented, Heading, Note, Picture, file_stem
from quadsim.campaign.flights.attempts import Attempt, attempts_of
from quadsim.campaign.flights.stats import (
    PairStats,
    Section,
    VariantStats,
    against,
    all_pairs,
    best_known_time,
    lap_limit,
    variant_stats,
)
from quadsim.campaign.flights.tables import comparison_tables, notes
from quadsim.campaign.run.runner import Runner
from quadsim.campaign.run.seeds import seeds_remark
from quadsim.campaign.run.store import AttemptRow
from quadsim.campaign.run.variants import Variant, make_variants, named_variants
from quadsim.config.setting_texts import Place, Settings
from quadsim.course import Course
from quadsim.files.extras import imported
from quadsim.files.json_values import without_nan
from quadsim.files.values import SettingError
from quadsim.files.yaml_errors import did_you_mean
from quadsim.physics.randomization_file import OUTDOOR
from quadsim.record.run import RunError, canonical
from quadsim.report.given_state import conditions
from quadsim.report.planner_differences import planner_differences

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from pandas import DataFrame

ID_DIGITS = 6  # hex digits that identify a comparison in the names of its files


@dataclass(frozen=True)
class Comparison(Documented):
    """The result of comparing variants; `print` shows it as tables, a notebook also its figure.

    The figure has laps, success, chatter and paths of each course.

    Examples:
        >>> import quadsim
        >>> variants = {"gaussian": {"sampler": "gaussian"}, "colored": {}}
        >>> comparison = quadsim.compare("figure8", variants, attempts=2, laps=1, samples=256)
        >>> (pair,) = comparison.pairs
        >>> pair.thrust_tv_ratio.mean < 1  # colored sampling changes the thrust less
        True
    """

    sections: list[Section]  # one for each course
    _folder: TemporaryDirectory | None = None  # holds the telemetry if no campaign keeps it

    @property
    def variants(self) -> list[VariantStats]:
        """Return the numbers of each variant on each course."""
        return [variant for section in self.sections for variant in section.variants]

    @property
    def pairs(self) -> list[PairStats]:
        """Return the differences with intervals: of each two variants, or from the baseline."""
        return [pair for section in self.sections for pair in section.pairs]

    @property
    def attempts(self) -> list[Attempt]:
        """Return every flight, by course, variant and seed."""
        return [attempt for section in self.sections for attempt in attempts_of(section)]

    def to_pandas(self) -> DataFrame:
        """Return the flights as a DataFrame, one row each with the fields of an Attempt as columns.

        Raises:
            ModuleNotFoundError: pandas is not installed; the message says what to do.
        """
        pandas = imported("pandas", "pandas", "pandas")
        columns = list(Attempt.__dataclass_fields__)
        return pandas.DataFrame([asdict(attempt) for attempt in self.attempts], columns=columns)

    def as_json(self) -> dict[str, list[dict[str, Any]]]:
        """Return the numbers of variants and pairs as plain dictionaries.

        A number that is not known is None. The `sd` of a pair's `thrust_tv_ratio` is the
        standard deviation of the logarithms of the ratios.
        """
        numbers = {
            "variants": [asdict(variant) for variant in self.variants],
            "pairs": [asdict(pair) for pair in self.pairs],
        }
        return without_nan(numbers)

    def _drawn(self) -> Figure:
        """Draw laps, success, chatter and paths on one page."""
        from quadsim.campaign.flights.figure import draw  # here: it loads matplotlib

        return draw(self.sections)

    def document(self) -> Document:
        """Return the tables and remarks of all courses, and the place of the figure."""
        blocks = [block for section in self.sections for block in _blocks(section)]
        if blocks:
            described = "Lap times, success and chatter of each variant, and the flown paths."
            blocks.append(Picture(described))
        return Document(tuple(blocks))

    def __repr__(self) -> str:
        """Return one line: courses, variants and the number of flights."""
        courses = ", ".join(section.course.name for section in self.sections)
        variants = ", ".join(dict.fromkeys(variant.name for variant in self.variants))
        return f"<Comparison {courses}: {variants}, {len(self.attempts)} flights>"


def compare(
    courses: Place | Sequence[Place],
    variants: Mapping[str, Settings | str] | Sequence[str] | str,
    attempts: int,
    jobs: int | None,
    campaign: str | Path | None,
    baseline: str | None,
    settings: Settings,
) -> Comparison:
    """Compare variants; `quadsim.compare` describes the arguments."""
    named = named_variants(variants)
    check_baseline(list(named), baseline)
    several = [courses] if isinstance(courses, str | Path | Course) else list(courses)
    made = make_variants(several, named, settings)
    folder = None if campaign else TemporaryDirectory(prefix="quadsim-")
    path = Path(folder.name) / "campaign.sqlite" if folder else Path(campaign or "")
    with Runner(path, jobs or 0, temporary=folder is not None) as runner:
        rows = runner(made, attempts)
    found = comparison(made, rows, path.parent, folder, baseline)
    if not found.sections:
        raise RunError("no attempt was flown: nothing to compare")
    return found


def check_baseline(names: Sequence[str], baseline: str | None) -> None:
    """Check that a baseline is one of several variants.

    Args:
        names: names of the variants.
        baseline: name of the baseline, None for none.

    Raises:
        SettingError: the baseline is not among the variants, or is the only variant.
    """
    if baseline is None:
        return
    if baseline not in names:
        raise SettingError("baseline", f"no variant {baseline!r}, {did_you_mean(baseline, names)}")
    if len(names) < 2:
        raise SettingError("baseline", f"expected another variant beside {baseline!r}, got none")


def comparison(
    variants: Sequence[Variant],
    rows: Sequence[Sequence[AttemptRow]],
    home: Path,
    folder: TemporaryDirectory | None = None,
    baseline: str | None = None,
) -> Comparison:
    """Return the comparison of flown attempts.

    Args:
        variants: the variants, on one course or several; those without an attempt are left out.
        rows: the attempts of each variant.
        home: the folder to which the paths of their telemetry are relative.
        folder: temporary folder of the telemetry, kept as long as the comparison exists.
        baseline: name of the variant that the others are compared with; None: all pairs.
    """
    by_course: dict[str, list[tuple[Variant, Sequence[AttemptRow]]]] = {}
    for variant, of_variant in zip(variants, rows, strict=True):
        if of_variant:
            by_course.setdefault(variant.course, []).append((variant, of_variant))
    sections = [section_of(flown, home, baseline) for flown in by_course.values()]
    return Comparison(sections, folder)


def section_of(
    flown: Sequence[tuple[Variant, Sequence[AttemptRow]]], home: Path, baseline: str | None
) -> Section:
    """Return the numbers of the variants of one course.

    Args:
        flown: variants with their attempts, at least one each.
        home: the folder to which the paths of their telemetry are relative.
        baseline: name of the variant that the others are compared with; None: all pairs.
    """
    names = [variant.name for variant, _ in flown]
    rows = [of_variant for _, of_variant in flown]
    stats = []
    records = {variant.name: variant.spec.record() for variant, _ in flown}
    for variant, of_variant in flown:
        record = records[variant.name]
        best_known = best_known_time(record, variant.spec.runs_dir)
        stats.append(variant_stats(variant.name, of_variant, lap_limit(record), best_known))
    first, _ = flown[0]
    return Section(
        course=first.spec.course,
        setting=_setting(first, rows),
        limit=lap_limit(first.spec.record()),
        variants=stats,
        pairs=against(baseline, names, rows) if baseline else all_pairs(names, rows),
        rows=rows,
        home=home,
        baseline=baseline if baseline in names else None,
        remark=seeds_remark(variant.spec for variant, _ in flown),
        conditions=(*conditions(records), *planner_differences(records)),
    )


def _setting(variant: Variant, rows: Sequence[Sequence[AttemptRow]]) -> str:
    """Return the conditions under which the variants of a course flew, as text."""
    spec = variant.spec
    laps = f"{spec.laps} lap" + "s" * (spec.laps > 1)
    vehicles = ", ".join(dict.fromkeys(of_variant[0].vehicle for of_variant in rows))
    seeds = {row.seed for of_variant in rows for row in of_variant}
    by = "" if spec.randomization == OUTDOOR else f" by {spec.randomization.name}"
    return (
        f"{laps}, vehicle {vehicles}, seeds {min(seeds)} to {max(seeds)}, "
        f"randomized {spec.randomize:g}{by}"
    )


def _notes(section: Section) -> list[str]:
    """Return the remarks on the tables of a course."""
    found = notes(section.variants, section.pairs, section.limit)
    return [*section.conditions, *([section.remark] if section.remark else []), *found]


def _blocks(section: Section) -> list[Block]:
    """Return the tables and remarks of a course."""
    return [
        Heading(section.course.name, section.setting),
        *comparison_tables(section.variants, section.pairs),
        *map(Note, _notes(section)),
    ]


def identity(variants: Sequence[Variant], attempts: int, baseline: str | None = None) -> str:
    """Return hex digits that tell a comparison from comparisons with other flags."""
    specs = [{"name": variant.name} | variant.spec.record() for variant in variants]
    decides = [attempts, specs] + ([baseline] if baseline else [])
    return sha256(canonical(decides)).hexdigest()[:ID_DIGITS]


def comparison_stem(found: Comparison, digits: str) -> str:
    """Return the name of a comparison's files without its ending: courses, variants, `identity`."""
    courses = [section.course.name for section in found.sections]
    variants = dict.fromkeys(variant.name for variant in found.variants)
    return file_stem([*courses, *variants], digits)
