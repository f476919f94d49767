"""Spec: the complete specification of one flight, which is built from it and stored with it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import InitVar, asdict, dataclass, field, fields, is_dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar, Unpack, get_args

import msgspec

from controllers.costs import Cost, Term
from controllers.costs.reference import ReferenceWeights
from controllers.learned.pilot import Pilot, load_pilot
from controllers.presets import Planner
from controllers.presets import faults as faults_of_planner
from controllers.samplers import SAMPLERS
from quadsim.config.parts import (
    check_part,
    describe,
    describe_term,
    is_registered,
    own_sampler,
    plain,
    sampler_name,
    term_of_text,
    terms_of,
)
from quadsim.config.presets import PresetSource
from quadsim.config.reference import followed_problem, stored_reference
from quadsim.config.settings import (
    CONTROL_UNITS,
    HELD,
    LINK,
    SETTINGS,
    FlightNumbers,
    FlightSettings,
    Group,
    HostSettings,
    LapCount,
    PlantName,
    Setting,
    SettingError,
    TimeLimit,
    Weight,
    is_optional,
)
from quadsim.course import Course, Start, load_course
from quadsim.course.course import is_described
from quadsim.dynamics.quadrotor import Control, ModelParams
from quadsim.files.values import checked, kinds_of
from quadsim.files.yaml_errors import did_you_mean, shown_value
from quadsim.firmware.configuration import Text, read_text
from quadsim.firmware.identified import identified
from quadsim.firmware.package import built_firmware
from quadsim.firmware.process import MAIN_LOOP
from quadsim.physics.domain_randomization import displaced, draw
from quadsim.physics.faults import (
    CommandLoss,
    Fault,
    RotorFault,
    drawn,
    first_lap,
    parse_fault,
    sensor_key,
)
from quadsim.physics.link import WIRE, LinkConfig
from quadsim.physics.plant import Plant, default_plant
from quadsim.racing.events import NO_PROGRESS, NO_PROGRESS_BY_HAND
from quadsim.racing.flight import ControlLaw, Controller, RefereeProtocol, whole_multiple
from quadsim.racing.hand import HAND, Hand
from quadsim.record.limits import StoredSolution
from quadsim.record.run import INTERACTIVE
from quadsim.record.schema import NumberChange
from quadsim.sensing import PERFECT, Sensing, load_sensing
from quadsim.streams import Streams, quadrotor_streams
from quadsim.vehicle import VEHICLES, Vehicle, load_vehicle, with_thrust_to_weight

if TYPE_CHECKING:
    from quadsim.config.keywords import CourseLike, Keywords

DEFAULT_COURSE = "split_s_swift"
# Keywords that take an object and are not settings.
OBJECTS = ("course", "planner", "model", "controller", "referee", "cost", "terms")
KEYWORDS = (*SETTINGS, *OBJECTS)
# Settings that take an object in place of a name
OBJECT_SETTINGS = ("sampler", "pilot", "vehicle", "sensing", "plant", "preset", "betaflight")
CONFIGURATION = ".betaflight.txt"  # ends the file of a vehicle's configuration of the firmware
PLANTS = get_args(PlantName)
# Settings that every record has under their own names. Any other is left out at its default, so
# that records and their hashes stay the same when a setting is added.
ALWAYS = (
    "seed",
    "penalties",
    "plant_dt",
    "randomize",
    "clock",
    "deadline_ms",
    "threads",
    "runs_dir",
)
# Settings that a record has in another form -> its key there
OTHER_FORMS = {
    "fault": "faults",
    "flight_controller": "betaflight",
    **dict.fromkeys(LINK, "link"),
}
# Plants with the rotors of quadsim.physics.actuators
PLANTS_WITH_ROTORS = ("bullet", "rigid")
# Numbers of the model that were added later; older runs lack them
ADDED = ("yaw_first", "rate_lag", "delay")
# Physics step with the firmware: its gyro and its link are exchanged in each [s]
FIRMWARE_STEP = 1e-3
ROUNDING = 1e-6

T = TypeVar("T")


@dataclass(frozen=True, kw_only=True)
class Spec(FlightNumbers, HostSettings):
    """A complete specification of one flight.

    The same spec gives the same Run to the last bit on the same machine.

    `Spec.of("split_s_swift", sampler="gaussian", horizon=120)` makes one from settings, and every
    setting of `race fly` is a keyword; `spec.but(seed=7)` returns one with changed settings.

    plant, controller and referee may be the user's own: an object for one flight, or a class or
    function that is called with the Spec and makes one. The user's own sampler is
    `planner.sampling`.

    Raises:
        SettingError: the parts do not fit together (a ValueError).

    Examples:
        >>> import quadsim
        >>> spec = quadsim.Spec.of("figure8", sampler="gaussian", laps=1)
        >>> spec.planner.mppi.samples
        4096
        >>> colored = spec.but(sampler="colored", samples=512)
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
        """Check the numbers, and the parts against each other."""
        for name, kind in kinds_of(Spec).items():
            object.__setattr__(self, name, checked(name, getattr(self, name), kind))
        validate(self)
        if settings is None:
            settings = {f.name: getattr(self, f.name) for f in fields(self) if f.name in KEYWORDS}
        object.__setattr__(self, "given", settings)

    def __repr__(self) -> str:
        """Return one short line; `record` has all numbers."""
        laps = f"{self.laps} lap" + "s" * (self.laps > 1)
        flown = f"{self.sampler}, preset {self.preset}, vehicle {self.vehicle.name}"
        return f"<Spec {self.course.name}: {laps}, {flown}, seed {self.seed}>"

    @classmethod
    def of(cls, course: CourseLike | None = None, **settings: Unpack[Keywords]) -> Spec:
        """Return the flight with these settings; the others come from preset, course and vehicle.

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

    def but(self, course: CourseLike | None = None, **changes: Unpack[Keywords]) -> Spec:
        """Return the spec of the same settings with some of them changed.

        Defaults are resolved anew: a new sampler, preset or vehicle brings its own. Settings that
        were given stay. Changes in flight do not: they belong to the one flight in which they were
        made.

        Args:
            course: another course; default: the same.
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
        """The sampler's name, the class name of the user's own, "pilot" or "hand"."""
        if self.hand:
            return HAND
        return "pilot" if self.pilot else sampler_name(self.planner.sampling)

    @property
    def hand(self) -> Hand | None:
        """The controller by which a person flies, None if nobody does."""
        return self.controller if isinstance(self.controller, Hand) else None

    @property
    def has_planner(self) -> bool:
        """Whether a planner may fly: neither a learned pilot nor a person does."""
        return self.pilot is None and self.hand is None

    @property
    def patience(self) -> float:
        """The time without progress after which the vehicle is stuck [s]."""
        return NO_PROGRESS_BY_HAND if self.hand else NO_PROGRESS

    @property
    def preset(self) -> str:
        """The preset that the planner's numbers started from: a name or a file."""
        return self.planner.preset

    @property
    def streams(self) -> Streams:
        """The random streams of this flight, made anew at each access."""
        return quadrotor_streams(self.seed)

    @property
    def link(self) -> LinkConfig:
        """The link that carries the commands."""
        return LinkConfig(**{number: getattr(self, name) for name, number in LINK.items()})

    @property
    def flown_course(self) -> Course:
        """The course with its gates where they truly stand; `course` is the planner's map."""
        if not self.displace_gates:
            return self.course
        return displaced(self.course, self.streams.gates, self.displace_gates)

    @property
    def faults(self) -> tuple[Fault, ...]:
        """The faults as they were given, with gaps where the seed draws."""
        return tuple(parse_fault(text) for text in self.fault)

    @property
    def drawn_faults(self) -> tuple[Fault, ...]:
        """The faults of this flight, with what its seed draws: times, rotors, directions."""
        if not self.fault:
            return ()
        latest = first_lap(self.course, self.vehicle)
        return drawn(self.faults, self.streams.faults, latest)

    def record(self) -> dict[str, Any]:
        """Return the spec as JSON, as a run stores it."""
        record = {
            "system": "quadrotor",
            "course": self.course.name,
            "course_text": self.course.text,
            "vehicle": plain(self.vehicle),
            "sampler": self.sampler,
            "preset": self.preset,
            "planner": {
                "vehicle": self.vehicle.name,
                "sampling": plain(self.planner.sampling),
                "mppi": plain(self.planner.mppi),
                "cost": plain(self.planner.cost),
            },
            "model": _of_model(self.model),
            "laps": self.laps,
            "timeout": self.timeout,
            "plant": self.plant if isinstance(self.plant, str) else "own",
            "variation": asdict(draw(self.streams.vehicle, self.randomize)),
            "host": self._host(),
        }
        # Parts that a flight does not use are left out.
        used = {
            "start": plain(self.start),
            "sensing": plain(self.sensing),
            "view_weight": self.view_weight,
            "faults": [str(fault) for fault in self.faults],
            "drawn_faults": [str(fault) for fault in self.drawn_faults],
            "pilot": self.pilot.record() if self.pilot else None,
            HAND: self.hand.record() if self.hand else None,
            "betaflight": _of_firmware(self.betaflight),
            "link": None if self.link == WIRE else plain(self.link),
            "reference": _followed(self.reference),
            "own": self._own_parts(),
            INTERACTIVE: msgspec.to_builtins(self.changes),
        }
        parts = record | {name: value for name, value in used.items() if value}
        return parts | self._recorded(FlightNumbers)

    def _recorded(self, settings: type) -> dict[str, Any]:
        """Return the settings of a dataclass that a record has under their own names."""
        return {
            f.name: plain(getattr(self, f.name))
            for f in fields(settings)
            if f.name not in OTHER_FORMS
            and (f.name in ALWAYS or getattr(self, f.name) != f.default)
        }

    def own_objects(self) -> dict[str, object]:
        """Return {role: part} of the user's own objects; the role `terms` has a tuple."""
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

    def _own_parts(self) -> dict[str, Any]:
        """Return {role: description} of the user's own objects."""
        own: dict[str, Any] = {}
        for role, part in self.own_objects().items():
            if role == "terms":
                own[role] = [describe_term(term) for term in self.terms]
            else:
                own[role] = describe(part)
        return own

    def _host(self) -> dict[str, Any]:
        """Return the threads and the files of this machine, which do not change the flight."""
        pilot = {"pilot": self.pilot.place} if self.pilot else {}
        return self._recorded(HostSettings) | pilot


