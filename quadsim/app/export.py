"""`race export`: a stored run to take along."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from tyro.conf import DisallowNone, FlagCreatePairsOff, Positional, arg

from quadsim.app.console import emit, emit_json
from quadsim.app.flags import UsageError, otherwise
from quadsim.app.stored import find_run
from quadsim.record.archive import load_run
from quadsim.record.run import RunError


@dataclass(frozen=True)
class Export:
    """A run as a page that plays offline, as a table, as one file.

    race export last --html

    race export 20261120T133511Z 20261120T134914Z --html --out race.html
    """

    runs: Annotated[tuple[str, ...], Positional, arg(metavar="RUN")] = ("last",)  # side by side in the page
    html: FlagCreatePairsOff[bool] = False  # one animated page, the drones in their scene
    csv: FlagCreatePairsOff[bool] = False  # telemetry, one row a control step
    zip: FlagCreatePairsOff[bool] = False  # the run folder
    out: Annotated[str | None, DisallowNone, otherwise("<run>.html, .csv or .zip here")] = None  # file to write
    runs_dir: str = "runs"  # where runs are kept
    json: FlagCreatePairsOff[bool] = False  # the name of the file as one JSON list

    def run(self) -> int:
        kind = self._kind()
        folders = [find_run(run, self.runs_dir) for run in self.runs]
        if kind != "html" and len(folders) > 1:
            raise UsageError(f"--{kind}: expected one run, got {len(folders)}")
        path = Path(self.out or f"{folders[0].name}.{kind}")
        data = _data(kind, folders)
        try:
            path.write_bytes(data)
        except OSError as error:
            raise RunError(f"{path}: cannot write: {error.strerror or error}") from error
        if self.json:
            emit_json([str(path)])
        else:
            emit(str(path))
        return 0

    def _kind(self) -> str:
        asked = [kind for kind in ("html", "csv", "zip") if getattr(self, kind)]
        if len(asked) != 1:
            raise UsageError(f"expected one of --html, --csv, --zip, got {' and '.join(asked) or 'none'}")
        return asked[0]


def _data(kind: str, folders: list[Path]) -> bytes:
    from web.competitor import named, stored_competitor  # here, so that --help does not load them
    from web.page.export import offline_page, telemetry_csv, zipped

    if kind == "csv":
        return telemetry_csv(load_run(folders[0]))
    if kind == "zip":
        load_run(folders[0])  # a damaged run is not handed on
        return zipped(folders[0])
    competitors = named([stored_competitor(folder) for folder in folders])
    if len({entry.spec["course_text"] for entry in competitors}) > 1:
        raise UsageError("--html: expected runs of one course, got several")
    return offline_page(competitors).encode()
