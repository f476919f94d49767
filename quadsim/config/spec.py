"""The complete specification of one flight, from which it is built and with which it is stored."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import InitVar, dataclass, field, fields, replace
from math import inf
from pathlib import Path
from typing import TYPE_CHECKING, Any, Unpack

import msgspec

from quadsim.config.checks import (
    check_beside_pilot,
    check_beside_reference,
    check_classes,
    check_cost,
    check_faults,
    check_firmware,
    check_known_from,
    check_link,
    check_network,
    check_no_firmware,
    check_period,
    check_planner,
    check_plant,
    check_record_sensing,
    check_reference,
    check_type,
    check_view,
)
from quadsim.config.competition import given_competition, with_competition
from quadsim.config.own import (
    check_part,
    describe,
    describe_term,
    term_of_text,
    terms_of,
)
from quadsim.config.recorded import check_same, sorted_settings, spec_fields
from quadsim.config.reference import followed_problem, stored_reference
from quadsim.config.resolve import (
    DEFAULT_COURSE,
    KEYWORDS,
    Loader,
    check_names,
    default_timeout,
    flight_settings,
    is_seen_late,
    nominal_model,
    scale_of,
    view_weight_of,
    with_excitation,
    with_numbers,
    with_settings,
)
from quadsim.config.settings import (
    HELD,
    FlightNumbers,
    HostSettings,
    LapCount,
    PlantName,
    TimeLimit,
    Weight,
)
from quadsim.controllers.costs import Cost, Term
from quadsim.controllers.costs.reference import ReferenceWeights
from quadsim.controllers.excitation import EXCITE
from quadsim.controllers.learned.pilot import Pilot, load_pilot
from quadsim.controllers.presets import Planner
from quadsim.controllers.samplers import is_registered, sampler_name
from quadsim.course import Course, Start, load_course
from quadsim.course.course import is_described
from quadsim.dynamics.quadrotor import ModelParams
from quadsim.files.plain_values import plain
from quadsim.files.values import checked, kinds_of
from quadsim.firmware.identified import model_behind
from quadsim.firmware.package import built_firmware
from quadsim.firmware.text import Text
from quadsim.limit.limits import StoredSolution
from quadsim.physics.domain_randomization import (
    Displacement,
    Randomization,
    displaced,
    draw,
    stretched,
)
from quadsim.physics.faults import (
    Fault,
    drawn,
    first_lap,
    parse_fault,
)
from quadsim.physics.link import LinkConfig
from quadsim.physics.plant import Plant, default_plant
from quadsim.physics.randomization_file import (
    OUTDOOR,
    OUTDOOR_NAME,
    RandomizationRanges,
    load_randomization,
)
from quadsim.racing.events import NO_PROGRESS, NO_PROGRESS_BY_HAND
from quadsim.racing.flight import ControlLaw, Controller, RefereeProtocol
from quadsim.racing.hand import HAND, Hand
from quadsim.record.run import INTERACTIVE, flown_by
from quadsim.record.schema import NumberChange
from quadsim.sensing import PERFECT, Sensing, load_sensing
from quadsim.streams import Streams, quadrotor_streams
from quadsim.vehicle import Vehicle, load_vehicle, with_thrust_to_weight

if TYPE_CHECKING:
    from quadsim.config.keywords import CourseLike, Keywords


@dataclass(frozen=True, kw_only=True)
class Spec(FlightNumbers, HostSettings):
    """A complete specification of one flight.

    The same spec gives the same Run to the last bit on the same machine.

    `Spec.of("split_s_swift", sampler="gaussian", horizon=120)` makes a spec from settings, and
    every setting of `race fly` is a keyword; `spec.but(seed=7)` returns a spec with changed
    settings.

    `plant`, `controller` and `referee` may be the user's own: an object for one flight, or a class
    or function that is called with the Spec and returns such an object. A user's own sampler is
    stored in `planner.sampling`.

    Raises:
        SettingError: the parts do not fit together (a ValueError).

    Examples:
        >>> import quadsim
        >>> spec = quadsim.Spec.of("figure8", sampler="gaussian", laps=1)
        >>> spec.planner.mppi.samples
        1024
        >>> colored = spec.but(sampler="colored", samples=256)
        >>> runs = [quadsim.fly(colored, seed=seed) for seed in range(2)]
    """

    course: Course  # the planner's map
    vehicle: Vehicle
    planner: Planner
    model: ModelParams  # the planner's model of the vehicle
    laps: LapCount
    timeout: TimeLimit  # [s]
    start: Start | None = None  # place on a start grid; None: the course's own start
    sensing: Sensing | None = None  # None: the planner is given the true state
    randomization: RandomizationRanges = OUTDOOR  # what `randomize` draws
    pilot: Pilot | None = None  # a learned pilot in the planner's place
    view_weight: Weight = 0.0  # of the term that keeps the camera along the flight
    plant: PlantName | Plant | Callable[[Spec], Plant] = field(default_factory=default_plant)
    betaflight: Text | None = None  # configuration of the firmware, if that flies
    terms: tuple[Term, ...] = ()  # the user's own, beside the terms of the cost
    cost: Cost | Callable[[Cost], Cost] | None = None  # replaces or changes the cost
    controller: Controller | ControlLaw | Callable[[Spec], Controller | ControlLaw] | None = None
    referee: RefereeProtocol | Callable[[Spec], RefereeProtocol] | None = None
    # The stored solution that a preset with ReferenceWeights follows
    reference: StoredSolution | None = field(default=None, compare=False)
    # The planner's numbers that change in flight, in the order of their times
    changes: tuple[NumberChange, ...] = ()
    # The settings that this spec is made from; None: its parts
    settings: InitVar[Mapping[str, Any] | None] = None
    # The same, which `but` changes. Files that they name have been read and are not read again.
    given: Mapping[str, Any] = field(init=False, repr=False, compare=False)

    def __post_init__(self, settings: Mapping[str, Any] | None) -> None:
        """Check the numbers, and that the parts fit together."""
        for name, kind in kinds_of(Spec).items():
            object.__setattr__(self, name, checked(name, getattr(self, name), kind))
        validate(self)
        if settings is None:
            settings = {f.name: getattr(self, f.name) for f in fields(self) if f.name in KEYWORDS}
        object.__setattr__(self, "given", settings)

    def __repr__(self) -> str:
        """Return one short line; `record` has all numbers."""
        laps = f"{self.laps} lap" + "s" * (self.laps > 1)
        flown = f"{self.flown_by}, preset {self.preset}, vehicle {self.vehicle.name}"
        return f"<Spec {self.course.name}: {laps}, {flown}, seed {self.seed}>"

    @classmethod
    def of(cls, course: CourseLike | None = None, **settings: Unpack[Keywords]) -> Spec:
        """Return the spec of a flight with these settings.

        Other settings come from the preset, the course and the vehicle.

        Args:
            course: a name, a FILE.yaml or a Course.
            settings: keywords of `quadsim.fly`.

        Raises:
            SettingError: a setting is invalid; its message is one line (a ValueError).
            FileError: a file or a stored solution that the settings need cannot be read (a
                ValueError).
        """
        given: dict[str, Any] = dict(settings)
        if course is not None:
            given["course"] = course
        return _resolved(given)

    @classmethod
    def of_record(cls, record: Mapping[str, Any], **settings: Any) -> Spec:
        """Return the Spec of a recorded flight, which flies the same to the last bit.

        Files that the flight used (a pilot, a solution of `race limit`) are read from their
        recorded places, and must be unchanged. A record has the names of the user's own parts, but
        not their code: each part must be given again, and be unchanged.

        Args:
            record: `spec` of a run.
            settings: keywords of `quadsim.fly`. The user's own parts of the flight, its pilot if
                the file has moved, the folder of runs and the threads do not change the flight.
                With any other keyword it is another flight, in which changes made in flight are not
                repeated.

        Raises:
            RecordError: a file or a part is missing or differs, or the record is not the record of
                a flight (a FileError).
            SettingError: a setting is invalid.

        Examples:
            >>> import quadsim
            >>> run = quadsim.fly("figure8", laps=1, samples=256)
            >>> quadsim.Spec.of_record(run.spec).sampler
            'colored'
        """
        beside = sorted_settings(record, settings)
        spec = cls(**spec_fields(record, beside))
        check_same(record, spec.record())
        return spec.but(**beside.changed) if beside.changed else spec

    def but(self, course: CourseLike | None = None, **changes: Unpack[Keywords]) -> Spec:
        """Return a spec with some settings changed.

        Given settings are kept. Defaults are resolved anew, because a new sampler, preset or
        vehicle has other defaults. Changes in flight are dropped, because they belong to the flight
        in which they were made.

        Args:
            course: another course; by default the same course.
            changes: keywords of `quadsim.fly`; None resets a setting to its default.

        Raises:
            SettingError, FileError: as for `of`.
        """
        given = {**self.given, **changes}
        if course is not None:
            given["course"] = course
        return _resolved(given)

    def on_threads(self, threads: int) -> Spec:
        """Return the spec of the same flight with another number of CPU threads."""
        return replace(self, threads=threads, settings={**self.given, "threads": threads})

    @property
    def sampler(self) -> str:
        """The sampler's name, the class of a user's own sampler, "pilot", "hand" or "excite"."""
        if self.hand:
            return HAND
        if self.excite:
            return EXCITE
        return "pilot" if self.pilot else sampler_name(self.planner.sampling)

    @property
    def flown_by(self) -> str:
        """The sampler's name as in `sampler`, or the class of the user's own controller."""
        return flown_by({"sampler": self.sampler, "own": self._own_controller()})

    @property
    def hand(self) -> Hand | None:
        """The controller of a flight by hand, None for other flights."""
        return self.controller if isinstance(self.controller, Hand) else None

    @property
    def has_planner(self) -> bool:
        """Whether a planner flies, rather than a learned pilot, a person or manoeuvres."""
        return self.pilot is None and self.hand is None and not self.excite

    @property
    def stuck_after(self) -> float:
        """The time without progress after which the vehicle is stuck [s]."""
        if self.excite:
            return inf
        return NO_PROGRESS_BY_HAND if self.hand else NO_PROGRESS

    @property
    def preset(self) -> str:
        """The preset on which the planner's numbers are based: a name or a file."""
        return self.planner.preset

    @property
    def streams(self) -> Streams:
        """New random streams of this flight."""
        return quadrotor_streams(self.seed)

    @property
    def link(self) -> LinkConfig:
        """The link that carries the commands."""
        return LinkConfig.of(vars(self))

    @property
    def flown_course(self) -> Course:
        """The course with the true positions of its gates; `course` is the planner's map."""
        by = self.displacement
        stands = self.course
        if self.map_scale != 1.0:
            stands = stretched(stands, 1.0 / self.map_scale)
        return displaced(stands, self.streams.gates, by) if by.is_any else stands

    @property
    def displacement(self) -> Displacement:
        """The half widths of the displacements of gates and obstacles from the map."""
        return Displacement.of(self.randomization, self.randomize, self.displace_gates)

    @property
    def variation(self) -> Randomization:
        """The changes of start, vehicle and wind that the seed draws."""
        return draw(
            self.streams.vehicle,
            self.randomize,
            self.flown_course,
            self.start,
            self.randomization,
            self.vehicle,
        )

    @property
    def faults(self) -> tuple[Fault, ...]:
        """The faults as given, in which numbers that the seed draws are missing."""
        return tuple(parse_fault(text) for text in self.fault)

    @property
    def drawn_faults(self) -> tuple[Fault, ...]:
        """The faults of this flight, completed by the seed: times, rotors, directions."""
        if not self.fault:
            return ()
        latest = first_lap(self.course, self.vehicle)
        return drawn(self.faults, self.streams.faults, latest)

    def record(self) -> dict[str, Any]:
        """Return the spec as a JSON dict for a run, with every number, also at its default."""
        return {
            "system": "quadrotor",
            "course": {"name": self.course.name, "text": self.course.text},
            "vehicle": plain(self.vehicle),
            "sampler": self.sampler,
            "preset": self.preset,
            "planner": {
                "vehicle": self.vehicle.name,
                "sampling": plain(self.planner.sampling),
                "mppi": plain(self.planner.mppi),
                "cost": plain(self.planner.cost),
            },
            "model": plain(self.model),
            "laps": self.laps,
            "timeout": self.timeout,
            "start": plain(self.start),
            "sensing": plain(self.sensing),
            "randomization": plain(self.randomization),
            "view_weight": self.view_weight,
            "plant": self.plant if isinstance(self.plant, str) else "own",
            "pilot": self.pilot.record() if self.pilot else None,
            HAND: self.hand.record() if self.hand else None,
            "betaflight": _of_firmware(self.betaflight),
            "reference": _followed(self.reference),
            "own": self._own_parts(),
            INTERACTIVE: msgspec.to_builtins(self.changes),
            **{f.name: plain(getattr(self, f.name)) for f in fields(FlightNumbers)},
            # What the seed has drawn
            "variation": plain(self.variation),
            "drawn_faults": [str(fault) for fault in self.drawn_faults],
            "host": self._host(),
        }

    def own_objects(self) -> dict[str, object]:
        """Return the user's own objects by role; the role `terms` has a tuple."""
        parts: dict[str, object] = {
            "cost": self.cost,
            "controller": None if self.hand else self.controller,
            "referee": self.referee,
            "terms": self.terms or None,
        }
        if not isinstance(self.plant, str):
            parts["plant"] = self.plant
        if not is_registered(self.planner.sampling):
            parts["sampler"] = self.planner.sampling
        # A course that was made in Python, or changed after its text was read
        if not is_described(self.course):
            parts["course"] = self.course
        return {role: part for role, part in parts.items() if part is not None}

    def _own_controller(self) -> dict[str, Any]:
        """Return the user's own controller as {"controller": description}, {} if none flies."""
        own = self.own_objects()
        return {"controller": describe(own["controller"])} if "controller" in own else {}

    def _own_parts(self) -> dict[str, Any]:
        """Return the descriptions of the user's own objects by role."""
        own: dict[str, Any] = {}
        for role, part in self.own_objects().items():
            if role == "terms":
                own[role] = [describe_term(term) for term in self.terms]
            else:
                own[role] = describe(part)
        return own

    def _host(self) -> dict[str, Any]:
        """Return the threads and the files of this machine, which do not change the flight."""
        settings = {f.name: plain(getattr(self, f.name)) for f in fields(HostSettings)}
        return settings | {"pilot": self.pilot.place if self.pilot else None}


