"""Experiment for the quadrotor rows of Table I, on a different course, and Figure 6.

The attempts are ordinary flights, stored like the flights of a comparison.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure

from quadsim.campaign.run.attempt import fly_attempt
from quadsim.campaign.run.runner import Runner
from quadsim.campaign.run.store import AttemptRow
from quadsim.campaign.run.variants import Variant
from quadsim.config.spec import Spec
from quadsim.console import complain
from quadsim.course import load_course
from quadsim.course.opening import half_sizes
from quadsim.dynamics.quadrotor import CONTROL
from quadsim.figures.style import STYLE, write_figure
from quadsim.palette import INK, style
from quadsim.paper.result import Result, write_csv
from quadsim.paper.table1 import MotionAttempt, draw_paths, table1, table1_row
from quadsim.record.archive import read_run
from quadsim.record.run import RecordedRun, RunError
from quadsim.report.metrics import chatter

COURSE = "paper_flat"
SAMPLERS = ("gaussian", "colored")
FILE = "campaign.sqlite"
LAPS_SHOWN = 9  # number of paths in the figure, as in the paper
CSV_COLUMNS = ("t", "px", "py", "vx", "vy", *CONTROL)


def make(runs: int, folder: Path) -> Result:
    """Fly `runs` laps with each sampler."""
    variants = [
        Variant(sampler, Spec.of(COURSE, preset="paper", sampler=sampler)) for sampler in SAMPLERS
    ]
    rows = flown(variants, runs, folder)
    flights = {
        variant.name: [load_flight(row, variant.spec, folder) for row in rows[variant.name]]
        for variant in variants
    }
    table = [
        table1_row("quadrotor", name, [attempt(row) for row in rows[name]]) | mean_chatter(of_name)
        for name, of_name in flights.items()
    ]
    files = [
        write_csv(folder / "quadrotor.csv", table),
        *write_figure(draw_laps(flights), folder, "quadrotor_laps"),
    ]
    for name, of_name in flights.items():
        run = fastest(of_name)
        if run:
            files.append(write_csv(folder / f"quadrotor_{name}_fastest.csv", csv_rows(run)))
    return Result({"variants": table}, (table1(table, "TV", "thrust_tv"),), tuple(files))


def flown(variants: Sequence[Variant], runs: int, folder: Path) -> dict[str, list[AttemptRow]]:
    """Return the attempts of each variant by seed; missing attempts are flown.

    Raises:
        RunError: an attempt is lost, or the folder cannot be used.
        KeyboardInterrupt: finished attempts are kept.
    """
    path = folder / FILE
    with Runner(path) as runner:
        rows = runner(variants, runs)
    if any(len(of_variant) < runs for of_variant in rows):
        raise RunError(
            f"{path}: a worker process was lost twice; the same command continues from here"
        )
    return {variant.name: of_variant for variant, of_variant in zip(variants, rows, strict=True)}


def load_flight(row: AttemptRow, spec: Spec, folder: Path) -> RecordedRun:
    """Return an attempt with its telemetry, which is flown again if it is missing or damaged."""
    if row.folder:
        try:
            return read_run(folder / row.folder)
        except RunError as error:
            complain(f"{error}; flown again")
    run = fly_attempt(replace(spec, seed=row.seed)).run
    if run.digest() != row.result["digest"]:
        complain(
            f"{row.name} seed {row.seed}: flown again it is another flight,"
            " as the code or the machine is another"
        )
    return run


def attempt(row: AttemptRow) -> MotionAttempt:
    """Return the numbers of one attempt for Table I."""
    finished = row.outcome == "finished"
    return MotionAttempt(
        time=row.result["laps"][0] if finished else None,
        plan_ms=row.result["plan_ms"]["p50"],
    )


def mean_chatter(flights: Sequence[RecordedRun]) -> dict[str, float]:
    """Return the mean chatter of the commanded thrust.

    Returns:
        thrust_tv: total variation [m/s^2/s].
        high_frequency_fraction: share of the power above the motors' corner.
    """
    each = [chatter(run)["commanded"] for run in flights]
    keys = ("thrust_tv", "high_frequency_fraction")
    return {key: float(np.mean([commanded[key] for commanded in each])) for key in keys}


def finished(flights: Sequence[RecordedRun]) -> list[RecordedRun]:
    """Return the flights that finished."""
    return [run for run in flights if run.outcome == "finished"]


def fastest(flights: Sequence[RecordedRun]) -> RecordedRun | None:
    """Return the flight with the fastest lap; None if none has finished."""
    return min(finished(flights), key=lambda run: run.laps[0], default=None)


def csv_rows(run: RecordedRun) -> list[dict]:
    """Return the CSV_COLUMNS of the telemetry, a row for each control step, to five decimals."""
    columns = [run.telemetry[name].tolist() for name in CSV_COLUMNS]
    return [
        {name: round(number, 5) for name, number in zip(CSV_COLUMNS, numbers, strict=True)}
        for numbers in zip(*columns, strict=True)
    ]


def draw_laps(flights: Mapping[str, Sequence[RecordedRun]]) -> Figure:
    """Return a figure of each sampler's first finished laps and controls of the fastest lap."""
    with rc_context(STYLE):
        figure = Figure(figsize=(12, 8), dpi=110, layout="constrained")
        parts = figure.subfigures(len(flights), 1, squeeze=False)[:, 0]
        for part, (name, of_sampler) in zip(parts, flights.items(), strict=True):
            left, right = part.subfigures(1, 2, width_ratios=(1.5, 1))
            _draw_first_laps(left, name, of_sampler)
            run = fastest(of_sampler)
            if run:
                _draw_controls(right.subplots(4, 1, sharex=True), name, run)
    return figure


def _draw_first_laps(part: SubFigure, sampler: str, flights: Sequence[RecordedRun]) -> None:
    """Draw the paths of the first laps, coloured by ground speed, and the gates."""
    axes = part.subplots()
    laps = finished(flights)[:LAPS_SHOWN]
    paths = [np.column_stack([run.telemetry["px"], run.telemetry["py"]]) for run in laps]
    speeds = [np.hypot(run.telemetry["vx"], run.telemetry["vy"]) for run in laps]
    lines = draw_paths(axes, paths, speeds, "plasma", top=12.0)
    part.colorbar(lines, ax=axes, label="ground speed [m/s]", pad=0.01, shrink=0.6)
    axes.set_title(f"{sampler}: first {len(laps)} laps that finished, of {len(flights)} attempts")
    for gate in load_course(COURSE).gates:
        half = half_sizes(gate.opening).left * gate.rotation[:2, 1]
        ends = np.array([gate.position[:2] - half, gate.position[:2] + half])
        axes.plot(*ends.T, color=INK, linewidth=3.0)
    axes.margins(0.03)


def _draw_controls(rows: Sequence[Axes], sampler: str, run: RecordedRun) -> None:
    """Draw the controls of one lap, a row for each."""
    names = ("roll [rad/s]", "pitch [rad/s]", "yaw [rad/s]", "thrust [m/s$^2$]")
    colour = style(sampler).colour
    for axes, column, name in zip(rows, CONTROL, names, strict=True):
        axes.step(
            run.telemetry["t"], run.telemetry[column], where="post", color=colour, linewidth=0.9
        )
        axes.set_ylabel(name)
    rows[0].set_title(f"controls of the fastest lap, {run.laps[0]:.2f} s")
    rows[-1].set_xlabel("t [s]")
