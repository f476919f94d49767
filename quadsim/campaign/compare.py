"""`race compare` and quadsim.compare: variants against each other on courses, paired by seed, with
intervals."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from hashlib import sha256
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Annotated, Any

from msgspec import Meta
from rich.console import Console, RenderableType
from rich.markup import escape
from rich.padding import Padding

from controllers.samplers import SAMPLERS
from quadsim.campaign.runner import Runner
from quadsim.campaign.store import Row
from quadsim.campaign.summary_stats import (
    PairStats,
    Section,
    VariantStats,
    all_pairs,
    best_known_time,
    lap_limit,
    variant_stats,
)
from quadsim.campaign.tables import as_markdown, as_table, comparison_tables, notes
from quadsim.campaign.variants import (
    CAMPAIGN,
    Campaign,
    Jobs,
    Scheduler,
    Variant,
    make_variants,
    parse_variants,
)
from quadsim.cli.flags import Given, Help, Json, Switch
from quadsim.console import UsageError, emit, emit_json
from quadsim.figures.style import save_figure, write_figure
from quadsim.record.run import RunError, canonical
from quadsim.record.whole_files import expect_file, expect_writable, write_whole

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def compare_command(
    *courses: Annotated[str, Help("see `race courses`, or FILE.yaml")],
    variants: Annotated[
        str, Help("samplers, or NAME=preset+flag=value+...", alias="--arms")
    ] = "gaussian,colored",
    attempts: Annotated[int, Meta(ge=1, le=100_000), Help("of each variant on each course")] = 10,
    jobs: Jobs = None,
    scheduler: Scheduler = None,
    campaign: Campaign = CAMPAIGN,
    this_commit: Annotated[bool, Switch("count only attempts that this commit has flown")] = False,
    out: Annotated[
        str | None, Help("folder of Markdown and figures; default: beside the campaign")
    ] = None,
    json: Json = False,
    settings: Given = None,
) -> int:
    """Fly variants against each other and report which is faster, safer, smoother, and by how much.

    Attempt i of every variant flies seed --seed + i: the same start, gusts and vehicle under
    --randomize. Every flag of `race fly` holds for all variants. What has been flown before is not
    flown again.

    race compare paper_flat --preset paper --variants gaussian,colored --attempts 100 --randomize 1

    race compare split_s_swift --variants
    colored,soft=race+target-ess=200,wild=gaussian+sigma=3:3:.6:6
    """
    if not courses:
        raise UsageError("expected one COURSE or more, got none (race courses lists them)")
    made = make_variants(courses, parse_variants(variants), settings or {})
    path = Path(campaign)
    expect_file(path)
    report = Path(out) if out else path.with_name(f"{path.stem}.report")
    expect_writable(report)
    with Runner(path, jobs, scheduler, this_commit) as runner:
        rows = runner(made, attempts)
    comparison = Comparison(sections(made, rows, path.parent))
    if not comparison.sections:
        raise RunError("no attempt was flown: nothing to compare")
    if json:
        emit_json(comparison.as_json() | {"campaign": campaign})
    else:
        emit(*comparison.renderables())
    written = write(comparison.sections, report, _identity(made, attempts))
    if not json:
        emit("", *(f"[dim]{escape(str(file))}[/]" for file in written))
    return 0 if all(len(flown) == attempts for flown in rows) else 1


@dataclass(frozen=True)
class Comparison:
    """What variants did against each other; `print` it for tables."""

    sections: list[Section]  # one for each course
    _folder: TemporaryDirectory | None = None  # of the telemetry, where no campaign keeps it

    @property
    def variants(self) -> list[VariantStats]:
        """The numbers of each variant on each course."""
        return [v for s in self.sections for v in s.variants]

    @property
    def pairs(self) -> list[PairStats]:
        """The differences of each two variants on each course, with intervals."""
        return [p for s in self.sections for p in s.pairs]

    def as_json(self) -> dict[str, list[dict]]:
        return {
            "variants": [asdict(v) for v in self.variants],
            "pairs": [asdict(p) for p in self.pairs],
        }

    def plot(self, path: str | Path | None = None) -> Figure:
        """Laps, success, chatter and paths on one page; written to `path` where given."""
        from quadsim.figures.comparison import draw  # which loads matplotlib

        figure = draw(self.sections)
        if path is not None:
            save_figure(figure, Path(path))
        return figure

    def renderables(self) -> list[RenderableType]:
        """For the terminal."""
        return [part for s in self.sections for part in _shown(s)]

    def __str__(self) -> str:
        console = Console(width=100, color_system=None, highlight=False)
        with console.capture() as text:
            console.print(*self.renderables(), sep="\n")
        return text.get().rstrip()


def compare(
    courses: Any,
    variants: Mapping[str, Mapping[str, Any]] | Sequence[str],
    attempts: int,
    jobs: int | None,
    campaign: str | Path | None,
    settings: Mapping[str, Any],
) -> Comparison:
    """See quadsim.compare."""
    said = variants if isinstance(variants, Mapping) else {name: {} for name in variants}
    each = {
        name: ({"sampler": name} if name in SAMPLERS else {}) | dict(own)
        for name, own in said.items()
    }
    several = courses if isinstance(courses, list | tuple) else [courses]
    made = make_variants(several, each, settings)
    folder = None if campaign else TemporaryDirectory(prefix="quadsim-")
    path = Path(campaign) if campaign else Path(str(folder and folder.name)) / "campaign.sqlite"
    with Runner(path, jobs or 0) as runner:
        rows = runner(made, attempts)
    return Comparison(sections(made, rows, path.parent), folder)


def sections(
    variants: Sequence[Variant], rows: Sequence[Sequence[Row]], home: Path
) -> list[Section]:
    """One for each course; variants without an attempt are left out."""
    flown: dict[str, list[tuple[Variant, Sequence[Row]]]] = {}
    for variant, of_variant in zip(variants, rows, strict=True):
        if of_variant:
            flown.setdefault(variant.course, []).append((variant, of_variant))
    return [_section(of_course, home) for of_course in flown.values()]


def _section(flown: Sequence[tuple[Variant, Sequence[Row]]], home: Path) -> Section:
    variants, rows = zip(*flown, strict=True)
    specs = [variant.spec.record() for variant in variants]
    stats = [
        variant_stats(variant.name, r, lap_limit(spec), best_known_time(spec))
        for variant, r, spec in zip(variants, rows, specs, strict=True)
    ]
    spec = variants[0].spec
    seeds = sorted({r.seed for of_variant in rows for r in of_variant})
    vehicles = ", ".join(dict.fromkeys(r[0].vehicle for r in rows))
    laps = f"{spec.laps} lap" + "s" * (spec.laps > 1)
    setting = f"{laps}, vehicle {vehicles}, seeds {seeds[0]} to {seeds[-1]}, randomized {spec.randomize:g}"
    pairs = all_pairs([variant.name for variant in variants], rows)
    return Section(spec.course, setting, lap_limit(spec.record()), stats, pairs, list(rows), home)


def _identity(variants: Sequence[Variant], attempts: int) -> str:
    """Digits of a comparison that no other one has, whatever its flags."""
    specs = [{"name": v.name} | v.spec.record() for v in variants]
    return sha256(canonical([attempts, specs])).hexdigest()[:6]


def write(found: Sequence[Section], folder: Path, identity: str) -> list[Path]:
    """Markdown, PNG and SVG, named after courses and variants. Raises RunError."""
    from quadsim.figures.comparison import draw  # here, so that --help does not load matplotlib

    names = dict.fromkeys(a.name for s in found for a in s.variants)
    stem = (
        "_".join([*(s.course.name for s in found), *names])[:120].replace("/", "-") + f"_{identity}"
    )
    text = folder / f"{stem}.md"
    figures = write_figure(draw(found), folder, stem)
    write_whole(text, markdown(found, figures[0].name).encode())
    return [text, *figures]


def markdown(found: Sequence[Section], picture: str) -> str:
    parts = []
    for s in found:
        parts += [f"## {s.course.name}", f"{s.setting[0].upper()}{s.setting[1:]}."]
        parts += [as_markdown(table) for table in comparison_tables(s.variants, s.pairs)]
        parts += [f"* {note}" for note in notes(s.variants, s.pairs, s.limit)]
    return "\n\n".join([*parts, f"![]({picture})"]) + "\n"


def _shown(s: Section) -> list[RenderableType]:
    tables = [
        Padding(as_table(t), (1, 0, 0, 2), expand=False)
        for t in comparison_tables(s.variants, s.pairs)
    ]
    remarks = [f"  [dim]{escape(note)}[/]" for note in notes(s.variants, s.pairs, s.limit)]
    return [f"[bold]{escape(s.course.name)}[/]  {escape(s.setting)}", *tables, "", *remarks, ""]
