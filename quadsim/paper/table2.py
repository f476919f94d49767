"""Table II: accumulated cost of the double integrator under six samplers, and under six that the
paper has not.

Figure 7: state, control and spectrum of the best run at sigma 1.5 of each of the paper's six.
"""

from __future__ import annotations

from itertools import product
from math import nan
from pathlib import Path

import numpy as np
from matplotlib import rc_context
from matplotlib.figure import Figure
from rich.table import Table

from quadsim.campaign.store import Row
from quadsim.campaign.variants import Variant
from quadsim.console import plain_table
from quadsim.course.point_goal import load_point_goal
from quadsim.figures.style import STYLE, line, write_figure
from quadsim.palette import MARK, dotted, style
from quadsim.paper.result import Result, flown, load_runs, write_csv
from quadsim.spec.spec import Spec

COURSE = "table2"
GOAL = load_point_goal(COURSE).goal[0]  # of either axis [m]
SIGMAS = (0.5, 1.5, 3.0)
CHOICES = {  # row -> settings of the flight; the first six are the paper's
    "gaussian": {"sampler": "gaussian"},
    "smooth": {"sampler": "smooth", "shift": "published"},
    "smooth_star": {"sampler": "smooth_star", "shift": "published"},
    "log_normal": {"sampler": "log_normal"},
    "colored_1": {"sampler": "colored", "gamma": (1.0, 1.0), "law": "library"},
    "colored_2": {"sampler": "colored", "gamma": (2.0, 2.0), "law": "library"},
    "colored_1_paper": {"sampler": "colored", "gamma": (1.0, 1.0), "law": "paper"},
    "colored_2_paper": {"sampler": "colored", "gamma": (2.0, 2.0), "law": "paper"},
    "colored_1_exact": {"sampler": "colored", "gamma": (1.0, 1.0), "law": "exact"},
    "colored_2_exact": {"sampler": "colored", "gamma": (2.0, 2.0), "law": "exact"},
    "smooth_corrected": {"sampler": "smooth", "shift": "corrected"},
    "smooth_star_corrected": {"sampler": "smooth_star", "shift": "corrected"},
}
# The published table: (sampler, sigma) -> accumulated cost, its standard deviation over 1000 runs,
# ms on an RTX 3080
TABLE2 = {
    ("gaussian", 0.5): (27919.0, 33.1, 0.259),
    ("smooth", 0.5): (61328.7, 1766.8, 0.296),
    ("smooth_star", 0.5): (21853.6, 19189.7, 0.295),
    ("log_normal", 0.5): (24545.3, 40.3, 0.297),
    ("colored_1", 0.5): (13569.7, 65.4, 0.379),
    ("colored_2", 0.5): (14201.7, 61.2, 0.379),
    ("gaussian", 1.5): (13815.5, 64.6, 0.259),
    ("smooth", 1.5): (44401.0, 3232.3, 0.293),
    ("smooth_star", 1.5): (11446.3, 71.1, 0.294),
    ("log_normal", 1.5): (7316.1, 324.5, 0.299),
    ("colored_1", 1.5): (10636.9, 74.4, 0.379),
    ("colored_2", 1.5): (11081.2, 75.6, 0.379),
    ("gaussian", 3.0): (10815.1, 75.7, 0.259),
    ("smooth", 3.0): (68088.2, 7521.7, 0.293),
    ("smooth_star", 3.0): (10505.5, 75.6, 0.294),
    ("log_normal", 3.0): (6963.5, 380.5, 0.307),
    ("colored_1", 3.0): (9191.7, 69.6, 0.380),
    ("colored_2", 3.0): (9700.0, 70.2, 0.380),
}
SIGMA = 1.5  # of the figure
LOOKS = {name: style(name) for name in ("gaussian", "smooth", "smooth_star", "log_normal")}
LOOKS |= {"colored_1": style("colored"), "colored_2": dotted(style("colored"))}
SPECTRUM = 2.0  # seconds of controls in the spectrum
# t [s], position [m] and control [m/s^2] of one axis
Track = tuple[np.ndarray, np.ndarray, np.ndarray]


def table2(runs: int, folder: Path, telemetry: bool = False) -> Result:
    """Thousands of runs, of which the table needs only the costs."""
    flown_cells = attempts(tuple(CHOICES), SIGMAS, runs, folder, telemetry)
    cells = [_cell(*cell, rows) for cell, rows in flown_cells.items()]
    return Result({"cells": cells}, (_table(cells),), (write_csv(folder / "table2.csv", cells),))


