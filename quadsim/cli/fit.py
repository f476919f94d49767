"""`race fit`: a vehicle from flight logs."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from json import loads
from pathlib import Path
from typing import Annotated

from msgspec import Meta
from rich.markup import escape
from rich.table import Table

from quadsim.api import fit as fitted
from quadsim.cli.flags import (
    Help,
    Json,
    RunsDir,
    Switch,
    names,
    settings_as_flags,
    stored_runs,
    vehicle_help,
)
from quadsim.cli.vehicle import file_of
from quadsim.console import UsageError, complain, emit, emit_json, plain_table
from quadsim.files.values import SettingError
from quadsim.identify import VehicleFit
from quadsim.record.archive import find_run
from quadsim.record.whole_files import expect_new_file, expect_writable
from quadsim.vehicle.flying import flying_numbers

LOG = "a log, or a stored run: its folder, a part of its name, or last; may be repeated"


def fit(
    *logs: Annotated[str, Help(LOG, completer=names(stored_runs))],
    test: Annotated[
        list[str] | None,
        Help(
            "logs on which the predictions of the fitted vehicle are measured; default: the fitted"
            " ones",
            metavar="LOG",
            consume_multiple=True,
            negative_iterable="",
        ),
    ] = None,
    name: Annotated[
        Annotated[str, Meta(min_length=1)], Help("name of the vehicle, and of its file NAME.yaml")
    ],
    mass: Annotated[
        float | None, Help("of the vehicle with its battery, by a scale [kg]; default: --like's")
    ] = None,
    like: Annotated[
        str | None,
        vehicle_help(
            "a similar vehicle, from which the search starts and which has what the logs do not"
            " tell; default: the nearest by mass"
        ),
    ] = None,
    arm: Annotated[
        float | None,
        Help(
            "from the centre to a rotor [m], which no log tells, and with it the inertia; default:"
            " --like's"
        ),
    ] = None,
    mapping: Annotated[
        str | None,
        Help("what the columns of a CSV log are: FILE.yaml or a name; default: one that fits"),
    ] = None,
    out: Annotated[str | None, Help("FILE.yaml to write; default: NAME.yaml")] = None,
    yes: Annotated[
        bool,
        Switch(
            "write the vehicle although it predicts the flights worse than constant velocity does"
        ),
    ] = False,
    runs_dir: RunsDir = "runs",
    json: Json = False,
) -> int:
    """Fit a vehicle to flight logs, each number with its 95 % interval.

    Logs: runs of quadsim, CSV, Betaflight's blackbox, PX4's .ulg, the
    Crazyflie's SD card. A comment of the file says what each number comes from,
    and NAME.png shows measured signals beside simulated ones.

    race fit last --mass .87 --name fitted

    race fit flight1.csv flight2.csv --test flight3.csv --mass .041 --name myquad

    race fly --vehicle myquad.yaml
    """
    if not logs:
        raise UsageError("expected one LOG or more, got none")
    file = file_of(name, out)
    picture = file.with_suffix(".png")
    for new in (file, picture):
        expect_new_file(new)
    expect_writable(file.parent)
    try:
        with settings_as_flags(), _logs_by_name(logs):
            found = fitted(
                [_place(log, runs_dir) for log in logs],
                test=[_place(log, runs_dir) for log in test or ()],
                name=name,
                mass=mass,
                arm=arm,
                like=like,
                mapping=mapping,
            )
    except ModuleNotFoundError as error:
        # A package that reads this kind of log
        raise UsageError(str(error)) from None
    if not json:
        emit(_table(found), "")
        if found.predictions:
            emit(_predictions(found), "")
        for remark in found.remarks:
            complain(remark)
    if found.doubt and not yes:
        raise UsageError(f"{found.doubt}: correct the log, or write the vehicle with --yes")
    # Imported here, so that --help does not load matplotlib
    from quadsim.figures.fit_figure import fit_figure
    from quadsim.figures.style import save_figure

    figure = fit_figure(found)
    found.to_yaml(file)
    save_figure(figure, picture)
    if json:
        emit_json({"file": str(file), "picture": str(picture), **loads(found.to_json())})
        return 0
    vehicle = found.vehicle
    emit(f"{escape(str(picture))}: measured and simulated")
    emit(f"{escape(str(file))}: {vehicle.mass:g} kg, {flying_numbers(vehicle).text()}")
    return 0


@contextmanager
def _logs_by_name(logs: Sequence[str]) -> Iterator[None]:
    """Convert an error in what was logged, which is no flag's, to a UsageError."""
    try:
        yield
    except SettingError as error:
        if error.name != "logs":
            raise
        raise UsageError(f"{', '.join(logs)}: {error.problem}") from None


def _place(log: str, runs_dir: str) -> Path:
    """Return the file of a log, or the folder of a stored run. Raises RunError."""
    path = Path(log)
    # The names of runs have no dots.
    if path.exists() or path.suffix or len(path.parts) > 1:
        return path
    return find_run(log, runs_dir)


def _table(found: VehicleFit) -> Table:
    """Return the fitted numbers with their intervals."""
    table = plain_table("number", "value", "from", "to", "unit", "source", left=(0, 4, 5))
    for number in found.numbers:
        limits = (f"{number.low:.4g}", f"{number.high:.4g}")
        interval = limits if number.source == "log" else ("", "")
        cells = (number.key, f"{number.value:.4g}", *interval, number.unit, number.source)
        table.add_row(*map(escape, cells))
    return table


def _predictions(found: VehicleFit) -> Table:
    """Return the errors of positions that are predicted open loop, from many begins in each log."""
    heads = ("after [s]", "measured attitude [m]", "simulated [m]", "constant velocity [m]")
    table = plain_table("log", *heads, left=(0,))
    for row in found.predictions:
        simulated = "" if row.simulated_attitude is None else f"{row.simulated_attitude:.3f}"
        table.add_row(
            escape(row.log),
            f"{row.seconds:g}",
            f"{row.measured_attitude:.3f}",
            simulated,
            f"{row.constant_velocity:.3f}",
        )
    return table
