"""The report of heats under several settings: Markdown with the tables, PNG and SVG."""

from __future__ import annotations

import re
from collections.abc import Sequence
from hashlib import sha256
from pathlib import Path

from quadsim.campaign.heats.compare import HeatComparison
from quadsim.campaign.heats.paired import HeatVariant
from quadsim.campaign.heats.store import key_of
from quadsim.figures.style import write_figure
from quadsim.record.whole_files import write_whole

ID_DIGITS = 6  # hex digits that tell reports with other flags apart
NAME_LENGTH = 80  # most characters of names in the files' names


def write_heats_report(
    variants: Sequence[HeatVariant], found: HeatComparison, folder: Path
) -> list[Path]:
    """Write a comparison as Markdown, PNG and SVG, and return the files.

    Args:
        variants: the settings.
        found: their comparison.
        folder: folder for the files, which are named after course and settings.

    Raises:
        RunError: the folder cannot be written.
    """
    from quadsim.campaign.heats.figure import title_of  # here: it loads matplotlib

    names = "_".join([found.course, *(one.name for one in found.settings)])[:NAME_LENGTH]
    stem = f"{re.sub('[/=:]', '-', names)}_{_identity(variants)}"
    figures = write_figure(found.plot(), folder, stem)
    text = folder / f"{stem}.md"
    title = title_of(found.course, found.settings[0].summary)
    write_whole(text, found.markdown(title, figures[0].name).encode())
    return [text, *figures]


def _identity(variants: Sequence[HeatVariant]) -> str:
    """Return hex digits that tell a report from those of other races."""
    keys = [key_of(heat) for variant in variants for heat in variant.heats]
    return sha256("".join(keys).encode()).hexdigest()[:ID_DIGITS]
