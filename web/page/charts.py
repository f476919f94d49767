"""Curves over time, place and frequency.

Every array keeps its length from one update to the next.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
import viser
from viser import uplot

from quadsim.record.metrics import motor_corner, motor_tau, thrust_psd
from web.competitor import Competitor
from web.lap_timing import LapTiming, Way, best_lap, gap, lap_of
from web.page.html import DIM, TRACK

TABS = ("Signals", "Spectrum", "Gap")
# the window of the signals: its length [s], how much of it is to come [s], points
WINDOW = 6.0
AHEAD = 2.0
POINTS = 240
RECENT = 1000  # frames: more than the window holds
PLACES = 300
FREQUENCIES = np.geomspace(0.4, 50.0, 120)  # [Hz]
FEWEST = 32  # frames that a spectrum needs
PSD_FLOOR = 1e-3  # [1e-3 (m/s^2)^2/Hz] below which nothing is drawn
SPEED = "speed"


class Signal(NamedTuple):
    """A curve of a chart."""

    label: str
    column: str  # of the telemetry, or SPEED
    width: float  # of the line [px]


class SignalChart(NamedTuple):
    """A chart of signals over time."""

    title: str
    height: int  # [px]
    signals: tuple[Signal, ...]


def _rate_chart(name: str, column: str) -> SignalChart:
    commanded = Signal("commanded", f"{column}_cmd", 0.6)
    return SignalChart(f"{name} [rad/s]", 100, (commanded, Signal("delivered", column, 1.6)))


SIGNAL_CHARTS = (
    SignalChart(
        "thrust [m/s²], thin: commanded, thick: delivered",
        140,
        (Signal("commanded", "a_cmd", 0.7), Signal("delivered", "a", 1.8)),
    ),
    _rate_chart("roll rate", "wx"),
    _rate_chart("pitch rate", "wy"),
    _rate_chart("yaw rate", "wz"),
    SignalChart("speed [m/s]", 100, (Signal("", SPEED, 1.6),)),
)
Tabs = Mapping[str, viser.GuiTabHandle]  # one for each of TABS


class Charts:
    """All charts of one race. Where the pointer is, the legend below a chart shows the values."""

    def __init__(self, gui: viser.GuiApi, tabs: Tabs, entries: Sequence[Competitor]):
        self._gui = gui
        self._all: list[viser.GuiUplotHandle] = []
        legs = entries[0].legs
        lines = [_line(entry, entry.name) for entry in entries]
        here = [*lines, _mark("here")]
        with tabs["Signals"]:
            self._signals = [self._add_signals(chart, entries) for chart in SIGNAL_CHARTS]
        self._corner = motor_corner(motor_tau(entries[0].spec["vehicle"]))
        with tabs["Spectrum"]:
            title = f"thrust PSD [10⁻³ (m/s²)²/Hz]; dashed: motors' corner {self._corner:.1f} Hz"
            curves = [*lines, _mark("corner")]
            self._spectrum = self._add(title, "f [Hz]", FREQUENCIES, curves, 250, log=True)
        self._race = np.linspace(0.0, legs.length, PLACES)
        last_lap = float(np.diff(legs.lap_ends, prepend=0.0)[-1])
        self._lap = np.linspace(0.0, last_lap, PLACES)
        with tabs["Gap"]:
            title = "this lap against the best lap of all [s]"
            self._lap_gap = self._add(title, "place [m]", self._lap, here, 160)
            title = f"gap to {entries[0].name} [s]; above 0: behind"
            self._race_gap = self._add(title, "place [m]", self._race, here, 160)

    def hide(self) -> None:
        """Hide every chart."""
        for chart in self._all:
            chart.visible = False

    def remove(self) -> None:
        """Remove every chart."""
        for chart in self._all:
            chart.remove()

    def update_signals(self, timings: Sequence[LapTiming]) -> None:
        """Show the last seconds of every competitor, and the next if all flights have ended."""
        now = max(s.t for s in timings)
        all_ended = all(s.entry.outcome for s in timings)
        ahead = AHEAD if all_ended else 0.0
        end = max(now + ahead, WINDOW)
        window = np.linspace(end - WINDOW, end, POINTS)
        t = with_mark(window, now)
        for handle, chart in zip(self._signals, SIGNAL_CHARTS, strict=True):
            curves = [
                _values(t, s, signal.column, ahead) for s in timings for signal in chart.signals
            ]
            handle.data = (t, *curves, mark_line(t, now))

    def update_spectrum(self, timings: Sequence[LapTiming]) -> None:
        """Show the power spectral density of the commanded thrust so far."""
        f = with_mark(FREQUENCIES, self._corner)
        curves = [psd(s.entry.until(s.t), f) for s in timings]
        if np.isfinite(curves).any():
            self._spectrum.data = (f, *curves, mark_line(f, self._corner))

    def update_gaps(self, timings: Sequence[LapTiming]) -> None:
        """Show the seconds behind at the same place.

        They are those of this lap behind the best of all, and of the race behind the first
        competitor.
        """
        first = timings[0]
        ways = [Way(s.entry.t[: s.i + 1], s.entry.progress[: s.i + 1]) for s in timings]
        place = with_mark(self._race, first.place)
        gaps = [gap(place, way, ways[0]) for way in ways]
        self._race_gap.data = (place, *gaps, mark_line(place, first.place))
        best = best_lap([s.entry for s in timings])
        if best is None:
            return
        laps = [lap_of(s.entry, s.lap - 1, s.i) for s in timings]
        here = first.place - [0.0, *first.entry.legs.lap_ends][first.lap - 1]
        place = with_mark(self._lap, here)
        gaps = [gap(place, lap, best) for lap in laps]
        self._lap_gap.data = (place, *gaps, mark_line(place, here))

    def _add_signals(
        self, chart: SignalChart, entries: Sequence[Competitor]
    ) -> viser.GuiUplotHandle:
        lines = [
            _line(entry, f"{entry.name} {signal.label}".strip(), signal.width)
            for entry in entries
            for signal in chart.signals
        ]
        window = np.linspace(0.0, WINDOW, POINTS)
        return self._add(chart.title, "t [s]", window, [*lines, _mark("now")], chart.height)

    def _add(
        self,
        title: str,
        x_label: str,
        x: np.ndarray,
        lines: list[uplot.Series],
        height: int,
        log: bool = False,
    ) -> viser.GuiUplotHandle:
        """Add a chart without values.

        Args:
            x: places of the points  (n,)
            lines: lines of the curves; the last one is the mark.
            height: [px]
            log: whether both axes are logarithmic.
        """
        axis = {"stroke": DIM, "grid": {"stroke": TRACK, "width": 1}, "ticks": {"stroke": TRACK}}
        x_scale = uplot.Scale(time=False, distr=3) if log else uplot.Scale(time=False)
        y_scale = uplot.Scale(distr=3) if log else uplot.Scale(auto=True)
        chart = self._gui.add_uplot(
            data=(x, *(np.full(len(x), np.nan) for _ in lines)),
            series=(uplot.Series(label=x_label), *lines),
            title=title,
            scales={
                "x": x_scale,
                "y": y_scale,
                "mark": uplot.Scale(auto=False, range=(0.0, 1.0)),
            },
            axes=(uplot.Axis(**axis, size=34), uplot.Axis(**axis, size=78 if log else 46)),
            legend=uplot.Legend(show=True, live=True),
            cursor=uplot.Cursor(sync=uplot.Cursor_Sync(key=x_label)),
            padding=(10, 18, 0, 0),
            height=height,
        )
        self._all.append(chart)
        return chart


def with_mark(x: np.ndarray, at: float) -> np.ndarray:
    """Return sorted values with `at` put in twice.  (n,) -> (n + 2,)"""
    return np.sort(np.append(x, [at, at]))


def mark_line(x: np.ndarray, at: float) -> np.ndarray:
    """Return a vertical line at `at`, on a scale from 0 to 1 of its own.

    Args:
        x: places that have `at` twice  (n,)

    Returns:
        0 and 1 at `at`, elsewhere nan  (n,)
    """
    line = np.full(len(x), np.nan)
    first = int(np.searchsorted(x, at))
    line[first : first + 2] = 0.0, 1.0
    return line


def _values(t: np.ndarray, s: LapTiming, column: str, ahead: float) -> np.ndarray:
    """Return a signal at these times.

    It is nan, a gap in the line, before the flight and `ahead` [s] after its frame.
    """
    rows = slice(max(s.i - RECENT, 0), s.entry.at(s.t + ahead) + 1)
    values = s.entry.speed(rows) if column == SPEED else s.entry.x[column][rows]
    return np.interp(t, s.entry.t[rows], values, left=np.nan, right=np.nan)


def psd(entry: Competitor, f: np.ndarray) -> np.ndarray:
    """Return the power spectral density of the commanded thrust [1e-3 (m/s^2)^2/Hz].

    Args:
        f: frequencies [Hz]  (n,)

    Returns:
        It is interpolated between the bins of Welch's estimate, and nan beyond them.  (n,)
    """
    if len(entry.t) < FEWEST:
        return np.full(len(f), np.nan)
    bins, power = thrust_psd(entry.t, entry.x["a_cmd"])
    curve = np.log(np.maximum(1e3 * power[1:], PSD_FLOOR))
    return np.exp(np.interp(np.log(f), np.log(bins[1:]), curve, left=np.nan, right=np.nan))


def _line(entry: Competitor, label: str, width: float = 1.8) -> uplot.Series:
    """Return a line in the colour and style of a competitor."""
    style = entry.style
    return uplot.Series(label=label, stroke=style.colour, width=width, dash=style.dash)


def _mark(label: str) -> uplot.Series:
    """Return a dashed vertical line."""
    return uplot.Series(label=label, stroke=DIM, width=1.2, dash=(3, 3), scale="mark")
