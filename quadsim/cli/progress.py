"""The live line of a flight on stderr: gates, time, speed, sample size, real-time factor."""

from __future__ import annotations

from math import hypot
from time import perf_counter

from rich.live import Live
from rich.progress_bar import ProgressBar
from rich.table import Table

from quadsim.config.spec import Spec
from quadsim.console import complain, progress_console
from quadsim.dynamics.quadrotor import State
from quadsim.racing.events import Frame

PERIOD = 0.1  # time between two updates of the line [s]


class Progress:
    """The live line: `with Progress(spec) as line: line.show(frame)`.

    If stderr is no terminal, each lap but the last is one line instead.
    """

    def __init__(self, spec: Spec, quiet: bool = False):
        """Prepare the line of a flight. quiet: draw nothing."""
        console = progress_console()
        self._laps = spec.laps
        self._gates = len(spec.course.gates)
        self._live = None
        if console.is_terminal and not quiet:
            self._live = Live(console=console, auto_refresh=False, transient=True)
        self._in_lines = not console.is_terminal and not quiet
        self._drawn = -PERIOD
        self._lap = 1

    def __enter__(self) -> Progress:
        """Start to draw."""
        if self._live:
            self._live.start()
        return self

    def __exit__(self, *_: object) -> None:
        """Remove the line."""
        if self._live:
            self._live.stop()

    def show(self, frame: Frame) -> None:
        """Draw the frame, unless the last update is more recent than PERIOD."""
        now = perf_counter()
        if self._in_lines and frame.lap > self._lap:
            speed = f"{frame.t / frame.elapsed:.2f} x real time" if frame.elapsed else ""
            complain(f"lap {self._lap} of {self._laps} flown at {frame.t:.1f} s, {speed}")
            self._lap = frame.lap
        if self._live and now - self._drawn >= PERIOD:
            self._live.update(self._line(frame), refresh=True)
            self._drawn = now

    def _line(self, frame: Frame) -> Table:
        """Return the line of one frame."""
        real_time = frame.t / frame.elapsed if frame.elapsed else 0.0
        speed = hypot(*State(*frame.x).velocity)
        lap = [f"lap [b]{frame.lap}[/]/{self._laps}"] if self._laps > 1 else []
        line = Table.grid(padding=(0, 2))
        line.add_row(
            *lap,
            f"gate [b]{min(frame.gate, self._gates)}[/]/{self._gates}",
            ProgressBar(total=self._gates * self._laps, completed=frame.passed, width=10),
            f"{frame.t:5.1f} s",
            f"{speed:4.1f} m/s",
            f"ESS {frame.ess:4.0f}",
            f"{real_time:.2f} x real time",
        )
        return line
