"""Competitor: one flight on the page, live or stored."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import accumulate
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import msgspec
import numpy as np

from quadsim.controllers.plan import PlannerSnapshot
from quadsim.course import Course
from quadsim.limit.limits import StoredSolution
from quadsim.palette import Style, style, styles_on_dark
from quadsim.racing.along import Legs
from quadsim.racing.events import Event
from quadsim.record.planner_snapshot import PlannerSnapshots
from quadsim.record.run import flown_by, has_planner
from quadsim.record.schema import NumberChange, RunSpec
from quadsim.report.metrics import motor_corner, motor_tau
from quadsim.web.state.differences import distinct_names
from quadsim.web.state.plain_text import plain

if TYPE_CHECKING:
    from quadsim.controllers.sampled_trajectories import SampledTrajectories
    from quadsim.sensing.measurements import Corners

# columns of the telemetry
POSITION = ("px", "py", "pz")
VELOCITY = ("vx", "vy", "vz")
QUATERNION = ("qw", "qx", "qy", "qz")
# kinds of events
MISSES = ("miss", "wrong_way")

SAME_TIME = 1e-9  # [s] Times that differ by less belong to one frame.

Rows = int | slice | np.ndarray
ALL = slice(None)


class Past(NamedTuple):
    """A value that changes with the events, laps or changes until a given time."""

    events: int
    changes: int
    events_so_far: int
    changes_so_far: int
    over: bool


@dataclass(frozen=True, eq=False)
class Competitor:
    """A flight at one moment.

    Rows of its arrays are never written again, so any thread may read them.
    """

    name: str
    record: dict[str, Any]  # its spec as a run stores it, for reports and comparisons
    spec: RunSpec  # the record, read
    course: Course
    legs: Legs
    x: dict[str, np.ndarray]  # columns of the telemetry so far  (frames,)
    events: tuple[Event, ...]
    laps: tuple[float, ...]  # [s]
    outcome: str | None  # None: still flying
    live: bool
    snapshots: PlannerSnapshots | None = None  # of the planner, once the flight has ended
    sampled_trajectories: SampledTrajectories | None = None  # while it flies
    folder: Path | None = None
    # of quadsim.web.state.numbers.SLIDERS
    start_numbers: Mapping[str, float] = field(default_factory=dict)
    # numbers that the next plan will use
    pending_numbers: Mapping[str, float] = field(default_factory=dict)
    own_style: Style | None = None  # distinct colour and line; None: the sampler's style
    limit: StoredSolution | None = None  # the best known solution of its race
    # its predicted paths of the other vehicles of its race, while it flies  (points, 3) each
    expected: tuple[np.ndarray, ...] = ()
    # samples of its last plan under a deadline, while it flies
    drawn_samples: int | None = None
    # corners of gates in the last picture of its camera, while it flies
    corners: Corners | None = None

    @cached_property
    def progress(self) -> np.ndarray:
        """The distance along the race at each frame [m].  (frames,)"""
        return self.legs.progress(self.rows(POSITION), self.x["passed"])

    @property
    def sampler(self) -> str:
        """The name of its sampler, `pilot`, `hand`, or the class of a controller of one's own."""
        return flown_by(self.record)

    @property
    def has_planner(self) -> bool:
        """Whether a planner flies, and not a learned pilot or a person."""
        return has_planner(self.record)

    @property
    def laps_to_fly(self) -> int:
        """The number of laps of its race."""
        return self.spec.laps

    @property
    def sensed(self) -> bool:
        """Whether the flight has an estimated state besides the true one."""
        return self.spec.sensing is not None and "est_px" in self.x

    @property
    def style(self) -> Style:
        """The colour and line style, unique among the competitors of the race."""
        return self.own_style or style(self.sampler)

    @property
    def t(self) -> np.ndarray:
        """The time of each frame [s].  (frames,)"""
        return self.x["t"]

    @property
    def last_t(self) -> float:
        """The time of the last frame; 0 before the first one [s]."""
        return float(self.t[-1]) if len(self.t) else 0.0

    @property
    def changes(self) -> list[NumberChange]:
        """The changes of the planner's numbers in flight."""
        return self.spec.interactive

    @property
    def motor_corner(self) -> float:
        """The corner frequency of its motors [Hz]."""
        return motor_corner(motor_tau(self.record["vehicle"]))

    @property
    def lap_starts(self) -> list[float]:
        """The start of every lap begun, and the end of the last one completed [s]."""
        return list(accumulate(self.laps, initial=0.0))

    def past(self, t: float) -> Past:
        """Return a value that changes with the events, laps and changes until t."""
        return Past(
            events=len(self.events),
            changes=len(self.changes),
            events_so_far=len(self.events_until(t)),
            changes_so_far=sum(change.t <= t + SAME_TIME for change in self.changes),
            over=self.outcome is not None and t >= self.last_t - SAME_TIME,
        )

    def events_until(self, t: float) -> tuple[Event, ...]:
        """Return the events up to t."""
        return tuple(event for event in self.events if event.t <= t + SAME_TIME)

    def laps_until(self, t: float) -> tuple[float, ...]:
        """Return the times of the laps that were completed by t [s]."""
        ends = self.lap_starts[1:]
        return tuple(lap for lap, end in zip(self.laps, ends, strict=True) if end <= t + SAME_TIME)

    def numbers(self, t: float) -> dict[str, float]:
        """Return the planner's numbers at t, including changes for its next plan.

        A change of a number that the page does not know, as another version may have recorded it,
        is left out.
        """
        changed = {
            change.name: change.after
            for change in self.changes
            if change.t <= t and change.name in self.start_numbers
        }
        return {**self.start_numbers, **changed, **self.pending_numbers}

    def rows(self, names: Sequence[str], rows: Rows = ALL) -> np.ndarray:
        """Return these columns side by side.  (rows, names); (names,) for one row"""
        return np.stack([self.x[name][rows] for name in names], axis=-1)

    def speed(self, rows: Rows = ALL) -> np.ndarray:
        """Return the speed [m/s].  (rows,)"""
        return np.linalg.norm(self.rows(VELOCITY, rows), axis=-1)

    def at(self, t: float) -> int:
        """Return the index of the frame at t."""
        frame = np.searchsorted(self.t, t + SAME_TIME) - 1
        return int(np.clip(frame, 0, len(self.t) - 1))

    def first_frame_with(self, event: Event) -> float:
        """Return the time of the first frame that has an event [s]; the event's own without one."""
        frame = np.searchsorted(self.t, event.t - SAME_TIME)
        return float(self.t[frame]) if frame < len(self.t) else event.t

    def frame_beside(self, t: float, by: int) -> float | None:
        """Return the time of the frame after t, or before it if `by` is negative [s].

        None: there is no such frame.
        """
        if by > 0:
            frame = np.searchsorted(self.t, t + SAME_TIME)
        else:
            frame = np.searchsorted(self.t, t - SAME_TIME) - 1
        return float(self.t[frame]) if 0 <= frame < len(self.t) else None

    def at_place(self, progress: float) -> int:
        """Return the index of the first frame that is this far along the race [m]."""
        frame = np.searchsorted(self.progress, progress)
        return int(np.clip(frame, 0, len(self.t) - 1))

    def until(self, t: float) -> Competitor:
        """Return the flight at t, without later frames, events, laps and the outcome."""
        if t >= self.last_t - SAME_TIME:
            return self
        seen = slice(self.at(t) + 1)
        return replace(
            self,
            x={name: column[seen] for name, column in self.x.items()},
            events=self.events_until(t),
            laps=self.laps_until(t),
            outcome=None,
        )

    def with_record(self, record: dict[str, Any]) -> Competitor:
        """Return the flight with another record of its spec."""
        return replace(self, record=record, spec=read_spec(record))

    def snapshot(self, i: int) -> tuple[float, PlannerSnapshot] | None:
        """Return the last planner snapshot up to frame i, and its time [s]."""
        found = self.snapshots.latest(i) if self.snapshots else None
        if found is None:
            return None
        frame, snapshot = found
        return float(self.t[frame]), snapshot


