"""Curves over time, place and frequency. Every array keeps its length from one picture to the next."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import viser
from viser import uplot

from quadsim.metrics import motor_corner, motor_tau, thrust_psd
from quadsim.palette import style
from web.lane import Lane, lap_starts
from web.progress import gap
from web.standing import Standing

WINDOW, POINTS = 6.0, 240  # seconds and points of the signals
PLACES = 300
FREQUENCIES = np.geomspace(0.4, 50.0, 120)  # [Hz]
FEWEST = 32  # frames that a spectrum is worth
GREY = "#8b93a1"

Curve = Callable[[Lane], np.ndarray]  # (frames,)
SPEED: Curve = lambda lane: np.sqrt(sum(lane.x[k] ** 2 for k in ("vx", "vy", "vz")))  # noqa: E731
SIGNALS: tuple[tuple[str, tuple[tuple[str, Curve, float], ...]], ...] = (  # title, (label, curve, line width)
    (
        "thrust [m/s²], thin: commanded, thick: delivered",
        (("commanded", lambda lane: lane.x["a_cmd"], 0.7), ("delivered", lambda lane: lane.x["a"], 1.8)),
    ),
    ("speed [m/s]", (("", SPEED, 1.6),)),
    ("roll rate [rad/s]", (("", lambda lane: lane.x["wx"], 1.3),)),
    ("pitch rate [rad/s]", (("", lambda lane: lane.x["wy"], 1.3),)),
    ("yaw rate [rad/s]", (("", lambda lane: lane.x["wz"], 1.3),)),
)


class Signals:
    """The last seconds of every lane."""

    def __init__(self, gui: viser.GuiApi, lanes: Sequence[Lane]):
        self._charts = []
        for title, curves in SIGNALS:
            lines = [(f"{lane.name} {label}".strip(), lane, width) for lane in lanes for label, _, width in curves]
            height = 150 if title.startswith("thrust") else 105
            self._charts.append(_chart(gui, title, "t [s]", np.linspace(0.0, WINDOW, POINTS), lines, height))

    def update(self, all_: Sequence[Standing]) -> None:
        now = max(float(s.lane.t[s.i]) for s in all_)
        t = np.linspace(max(now - WINDOW, 0.0), max(now, WINDOW), POINTS)
        for chart, (_, curves) in zip(self._charts, SIGNALS, strict=True):
            rows = [_over(t, s, curve) for s in all_ for _, curve, _ in curves]
            chart.data = (t, *rows)


def _over(t: np.ndarray, s: Standing, curve: Curve) -> np.ndarray:
    """A curve of a lane at these times; nan, a gap, before its start and after now. For lanes shown at another
    place than their own time, the time of the first lane."""
    rows = slice(max(s.i - 1000, 0), s.i + 1)
    shift = 0.0
    return np.interp(t, s.lane.t[rows] + shift, curve(_cut(s.lane, rows)), left=np.nan, right=np.nan)


def _cut(lane: Lane, rows: slice) -> Lane:
    from dataclasses import replace

    return replace(lane, x={k: v[rows] for k, v in lane.x.items()})


class Spectrum:
    """Welch's power spectral density of the commanded thrust, on log axes, with the motors' corner."""

    def __init__(self, gui: viser.GuiApi, lanes: Sequence[Lane]):
        self._corner = motor_corner(motor_tau(lanes[0].spec["vehicle"]))
        f = np.sort(np.append(FREQUENCIES, [self._corner, self._corner]))
        lines = [(lane.name, lane, 1.8) for lane in lanes]
        title = f"thrust commanded, PSD [(m/s²)²/Hz]; motors' corner {self._corner:.1f} Hz"
        self._chart = _chart(gui, title, "f [Hz]", f, lines, 250, log=True, extra=("motors' corner",))
        self._f = f

    def update(self, all_: Sequence[Standing]) -> None:
        rows = [psd(s.lane, self._f) for s in all_]
        seen = np.concatenate(rows)[np.isfinite(np.concatenate(rows))]
        if len(seen):
            line = np.full(len(self._f), np.nan)
            line[self._f == self._corner] = seen.min(), seen.max()
            self._chart.data = (self._f, *rows, line)


def psd(lane: Lane, f: np.ndarray) -> np.ndarray:
    """At these frequencies [Hz], between the bins of the estimate; nan beyond them."""
    if len(lane.t) < FEWEST:
        return np.full(len(f), np.nan)
    bins, power = thrust_psd(lane.t, lane.x["a_cmd"])
    curve = np.log(np.maximum(power[1:], 1e-9))
    return np.exp(np.interp(np.log(f), np.log(bins[1:]), curve, left=np.nan, right=np.nan))


class Gaps:
    """Seconds behind the first lane at the same place: over the race, and best lap against best lap."""

    def __init__(self, gui: viser.GuiApi, lanes: Sequence[Lane]):
        legs = lanes[0].legs
        self._race = np.linspace(0.0, legs.length, PLACES)
        self._lap = np.linspace(0.0, float(np.diff(legs.lap_ends, prepend=0.0)[-1]), PLACES)
        lines = [(lane.name, lane, 1.8) for lane in lanes]
        first = lanes[0].name
        self._over_race = _chart(gui, f"gap to {first} [s]; above 0: behind", "place [m]", self._race, lines, 190)
        self._over_lap = _chart(gui, "best lap against its best lap [s]", "place in the lap [m]", self._lap, lines, 190)

    def update(self, all_: Sequence[Standing]) -> None:
        flights = [(s.lane.t[: s.i + 1], s.lane.progress[: s.i + 1]) for s in all_]
        self._over_race.data = (self._race, *(gap(self._race, f, flights[0]) for f in flights))
        best = [best_lap(s.lane) for s in all_]
        none = np.full(PLACES, np.nan)
        rows = [gap(self._lap, b, best[0]) if b and best[0] else none for b in best]
        self._over_lap.data = (self._lap, *rows)


def best_lap(lane: Lane) -> tuple[np.ndarray, np.ndarray] | None:
    """(t, progress) of the fastest lap, both from its beginning."""
    if not lane.laps:
        return None
    k = int(np.argmin(lane.laps))
    ends = [0.0, *lane.legs.lap_ends]
    t0 = lap_starts(lane)[k]
    rows = (lane.t >= t0 - 0.02) & (lane.t <= t0 + lane.laps[k] + 0.02)
    return lane.t[rows] - t0, lane.progress[rows] - ends[k]


def _chart(
    gui: viser.GuiApi,
    title: str,
    x_label: str,
    x: np.ndarray,
    lines: Sequence[tuple[str, Lane, float]],
    height: int,
    log: bool = False,
    extra: tuple[str, ...] = (),
) -> viser.GuiUplotHandle:
    series = [uplot.Series(label=x_label)]
    for label, lane, width in lines:
        s = style(lane.sampler)
        series.append(uplot.Series(label=label, stroke=s.colour, width=width, dash=list(s.dash)))
    series += [uplot.Series(label=label, stroke=GREY, width=1.2, dash=[3, 3]) for label in extra]
    scale = uplot.Scale(time=False, distr=3) if log else uplot.Scale(time=False)
    axis = {"stroke": GREY, "grid": {"stroke": "#2c3038", "width": 1}, "ticks": {"stroke": "#2c3038"}, "size": 34}
    return gui.add_uplot(
        data=(x, *(np.full(len(x), np.nan) for _ in series[1:])),
        series=tuple(series),
        title=title,
        scales={"x": scale, "y": uplot.Scale(distr=3) if log else uplot.Scale(auto=True)},
        axes=(uplot.Axis(**axis), uplot.Axis(**{**axis, "size": 46})),
        legend=uplot.Legend(show=False),
        height=height,
    )
