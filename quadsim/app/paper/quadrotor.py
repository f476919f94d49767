"""Table I, quadrotor rows: the paper's settings on a course of ours; paths, fastest laps."""

from __future__ import annotations

from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

from quadsim.app.figures.style import STYLE, write_figure
from quadsim.app.flight_flags import FlightFlags
from quadsim.app.paper.gather import gather
from quadsim.app.paper.result import Result, write_csv
from quadsim.app.paper.store import run_key
from quadsim.app.paper.variants import VARIANTS, variant_stats, variant_table
from quadsim.course import load_course
from quadsim.palette import INK, style
from quadsim.race.build import build, launch
from quadsim.race.spec import Spec
from quadsim.record.metrics import chatter
from quadsim.record.run import Run, hostless
from quadsim.systems.quadrotor import CONTROL

RUNS = 20
LAPS_SHOWN = 9  # as in the paper
COLUMNS = ("t", "px", "py", "vx", "vy", *CONTROL)


@dataclass(frozen=True)
class Flight:
    """One attempt."""

    sampler: str
    seed: int

    @property
    def spec(self) -> Spec:
        flags = FlightFlags.defaults(("--preset", "paper", "--sampler", self.sampler))
        return replace(flags, course="paper_flat", seed=self.seed, threads=1).spec()

    @property
    def key(self) -> str:
        return run_key(hostless(self.spec.record()))


def record(flight: Flight) -> dict:
    """Outcome, time [s], thrust's total variation [m/s^2/s], and a row of COLUMNS for every control step."""
    spec = flight.spec
    plant, controller, referee = build(spec)
    with closing(plant):
        run = Run.from_frames(spec.record(), launch(spec, plant, controller, referee))
    x = run.telemetry
    rows = np.column_stack([x[name] for name in COLUMNS]).round(5).tolist()
    noise = chatter(run)["commanded"]
    end = run.laps[0] if run.laps else float(x["t"][-1])
    return {
        "outcome": run.outcome,
        "time": end,
        "thrust_tv": noise["thrust_tv"],
        "high_frequency_fraction": noise["high_frequency_fraction"],
        "ms": run.wall["plan_ms"]["p50"],
        "rows": rows,
    }


def run(runs: int, folder: Path) -> Result:
    flights = {name: [Flight(name, seed) for seed in range(runs)] for name in VARIANTS}
    keys = {name: [f.key for f in variant] for name, variant in flights.items()}
    jobs = {keys[name][i]: flights[name][i] for i in range(runs) for name in VARIANTS}  # seed by seed, for both alike
    made = gather(jobs, record, folder / "quadrotor.jsonl")
    records = {name: [made[key] for key in variant] for name, variant in keys.items()}
    rows = [variant_stats("quadrotor", name, variant) | _chatter(variant) for name, variant in records.items()]
    files = (write_csv(folder / "quadrotor.csv", rows), *_picture(records, folder))
    return Result({"variants": rows}, (variant_table(rows, {"TV": "thrust_tv"}),), files)


def _chatter(records: list[dict]) -> dict:
    keys = ("thrust_tv", "high_frequency_fraction")
    return {key: float(np.mean([r[key] for r in records])) for key in keys}


def _picture(records: dict[str, list[dict]], folder: Path) -> tuple[Path, ...]:
    csvs = []
    with rc_context(STYLE):
        figure = Figure(figsize=(12, 8), dpi=110, layout="constrained")
        parts = figure.subfigures(len(records), 1, squeeze=False)[:, 0]
        for part, (name, variant) in zip(parts, records.items(), strict=True):
            finished = [r for r in variant if r["outcome"] == "finished"][:LAPS_SHOWN]
            left, right = part.subfigures(1, 2, width_ratios=(1.5, 1))
            axes = left.subplots()
            left.colorbar(_draw_laps(axes, finished), ax=axes, label="ground speed [m/s]", pad=0.01, shrink=0.6)
            axes.set_title(f"{name}: first {len(finished)} laps that finished, of {len(variant)} attempts")
            if finished:
                fastest = min(finished, key=lambda r: r["time"])
                _draw_controls(right.subplots(4, 1, sharex=True), name, fastest)
                rows = [dict(zip(COLUMNS, row, strict=True)) for row in fastest["rows"]]
                csvs.append(write_csv(folder / f"quadrotor_{name}_fastest.csv", rows))
    return *write_figure(figure, folder, "quadrotor_laps"), *csvs


def _draw_laps(axes: Axes, records: list[dict]) -> LineCollection:
    rows = [np.array(r["rows"]) for r in records]
    segments = [np.stack([x[:-1, 1:3], x[1:, 1:3]], axis=1) for x in rows]
    speed = [np.hypot(x[:-1, 3], x[:-1, 4]) for x in rows]
    lines = LineCollection(list(np.concatenate(segments)) if segments else [], cmap="plasma", linewidths=1.1)
    lines.set_array(np.concatenate(speed) if speed else np.zeros(0))
    lines.set_clim(0.0, 12.0)
    axes.add_collection(lines)
    for gate in load_course("paper_flat").gates:
        half = gate.opening[0] / 2 * gate.rotation[:2, 1]
        axes.plot(*np.array([gate.position[:2] - half, gate.position[:2] + half]).T, color=INK, linewidth=3.0)
    axes.set(aspect="equal", xlabel="x [m]", ylabel="y [m]")
    axes.margins(0.03)
    return lines


def _draw_controls(rows: np.ndarray, sampler: str, record: dict) -> None:
    x = dict(zip(COLUMNS, np.array(record["rows"]).T, strict=True))
    names = ("roll [rad/s]", "pitch [rad/s]", "yaw [rad/s]", "thrust [m/s$^2$]")
    for axes, column, title in zip(rows, CONTROL, names, strict=True):
        axes.step(x["t"], x[column], where="post", color=style(sampler).colour, linewidth=0.9)
        axes.set_ylabel(title)
    rows[0].set_title(f"controls of the fastest lap, {record['time']:.2f} s")
    rows[-1].set_xlabel("t [s]")