def double_integrator(runs: int, folder: Path, telemetry: bool = False) -> Result:
    best = {
        name: min(rows, key=_cost)
        for (name, _), rows in attempts(tuple(LOOKS), (SIGMA,), runs, folder, telemetry).items()
    }
    cells = [variant(name, SIGMA) for name in LOOKS]
    flights = load_runs(
        cells, {cell.name: [row] for cell, row in zip(cells, best.values(), strict=True)}, folder
    )
    columns = {name: run.telemetry for name, (run,) in zip(LOOKS, flights.values(), strict=True)}
    tracks = {name: (x["t"], x["px"], x["ax_cmd"]) for name, x in columns.items()}
    numbers = {
        name: {"seed": row.seed, "cost": _cost(row)} | _summary(*tracks[name])
        for name, row in best.items()
    }
    rows = [
        {"sampler": name, "t": t, "p": p, "u": u}
        for name, track in tracks.items()
        for t, p, u in zip(*(column.tolist() for column in track), strict=True)
    ]
    files = (
        write_csv(folder / "double_integrator.csv", rows),
        *write_figure(draw(tracks), folder, "double_integrator"),
    )
    return Result(numbers, (), files)


def attempts(
    names: tuple[str, ...], sigmas: tuple[float, ...], runs: int, folder: Path, telemetry: bool
) -> dict[tuple[str, float], list[Row]]:
    """(row of the table, sigma) -> attempts by seed."""
    cells = [(name, sigma) for sigma, name in product(sigmas, names)]
    rows = flown([variant(*cell) for cell in cells], runs, folder, telemetry).values()
    return dict(zip(cells, rows, strict=True))


def variant(name: str, sigma: float) -> Variant:
    return Variant(
        f"{name} sigma {sigma:g}", Spec.of(COURSE, sigma=(sigma, sigma), **CHOICES[name])
    )


def _cost(row: Row) -> float:
    """nan where the attempt has none."""
    return nan if (cost := row.result.get("cost")) is None else cost


def _cell(name: str, sigma: float, rows: list[Row]) -> dict:
    """One row of the report; what the paper does not have is None.

    ms: of a control step, one thread, every core busy; paper_ms: on an RTX 3080.
    """
    cost = np.array([_cost(r) for r in rows])
    paper_mean, paper_sd, paper_ms = TABLE2.get((name, sigma), (None, None, None))
    return {
        "sampler": name,
        "sigma": sigma,
        "runs": len(cost),
        "mean": float(cost.mean()),
        "sd": float(cost.std(ddof=1)) if len(cost) > 1 else 0.0,
        "paper_mean": paper_mean,
        "paper_sd": paper_sd,
        "ms": float(np.median([r.result["plan_ms"]["p50"] for r in rows])),
        "paper_ms": paper_ms,
    }


def _table(cells: list[dict]) -> Table:
    table = plain_table("sigma", "sampler", "ours", "sd", "paper", "sd", "off", "ms", left=(1,))
    for c in cells:
        paper = ("", "", "")
        if c["paper_mean"] is not None:
            off = 100 * (c["mean"] / c["paper_mean"] - 1)
            paper = f"{c['paper_mean']:.0f}", f"{c['paper_sd']:.0f}", f"{off:+.1f} %"
        ours = f"{c['mean']:.0f}", f"{c['sd']:.0f}"
        table.add_row(f"{c['sigma']:g}", c["sampler"], *ours, *paper, f"{c['ms']:.2f}")
    return table


def psd(t: np.ndarray, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """One-sided periodogram of the first SPECTRUM seconds: f [Hz], power per Hz."""
    dt = float(t[1] - t[0])
    u = u[: round(SPECTRUM / dt)]
    power = 2 * dt / len(u) * np.abs(np.fft.rfft(u)) ** 2
    return np.fft.rfftfreq(len(u), dt), power


def _summary(t: np.ndarray, p: np.ndarray, u: np.ndarray) -> dict:
    """When the axis is within .25 m of the goal for good [s]; largest control; control at rest;
    power above 20 Hz."""
    away = np.flatnonzero(abs(p - GOAL) > 0.25)
    settled = away[-1] + 1 if len(away) else len(t)
    f, power = psd(t, u)
    return {
        "settled": float(t[settled]) if settled < len(t) else None,
        "largest_control": float(abs(u).max()),
        "control_at_rest": float(u[-round(1.0 / (t[1] - t[0])) :].std()),
        "power_above_20_hz": float(power[f > 20.0].sum() * f[1]),
    }


def draw(tracks: dict[str, Track]) -> Figure:
    with rc_context(STYLE):
        figure = Figure(figsize=(14, 4.4), dpi=110, layout="constrained")
        state, control, spectrum = figure.subplots(1, 3)
        for name, (t, p, u) in tracks.items():
            look = line(LOOKS[name])
            state.plot(t, p, **look, label=name, linewidth=1.3)
            control.plot(t, u, **look, linewidth=0.9)
            f, power = psd(t, u)
            spectrum.loglog(f[1:], power[1:], **look, linewidth=1.0)
        state.axhline(GOAL, color=MARK, linestyle="--", linewidth=0.8)
        state.set(title="position of one axis [m]", xlabel="t [s]")
        control.set(title="control [m/s$^2$]", xlabel="t [s]")
        control.set_yscale("symlog", linthresh=5.0)
        spectrum.set(title=f"control's spectrum, first {SPECTRUM:g} s", xlabel="f [Hz]")
        state.legend(loc="lower right")
    return figure
