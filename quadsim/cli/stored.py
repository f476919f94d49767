"""`race show`, `race plot` and `race export`: stored runs as reports, figures and files."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from rich.markup import escape

from quadsim.cli.flags import (
    Help,
    Json,
    RunsDir,
    Stored,
    Switch,
    names,
    stored_runs_and_races,
)
from quadsim.cli.report import known_limit, present
from quadsim.console import UsageError, emit, emit_json, plain_table
from quadsim.controllers.learned.export import export_pilot
from quadsim.controllers.learned.pilot import load_pilot
from quadsim.figures.style import PICTURES, save_figure, write_figure
from quadsim.files.values import SettingError
from quadsim.heat.archive import (
    export_name,
    heat_folder,
    is_heat,
    named_runs,
    read_heat,
    run_folders,
    with_whole_races,
)
from quadsim.record.archive import find_run, read_run
from quadsim.record.exchange import telemetry_csv
from quadsim.record.mcap_file import mcap_bytes
from quadsim.record.polynomials import run_polynomials
from quadsim.record.whole_files import expect_new_file, write_whole
from quadsim.report.preset_changes import changed_numbers, number_text, recorded_derivation
from quadsim.results.heat import Heat
from quadsim.results.stored_runs import stored_runs

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# Suffix of a pilot's file by the flag that asks for it
PILOT_SUFFIXES = {"header": ".h", "onnx": ".onnx"}


def runs(
    *,
    course: Annotated[str | None, Help("pattern of the courses to list")] = None,
    vehicle: Annotated[str | None, Help("pattern of the vehicles to list")] = None,
    sampler: Annotated[str | None, Help("pattern of the samplers to list")] = None,
    preset: Annotated[str | None, Help("pattern of the presets to list")] = None,
    pilot: Annotated[str | None, Help("pattern of the learned pilots to list")] = None,
    controller: Annotated[
        str | None, Help("pattern of the classes of controllers of your own to list")
    ] = None,
    seed: Annotated[int | None, Help("seed of the runs to list")] = None,
    outcome: Annotated[str | None, Help("outcome of the runs to list")] = None,
    runs_dir: RunsDir = "runs",
    json: Json = False,
) -> int:
    """List the stored runs and races of several vehicles, the oldest first.

    A race is listed if any of its entrants fits.

    race runs --course 'split_s*' --outcome finished
    """
    found = stored_runs(
        runs_dir,
        course=course,
        vehicle=vehicle,
        sampler=sampler,
        preset=preset,
        pilot=pilot,
        controller=controller,
        seed=seed,
        outcome=outcome,
    )
    if json:
        damaged = {str(path): problem for path, problem in found.damaged.items()}
        emit_json({"runs": [row.as_json() for row in found], "damaged": damaged})
    else:
        emit(*map(escape, found.by_name().splitlines()))
    return 0


def show(
    run: Stored = "last",
    /,
    *,
    numbers: Annotated[
        bool, Switch("the planner's numbers that follow from vehicle and course, and why")
    ] = False,
    runs_dir: RunsDir = "runs",
    json: Json = False,
) -> int:
    """Show the report of a stored run or race, as printed after the flight.

    race show last

    race show last --numbers

    race show 20261120T133511Z --json
    """
    race = heat_folder(run, runs_dir)
    if race is not None:
        heat = Heat.load(race)
        if json:
            emit_json(heat.as_json() | {"folder": str(race)})
        else:
            emit(*heat.renderables(), "", f"[dim]stored in {escape(str(race))}[/]")
        return 0
    folder = find_run(run, runs_dir)
    found = read_run(folder)
    if numbers:
        _show_numbers(found.spec, json)
    else:
        present(found, folder, json, runs_dir)
    return 0


def _show_numbers(spec: Mapping[str, Any], json: bool) -> None:
    """Print the derived numbers of a recorded flight, a line for each.

    Raises:
        UsageError: its preset has none.
    """
    found = recorded_derivation(spec)
    if not found:
        wanted = "expected a run of the preset race, whose numbers are derived"
        raise UsageError(f"--numbers: {wanted}, got one of {spec['preset']}")
    if json:
        emit_json([number._asdict() for number in found])
        return
    changed = changed_numbers(spec)
    table = plain_table("number", "value", "law", left=(0, 1, 2))
    for number in found:
        given = changed.get(number.name)
        value = number_text(number.value)
        table.add_row(
            number.name, value if given is None else f"{given}, given; law: {value}", number.law
        )
    emit(table)


def plot(
    run: Stored = "last",
    /,
    *,
    out: Annotated[
        str | None, Help("FILE.png, .svg or .pdf, or a folder for figures; default: the run's")
    ] = None,
    value: Annotated[
        bool,
        Switch(
            "the best way of a point mass through the race instead, beside the best known limit"
        ),
    ] = False,
    runs_dir: RunsDir = "runs",
    json: Json = False,
) -> int:
    """Draw a stored run: path from above, thrust, body rates, spectrum.

    A race of several vehicles is drawn as paths, places at the gates and gaps. --value draws the
    way, speeds and times of a point mass with the vehicle's thrust and drag.

    race plot last --out race.png
    """
    folder = heat_folder(run, runs_dir)
    stem = "value" if value else "plot"
    if value:
        folder, figure = _value_figure(run, runs_dir)
    elif folder is not None:
        figure = Heat.load(folder).plot()
    else:
        folder = find_run(run, runs_dir)
        flown = read_run(folder)
        # Imported here, so that --help does not load matplotlib
        from quadsim.figures.run_figure import draw

        figure = draw(flown, known_limit(flown, folder, runs_dir))
    if out is None:
        paths = write_figure(figure, folder, stem)
    elif Path(out).suffix.lower() in PICTURES:
        paths = (save_figure(figure, Path(out)),)
    else:
        paths = write_figure(figure, Path(out), export_name(folder))
    _print_paths(paths, json)
    return 0


def _value_figure(run: str, runs_dir: str) -> tuple[Path, Figure]:
    """Return the folder of a run, and the figure of the value of its race.

    Raises:
        UsageError: its rules are not those of a race.
    """
    # Imported here, so that --help does not load matplotlib
    from quadsim.figures.value_figure import draw_value
    from quadsim.limit.limits import LimitProblem

    folder = find_run(run, runs_dir)
    flown = read_run(folder)
    problem = LimitProblem.of_run(flown.spec)
    if problem is None:
        wanted = "expected a race with the vehicle of quadsim and without penalties"
        raise UsageError(f"--value: {wanted}, got {run}")
    return folder, draw_value(problem, known_limit(flown, folder, runs_dir))


def export(
    *runs: Annotated[
        str,
        Help(
            "a run: its folder, a part of its name, or last; for --header and --onnx a pilot: "
            "a name or FILE.npz",
            completer=names(stored_runs_and_races),
        ),
    ],
    html: Annotated[bool, Switch("one animated page, the drones in their scene")] = False,
    csv: Annotated[
        bool, Switch("telemetry, one row a control step; of several runs also a column `run`")
    ] = False,
    mcap: Annotated[
        bool, Switch("poses, gates, commands and events of one run, for Foxglove and Rerun")
    ] = False,
    zip: Annotated[bool, Switch("the folders of the runs, or the whole folder of a race")] = False,
    polynomials: Annotated[
        bool, Switch("the path of one run as polynomials for a Crazyflie (CSV)")
    ] = False,
    header: Annotated[bool, Switch("a pilot as one C header, without a library")] = False,
    onnx: Annotated[bool, Switch("a pilot as an ONNX file")] = False,
    out: Annotated[
        str | None, Help("new file to write; default: here, named after the run or the pilot")
    ] = None,
    runs_dir: RunsDir = "runs",
    json: Json = False,
) -> int:
    """Export runs or a pilot for other programs.

    Of a race of several vehicles, all runs are exported. A file that is there
    already is not written over. A zip is read back by unzipping it into the
    folder of runs.

    race export last --html

    race export 20261120T133511Z 20261120T134914Z --html --out race.html

    race export last --mcap

    race export pilots/mine.npz --header
    """
    given = {
        "html": html,
        "csv": csv,
        "mcap": mcap,
        "zip": zip,
        "polynomials": polynomials,
        "header": header,
        "onnx": onnx,
    }
    kinds = [kind for kind, wanted in given.items() if wanted]
    if len(kinds) != 1:
        got = " and ".join(kinds) or "none"
        wanted = ", ".join(f"--{kind}" for kind in given)
        raise UsageError(f"expected one of {wanted}, got {got}")
    kind = kinds[0]
    if kind in PILOT_SUFFIXES:
        _print_paths((_export_pilot(kind, runs, out),), json)
        return 0
    folders = [f for run in runs or ("last",) for f in run_folders(run, runs_dir)]
    if kind == "polynomials":
        _export_polynomials(folders, out, json)
        return 0
    path = Path(out or f"{export_name(with_whole_races(folders)[0])}.{kind}")
    expect_new_file(path)
    write_whole(path, _data(kind, folders))
    _print_paths((path,), json)
    return 0


def _export_polynomials(folders: list[Path], out: str | None, json: bool) -> None:
    """Write the path of a run as polynomials, and print the file and the largest errors.

    Raises:
        UsageError: several runs are given, or the flight is too short.
        RunError: the run is damaged, or the file cannot be written.
    """
    if len(folders) > 1:
        raise UsageError(f"--polynomials: expected one run, got {len(folders)}")
    path = Path(out or f"{export_name(folders[0])}_polynomials.csv")
    expect_new_file(path)
    try:
        fitted = run_polynomials(read_run(folders[0]))
    except SettingError as error:
        raise UsageError(f"--polynomials: {error.problem}") from None
    fitted.save(path)
    if json:
        emit_json(
            {
                "file": str(path),
                "pieces": len(fitted.durations),
                "duration": float(fitted.durations.sum()),
                "largest_error": fitted.largest_error,
                "largest_yaw_error": None if fitted.yaw_held else fitted.largest_yaw_error,
            }
        )
    else:
        emit(escape(f"{path}: {fitted.summary}"))


def _export_pilot(kind: str, pilots: tuple[str, ...], out: str | None) -> Path:
    """Write a pilot as a C header or as an ONNX file, and return the path.

    Raises:
        UsageError: not one pilot is given, the file is named otherwise, or onnx is missing.
        FileError: there is no such pilot.
        RunError: the file cannot be written.
    """
    if len(pilots) != 1:
        raise UsageError(f"--{kind}: expected one pilot, got {len(pilots) or 'none'}")
    suffix = PILOT_SUFFIXES[kind]
    pilot = load_pilot(pilots[0])
    path = Path(out or f"{pilot.name}{suffix}")
    if path.suffix != suffix:
        raise UsageError(f"--out: expected FILE{suffix}, got {str(path)!r}")
    expect_new_file(path)
    try:
        return export_pilot(pilot, path)
    except ModuleNotFoundError as error:
        raise UsageError(f"--{kind}: {error}") from None


def _print_paths(paths: tuple[Path, ...], json: bool) -> None:
    names = [str(path) for path in paths]
    if json:
        emit_json(names)
    else:
        emit(*names)


def _data(kind: str, folders: list[Path]) -> bytes:
    """Return the bytes of the file.

    Raises:
        UsageError: the runs of one page are of several courses, --mcap was given several runs, or
            the packages that it needs are missing.
        RunError: a run is damaged.
    """
    if kind == "csv":
        return telemetry_csv(named_runs(folders))
    if kind == "mcap":
        return _mcap_data(folders)
    # Imported here, so that --help does not load them
    from quadsim.web.page.forms.export import offline_page, zipped
    from quadsim.web.race.competitor import named
    from quadsim.web.race.stored_competitor import stored_competitor

    if kind == "zip":
        for folder in with_whole_races(folders):
            if is_heat(folder):
                read_heat(folder)
            else:
                read_run(folder)
        return zipped(folders)
    competitors = named([stored_competitor(folder) for folder in folders])
    courses = {competitor.course.text for competitor in competitors}
    if len(courses) > 1:
        raise UsageError("--html: expected runs of one course, got several")
    return offline_page(competitors).encode()


def _mcap_data(folders: list[Path]) -> bytes:
    """Return the bytes of an MCAP file, see `_data`."""
    if len(folders) > 1:
        raise UsageError(f"--mcap: expected one run, got {len(folders)}")
    run = read_run(folders[0])
    try:
        return mcap_bytes(run)
    except ModuleNotFoundError as error:
        raise UsageError(f"--mcap: {error}") from None