def _followed(reference: StoredSolution | None) -> dict[str, str] | None:
    """Return the key and the hash of the solution that a planner follows, as a record has them."""
    return {"key": reference.key, "sha256": reference.digest} if reference else None


def _of_model(model: ModelParams) -> dict[str, Any]:
    """Return the numbers of a model as a record has them.

    Numbers in ADDED are left out at their defaults, so that records and their hashes stay the
    same.
    """
    nominal = {f.name: f.default for f in fields(model) if f.name in ADDED}
    numbers: dict[str, Any] = plain(model)
    return {name: number for name, number in numbers.items() if number != nominal.get(name, ...)}


def _of_firmware(text: Text | None) -> dict[str, Any] | None:
    """Return the configuration and the firmware that reads it, as a record has them."""
    if text is None:
        return None
    firmware = built_firmware().identity
    return {"name": Path(text.name).name, "lines": list(text.lines), "firmware": firmware}


def validate(spec: Spec) -> None:
    """Check the parts of a spec against each other.

    Raises:
        SettingError: some parts do not fit together.
        FileError: the pilot is for another vehicle or control period.
    """
    _check_types(spec)
    dt = spec.planner.mppi.dt
    try:
        whole_multiple(dt, spec.plant_dt)
    except ValueError:
        wanted = f"expected a whole multiple of the plant's step {spec.plant_dt:g} [s]"
        raise SettingError("dt", f"{wanted}, got {dt:g}") from None
    _check_channels(spec.planner)
    for path, problem in faults_of_planner(spec.planner):
        raise SettingError(path.partition(".")[2], problem)
    if spec.view_weight and not (spec.sensing and spec.sensing.camera):
        name = spec.sensing.name if spec.sensing else PERFECT
        raise SettingError("view_weight", f"expected a sensing with a camera, got {name}")
    if isinstance(spec.planner.cost, ReferenceWeights):
        _check_beside_reference(spec.displace_gates, spec.view_weight)
        _check_reference(spec, spec.planner.cost)
    _check_faults(spec)
    _check_flight_controller(spec)
    _check_link(spec)
    if spec.pilot:
        _check_beside_pilot(spec)
        spec.pilot.check(spec.vehicle.name, dt)


