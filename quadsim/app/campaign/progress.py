"""How far a campaign is, on stderr: a bar with the time left, or one plain line an attempt where nobody watches."""

from __future__ import annotations

from time import perf_counter

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

from quadsim.app.console import complain


class Tally:
    """`with Tally(total, kept) as tally: tally.count("colored seed 3: finished")`."""

    def __init__(self, total: int, kept: int):
        """kept: of the total, flown before."""
        self.total, self.kept, self.done = total, kept, 0
        self._began = perf_counter()
        console = Console(stderr=True, highlight=False)
        columns = (BarColumn(24), MofNCompleteColumn(), TimeElapsedColumn(), TextColumn("{task.fields[note]}"))
        self._bar = Progress(*columns, console=console, transient=True) if console.is_terminal else None

    def __enter__(self) -> Tally:
        if self._bar:
            self._task = self._bar.add_task("", total=self.total, completed=self.kept, note="")
            self._bar.start()
        if self.kept:
            complain(f"{self.kept} of {self.total} attempts are kept from before")
        return self

    def __exit__(self, *_: object) -> None:
        if self._bar:
            self._bar.stop()

    def count(self, note: str) -> None:
        self.done += 1
        note = f"{note}{self._left()}"
        if self._bar:
            self._bar.update(self._task, advance=1, note=note)
        else:
            complain(f"{self.kept + self.done}/{self.total} {note}")

    def _left(self) -> str:
        """Time left at the pace so far, workers starting up included."""
        seconds = (perf_counter() - self._began) / self.done * (self.total - self.kept - self.done)
        if seconds < 1:
            return ""
        return f", {seconds / 60:.0f} min left" if seconds > 90 else f", {seconds:.0f} s left"
