"""The result of an experiment: numbers, tables and files.

The paper is B. Vlahov, J. Gibson, D. D. Fan, P. Spieler, A. Agha-mohammadi and E. A. Theodorou,
"Low Frequency Sampling in Model Predictive Path Integral Control", IEEE Robotics and Automation
Letters 9(5), 2024.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from rich.console import RenderableType

from quadsim.files.csv_rows import csv_text
from quadsim.record.whole_files import write_whole


@dataclass(frozen=True)
class Result:
    """The numbers, tables and files of one experiment."""

    numbers: dict  # JSON
    shown: tuple[RenderableType, ...]
    files: tuple[Path, ...]


def write_csv(path: Path, rows: Sequence[dict]) -> Path:
    """Write rows with equal keys as CSV, and return the path. Raises RunError."""
    write_whole(path, csv_text(rows).encode())
    return path
