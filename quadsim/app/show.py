"""`race show` and `race plot`: a stored run as text and as a picture."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from tyro.conf import DisallowNone, FlagCreatePairsOff, Positional, arg

from quadsim.app.console import emit, emit_json
from quadsim.app.figures.style import write_figure
from quadsim.app.flags import otherwise
from quadsim.app.report import present
from quadsim.app.stored import find_run
from quadsim.record.archive import load_run

RunName = Annotated[str, Positional, arg(name="run", metavar="RUN")]


@dataclass(frozen=True)
class Show:
    """The report of a stored run, as `race fly` printed it.

    race show last

    race show 20261120T133511Z --json
    """

    run_: RunName = "last"  # a folder, part of a name, or last
    runs_dir: str = "runs"  # where runs are kept
    json: FlagCreatePairsOff[bool] = False  # one JSON object instead of tables

    def run(self) -> int:
        folder = find_run(self.run_, self.runs_dir)
        present(load_run(folder), folder, self.json)
        return 0


@dataclass(frozen=True)
class Plot:
    """A stored run as PNG and SVG: path from above and from the side, controls, thrust spectrum.

    race plot last --out pictures
    """

    run_: RunName = "last"  # a folder, part of a name, or last
    out: Annotated[str | None, DisallowNone, otherwise("the run's folder")] = None  # folder for the pictures
    runs_dir: str = "runs"  # where runs are kept
    json: FlagCreatePairsOff[bool] = False  # the names of the pictures as one JSON list

    def run(self) -> int:
        folder = find_run(self.run_, self.runs_dir)
        run = load_run(folder)
        from quadsim.app.figures.run_figure import draw  # here, so that --help does not load matplotlib

        stem = "plot" if self.out is None else folder.name
        paths = write_figure(draw(run), Path(self.out or folder), stem)
        if self.json:
            emit_json([str(path) for path in paths])
        else:
            emit(*map(str, paths))
        return 0
