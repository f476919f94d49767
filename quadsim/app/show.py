"""`race show`: the report of a run, from the disk."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from tyro.conf import FlagCreatePairsOff, Positional, arg

from quadsim.app.report import present
from quadsim.app.stored import find_run
from quadsim.record.archive import load_run


@dataclass(frozen=True)
class Show:
    """The report of a stored run, as `race fly` printed it.

    race show last

    race show 20261120T133511Z --json
    """

    run_: Annotated[str, Positional, arg(name="run", metavar="RUN")] = "last"  # a folder, part of a name, or last
    runs_dir: str = "runs"  # where runs are kept
    json: FlagCreatePairsOff[bool] = False  # one JSON object instead of tables

    def run(self) -> int:
        folder = find_run(self.run_, self.runs_dir)
        present(load_run(folder), folder, self.json)
        return 0
