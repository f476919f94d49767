"""LiveHeat: a race of several vehicles in one world, flown on the page and stored when it ends."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from quadsim.heat.archive import entrant_folder
from quadsim.heat.launch import heat_frames, is_compiled
from quadsim.heat.loop import HeatFrame
from quadsim.heat.result import HeatRecorder, run_records
from quadsim.limit.limits import limit_of, limits_folder
from quadsim.racing.along import Legs
from quadsim.record.archive import remove_unfinished
from quadsim.record.run import columns_of
from quadsim.results.heat import Heat
from quadsim.web.race.competitor import Competitor, read_spec
from quadsim.web.race.live_flight import FlownFrame, laps_so_far
from quadsim.web.state.choices import HeatChoices
from quadsim.web.state.numbers import SLIDERS, Change, numbers_of
from quadsim.web.stored.again import HeatAgainChoices

# Times ahead at which predicted paths are drawn [s]
AHEAD = np.linspace(0.0, 1.0, 11)


class LiveHeat:
    """A race of several vehicles, for use by one thread.

    Attributes:
        entries: the flights for display; any thread may read them.
        period: the shortest control period [s].
        is_cached: False if planners have to be compiled.
        hand: the controller by which a person flies; None: nobody does.

    Args:
        choices: the choices of the race.

    Raises:
        ValueError: the choices cannot be flown; the message is one line.
    """

    def __init__(self, choices: HeatChoices | HeatAgainChoices):
        self._spec = choices.spec()
        if isinstance(choices, HeatChoices):
            bases = [flight.planners().base for flight in choices.flights]
        else:
            bases = [entrant.spec.planner for entrant in self._spec.entrants]
        self._frames = heat_frames(self._spec)
        self._ahead: HeatFrame | None = None  # the first frame of the next period
        self._recorder = HeatRecorder(self._spec)
        self._root: str | None = None
        self.is_cached = is_compiled(self._spec)
        specs = [entrant.spec for entrant in self._spec.entrants]
        self.hand = next((spec.hand for spec in specs if spec.hand), None)
        self.period = min(spec.planner.mppi.dt for spec in specs)
        self.t = -self.period
        records = run_records(self._recorder.record)
        self._columns = [tuple(columns_of(record)) for record in records]
        self.entries = tuple(
            Competitor(
                name=name,
                record=record,
                spec=read_spec(record),
                course=spec.course,
                legs=Legs(spec.course, spec.laps),
                x=self._recorder.recorders[k].views(self._columns[k]),
                events=(),
                laps=(),
                outcome=None,
                live=True,
                start_numbers=numbers_of(spec.planner, base),
            )
            for k, (name, record, spec, base) in enumerate(
                zip(self._spec.names, records, specs, bases, strict=True)
            )
        )

    @property
    def is_over(self) -> bool:
        """Whether all flights have ended."""
        return all(entry.outcome is not None for entry in self.entries)

    def show_as(self, entries: Sequence[Competitor]) -> None:
        """Show the flights under other names."""
        self.entries = tuple(entries)

    def keep_in(self, root: str) -> None:
        """Store the race in this folder of runs when it ends."""
        remove_unfinished(root)
        self._root = root
        limits = limits_folder(root)
        self.entries = tuple(
            replace(entry, limit=limit_of(entry.record, limits)) for entry in self.entries
        )

    def turn(self) -> list[FlownFrame]:
        """Fly one period of all vehicles."""
        first = self._ahead or next(self._frames)
        frames = [first]
        self._ahead = None
        for frame in self._frames:
            if frame.t > first.t:
                self._ahead = frame
                break
            frames.append(frame)
        self.t = first.t
        entries = list(self.entries)
        flown = []
        for frame in frames:
            self._recorder.add(frame)
            entries[frame.number] = self._with(entries[frame.number], frame)
            flown.append(FlownFrame(entries[frame.number], frame.frame))
        self.entries = tuple(entries)
        return flown

    def _with(self, entry: Competitor, frame: HeatFrame) -> Competitor:
        """Return a flight with its next frame."""
        recorder = self._recorder.recorders[frame.number]
        events = tuple(recorder.events)
        over = frame.frame.outcome is not None
        return replace(
            entry,
            x=recorder.views(self._columns[frame.number]),
            events=events,
            laps=laps_so_far(events, entry.legs.gates),
            outcome=frame.frame.outcome,
            expected=() if over else _expected(frame),
        )

    def change(self, change: Change) -> None:
        """Refuse: the numbers of a race in one world stay as they were at its start.

        Raises:
            ValueError: always; the message suggests an alternative.
        """
        label = SLIDERS[change.name].label
        raise ValueError(
            f"{label}: in one world the numbers of START stay; change the competitor's number"
            " before START, or fly as ghosts"
        )

    def update_trajectories(self) -> None:
        """Do nothing, as a race shows predicted paths instead of sampled trajectories."""

    def end(self) -> None:
        """Store the race, unless interrupted before the first gate pass of any vehicle."""
        interrupted = not self.is_over
        self.entries = tuple(
            replace(entry, outcome=entry.outcome or "interrupted", expected=())
            for entry in self.entries
        )
        self.close()
        passed = any(event.kind == "pass" for entry in self.entries for event in entry.events)
        if self._root is None or (interrupted and not passed):
            return
        flown = Heat.flown(self._spec, self._recorder)
        folder = flown.save(self._root)
        self.entries = tuple(
            replace(
                entry,
                snapshots=run.snapshots,
                folder=folder / entrant_folder(k, self._spec.names[k - 1]),
            )
            for k, (entry, run) in enumerate(zip(self.entries, flown.runs, strict=True), 1)
        )

    def close(self) -> None:
        """Free the world."""
        self._frames.close()


def _expected(frame: HeatFrame) -> tuple[np.ndarray, ...]:
    """Return the paths that a vehicle expects the others to fly [m]  (points, 3) each."""
    return tuple(path.at(frame.t + AHEAD) for _, path in frame.others)