def _check_beside_reference(displace_gates: float, view_weight: float) -> None:
    """Check that no setting is given that a reference does not know. Raises SettingError."""
    for name, number in (("displace_gates", displace_gates), ("view_weight", view_weight)):
        if number:
            why = "for a preset whose reference ignores displaced gates and the camera"
            raise SettingError(name, f"expected 0 {why}, got {number:g}")


def _check_reference(spec: Spec, weights: ReferenceWeights) -> None:
    """Check that the solution to be followed is one of this race. Raises SettingError."""
    problem = followed_problem(spec.course, spec.vehicle, spec.laps, weights)
    if spec.reference is None or spec.reference.key != problem.key:
        got = spec.reference.key if spec.reference else None
        raise SettingError("reference", f"expected a solution of {problem.file_name}, got {got}")


def _check_beside_pilot(spec: Spec) -> None:
    """Check that no part is given that a flight with a pilot would ignore. Raises SettingError."""
    if spec.controller is not None:
        problem = f"expected none beside a pilot, got {shown_value(spec.controller)}"
        raise SettingError("controller", problem)
    if spec.deadline_ms is not None:
        problem = f"expected none beside a pilot, which has no samples, got {spec.deadline_ms:g}"
        raise SettingError("deadline_ms", problem)


def _check_flight_controller(spec: Spec) -> None:
    """Check that the firmware has all that it needs. Raises SettingError."""
    if spec.flight_controller == "ideal":
        if spec.betaflight is not None:
            wanted = "expected none beside the flight controller 'ideal'"
            raise SettingError("betaflight", f"{wanted}, got {spec.betaflight.name!r}")
        if spec.blackbox is not None:
            wanted = "expected none without the flight controller 'betaflight'"
            raise SettingError("blackbox", f"{wanted}, got {spec.blackbox!r}")
        return
    if spec.blackbox is not None and not Path(spec.blackbox).absolute().parent.is_dir():
        wanted = "expected a file in a folder that exists"
        raise SettingError("blackbox", f"{wanted}, got {spec.blackbox!r}")
    name = "flight_controller"
    if spec.vehicle.rotors is None:
        wanted = "expected a vehicle with rotors for 'betaflight'"
        raise SettingError(name, f"{wanted}, got {spec.vehicle.name}")
    if spec.plant not in PLANTS_WITH_ROTORS:
        plant = spec.plant if isinstance(spec.plant, str) else "a plant of your own"
        wanted = f"expected plant {' or '.join(PLANTS_WITH_ROTORS)} for 'betaflight'"
        raise SettingError(name, f"{wanted}, got {plant}")
    if not is_whole(spec.plant_dt / MAIN_LOOP):
        wanted = f"expected a whole multiple of {MAIN_LOOP:g} s for 'betaflight'"
        raise SettingError("plant_dt", f"{wanted}, got {spec.plant_dt:g}")
    if spec.betaflight is None:
        wanted = f"expected FILE.txt of Betaflight's CLI for the vehicle {spec.vehicle.name}"
        raise SettingError("betaflight", f"{wanted}, as none comes with the project")


