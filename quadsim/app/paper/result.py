"""What a table or figure of the paper leaves behind: numbers, tables for the terminal, files."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from rich.console import RenderableType

from quadsim.record.run import RunError


@dataclass(frozen=True)
class Result:
    """One experiment, done."""

    numbers: dict  # JSON
    shown: tuple[RenderableType, ...]
    files: tuple[Path, ...]


def write_csv(path: Path, rows: Sequence[dict]) -> Path:
    """Rows of equal keys."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with path.open("w", newline="") as file:
            writer = csv.DictWriter(file, rows[0])
            writer.writeheader()
            writer.writerows(rows)
    except OSError as error:
        raise RunError(f"{path}: cannot write: {error.strerror or error}") from error
    return path
