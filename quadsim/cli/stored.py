"""`race show`, `race plot` and `race export`: stored runs as a report, as figures, as files for
others."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from quadsim.cli.flags import Help, Json, RunsDir, Stored, Switch
from quadsim.cli.report import known_limit, present
from quadsim.console import UsageError, emit, emit_json
from quadsim.figures.style import PICTURES, save_figure, write_figure
from quadsim.record.archive import find_run, load_run
from quadsim.record.whole_files import write_whole


def show(run: Stored = "last", /, *, runs_dir: RunsDir = "runs", json: Json = False) -> int:
    """The report of a stored run, as `race fly` printed it.

    race show last

    race show 20261120T133511Z --json
    """
    folder = find_run(run, runs_dir)
    present(load_run(folder), folder, json)
    return 0


def plot(
    run: Stored = "last",
    /,
    *,
    out: Annotated[
        str | None, Help("FILE.png, .svg or .pdf, or a folder for figures; default: the run's")
    ] = None,
    runs_dir: RunsDir = "runs",
    json: Json = False,
) -> int:
    """A stored run as a picture: path from above, states, controls, spectra.

    race plot last --out race.png
    """
    folder = find_run(run, runs_dir)
    flown = load_run(folder)
    from quadsim.figures.run_figure import draw  # here, so that --help does not load matplotlib

    figure = draw(flown, known_limit(flown, folder))
    if out and Path(out).suffix.lower() in PICTURES:
        paths = (save_figure(figure, Path(out)),)
    else:
        paths = write_figure(figure, Path(out or folder), "plot" if out is None else folder.name)
    _say([str(path) for path in paths], json)
    return 0


def export(
    *runs: Stored,
    html: Annotated[bool, Switch("one animated page, the drones in their scene")] = False,
    csv: Annotated[
        bool, Switch("telemetry, one row a control step; of several runs also a column `run`")
    ] = False,
    zip: Annotated[bool, Switch("the run folders")] = False,
    out: Annotated[
        str | None, Help("file to write; default: <run>.html, .csv or .zip here")
    ] = None,
    runs_dir: RunsDir = "runs",
    json: Json = False,
) -> int:
    """Runs as a page that plays offline, as a table, as one file.

    race export last --html

    race export 20261120T133511Z 20261120T134914Z --html --out race.html
    """
    asked = [kind for kind, said in (("html", html), ("csv", csv), ("zip", zip)) if said]
    if len(asked) != 1:
        raise UsageError(
            f"expected one of --html, --csv, --zip, got {' and '.join(asked) or 'none'}"
        )
    folders = [find_run(run, runs_dir) for run in runs or ("last",)]
    path = Path(out or f"{folders[0].name}.{asked[0]}")
    data = _data(asked[0], folders)
    write_whole(path, data)
    _say([str(path)], json)
    return 0


def _say(names: list[str], json: bool) -> None:
    if json:
        emit_json(names)
    else:
        emit(*names)


def _data(kind: str, folders: list[Path]) -> bytes:
    # imported here, so that --help does not load them
    from web.competitor import named
    from web.page.export import offline_page, telemetry_csv, zipped
    from web.stored_runs import stored_competitor

    if kind == "csv":
        return telemetry_csv(folders)
    if kind == "zip":
        for folder in folders:
            load_run(folder)  # raises RunError for a damaged run
        return zipped(folders)
    competitors = named([stored_competitor(folder) for folder in folders])
    if len({entry.spec["course_text"] for entry in competitors}) > 1:
        raise UsageError("--html: expected runs of one course, got several")
    return offline_page(competitors).encode()
