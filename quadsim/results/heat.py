"""The result of a race of several vehicles, which the library returns."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.console import RenderableType
from rich.markup import escape

from quadsim.console import as_text, plain, plain_table
from quadsim.course import Course
from quadsim.heat.archive import read_heat, save_heat
from quadsim.heat.launch import heat_frames
from quadsim.heat.result import (
    HeatEvent,
    HeatRecorder,
    Placing,
    heat_digest,
    heat_events,
    placings,
)
from quadsim.heat.spec import HeatSpec
from quadsim.report.given_state import conditions
from quadsim.results.run import Run

if TYPE_CHECKING:
    from matplotlib.figure import Figure

COLUMNS = 80


@dataclass(frozen=True, eq=False)
class Heat:
    """A race of several vehicles: a Run for each entrant, and the events between them.

    Attributes:
        names: names of the entrants.
        runs: runs of the entrants, in the same order.
        course: the course.
        start_times: start time of each entrant [s].
        rules: name of the rules.
        spec: record of the specification, with which `quadsim.race` repeats the race.
        faults: errors of controllers in flight, by the name of the entrant, which counts as
            crashed.

    Examples:
        >>> import quadsim
        >>> heat = quadsim.race(["colored", "gaussian"], "figure8", laps=1, samples=256)
        >>> [placing.rank for placing in heat.order]
        [1, 2]
        >>> heat["colored"].outcome in ("finished", "crashed")
        True
    """

    names: tuple[str, ...]
    runs: tuple[Run, ...]
    course: Course
    start_times: tuple[float, ...]
    rules: str
    spec: dict[str, Any]
    faults: Mapping[str, str] = field(default_factory=dict)
    _flown: HeatSpec | None = None  # the specification of a race that was flown now

    @classmethod
    def flown(cls, spec: HeatSpec, recorder: HeatRecorder) -> Heat:
        """Return the race that a recorder has collected."""
        return cls(
            names=spec.names,
            runs=tuple(map(Run.of, recorder.runs())),
            course=spec.course,
            start_times=tuple(spec.start_time(k) for k in range(len(spec.entrants))),
            rules=spec.settings.rules,
            spec=recorder.record,
            faults=recorder.faults,
            _flown=spec,
        )

    @classmethod
    def load(cls, folder: str | Path) -> Heat:
        """Return a stored race. Raises RunError."""
        loaded = read_heat(folder)
        return cls(
            names=loaded.names,
            runs=tuple(map(Run.of, loaded.runs)),
            course=loaded.course,
            start_times=loaded.start_times,
            rules=loaded.spec.settings.rules,
            spec=loaded.record,
            faults=loaded.faults,
        )

    def __getitem__(self, name: str) -> Run:
        """Return the run of an entrant. Raises KeyError."""
        return dict(zip(self.names, self.runs, strict=True))[name]

    def __repr__(self) -> str:
        """Return the results in one line."""
        first = self.order[0]
        time = f"{first.time:.3f} s" if first.time is not None else first.outcome
        entrants = f"{len(self.runs)} entrants, first {first.name}, {time}"
        return plain(f"<Heat {self.course.name}: {entrants}>")

    @cached_property
    def order(self) -> list[Placing]:
        """The results, the winner first."""
        return placings(self.names, self.runs, self.course)

    @cached_property
    def events(self) -> list[HeatEvent]:
        """Overtakes, contacts and entrants that are out, in the order of time."""
        return heat_events(self.names, self.runs, self.start_times)

    def digest(self) -> str:
        """Return the sha256 [hex] of all that the seed determines."""
        return heat_digest(self.runs)

    def renderables(self) -> list[RenderableType]:
        """Return the parts of the report that `race heat` prints."""
        rules = f"rules {self.rules}"
        entrants = f"{len(self.runs)} entrant" + "s" * (len(self.runs) > 1)
        head = f"[bold]{escape(self.course.name)}[/]  {entrants}, {rules}"
        specs = {name: run.spec for name, run in zip(self.names, self.runs, strict=True)}
        lines = [escape(line) for line in conditions(specs)]
        table = plain_table(
            "place", "entrant", "outcome", "race [s]", "gap [s]", "gates", "top [m/s]"
        )
        winner = self.order[0].time
        for placing in self.order:
            run = self[placing.name]
            time = placing.time
            gap = time - winner if time is not None and winner is not None else None
            table.add_row(
                str(placing.rank),
                escape(placing.name),
                placing.outcome,
                f"{time:.3f}" if time is not None else "-",
                f"+{gap:.3f}" if gap else "-",
                str(placing.passed),
                f"{run.metrics.top_speed:.1f}",
            )
        happened = [escape(f"  {self._told(event)}") for event in self.events]
        return [head, *lines, "", table, "", *(happened or ["  no overtakes, no contacts"])]

    def _told(self, event: HeatEvent) -> str:
        """Return an event as a line of the report."""
        t = f"{event.t:7.2f} s"
        match event.kind:
            case "overtake":
                return f"{t}  {event.name} overtakes {event.other} at gate {event.gate}"
            case "contact":
                return f"{t}  contact of {event.name} and {event.other}"
        run = self[event.name]
        if event.name in self.faults:
            return f"{t}  {event.name} is out: {run.outcome}, {self.faults[event.name]}"
        where = run.events[-1].place if run.events else ""
        at = f" with {event.other}" if event.other else f" at {where}" if where else ""
        return f"{t}  {event.name} is out: {run.outcome}{at}"

    def __str__(self) -> str:
        return as_text(*self.renderables(), columns=COLUMNS)

    def as_json(self) -> dict:
        """Return results and events as JSON."""
        return {
            "course": self.course.name,
            "rules": self.rules,
            "order": [placing._asdict() for placing in self.order],
            "events": [event._asdict() for event in self.events],
            "faults": dict(self.faults),
            "digest": self.digest(),
        }

    def plot(self, path: str | Path | None = None) -> Figure:
        """Return a figure of places at the gates, gaps to the leader, and all paths from above.

        Args:
            path: file to write, with the suffix .png, .svg or .pdf; None writes nothing.

        Returns:
            The matplotlib Figure.
        """
        from quadsim.figures.heat_figure import draw_heat  # here: it loads matplotlib
        from quadsim.figures.style import save_figure

        figure = draw_heat(self.names, self.runs, self.start_times, self.events, self.course)
        if path is not None:
            save_figure(figure, Path(path))
        return figure

    def save(self, runs_dir: str | Path = "runs") -> Path:
        """Store the race, completely or not at all, and return its folder.

        Raises:
            RunError: the race cannot be written.
            ValueError: the race was read from a folder.
        """
        if self._flown is None:
            raise ValueError("expected a race that was flown now; a stored one has its folder")
        return save_heat(self._flown, self.spec, self.runs, runs_dir)


def fly_heat(spec: HeatSpec) -> Heat:
    """Simulate a race and return it."""
    recorder = HeatRecorder(spec)
    for frame in heat_frames(spec):
        recorder.add(frame)
    return Heat.flown(spec, recorder)
