"""Table I, off-road rows, in simulation: who gets through the corridor, how fast; two figures."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

from quadsim.app.figures.style import STYLE, line, write_figure
from quadsim.app.paper.gather import gather
from quadsim.app.paper.result import Result, write_csv
from quadsim.app.paper.variants import VARIANTS, variant_stats, variant_table
from quadsim.app.paper.vehicle import COLUMNS, CORRIDOR, Drive, record
from quadsim.course.corridor import load_corridor
from quadsim.palette import HIT, INK, LIMIT, style

DRIVES = {  # variant -> its attempts by seed; the last, a quarter of them, asks whether the temperature holds it back
    "gaussian": lambda seed: Drive("gaussian", seed),
    "colored": lambda seed: Drive("colored", seed),
    "gaussian_cold": lambda seed: Drive("gaussian", seed, temperature=0.02),
}
RUNS = 20
SHOWN = 8.0  # seconds of controls, as in the paper


def run(runs: int, folder: Path) -> Result:
    counts = {name: runs if name in VARIANTS else -(-runs // 4) for name in DRIVES}
    drives = {name: [drive(seed) for seed in range(counts[name])] for name, drive in DRIVES.items()}
    in_turn = sorted((d for variant in drives.values() for d in variant), key=lambda d: d.seed)
    made = gather({d.key: d for d in in_turn}, record, folder / "offroad.jsonl")
    records = {name: [made[d.key] for d in variant] for name, variant in drives.items()}
    rows = [variant_stats("offroad", name, variant) | _ends(variant) for name, variant in records.items()]
    files = (write_csv(folder / "offroad.csv", rows), *_pictures(records, folder))
    return Result({"variants": rows}, (variant_table(rows, {"legs": "mean_legs"}),), files)


def _ends(records: list[dict]) -> dict:
    """How many legs were driven to their end line, and how attempts ended that did not finish."""
    outcomes = [r["outcome"] for r in records]
    ended = {outcome: outcomes.count(outcome) for outcome in ("crashed", "stuck", "timeout")}
    return {"mean_legs": float(np.mean([r["legs"] for r in records]))} | ended


def _pictures(records: dict[str, list[dict]], folder: Path) -> tuple[Path, ...]:
    with rc_context(STYLE):
        paths = Figure(figsize=(13, 5), dpi=110, layout="constrained")
        for axes, (name, variant) in zip(paths.subplots(1, len(records), sharey=True), records.items(), strict=True):
            lines = draw_paths(axes, variant)
            axes.set_title(
                f"{name}: {sum(r['outcome'] == 'finished' for r in variant)} of {len(variant)} reach the goal"
            )
        paths.colorbar(lines, ax=paths.axes, label="t [s]", pad=0.01)
        controls = Figure(figsize=(9, 5), dpi=110, layout="constrained")
        rows = controls.subplots(2, 1, sharex=True)
        for name in VARIANTS:
            draw_controls(rows, name, records[name][0])
        rows[0].legend(loc="lower right", ncols=2)
    csvs = [_csv(folder, name, variant) for name, variant in records.items()]
    return *write_figure(paths, folder, "offroad_paths"), *write_figure(controls, folder, "offroad_controls"), *csvs


def draw_paths(axes: Axes, records: list[dict]) -> LineCollection:
    """Every attempt, coloured by the time since its start; a cross where one ended before the goal."""
    corridor = load_corridor(CORRIDOR)
    for wall in corridor.walls():
        axes.plot(*wall.T, color=INK, linewidth=1.5)
    segments, times = [], []
    for r in records:
        rows = np.array(r["rows"])
        segments.append(np.stack([rows[:-1, 1:3], rows[1:, 1:3]], axis=1))
        times.append(rows[:-1, 0])
        if r["outcome"] != "finished":
            axes.plot(*rows[-1:, 1:3].T, "x", color=HIT, markersize=6, zorder=4)
    lines = LineCollection(list(np.concatenate(segments)), cmap="viridis", linewidths=1.1)
    lines.set_array(np.concatenate(times))
    lines.set_clim(0.0, 20.0)
    axes.add_collection(lines)
    axes.plot(*corridor.points[0], "o", color=INK, zorder=5)
    axes.set(aspect="equal", xlabel="x [m]", ylabel="y [m]")
    return lines


def draw_controls(rows: np.ndarray, name: str, record: dict) -> None:
    """Commands of the first seconds; throttle above zero, brake below."""
    x = dict(zip(COLUMNS, np.array(record["rows"]).T, strict=True))
    early = x["t"] <= SHOWN
    for axes, column, title in zip(rows, ("drive_cmd", "steer_cmd"), ("throttle and brake", "steering"), strict=True):
        axes.axhline(0.0, color=LIMIT, linewidth=0.8)
        axes.plot(x["t"][early], x[column][early], **line(style(name)), linewidth=1.1, label=name)
        axes.set(title=title, ylim=(-1.05, 1.05))
    rows[-1].set_xlabel("t [s]")


def _csv(folder: Path, name: str, records: list[dict]) -> Path:
    rows = [{"attempt": i} | dict(zip(COLUMNS, row, strict=True)) for i, r in enumerate(records) for row in r["rows"]]
    return write_csv(folder / f"offroad_{name}.csv", rows)
