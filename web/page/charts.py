"""Curves over time, place and frequency. Every array keeps its length from one update to the
next."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np
import viser
from viser import uplot

from quadsim.record.metrics import motor_corner, motor_tau, thrust_psd
from web.competitor import Competitor
from web.lap_timing import LapTiming, best_lap, gap, lap_of
from web.page.html import DIM, TRACK

TABS = ("Signals", "Spectrum", "Gap")
# seconds of the signals, how many of them are to come, points
WINDOW, AHEAD, POINTS = 6.0, 2.0, 240
RECENT = 1000  # frames: more than the window holds
PLACES = 300
FREQUENCIES = np.geomspace(0.4, 50.0, 120)  # [Hz]
FEWEST = 32  # frames that a spectrum needs
SPEED = "speed"
SIGNALS = {  # title -> (label, column of the telemetry or SPEED, line width)
    "thrust [m/s²], thin: commanded, thick: delivered": (
        ("commanded", "a_cmd", 0.7),
        ("delivered", "a", 1.8),
    ),
    "roll rate [rad/s]": (("commanded", "wx_cmd", 0.6), ("delivered", "wx", 1.6)),
    "pitch rate [rad/s]": (("commanded", "wy_cmd", 0.6), ("delivered", "wy", 1.6)),
    "yaw rate [rad/s]": (("commanded", "wz_cmd", 0.6), ("delivered", "wz", 1.6)),
    "speed [m/s]": (("", SPEED, 1.6),),
}
Tabs = Mapping[str, viser.GuiTabHandle]  # one for each of TABS


def put_away_charts(tabs: Tabs) -> None:
    """Hide those of the last race, remove those of the one before, whose last curves have arrived
    by now: a slow page gets many messages at once and looks for what it is to change only after it
    has removed what it is to remove.
    """
    for tab in tabs.values():
        for handle in [h for h in tab._children.values() if isinstance(h, viser.GuiUplotHandle)]:
            if handle.visible:
                handle.visible = False
            else:
                handle.remove()


class Charts:
    """All of one race. Where the pointer is, the legend below a chart shows the values."""

    def __init__(self, gui: viser.GuiApi, tabs: Tabs, entries: Sequence[Competitor]):
        lines, legs = [_line(e, e.name) for e in entries], entries[0].legs
        window = np.linspace(0.0, WINDOW, POINTS)
        self._signals = []
        with tabs["Signals"]:
            for title, curves in SIGNALS.items():
                drawn = [
                    _line(e, f"{e.name} {label}".strip(), width)
                    for e in entries
                    for label, _, width in curves
                ]
                height = 140 if title.startswith("thrust") else 100
                self._signals.append(
                    _chart(gui, title, "t [s]", window, [*drawn, _mark("now")], height)
                )
        self._corner = motor_corner(motor_tau(entries[0].spec["vehicle"]))
        with tabs["Spectrum"]:
            title = f"thrust PSD [10⁻³ (m/s²)²/Hz]; dashed: motors' corner {self._corner:.1f} Hz"
            self._spectrum = _chart(
                gui, title, "f [Hz]", FREQUENCIES, [*lines, _mark("corner")], 250, log=True
            )
        self._race = np.linspace(0.0, legs.length, PLACES)
        self._lap = np.linspace(0.0, float(np.diff(legs.lap_ends, prepend=0.0)[-1]), PLACES)
        with tabs["Gap"]:
            title = "this lap against the best lap of all [s]"
            self._lap_gap = _chart(gui, title, "place [m]", self._lap, [*lines, _mark("here")], 160)
            title = f"gap to {entries[0].name} [s]; above 0: behind"
            self._race_gap = _chart(
                gui, title, "place [m]", self._race, [*lines, _mark("here")], 160
            )

    def update_signals(self, timings: Sequence[LapTiming]) -> None:
        """The last seconds of every competitor; of flights that have ended also the next ones."""
        now = max(s.t for s in timings)
        ahead = AHEAD if all(s.entry.outcome for s in timings) else 0.0
        end = max(now + ahead, WINDOW)
        t = np.linspace(end - WINDOW, end, POINTS)
        for chart, curves in zip(self._signals, SIGNALS.values(), strict=True):
            chart.data = marked(
                t,
                now,
                lambda t, shown=curves: [
                    _curve(t, s, column, ahead) for s in timings for _, column, _ in shown
                ],
            )

    def update_spectrum(self, timings: Sequence[LapTiming]) -> None:
        """Welch's power spectral density of the commanded thrust so far, on log axes, with the
        motors' corner."""
        data = marked(
            FREQUENCIES, self._corner, lambda f: [psd(s.entry.until(s.t), f) for s in timings]
        )
        if np.isfinite(data[1:-1]).any():
            self._spectrum.data = data

    def update_gaps(self, timings: Sequence[LapTiming]) -> None:
        """Seconds behind at the same place: this lap behind the best of all, the race behind the
        first competitor."""
        flights, first = (
            [(s.entry.t[: s.i + 1], s.entry.progress[: s.i + 1]) for s in timings],
            timings[0],
        )
        self._race_gap.data = marked(
            self._race, first.place, lambda at: [gap(at, f, flights[0]) for f in flights]
        )
        best = best_lap([s.entry for s in timings])
        if best is not None:
            laps = [lap_of(s.entry, s.lap - 1, s.i) for s in timings]
            here = first.place - [0.0, *first.entry.legs.lap_ends][first.lap - 1]
            self._lap_gap.data = marked(
                self._lap, here, lambda at: [gap(at, lap, best) for lap in laps]
            )