def is_whole(number: float) -> bool:
    """Return whether a number is a whole one from 1 on, up to rounding."""
    return abs(number - round(number)) < ROUNDING and round(number) >= 1


def _check_link(spec: Spec) -> None:
    """Check that the plant has a link, and that its numbers agree. Raises SettingError."""
    link = spec.link
    if link == WIRE:
        return
    if spec.plant not in PLANTS_WITH_ROTORS:
        plant = spec.plant if isinstance(spec.plant, str) else "a plant of your own"
        name = next(name for name in LINK if getattr(spec, name))
        wanted = f"expected plant {' or '.join(PLANTS_WITH_ROTORS)} for a link"
        raise SettingError(name, f"{wanted}, got {plant}")
    if link.rate and link.rate * spec.plant_dt > 1.0 + ROUNDING:
        wanted = f"expected at most {1.0 / spec.plant_dt:g} Hz, a frame in each physics step"
        raise SettingError("link_hz", f"{wanted}, got {link.rate:g}")
    if link.burst is not None:
        # A channel that is bad after each good frame loses bursts of no less than this.
        shortest = link.loss / (1.0 - link.loss)
        if not link.loss or link.burst < shortest:
            wanted = f"at least {shortest:.3g} frames with" if link.loss else "none without"
            raise SettingError("link_burst", f"expected {wanted} link_loss, got {link.burst:g}")


