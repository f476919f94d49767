"""The keys of run.json and heat.json that this version reads.

The other keys of a file follow from these, or are for people who read it. Pictures, reports, the
page and repeated flights read the spec of a run as a RunSpec; a list of runs reads only the keys of
a ListedSpec, which is much faster. A file whose key `format` has another number is refused.
"""

from __future__ import annotations

from typing import Annotated, Any

from msgspec import Meta, Raw, Struct, field

from quadsim.controllers.config import MPPIConfig
from quadsim.course import Course, Start, parse_course
from quadsim.dynamics.quadrotor import ModelParams
from quadsim.physics.randomization_file import RandomizationRanges
from quadsim.racing.events import Event
from quadsim.record.run import Outcome, PlanTime
from quadsim.sensing import Sensing
from quadsim.vehicle import Vehicle

RUN_FORMAT = "quadsim run 3"
HEAT_FORMAT = "quadsim heat 2"
# columns of events.csv that only runs with changes in flight have
CHANGE_COLUMNS = ("number", "from", "to")

Number = int | float
PlainText = Annotated[str, Meta(pattern=r"^[^\x00-\x1f\x7f]*\Z")]
LapCount = Annotated[int, Meta(ge=1, le=1000)]


class Header(Struct):
    """The keys of a run.json that say how to read its other keys."""

    format: str | None = None
    git: str | None = None  # the commit that flew the run


class Named(Struct):
    """The name of a part: a vehicle, a sensing or a pilot."""

    name: str


# The parts of a spec


class ChangedPlanner(Struct):
    """The planner's numbers that may be changed in flight."""

    # numbers of a registered sampler; of the user's own, whatever describes it
    sampling: Any
    mppi: MPPIConfig


class RecordedPlanner(ChangedPlanner):
    """All numbers of a planner."""

    vehicle: str
    # which class they are of, a reference decides
    cost: dict[str, Any]


class ReplayedSampling(Struct):
    """A sampler's numbers that a replay shows."""

    sigma: list[float] = []
    gamma: list[float] = []


class ReplayedPlanner(Struct):
    """A planner's numbers that a replay shows."""

    mppi: MPPIConfig
    # a text describes the user's own sampler
    sampling: ReplayedSampling | str | None = None


class NumberChange(Struct, frozen=True):
    """A number of the planner that was changed in flight."""

    t: Number  # time of the first plan with the number [s]
    name: str  # of the page's slider
    before: Number = field(name="from")
    after: Number = field(name="to")
    planner: dict[str, Any] = {}  # numbers after it, see ChangedPlanner

    def row(self) -> dict[str, object]:
        """Return the change as a row of events.csv; gate and position are empty."""
        values = (float(self.t), "change", self.name, float(self.before), float(self.after))
        return dict(zip(("t", "kind", *CHANGE_COLUMNS), values, strict=True))


class RecordedCourse(Struct):
    """The course of a flight: its name and the text of its file."""

    name: PlainText
    text: str

    def course(self) -> Course:
        """Return the course. Raises FileError."""
        return parse_course(self.text, self.name)


class RecordedPilot(Named):
    """The learned pilot that flew."""

    sha256: str


class RecordedReference(Struct):
    """The solution of `race limit` that the planner followed."""

    key: str
    sha256: str


class RecordedFirmware(Struct):
    """The configuration of the firmware; a repeated flight compares it with its own firmware."""

    name: str
    lines: tuple[str, ...]


class Host(Struct):
    """Paths of files on the machine that flew, which do not change the flight."""

    runs_dir: str = "runs"
    pilot: str | None = None


class StickRates(Struct):
    """The map from one stick to a command, in a flight by hand."""

    most: float  # at the end of the stick [rad/s]


class FlownByHand(Struct):
    """The maps from the sticks to commands, in a flight by hand."""

    roll: StickRates
    pitch: StickRates
    yaw: StickRates


class OwnPart(Struct):
    """The class of one of the user's own parts."""

    kind: str = field(name="class")


class OwnTerm(Struct):
    """The name and the weight of one of the user's own cost terms."""

    name: str
    weight: float | list[float]


class Rules(Struct):
    """The rules of a race of several vehicles."""

    rules: str


