"""`race compare`: variants against each other on courses, paired by seed; tables or JSON, Markdown and figures."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Annotated

from msgspec import Meta
from rich.markup import escape
from rich.padding import Padding
from tyro.conf import DisallowNone, FlagCreatePairsOff, OmitArgPrefixes, Positional, arg

from quadsim.app.campaign.runner import Runner
from quadsim.app.campaign.store import Row
from quadsim.app.campaign.summary_stats import PairStats, VariantStats, all_pairs, lap_limit, variant_stats
from quadsim.app.campaign.tables import as_markdown, as_table, comparison_tables, notes
from quadsim.app.campaign.variants import (
    CAMPAIGN,
    INTERRUPTED,
    Campaign,
    FlightWords,
    Variant,
    Workers,
    parse_variants,
    read_with_flight,
)
from quadsim.app.console import emit, emit_json
from quadsim.app.flags import UsageError, otherwise
from quadsim.course import Course
from quadsim.record.run import RunError


@dataclass(frozen=True)
class Compare:
    """Fly variants against each other and report which is faster, safer, smoother, and by how much.

    Attempt i of every variant flies seed --seed + i: the same start, gusts and vehicle under --randomize.
    Every flag of `race fly` holds for all variants. What has been flown before is not flown again.

    race compare paper_flat --preset paper --variants gaussian,colored --attempts 100 --randomize 1

    race compare split_s_swift --variants colored,soft=race+target-ess=200,wild=gaussian+sigma=3:3:.6:6
    """

    courses: Annotated[tuple[str, ...], Positional, arg(metavar="COURSE")] = ()  # see `race courses`, or FILE.yaml
    variants: Annotated[str, arg(metavar="NAME,NAME", aliases=("--arms",))] = (
        "gaussian,colored"  # samplers, or NAME=preset+flag=value+...
    )
    attempts: Annotated[int, Meta(ge=1, le=100_000)] = 10  # of each variant on each course
    workers: OmitArgPrefixes[Workers] = field(default_factory=Workers)
    campaign: Campaign = CAMPAIGN  # where attempts are kept
    this_commit: FlagCreatePairsOff[bool] = False  # count only attempts that this commit has flown
    out: Annotated[str | None, DisallowNone, otherwise("beside the campaign")] = None  # folder of Markdown and figures
    json: FlagCreatePairsOff[bool] = False  # one JSON object instead of tables
    flight: FlightWords = ()

    @classmethod
    def from_argv(cls, argv: Sequence[str]) -> Compare:
        flags = read_with_flight(cls, "race compare", argv)
        if not flags.courses:
            raise UsageError("expected one COURSE or more, got none (race courses lists them)")
        return flags

    def run(self) -> int:
        variants = parse_variants(self.variants, self.courses, self.flight, "race compare")
        campaign = Path(self.campaign)
        try:
            with Runner(campaign, self.workers, self.this_commit) as runner:
                rows = runner(variants, self.attempts)
        except KeyboardInterrupt:
            return INTERRUPTED
        found = sections(variants, rows, campaign.parent)
        if self.json:
            stats = {"variants": [a for s in found for a in s.variants], "pairs": [p for s in found for p in s.pairs]}
            emit_json(
                {name: [asdict(x) for x in of_all] for name, of_all in stats.items()} | {"campaign": self.campaign}
            )
        else:
            for s in found:
                _print(s)
        written = write(found, Path(self.out) if self.out else campaign.with_suffix(".report"))
        if not self.json:
            emit("", *(f"[dim]{escape(str(path))}[/]" for path in written))
        return 0 if all(len(flown) == self.attempts for flown in rows) else 1


@dataclass(frozen=True)
class Section:
    """All variants of one course."""

    course: Course
    setting: str
    limit: float  # [s] a lap
    variants: list[VariantStats]
    pairs: list[PairStats]
    rows: list[Sequence[Row]]  # of each variant
    home: Path  # folder that their telemetry is relative to


def sections(variants: Sequence[Variant], rows: Sequence[Sequence[Row]], home: Path) -> list[Section]:
    """One for each course; variants without an attempt are left out."""
    flown = [(variant, r) for variant, r in zip(variants, rows, strict=True) if r]
    courses = dict.fromkeys(variant.course for variant, _ in flown)
    return [_section([pair for pair in flown if pair[0].course == course], home) for course in courses]


def _section(flown: Sequence[tuple[Variant, Sequence[Row]]], home: Path) -> Section:
    variants, rows = zip(*flown, strict=True)
    stats = [variant_stats(variant.name, r, lap_limit(variant.spec.record())) for variant, r in flown]
    spec = variants[0].spec
    seeds = sorted({r.seed for of_variant in rows for r in of_variant})
    vehicles = ", ".join(dict.fromkeys(r[0].vehicle for r in rows))
    laps = f"{spec.laps} lap" + "s" * (spec.laps > 1)
    setting = f"{laps}, vehicle {vehicles}, seeds {seeds[0]} to {seeds[-1]}, randomized {spec.randomize:g}"
    pairs = all_pairs([variant.name for variant in variants], rows)
    return Section(spec.course, setting, lap_limit(spec.record()), stats, pairs, list(rows), home)


def write(found: Sequence[Section], folder: Path) -> list[Path]:
    """Markdown, PNG and SVG, named after courses and variants. Raises RunError."""
    from quadsim.app.campaign.figure import draw  # here, so that --help does not load matplotlib

    names = dict.fromkeys(a.name for s in found for a in s.variants)
    stem = "_".join([*(s.course.name for s in found), *names])[:120].replace("/", "-")
    paths = [folder / f"{stem}.{kind}" for kind in ("md", "png", "svg")]
    try:
        folder.mkdir(parents=True, exist_ok=True)
        paths[0].write_text(markdown(found, paths[1].name), encoding="utf-8")
        figure = draw(found)
        for path in paths[1:]:
            figure.savefig(path)
    except OSError as error:
        raise RunError(f"{folder}: cannot write the report: {error.strerror or error}") from error
    return paths


def markdown(found: Sequence[Section], picture: str) -> str:
    parts = []
    for s in found:
        parts += [f"## {s.course.name}", f"{s.setting[0].upper()}{s.setting[1:]}."]
        parts += [as_markdown(table) for table in comparison_tables(s.variants, s.pairs)]
        parts += [f"* {note}" for note in notes(s.variants, s.pairs, s.limit)]
    return "\n\n".join([*parts, f"![]({picture})"]) + "\n"


def _print(s: Section) -> None:
    emit(f"[bold]{escape(s.course.name)}[/]  {escape(s.setting)}")
    for table in comparison_tables(s.variants, s.pairs):
        emit("", Padding(as_table(table), (0, 0, 0, 2), expand=False))
    emit("", *(f"  [dim]{escape(note)}[/]" for note in notes(s.variants, s.pairs, s.limit)), "")