def _check_faults(spec: Spec) -> None:
    """Check that the parts that fail are there. Raises SettingError."""
    for text in spec.fault:
        try:
            fault = parse_fault(text)
        except ValueError as error:
            raise SettingError("fault", str(error)) from None
        if isinstance(fault, RotorFault):
            if spec.vehicle.rotors is None:
                wanted = "expected a vehicle with rotors"
                raise SettingError("fault", f"{wanted} for {text!r}, got {spec.vehicle.name}")
            if spec.plant not in PLANTS_WITH_ROTORS:
                plant = spec.plant if isinstance(spec.plant, str) else "a plant of your own"
                wanted = f"expected plant {' or '.join(PLANTS_WITH_ROTORS)}"
                raise SettingError("fault", f"{wanted} for {text!r}, got {plant}")
        elif not isinstance(fault, CommandLoss):
            key = sensor_key(fault)
            if spec.sensing is None or getattr(spec.sensing, key) is None:
                name = spec.sensing.name if spec.sensing else PERFECT
                wanted = f"expected a sensing with {key!r}"
                raise SettingError("fault", f"{wanted} for {text!r}, got {name}")


def _check_types(spec: Spec) -> None:
    """Check that the parts are objects of the right type. Raises SettingError."""
    wanted = {"course": Course, "vehicle": Vehicle, "planner": Planner, "model": ModelParams}
    for name, kind in wanted.items():
        _check_type(name, getattr(spec, name), kind)
    for name in ("vehicle", "model", "sensing"):
        _check_classes(name, getattr(spec, name))
    if isinstance(spec.plant, str):
        if spec.plant not in PLANTS:
            known = " or ".join(map(repr, PLANTS))
            raise SettingError("plant", f"expected {known}, got {spec.plant!r}")
    else:
        check_part("plant", spec.plant)
    if not (spec.cost is None or isinstance(spec.cost, Cost) or callable(spec.cost)):
        wanted = "expected a Cost, or a function of the default Cost that returns one"
        raise SettingError("cost", f"{wanted}, got {shown_value(spec.cost)}")
    if spec.controller is not None:
        check_part("controller", spec.controller)
    if spec.referee is not None:
        check_part("referee", spec.referee)


def _check_type(name: str, part: object, kind: type) -> None:
    """Raise SettingError unless a part is an object of its type."""
    if not isinstance(part, kind):
        raise SettingError(name, f"expected a {kind.__name__}, got {shown_value(part)}")


def _check_classes(name: str, part: object) -> None:
    """Check that a part and all in it are of the project's own classes. Raises SettingError.

    A record has their numbers alone, which would fly without a subclass's methods.
    """
    if not is_dataclass(part):
        return
    kind = type(part)
    if kind.__module__.partition(".")[0] != "quadsim":
        wanted = "expected one of quadsim's own classes, whose methods need not be recorded"
        raise SettingError(name, f"{wanted}, got {kind.__name__}")
    for inner in fields(part):
        _check_classes(name, getattr(part, inner.name))


def _check_channels(planner: Planner) -> None:
    """Check that a registered sampler has one number for each control. Raises SettingError."""
    if not is_registered(planner.sampling):
        return
    wanted = len(Control._fields)
    for name in ("sigma", "gamma"):
        numbers = getattr(planner.sampling, name, None)
        if numbers is not None and len(numbers) != wanted:
            units = f" [{CONTROL_UNITS}]" if name == "sigma" else ""
            shown = " ".join(map(str, numbers))
            raise SettingError(name, f"expected {wanted} numbers{units}, got {shown}")