class FlownAmong(Struct):
    """The race of several vehicles in which a run was flown."""

    name: str  # of this run's entrant
    names: list[str]
    number: Annotated[int, Meta(ge=1)]  # of this run's entrant
    settings: Rules
    sha256: str

    def __post_init__(self) -> None:
        if self.number > len(self.names):
            raise ValueError(f"expected a number of {len(self.names)} entrants")


# The spec of a run


class RunSpec(Struct, kw_only=True):
    """The spec of a run, see quadsim.config.spec.Spec.record."""

    course: RecordedCourse
    vehicle: Vehicle
    sampler: str
    preset: str
    planner: RecordedPlanner
    model: ModelParams
    laps: LapCount
    timeout: float
    start: Start | None
    sensing: Sensing | None
    randomization: RandomizationRanges
    view_weight: float
    plant: str
    pilot: RecordedPilot | None
    hand: FlownByHand | None
    betaflight: RecordedFirmware | None
    reference: RecordedReference | None
    own: dict[str, OwnPart | list[OwnTerm]]
    interactive: list[NumberChange]
    seed: int
    randomize: float
    displace_gates: float
    known_from: float | None
    map_scale: float
    penalties: bool
    predict: bool
    excite: bool
    clock: str
    deadline_ms: float | None
    link_hz: float | None
    link_latency: float
    link_loss: float
    link_burst: float | None
    drawn_faults: list[str]
    host: Host
    heat: FlownAmong | None = None


# The part of a spec that a list of runs shows


class RaceOfRun(Struct):
    """The keys of an entrant's run that say in which race it was flown."""

    number: int  # of the entrant, from 1
    names: list[str]  # of all entrants
    seed: int


class ListedSpec(Struct, kw_only=True):
    """The keys of a RunSpec that a list shows."""

    course: RecordedCourse
    vehicle: Named
    sampler: str
    preset: str
    laps: LapCount
    sensing: Named | None
    plant: str
    pilot: Named | None
    betaflight: Named | None
    own: dict[str, OwnPart | list[OwnTerm]]
    interactive: list[Any]
    seed: int
    randomize: float
    penalties: bool
    clock: str
    deadline_ms: float | None
    heat: RaceOfRun | None = None  # None: the run is no part of a race of several


# run.json


class ListedRun(Struct):
    """The keys of a run.json that a row of a list shows."""

    outcome: Outcome
    laps: list[float]
    spec: Raw  # see ListedSpec


class StoredRotor(Struct):
    """A rotor whose estimated thrust differs from the nominal one."""

    rotor: int
    share: float
    since: float  # [s]


class StoredDelay(Struct):
    """A delay of the commands that was found in flight."""

    delay: float  # [s]
    since: float  # [s]


class StoredRecord(Struct):
    """The keys of a run.json that a Run is made from."""

    spec: dict[str, Any]
    outcome: Outcome
    events: tuple[Event, ...]
    plan_ms: PlanTime
    real_time_factor: float
    digest: str
    # The error that ended the flight, "" if there was none
    fault: str = ""
    # The rotors that were found to be weak or strong
    learned: tuple[StoredRotor, ...] = ()
    # None: commands came when the planner expected them
    learned_delay: StoredDelay | None = None


# heat.json, and the result of a race in the file of a campaign


class StoredPlacing(Struct):
    """The result of one entrant."""

    rank: int
    name: str
    outcome: str
    time: float | None  # None: the entrant has not finished [s]


class StoredEvent(Struct):
    """An event between entrants, see quadsim.heat.result.HeatEvent."""

    kind: str
    name: str
    other: str
    gate: int = 0
    lap: int = 0


class StoredResult(Struct):
    """The result of a race, as a campaign's file stores it."""

    order: list[StoredPlacing]
    events: list[StoredEvent]
    digest: str
    real_time_factor: float
    # name of an entrant -> the error of its planner or controller in flight
    faults: dict[str, str]


class ListedEntrant(Struct):
    """One entrant of a race that a list shows."""

    name: str


class ListedHeatSpec(Struct):
    """The specification of a race that a list shows."""

    seed: int
    entrants: list[ListedEntrant]


class ListedHeat(Struct):
    """The keys of a heat.json that a row of a list shows."""

    course: str
    order: list[StoredPlacing]
    spec: ListedHeatSpec
    runs: list[str]
