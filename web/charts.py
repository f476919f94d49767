"""Curves over time, place and frequency. Every array keeps its length from one picture to the next."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import viser
from viser import uplot

from quadsim.palette import style
from quadsim.record.metrics import motor_corner, motor_tau, thrust_psd
from web.competitor import Competitor, lap_starts
from web.lap_timing import LapTiming
from web.progress import gap

WINDOW, POINTS = 6.0, 240  # seconds and points of the signals
RECENT = 1000  # frames that surely reach over the window
PLACES = 300
FREQUENCIES = np.geomspace(0.4, 50.0, 120)  # [Hz]
FEWEST = 32  # frames that a spectrum is worth
GREY = "#8b93a1"

Curve = Callable[[Competitor], np.ndarray]  # (frames,)
SPEED: Curve = lambda competitor: np.sqrt(sum(competitor.x[k] ** 2 for k in ("vx", "vy", "vz")))  # noqa: E731
SIGNALS: tuple[tuple[str, tuple[tuple[str, Curve, float], ...]], ...] = (  # title, (label, curve, line width)
    (
        "thrust [m/s²], thin: commanded, thick: delivered",
        (
            ("commanded", lambda competitor: competitor.x["a_cmd"], 0.7),
            ("delivered", lambda competitor: competitor.x["a"], 1.8),
        ),
    ),
    ("speed [m/s]", (("", SPEED, 1.6),)),
    ("roll rate [rad/s]", (("", lambda competitor: competitor.x["wx"], 1.3),)),
    ("pitch rate [rad/s]", (("", lambda competitor: competitor.x["wy"], 1.3),)),
    ("yaw rate [rad/s]", (("", lambda competitor: competitor.x["wz"], 1.3),)),
)


class Signals:
    """The last seconds of every competitor."""

    def __init__(self, gui: viser.GuiApi, competitors: Sequence[Competitor]):
        self._charts = []
        for title, curves in SIGNALS:
            lines = [
                (f"{competitor.name} {label}".strip(), competitor, width)
                for competitor in competitors
                for label, _, width in curves
            ]
            height = 150 if title.startswith("thrust") else 105
            self._charts.append(_chart(gui, title, "t [s]", np.linspace(0.0, WINDOW, POINTS), lines, height))

    def update(self, all_: Sequence[LapTiming]) -> None:
        now = max(float(s.competitor.t[s.i]) for s in all_)
        t = np.linspace(max(now - WINDOW, 0.0), max(now, WINDOW), POINTS)
        for chart, (_, curves) in zip(self._charts, SIGNALS, strict=True):
            rows = [_over(t, s, curve) for s in all_ for _, curve, _ in curves]
            chart.data = (t, *rows)


def _over(t: np.ndarray, s: LapTiming, curve: Curve) -> np.ndarray:
    """A curve of a competitor at these times; nan, a gap, before its start and after where it stands."""
    rows = slice(max(s.i - RECENT, 0), s.i + 1)
    recent = replace(s.competitor, x={name: column[rows] for name, column in s.competitor.x.items()})
    return np.interp(t, recent.t, curve(recent), left=np.nan, right=np.nan)


class Spectrum:
    """Welch's power spectral density of the commanded thrust, on log axes, with the motors' corner."""

    def __init__(self, gui: viser.GuiApi, competitors: Sequence[Competitor]):
        self._corner = motor_corner(motor_tau(competitors[0].spec["vehicle"]))
        f = np.sort(np.append(FREQUENCIES, [self._corner, self._corner]))
        lines = [(competitor.name, competitor, 1.8) for competitor in competitors]
        title = f"thrust commanded, PSD [10⁻³ (m/s²)²/Hz]; motors' corner {self._corner:.1f} Hz"
        self._chart = _chart(gui, title, "f [Hz]", f, lines, 250, log=True, extra=("motors' corner",))
        self._f = f

    def update(self, all_: Sequence[LapTiming]) -> None:
        rows = [psd(s.competitor, self._f) for s in all_]
        seen = np.concatenate(rows)[np.isfinite(np.concatenate(rows))]
        if len(seen):
            line = np.full(len(self._f), np.nan)
            line[self._f == self._corner] = seen.min(), seen.max()
            self._chart.data = (self._f, *rows, line)


def psd(competitor: Competitor, f: np.ndarray) -> np.ndarray:
    """[1e-3 (m/s^2)^2/Hz] at these frequencies [Hz], between the bins of the estimate; nan beyond them."""
    if len(competitor.t) < FEWEST:
        return np.full(len(f), np.nan)
    bins, power = thrust_psd(competitor.t, competitor.x["a_cmd"])
    curve = np.log(np.maximum(1e3 * power[1:], 1e-3))
    return np.exp(np.interp(np.log(f), np.log(bins[1:]), curve, left=np.nan, right=np.nan))


class Gaps:
    """Seconds behind at the same place: behind the first competitor over the race, behind the best lap of all in this lap."""

    def __init__(self, gui: viser.GuiApi, competitors: Sequence[Competitor]):
        legs = competitors[0].legs
        self._race = np.linspace(0.0, legs.length, PLACES)
        self._lap = np.linspace(0.0, float(np.diff(legs.lap_ends, prepend=0.0)[-1]), PLACES)
        lines = [(competitor.name, competitor, 1.8) for competitor in competitors]
        first = f"gap to {competitors[0].name} [s]; above 0: behind"
        self._over_lap = _chart(gui, "this lap against the best lap of all [s]", "place [m]", self._lap, lines, 170)
        self._over_race = _chart(gui, first, "place [m]", self._race, lines, 170)

    def update(self, all_: Sequence[LapTiming]) -> None:
        flights = [(s.competitor.t[: s.i + 1], s.competitor.progress[: s.i + 1]) for s in all_]
        self._over_race.data = (self._race, *(gap(self._race, f, flights[0]) for f in flights))
        best = best_lap([s.competitor for s in all_])
        if best is not None:
            laps = [lap_of(s.competitor, s.lap - 1, s.i) for s in all_]
            self._over_lap.data = (self._lap, *(gap(self._lap, lap, best) for lap in laps))


def best_lap(competitors: Sequence[Competitor]) -> tuple[np.ndarray, np.ndarray] | None:
    """(t, progress) of the fastest lap, both from its beginning."""
    fastest = min(
        ((t, k, n) for n, competitor in enumerate(competitors) for k, t in enumerate(competitor.laps)), default=None
    )
    return None if fastest is None else lap_of(competitors[fastest[2]], fastest[1])


def lap_of(competitor: Competitor, k: int, until: int | None = None) -> tuple[np.ndarray, np.ndarray]:
    """(t, progress) of lap k, 0-based, both from its beginning; until: its last frame."""
    starts, ends = lap_starts(competitor), [0.0, *competitor.legs.lap_ends]
    t0, t1 = starts[k], starts[k + 1] if k + 1 < len(starts) else float(competitor.t[-1])
    rows = np.flatnonzero((competitor.t >= t0 - 0.02) & (competitor.t <= t1 + 0.02))
    rows = rows if until is None else rows[rows <= until]
    return competitor.t[rows] - t0, competitor.progress[rows] - ends[k]


def _chart(
    gui: viser.GuiApi,
    title: str,
    x_label: str,
    x: np.ndarray,
    lines: Sequence[tuple[str, Competitor, float]],
    height: int,
    log: bool = False,
    extra: tuple[str, ...] = (),
) -> viser.GuiUplotHandle:
    series = [uplot.Series(label=x_label)]
    for label, competitor, width in lines:
        s = style(competitor.sampler)
        series.append(uplot.Series(label=label, stroke=s.colour, width=width, dash=s.dash))
    series += [uplot.Series(label=label, stroke=GREY, width=1.2, dash=(3, 3)) for label in extra]
    scale = uplot.Scale(time=False, distr=3) if log else uplot.Scale(time=False)
    axis = {"stroke": GREY, "grid": {"stroke": "#2c3038", "width": 1}, "ticks": {"stroke": "#2c3038"}, "size": 34}
    return gui.add_uplot(
        data=(x, *(np.full(len(x), np.nan) for _ in series[1:])),
        series=tuple(series),
        title=title,
        scales={"x": scale, "y": uplot.Scale(distr=3) if log else uplot.Scale(auto=True)},
        axes=(uplot.Axis(**axis), uplot.Axis(**{**axis, "size": 46})),
        legend=uplot.Legend(show=False),
        padding=(10, 18, 0, 0),
        height=height,
    )
