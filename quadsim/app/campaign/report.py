"""The report of a comparison: tables or JSON on stdout, Markdown and one page of figures in a folder."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from rich.markup import escape
from rich.padding import Padding

from quadsim.app.campaign.store import Row
from quadsim.app.campaign.summary_stats import Section, all_pairs, as_json, lap_limit, variant_stats
from quadsim.app.campaign.tables import as_markdown, as_table, notes, sheets
from quadsim.app.campaign.variants import Variant
from quadsim.app.console import emit, emit_json
from quadsim.app.figures.style import write_figure
from quadsim.record.run import RunError


def sections(variants: Sequence[Variant], rows: Sequence[Sequence[Row]], campaign: Path) -> list[Section]:
    """One for each course; variants of which nothing has landed are left out."""
    found = []
    for course in dict.fromkeys(variant.spec.course.name for variant in variants):
        here = [(a, r) for a, r in zip(variants, rows, strict=True) if a.spec.course.name == course and r]
        if here:
            found.append(_section([a for a, _ in here], [r for _, r in here], campaign.parent))
    return found


def _section(variants: Sequence[Variant], rows: Sequence[Sequence[Row]], home: Path) -> Section:
    names = [variant.name for variant in variants]
    numbers = [variant_stats(variant.name, r, lap_limit(variant)) for variant, r in zip(variants, rows, strict=True)]
    spec = variants[0].spec
    seeds = sorted({r.seed for of_variant in rows for r in of_variant})
    vehicles = ", ".join(dict.fromkeys(variant.spec.vehicle.name for variant in variants))
    laps = f"{spec.laps} lap" + "s" * (spec.laps > 1)
    setting = f"{laps}, vehicle {vehicles}, seeds {seeds[0]} to {seeds[-1]}, randomized {spec.randomize:g}"
    return Section(spec.course, setting, lap_limit(variants[0]), numbers, all_pairs(names, rows), list(rows), home)


def present(found: Sequence[Section], campaign: Path, folder: Path, to_json: bool) -> None:
    """Raises RunError where the folder cannot be written, after what is on stdout."""
    variants, pairs = [a for s in found for a in s.variants], [p for s in found for p in s.pairs]
    if to_json:
        emit_json(as_json(variants, pairs, str(campaign)))
    else:
        for s in found:
            _print(s)
    written = write(found, folder)
    if not to_json:
        emit("", *(f"[dim]{escape(str(path))}[/]" for path in written))


def write(found: Sequence[Section], folder: Path) -> list[Path]:
    """Markdown, PNG and SVG, named after courses and variants."""
    from quadsim.app.figures.comparison import draw  # here, so that --help does not load matplotlib

    names = dict.fromkeys(a.name for s in found for a in s.variants)
    stem = "_".join([*(s.course.name for s in found), *names])[:120].replace("/", "-")
    pictures = write_figure(draw(found), folder, stem)
    text = folder / f"{stem}.md"
    try:
        text.write_text(markdown(found, pictures[0].name), encoding="utf-8")
    except OSError as error:
        raise RunError(f"{folder}: cannot write the report: {error.strerror or error}") from error
    return [text, *pictures]


def markdown(found: Sequence[Section], picture: str) -> str:
    parts = []
    for s in found:
        parts += [f"## {s.course.name}", f"{s.setting[0].upper()}{s.setting[1:]}."]
        parts += [as_markdown(sheet) for sheet in sheets(s.variants, s.pairs)]
        parts += [f"* {note}" for note in notes(s.variants, s.pairs, s.limit)]
    return "\n\n".join([*parts, f"![]({picture})"]) + "\n"


def _print(s: Section) -> None:
    emit(f"[bold]{escape(s.course.name)}[/]  {escape(s.setting)}")
    for sheet in sheets(s.variants, s.pairs):
        emit("", Padding(as_table(sheet), (0, 0, 0, 2), expand=False))
    emit("", *(f"  [dim]{escape(note)}[/]" for note in notes(s.variants, s.pairs, s.limit)), "")
