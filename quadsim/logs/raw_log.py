"""RawLog: the signals of a file in the units and frames of FlightLog, not yet cleaned."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from quadsim.files.strict_yaml import FileError

# A log is read up to this row: half an hour at 500 Hz, some 250 MB with all signals.
MOST_ROWS = 1_000_000


class LogError(FileError):
    """A log cannot be used. One line: the file, what was expected, what came, what to do."""


@dataclass(frozen=True, eq=False)
class RawLog:
    """The signals of a log as they were recorded, on one clock.

    Attributes:
        name: name of the file, with the number of the flight if the file has several.
        t: time of each row, on the log's own clock, in any order [s]  (n,)
        signals: key of SIGNALS -> (n, width), or (n,) for one number, in the units of SIGNALS.
        remarks: one line each, on what the reader has left out.
        largest: key of SIGNALS -> the reading at which its sensor saturates.
    """

    name: str
    t: np.ndarray
    signals: Mapping[str, np.ndarray]
    remarks: tuple[str, ...] = ()
    largest: Mapping[str, float] = field(default_factory=dict)


def cut_remark(rows: int) -> str:
    """Return the remark on a log of which only the first rows are read."""
    return f"the first {MOST_ROWS:,} of {rows:,} rows are read"