def _followed(reference: StoredSolution | None) -> dict[str, str] | None:
    """Return the key and the hash of the solution that a planner follows, for a record."""
    return {"key": reference.key, "sha256": reference.digest} if reference else None


def _of_firmware(text: Text | None) -> dict[str, Any] | None:
    """Return the configuration and the version of the firmware, for a record."""
    if text is None:
        return None
    firmware = built_firmware().identity
    return {"name": Path(text.name).name, "lines": list(text.lines), "firmware": firmware}


def validate(spec: Spec) -> None:
    """Check each part of a spec, and that the parts fit together.

    Raises:
        SettingError: some parts do not fit together.
        FileError: the pilot is for another vehicle or control period.
    """
    wanted = {"course": Course, "vehicle": Vehicle, "planner": Planner, "model": ModelParams}
    for name, kind in wanted.items():
        check_type(name, getattr(spec, name), kind)
    for name in ("vehicle", "model", "sensing", "randomization"):
        check_classes(name, getattr(spec, name))
    check_plant(spec.plant)
    check_cost(spec.cost)
    for role in ("controller", "referee"):
        if getattr(spec, role) is not None:
            check_part(role, getattr(spec, role))
    dt = spec.planner.mppi.dt
    check_period(dt, spec.plant_dt)
    check_planner(spec.planner)
    check_view(spec.view_weight, spec.sensing)
    check_record_sensing(spec.record_sensing, spec.sensing)
    check_known_from(spec.known_from, spec.sensing, spec.pilot)
    check_network(spec.sensing)
    if isinstance(spec.planner.cost, ReferenceWeights):
        check_beside_reference(spec.displacement.gates, spec.view_weight, spec.map_scale)
        problem = followed_problem(spec.course, spec.vehicle, spec.laps, spec.planner.cost)
        check_reference(spec.reference, problem)
    check_faults(spec.fault, spec.vehicle, spec.plant, spec.sensing, spec.flight_controller)
    if spec.flight_controller == "ideal":
        check_no_firmware(spec.betaflight, spec.blackbox)
    else:
        check_firmware(spec.betaflight, spec.blackbox, spec.vehicle, spec.plant, spec.plant_dt)
    check_link(spec.link, spec.plant, spec.plant_dt)
    if spec.pilot:
        check_beside_pilot(spec.controller, spec.deadline_ms)
        spec.pilot.check(spec.vehicle.name, dt)