def marked(
    x: np.ndarray, at: float, curves: Callable[[np.ndarray], list[np.ndarray]]
) -> tuple[np.ndarray, ...]:
    """x with `at` put in twice, the curves there, and 0, 1 at `at`: a vertical line on a scale of
    its own.  (n + 2,)"""
    x = np.sort(np.append(x, [at, at]))
    line, k = np.full(len(x), np.nan), int(np.searchsorted(x, at))
    line[k : k + 2] = 0.0, 1.0
    return x, *curves(x), line


def _curve(t: np.ndarray, s: LapTiming, column: str, ahead: float) -> np.ndarray:
    """At these times; nan, a gap in the line, before the flight and `ahead` [s] after its frame."""
    rows = slice(max(s.i - RECENT, 0), s.entry.at(s.t + ahead) + 1)
    values = s.entry.speed(rows) if column == SPEED else s.entry.x[column][rows]
    return np.interp(t, s.entry.t[rows], values, left=np.nan, right=np.nan)


def psd(entry: Competitor, f: np.ndarray) -> np.ndarray:
    """[1e-3 (m/s^2)^2/Hz] at these frequencies [Hz], interpolated between the bins of the estimate;
    nan beyond them."""
    if len(entry.t) < FEWEST:
        return np.full(len(f), np.nan)
    bins, power = thrust_psd(entry.t, entry.x["a_cmd"])
    curve = np.log(np.maximum(1e3 * power[1:], 1e-3))
    return np.exp(np.interp(np.log(f), np.log(bins[1:]), curve, left=np.nan, right=np.nan))


def _line(entry: Competitor, label: str, width: float = 1.8) -> uplot.Series:
    s = entry.style
    return uplot.Series(label=label, stroke=s.colour, width=width, dash=s.dash)


def _mark(label: str) -> uplot.Series:
    return uplot.Series(label=label, stroke=DIM, width=1.2, dash=(3, 3), scale="mark")


def _chart(
    gui: viser.GuiApi,
    title: str,
    x_label: str,
    x: np.ndarray,
    lines: list[uplot.Series],
    height: int,
    log: bool = False,
) -> viser.GuiUplotHandle:
    axis = {"stroke": DIM, "grid": {"stroke": TRACK, "width": 1}, "ticks": {"stroke": TRACK}}
    logarithmic: dict = {"distr": 3} if log else {}
    return gui.add_uplot(
        data=(x, *(np.full(len(x), np.nan) for _ in lines)),
        series=(uplot.Series(label=x_label), *lines),
        title=title,
        scales={
            "x": uplot.Scale(time=False, **logarithmic),
            "y": uplot.Scale(**(logarithmic or {"auto": True})),
            "mark": uplot.Scale(auto=False, range=(0.0, 1.0)),
        },
        axes=(uplot.Axis(**axis, size=34), uplot.Axis(**axis, size=78 if log else 46)),
        legend=uplot.Legend(show=True, live=True),
        cursor=uplot.Cursor(sync=uplot.Cursor_Sync(key=x_label)),
        padding=(10, 18, 0, 0),
        height=height,
    )