def _resolved(given: Mapping[str, Any]) -> Spec:
    """Return the spec of these settings; the others come from preset, course and vehicle."""
    _check_names(given)
    flight = _flight_settings(given)
    plant = given.get("plant")
    own_terms = given.get("terms")

    # Each file is read once; `but` uses the objects that were read.
    read: dict[str, Any] = {}
    course = _loaded(given, "course", Course, load_course, DEFAULT_COURSE, read)
    own_pilot = given.get("pilot")
    pilot = None if own_pilot is None else _part("pilot", own_pilot, Pilot, load_pilot, read)
    sensing = _loaded(given, "sensing", Sensing, load_sensing, PERFECT, read)
    base = _base_planner(given, flight, read)
    default_vehicle = pilot.about.vehicle if pilot else base.vehicle
    vehicle = _loaded(given, "vehicle", Vehicle, load_vehicle, default_vehicle, read)
    if flight.thrust_to_weight:
        vehicle = with_thrust_to_weight(vehicle, flight.thrust_to_weight)

    planner = with_numbers(replace(base, vehicle=vehicle.name), given)
    configuration = _configuration(flight, given, vehicle, read)
    laps = flight.laps or course.laps
    view_weight = _view_weight(flight, base, sensing)
    reference = None
    if isinstance(planner.cost, ReferenceWeights):
        # What can never fly is refused before a solution is asked for.
        _check_beside_reference(flight.displace_gates, view_weight)
        reference = stored_reference(course, vehicle, laps, planner.cost, flight.runs_dir, given)
    settings = {**given, **read}
    spec = Spec(
        course=course,
        vehicle=vehicle,
        planner=planner,
        model=_nominal_model(given, vehicle),
        laps=laps,
        timeout=flight.timeout or default_timeout(course, laps),
        sensing=None if sensing.exact else sensing,
        pilot=pilot,
        view_weight=view_weight,
        plant=default_plant() if plant is None else plant,
        betaflight=configuration,
        terms=(*terms_of(() if own_terms is None else own_terms), *map(term_of_text, flight.term)),
        cost=given.get("cost"),
        controller=given.get("controller"),
        referee=given.get("referee"),
        reference=reference,
        settings=settings,
        **{name: getattr(flight, name) for name in HELD},
    )
    # The spec is checked by now: what can never fly is refused before the firmware is asked for.
    if configuration is not None and given.get("model") is None:
        found = identified(vehicle, configuration, spec.plant_dt, planner.mppi.dt).model(vehicle)
        return replace(spec, model=_changed("model", found, given), settings=settings)
    return spec


def _configuration(
    flight: FlightSettings, given: Mapping[str, Any], vehicle: Vehicle, read: dict[str, Any]
) -> Text | None:
    """Return the firmware's configuration: the one given, or the vehicle's, which may be missing.

    Raises:
        SettingError: it is no file.
        FileError: its file cannot be read.
    """
    own = given.get("betaflight")
    if isinstance(own, Text):
        return own
    if own is not None:
        if not isinstance(own, str | Path):
            raise SettingError("betaflight", f"expected a FILE.txt, got {shown_value(own)}")
        read["betaflight"] = read_text(Path(own))
        return read["betaflight"]
    if flight.flight_controller == "ideal":
        return None
    return shipped_configuration(vehicle)


def shipped_configuration(vehicle: Vehicle) -> Text | None:
    """Return the firmware's configuration that comes with a vehicle, None if none does."""
    path = VEHICLES / f"{vehicle.name.partition('-twr')[0]}{CONFIGURATION}"
    return read_text(path) if path.exists() else None


def _check_names(given: Mapping[str, Any]) -> None:
    """Check that each name is a setting's. Raises SettingError."""
    for name in given:
        if name not in KEYWORDS:
            raise SettingError(name, f"no such setting, {did_you_mean(name, KEYWORDS)}")


def _flight_settings(given: Mapping[str, Any]) -> FlightSettings:
    """Return the flight's settings except those given as objects. Raises SettingError."""
    values: dict[str, Any] = {}
    for f in fields(FlightSettings):
        value = given.get(f.name)
        is_object = f.name in OBJECT_SETTINGS
        if value is None or (is_object and not isinstance(value, str | Path)):
            continue
        if f.name in ("term", "fault") and isinstance(value, str):
            value = (value,)
        values[f.name] = checked(f.name, value, SETTINGS[f.name].kind)
    # The firmware has a physics step of its own.
    if values.get("flight_controller", "ideal") != "ideal":
        values.setdefault("plant_dt", FIRMWARE_STEP)
    return FlightSettings(**values)


def _loaded(
    given: Mapping[str, Any],
    name: str,
    kind: type[T],
    load: Callable[[str], T],
    default: str,
    read: dict[str, Any],
) -> T:
    """Return a part that was given by name, as a FILE.yaml or as an object, or the default.

    Args:
        given: the settings.
        name: name of the setting.
        kind: type of the object.
        load: reads the part that a name or path stands for; raises FileError.
        default: name to load if no part is given.
        read: collects the parts that were loaded by a given name.

    Raises:
        SettingError: the part is neither a name nor an object of its type.
    """
    part = given.get(name)
    return load(default) if part is None else _part(name, part, kind, load, read)


def _part(
    name: str, part: object, kind: type[T], load: Callable[[str], T], read: dict[str, Any]
) -> T:
    """Return a part that was given, see `_loaded`. Raises SettingError."""
    if isinstance(part, kind):
        _check_numbers(name, part)
        return part
    if not isinstance(part, str | Path):
        wanted = f"expected a name, a FILE.yaml or a {kind.__name__}"
        raise SettingError(name, f"{wanted}, got {shown_value(part)}")
    loaded = load(str(part))
    read[name] = loaded
    return loaded


