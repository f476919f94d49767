"""The live line of a flight on stderr: lap, gate, time, speed, effective sample size, real-time factor."""

from __future__ import annotations

from math import hypot
from time import perf_counter

from rich.console import Console
from rich.live import Live
from rich.progress_bar import ProgressBar
from rich.table import Table

from quadsim.race.events import Frame

PERIOD = 0.1  # between two pictures of the line [s]


class Progress:
    """`with Progress(...) as line: line.show(frame)`. Draws nothing where stderr is no terminal."""

    def __init__(self, gates: int, laps: int, quiet: bool = False):
        console = Console(stderr=True, highlight=False)
        self._gates, self._laps = gates, laps
        self._live = None
        if console.is_terminal and not quiet:
            self._live = Live(console=console, auto_refresh=False, transient=True)
        self._drawn = -PERIOD

    def __enter__(self) -> Progress:
        if self._live:
            self._live.start()
        return self

    def __exit__(self, *_: object) -> None:
        if self._live:
            self._live.stop()

    def show(self, frame: Frame) -> None:
        now = perf_counter()
        if self._live and now - self._drawn >= PERIOD:
            self._live.update(self._line(frame), refresh=True)
            self._drawn = now

    def _line(self, f: Frame) -> Table:
        factor = f.t / f.elapsed if f.elapsed else 0.0
        line = Table.grid(padding=(0, 2))
        line.add_row(
            f"lap [b]{f.lap}[/]/{self._laps}",
            f"gate [b]{f.gate}[/]/{self._gates}",
            ProgressBar(total=self._gates * self._laps, completed=f.passed, width=10),
            f"{f.t:5.1f} s",
            f"{hypot(*f.x[3:6]):4.1f} m/s" if len(f.x) > 6 else "",
            f"ESS {f.ess:4.0f}",
            f"{factor:.2f} x real time",
        )
        return line