def _resolved(given: Mapping[str, Any]) -> Spec:
    """Return the spec of settings, completed by the preset, the course and the vehicle."""
    check_names(given)
    asked = given
    competition = given_competition(asked)
    given = with_excitation(with_competition(asked, competition))
    flight = flight_settings(given)
    loader = Loader(given)
    plant = given.get("plant")
    own_terms = () if given.get("terms") is None else terms_of(given["terms"])

    course = loader.part("course", Course, load_course, DEFAULT_COURSE)
    pilot = loader.given_part("pilot", Pilot, load_pilot)
    controller = loader.controller()
    sensing = loader.part("sensing", Sensing, load_sensing, PERFECT)
    randomization = loader.part(
        "randomization", RandomizationRanges, load_randomization, OUTDOOR_NAME
    )
    source = loader.planner_source(flight)
    base = source.at(None)
    default_vehicle = pilot.about.vehicle if pilot else base.vehicle
    vehicle = loader.part("vehicle", Vehicle, load_vehicle, default_vehicle)
    if flight.thrust_to_weight:
        vehicle = with_thrust_to_weight(vehicle, flight.thrust_to_weight)

    # Numbers of the preset follow from course, vehicle and control period.
    seen_late = is_seen_late(flight, randomization)
    base = source.at(scale_of(course, vehicle, given, base, seen_late))
    planner = with_numbers(replace(base, vehicle=vehicle.name), given)
    configuration = loader.configuration(flight, vehicle)
    laps = flight.laps or course.laps
    view_weight = view_weight_of(flight, base, sensing)
    reference = None
    if isinstance(planner.cost, ReferenceWeights):
        # What can never fly is refused before a solution is asked for.
        check_beside_reference(flight.displace_gates, view_weight, flight.map_scale)
        reference = stored_reference(course, vehicle, laps, planner.cost, flight.runs_dir, given)
    # Parts of a competition are not kept as given: another competition has others.
    read = loader.read | ({"competition": competition} if competition else {})
    settings = {**asked, **{name: part for name, part in read.items() if name in asked}}
    spec = Spec(
        course=course,
        vehicle=vehicle,
        planner=planner,
        model=nominal_model(given, vehicle),
        laps=laps,
        timeout=flight.timeout or default_timeout(course, laps),
        sensing=None if sensing.exact else sensing,
        randomization=randomization,
        pilot=pilot,
        view_weight=view_weight,
        plant=default_plant() if plant is None else plant,
        betaflight=configuration,
        terms=(*own_terms, *map(term_of_text, flight.term)),
        cost=given.get("cost"),
        controller=controller,
        referee=given.get("referee"),
        reference=reference,
        settings=settings,
        **{name: getattr(flight, name) for name in HELD},
    )
    # The spec has been checked, so an invalid one is refused before the firmware is needed.
    if configuration is not None and given.get("model") is None:
        found = model_behind(vehicle, configuration, spec.plant_dt, planner.mppi.dt)
        return replace(spec, model=with_settings("model", found, given), settings=settings)
    return spec