def _check_numbers(name: str, part: object) -> None:
    """Check the numbers of a vehicle or a sensing as in a file. Raises SettingError."""
    if not isinstance(part, Vehicle | Sensing):
        return
    try:
        part.but()
    except SettingError as error:
        raise SettingError(name, str(error)) from None


def _base_planner(
    given: Mapping[str, Any], flight: FlightSettings, read: dict[str, Any]
) -> Planner:
    """Return the preset's planner for the sampler, before single numbers are changed.

    read: collects the text of a preset file, and the user's own sampler.
    """
    sampling = own_sampler(given["sampler"]) if given.get("sampler") is not None else None
    planner = given.get("planner")
    if planner is not None:
        for name in ("sampler", "preset"):
            if given.get(name) is not None:
                wanted = "expected none: the planner of a stored run, or planner=, has its own"
                raise SettingError(name, wanted)
        _check_type("planner", planner, Planner)
        return planner
    preset = given.get("preset")
    if not isinstance(preset, PresetSource):
        if not (preset is None or isinstance(preset, str | Path)):
            raise SettingError(
                "preset", f"expected a name or a FILE.yaml, got {shown_value(preset)}"
            )
        preset = PresetSource.read(flight.preset)
        read |= {"preset": preset} if "preset" in given else {}
    firmware = flight.flight_controller != "ideal"
    if sampling is None:
        return preset.planner(flight.sampler, firmware)
    read["sampler"] = sampling
    # The user's own sampler gets the MPPI and cost numbers of the default sampler.
    name = sampler_name(sampling) if is_registered(sampling) else FlightSettings.sampler
    return replace(preset.planner(name, firmware), sampling=sampling)


def with_numbers(planner: Planner, given: Mapping[str, Any]) -> Planner:
    """Return the planner with the given numbers of its sampler, MPPI and cost."""
    groups: tuple[Group, ...] = ("sampling", "mppi", "cost")
    changed = {group: _changed(group, getattr(planner, group), given) for group in groups}
    return replace(planner, **changed)


def _nominal_model(given: Mapping[str, Any], vehicle: Vehicle) -> ModelParams:
    """Return the planner's model: the vehicle's nominal one with the given numbers.

    Behind the firmware it is replaced by the model that a flight on the test bench shows.
    """
    model = given.get("model")
    if model is None:
        model = ModelParams.of(vehicle)
    _check_type("model", model, ModelParams)
    return _changed("model", model, given)


def _changed(group: Group, values: Any, given: Mapping[str, Any]) -> Any:
    """Return a group's dataclass with the settings that were given. Raises SettingError."""
    owner: type[object] = values.__class__
    changes: dict[str, object] = {}
    for name, value in given.items():
        setting = SETTINGS.get(name)
        if setting is None or setting.group != group:
            continue
        kind = setting.kinds.get(owner)
        if value is None and (kind is None or not is_optional(kind)):
            continue  # the default
        if kind is None:
            raise SettingError(name, _owners(setting))
        changes[setting.field] = checked(name, value, kind)
    return replace(values, **changes) if changes else values


def _owners(setting: Setting) -> str:
    """Return an error's text with the samplers or costs that have this setting."""
    names = [name for name, cls in SAMPLERS.items() if cls in setting.kinds]
    if names:
        return f"expected none, it is a setting of {' and '.join(names)} sampling only"
    owners = " and ".join(owner.__name__ for owner in setting.kinds)
    return f"expected none, it is a setting of {owners} only"


def _view_weight(flight: FlightSettings, base: Planner, sensing: Sensing) -> float:
    """Return the weight of the cost term that makes the camera look along the flight.

    It helps if a camera has to find displaced gates; otherwise a flight without yaw is faster.
    """
    if flight.view_weight is not None:
        return flight.view_weight
    return base.view_weight if sensing.camera and flight.displace_gates else 0.0


def default_timeout(course: Course, laps: int) -> float:
    """Return the time limit [s]: 10 s, and the laps at 2 m/s along the lines between gates.

    It is at most the largest `timeout` that may be given.
    """
    return min(10.0 + laps * course.lap_length / 2.0, 1e5)
