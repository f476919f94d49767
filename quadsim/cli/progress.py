"""The live line of a flight on stderr: gates or legs, time, speed, effective sample size (ESS),
real-time factor."""

from __future__ import annotations

from math import hypot
from time import perf_counter

from rich.live import Live
from rich.progress_bar import ProgressBar
from rich.table import Table

from quadsim.console import progress_console
from quadsim.race.events import Frame
from quadsim.spec.spec import Spec

PERIOD = 0.1  # from one drawing of the line to the next [s]
SPEEDS = ("vx", "vy", "vz", "v")  # states that the speed is made of
# what is passed -> attribute of a course that has one for each
TARGETS = {"gate": "gates", "leg": "lengths"}


class Progress:
    """`with Progress(spec) as line: line.show(frame)`. Draws nothing where stderr is no
    terminal."""

    def __init__(self, spec: Spec, quiet: bool = False):
        console = progress_console()
        self._laps, self._timeout = spec.laps, spec.timeout
        self._targets = {
            k: len(getattr(spec.course, name))
            for k, name in TARGETS.items()
            if hasattr(spec.course, name)
        }
        states = spec.entry.states.items()
        self._speed = [
            i for i, (name, unit) in enumerate(states) if name in SPEEDS and unit == "m/s"
        ]
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
        done, total = f.t, self._timeout
        parts = [f"lap [b]{f.lap}[/]/{self._laps}"] if self._laps > 1 else []
        for target, count in self._targets.items():
            parts.append(f"{target} [b]{min(f.gate, count)}[/]/{count}")
            done, total = f.passed, count * self._laps
        line = Table.grid(padding=(0, 2))
        line.add_row(
            *parts,
            ProgressBar(total=total, completed=done, width=10),
            f"{f.t:5.1f} s",
            *([f"{hypot(*(f.x[i] for i in self._speed)):4.1f} m/s"] if self._speed else []),
            f"ESS {f.ess:4.0f}",
            f"{factor:.2f} x real time",
        )
        return line
