"""Spec: one flight, whole. The same record builds the flight and is stored with its run."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field, fields
from typing import Any

from controllers.learned.pilot import Pilot
from controllers.presets import Planner
from controllers.samplers import SAMPLERS
from quadsim.physics.domain_randomization import displaced, draw
from quadsim.sensing import Sensing
from quadsim.spec.own_parts import OwnParts, describe, plain
from quadsim.spec.resolve import resolve
from quadsim.spec.systems import SYSTEMS, SystemEntry
from quadsim.streams import Streams


@dataclass(frozen=True)
class Spec:
    """One flight, whole. Same spec, same machine: the same Run to the last bit.

    Made by `Spec.of("split_s_swift", sampler="gaussian", horizon=120)`; every setting of `race fly`
    is a keyword.
    """

    system: str  # of SYSTEMS
    course: Any  # Course, Corridor or PointGoal
    vehicle: Any
    sampler: str  # name, or the class name of the user's own
    preset: str
    planner: Planner
    model: Any  # the planner's model of the vehicle
    seed: int
    laps: int
    timeout: float  # [s]
    penalties: bool
    plant_dt: float  # [s]
    plant: str = "model"  # of physics.plant.PLANTS; model: the system is its own world
    # size of domain randomization and disturbance, see quadsim.physics.domain_randomization
    randomize: float = 0.0
    sensing: Sensing | None = None  # None: the planner is given the true state
    displace_gates: float = 0.0  # how far gates may stand off the map, along x and y [m]
    view_weight: float = 0.0  # of the nose pointing where the vehicle flies, for a gate camera
    clock: str = "simulated"  # of CLOCKS
    deadline_ms: float | None = None  # shrink the samples so that a plan takes no longer
    pilot: Pilot | None = None  # a learned one in the planner's place
    host: dict = field(default_factory=dict)  # what must not change a flight: threads, folders
    own: OwnParts = field(default_factory=OwnParts)

    @classmethod
    def of(cls, course: Any = None, **settings: Any) -> Spec:
        """Names resolved, numbers checked; arguments as of `quadsim.fly`.

        Raises:
            SettingError: a ValueError of one line that names the setting.
            FileError: a course, vehicle or preset that cannot be read (a ValueError).
        """
        return cls(**resolve(course, **settings))

    @property
    def entry(self) -> SystemEntry:
        return self.own.system or SYSTEMS[self.system]

    @property
    def streams(self) -> Streams:
        """The random streams of this flight, made anew at each access."""
        return self.entry.streams(self.seed)

    @property
    def flown_course(self) -> Any:
        """The course as it stands, which may differ from the planner's map `course`."""
        return (
            displaced(self.course, self.streams.gates, self.displace_gates)
            if self.displace_gates
            else self.course
        )

    def record(self) -> dict:
        """The JSON that a run keeps. What no flight had before there were sensors is left out where
        it is not used."""
        unused = {
            name for name in ("sensing", "displace_gates", "view_weight") if not getattr(self, name)
        }
        left_out = unused | {"course", "own", "pilot"}
        kept = {
            f.name: plain(getattr(self, f.name)) for f in fields(self) if f.name not in left_out
        }
        kept["planner"].pop("view_weight")  # the preset's; the flight's own is kept above
        kept |= {"course": self.course.name, "course_text": self.course.text}
        kept["variation"] = asdict(
            draw(self.streams.vehicle, self.randomize if self.system == "quadrotor" else 0.0)
        )
        own = self.own.described()
        if type(self.planner.sampling) not in SAMPLERS.values():
            own["sampler"] = describe(self.planner.sampling)
        if self.own.system:
            own["system"] = {
                "states": list(self.entry.states),
                "controls": list(self.entry.controls),
            }
        learned = {"pilot": self.pilot.record()} if self.pilot else {}
        return kept | learned | ({"own": own} if own else {})
