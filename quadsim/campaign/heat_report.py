"""The report of races under several settings: Markdown with the tables, PNG and SVG."""

from __future__ import annotations

from collections.abc import Sequence
from hashlib import sha256
from pathlib import Path

from quadsim.campaign.heat_tables import (
    differences_table,
    entrants_table,
    lines_of,
    overtakers_table,
    settings_table,
    win_matrix,
)
from quadsim.campaign.heats import key_of
from quadsim.campaign.paired_heats import FlownHeats, HeatsDifference, HeatVariant
from quadsim.campaign.tables import as_markdown
from quadsim.figures.style import write_figure
from quadsim.record.whole_files import write_whole

ID_DIGITS = 6  # hex digits that tell reports with other flags apart
NAME_LENGTH = 80  # most characters of names in the files' names


def write_heats_report(
    variants: Sequence[HeatVariant],
    flown: Sequence[FlownHeats],
    differences: Sequence[HeatsDifference],
    folder: Path,
) -> list[Path]:
    """Write what was found as Markdown, PNG and SVG, and return the files.

    Args:
        variants: the settings.
        flown: their races.
        differences: what changes from the first setting to each other one.
        folder: folder for the files, which are named after course and settings.

    Raises:
        RunError: the folder cannot be written.
    """
    from quadsim.campaign.heats_figure import draw_heats, title_of  # here: it loads matplotlib

    course = variants[0].heats[0].course.name
    names = "_".join([course, *(one.name for one in flown)])[:NAME_LENGTH]
    stem = f"{names.replace('/', '-').replace('=', '-')}_{_identity(variants)}"
    title = title_of(course, flown[0].summary)
    figures = write_figure(draw_heats(flown, title), folder, stem)

    parts = [f"## {title}"]
    if differences:
        parts += [as_markdown(settings_table(flown)), as_markdown(differences_table(differences))]
    for one in flown:
        found = one.summary
        parts.append(f"### {one.name}")
        parts += [as_markdown(entrants_table(found)), as_markdown(win_matrix(found))]
        if found.overtakers:
            parts.append(as_markdown(overtakers_table(found)))
        parts.append("\n".join(f"* {line}" for line in lines_of(found)))
    parts.append(f"![]({figures[0].name})")
    text = folder / f"{stem}.md"
    write_whole(text, ("\n\n".join(parts) + "\n").encode())
    return [text, *figures]


def _identity(variants: Sequence[HeatVariant]) -> str:
    """Return hex digits that tell a report from those of other races."""
    keys = [key_of(heat) for variant in variants for heat in variant.heats]
    return sha256("".join(keys).encode()).hexdigest()[:ID_DIGITS]
