"""LiveFlight: a flight that the page flies frame by frame and stores at its end."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, NamedTuple

import msgspec

from quadsim.config.build import build
from quadsim.config.changes import changeable_numbers
from quadsim.controllers.in_flight import PlannerInFlight
from quadsim.controllers.presets import Planner
from quadsim.limit.limits import limit_of, limits_folder
from quadsim.racing.along import Legs
from quadsim.racing.clock import PlanningClock
from quadsim.racing.events import Event, Frame, flown_laps, lap_penalties
from quadsim.racing.flight import simulate
from quadsim.record.archive import RunFolder, remove_unfinished
from quadsim.record.provenance import this_provenance
from quadsim.record.run import INTERACTIVE, Recorder, columns_of
from quadsim.record.schema import NumberChange
from quadsim.web.race.competitor import Competitor, read_spec
from quadsim.web.state.choices import Choices
from quadsim.web.state.numbers import Change, numbers_of, with_change
from quadsim.web.stored.again import AgainChoices

if TYPE_CHECKING:
    from quadsim.controllers.sampled_trajectories import SampledTrajectories
    from quadsim.sensing.measurements import Corners


class FlownFrame(NamedTuple):
    """A flown frame."""

    entry: Competitor  # with this frame
    frame: Frame


class LiveFlight:
    """A flight whose numbers may change in flight, for use by one thread.

    Attributes:
        now: the flight for display; any thread may read it.
        period: control period [s].
        is_cached: False if the first plan has to compile, which takes some 15 s.
        hand: the controller by which a person flies, None if nobody does.

    Args:
        choices: the choices of the flight.

    Raises:
        ValueError: the choices cannot be flown; the message is one line.
    """

    is_cached: bool

    def __init__(self, choices: Choices | AgainChoices):
        base = choices.base_spec()
        self._preset = base.planner  # the scale of the standard deviations multiplies its own
        self._spec = spec = choices.flown(base)
        self.hand = spec.hand
        # The numbers in use at present
        self._numbers = planner = spec.planner
        self.period = planner.mppi.dt
        self._pending: dict[str, Change] = {}
        # Before `_take_off`, which lets a sampler of the user's own draw
        record = self._spec.record()
        self._frames = self._take_off()
        self._recorder = Recorder()
        self._folder: RunFolder | None = None
        self._columns = tuple(columns_of(record))
        self.now = Competitor(
            name=spec.sampler,
            record=record,
            spec=read_spec(record),
            course=spec.course,
            legs=Legs(spec.course, spec.laps),
            x=self._recorder.views(self._columns),
            events=(),
            laps=(),
            outcome=None,
            live=True,
            start_numbers=numbers_of(planner, self._preset),
        )

    @property
    def t(self) -> float:
        """The time of the last frame; before the first, one period before the start [s]."""
        return self._recorder.last.t if self._recorder.last else -self.period

    @property
    def is_over(self) -> bool:
        """Whether the flight has ended."""
        return self.now.outcome is not None

    @property
    def entries(self) -> tuple[Competitor, ...]:
        """The flight for display, as the only entry."""
        return (self.now,)

    def show_as(self, entries: Sequence[Competitor]) -> None:
        """Show the flight under another name."""
        (self.now,) = entries

    def turn(self) -> list[FlownFrame]:
        """Fly one period."""
        frame = self.advance()
        return [FlownFrame(self.now, frame)]

    def keep_in(self, root: str) -> None:
        """Claim a folder among the runs for the resulting run."""
        remove_unfinished(root)
        self._folder = RunFolder.open(root, self.now.record, this_provenance())
        self.now = replace(self.now, limit=limit_of(self.now.record, limits_folder(root)))

    def advance(self) -> Frame:
        """Plan with the requested numbers and fly one period.

        Returns:
            The frame of this plan. The last frame of a flight has the outcome, and no plan.
        """
        changes = self._use_pending()
        drawn = self._samples_to_draw()
        frame = next(self._frames)
        self._recorder.add(frame)
        events = tuple(self._recorder.events)
        self.now = replace(
            self.now,
            x=self._recorder.views(self._columns),
            events=events,
            laps=laps_so_far(events, self.now.legs.gates),
            outcome=frame.outcome,
            corners=self._corners(),
            drawn_samples=drawn,
            pending_numbers={},
        )
        # A change is recorded when a plan has used it.
        if changes and not self.is_over:
            noted = [msgspec.to_builtins(change(frame.t)) for change in changes]
            record = self.now.record
            self.now = self.now.with_record({**record, INTERACTIVE: [*record[INTERACTIVE], *noted]})
        return frame

    def change(self, change: Change) -> None:
        """Use a number from the next plan on.

        Only a planner has these numbers, and a flight that repeats recorded changes accepts no
        further changes.
        """
        if not self._spec.has_planner or self._spec.changes:
            return
        self._pending[change.name] = change
        asked = numbers_of(self._asked_planner(), self._preset)
        flown = numbers_of(self._numbers, self._preset)
        differing = {name: value for name, value in asked.items() if value != flown[name]}
        self.now = replace(self.now, pending_numbers=differing)

    def update_trajectories(self) -> None:
        """Take the sampled trajectories of the last plan, for display."""
        self.now = replace(self.now, sampled_trajectories=self.sampled_trajectories())

    def end(self) -> None:
        """Free the plant and store the run, unless interrupted before the first gate."""
        outcome = self.now.outcome or "interrupted"
        self.now = replace(
            self.now,
            outcome=outcome,
            sampled_trajectories=None,
            corners=None,
            pending_numbers={},
        )
        self.close()
        if self._folder is None:
            return
        with self._folder as folder:
            passed = any(event.kind == "pass" for event in self.now.events)
            if outcome != "interrupted" or passed:
                run = self._recorder.run(self.now.record)
                path = folder.save(run)
                self.now = replace(self.now, snapshots=run.snapshots, folder=path)

    def _asked_planner(self) -> Planner:
        """Return the planner with the requested numbers."""
        planner = self._numbers
        for change in self._pending.values():
            planner = with_change(planner, self._preset, change)
        return planner

    def _use_pending(self) -> list[Callable[[float], NumberChange]]:
        """Plan with the numbers that are asked for, from the next plan on.

        Returns:
            For each changed number, a function from the time of the plan [s] to the change.
        """
        if not self._pending:
            return []
        after = self._asked_planner()
        old = numbers_of(self._numbers, self._preset)
        new = numbers_of(after, self._preset)
        self._pending.clear()
        differing = [name for name in new if new[name] != old[name]]
        if differing:
            self._numbers = after
            self._replan(after)
        return [
            partial(
                NumberChange,
                name=name,
                before=old[name],
                after=new[name],
                planner=changeable_numbers(after),
            )
            for name in differing
        ]

    # What follows is the simulation behind the flight.

    def _take_off(self) -> Iterator[Frame]:
        """Build plant, planner and referee. Return the frames of the flight."""
        parts = build(self._spec)
        self._plant = parts.plant
        if self._spec.clock == "wall":
            parts = replace(parts, clock=PlanningClock())
        self._navigation = parts.navigation
        # None: a learned pilot or a person flies, without numbers to change
        self._planner: PlannerInFlight | None = None
        self.is_cached = True
        if isinstance(parts.controller, PlannerInFlight):
            self._planner = parts.controller
            self.is_cached = self._planner.planner.is_cached
        return simulate(parts)

    def _replan(self, numbers: Planner) -> None:
        """Use these numbers from the next plan on."""
        if self._planner:
            self._planner.change(numbers)

    def sampled_trajectories(self) -> SampledTrajectories | None:
        """Return the sampled trajectories of the last plan, None for a learned pilot."""
        # imported here, as it loads the compiler
        from quadsim.controllers.sampled_trajectories import sampled_trajectories

        return sampled_trajectories(self._planner.planner) if self._planner else None

    def _corners(self) -> Corners | None:
        """Return the corners in the last picture, if the vehicle has a gate camera."""
        return self._navigation.corners if self._navigation else None

    def _samples_to_draw(self) -> int | None:
        """Return the number of samples of the next plan; None for a learned pilot."""
        return self._planner.planner.samples if self._planner else None

    def close(self) -> None:
        """Free the plant."""
        self._plant.close()


def laps_so_far(events: Sequence[Event], gates: int) -> tuple[float, ...]:
    """Return the times of the completed laps, penalties included [s]."""
    completed = sum(event.kind == "pass" for event in events) // gates
    flown = flown_laps(events, completed)
    penalties = lap_penalties(events, completed)
    return tuple(lap + penalty for lap, penalty in zip(flown, penalties, strict=True))