def read_spec(record: Mapping[str, Any]) -> RunSpec:
    """Return the record of a spec as a struct. Records from the disk were checked when read."""
    return msgspec.convert(dict(record), RunSpec)


def heat_of(entries: Sequence[Competitor]) -> str:
    """Return the identifier of the common race of several vehicles; "" if there is none."""
    heats = [entry.spec.heat for entry in entries if entry.spec.heat]
    identifiers = {heat.sha256 for heat in heats}
    numbers = {heat.number for heat in heats}
    is_common = len(identifiers) == 1 and len(numbers) == len(entries)
    return identifiers.pop() if is_common else ""


def named(entries: Sequence[Competitor]) -> tuple[Competitor, ...]:
    """Return the competitors with distinct names and styles."""
    names = _names(entries)
    styles = styles_on_dark([entry.sampler for entry in entries])
    return tuple(
        entry
        if (entry.name, entry.style) == (name, own)
        else replace(entry, name=name, own_style=own)
        for entry, name, own in zip(entries, names, styles, strict=True)
    )


def _names(entries: Sequence[Competitor]) -> list[str]:
    """Return distinct names; in a race of several vehicles, the entrants' own."""
    if heat_of(entries):
        return [plain(entry.spec.heat.name) for entry in entries if entry.spec.heat]
    return distinct_names([entry.record for entry in entries])
