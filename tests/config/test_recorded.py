"""A stored run can be flown again from its spec, or one line says why it cannot."""

import json
import shutil
from dataclasses import dataclass, fields, replace
from typing import NamedTuple

import numpy as np
import pytest
from run_cases import two_laps

import quadsim
from quadsim.config.changes import changeable_numbers
from quadsim.config.recorded import RecordError
from quadsim.config.settings import FlightNumbers, SettingError
from quadsim.config.spec import Spec
from quadsim.controllers.learned.pilot import PILOTS
from quadsim.course import load_course
from quadsim.dynamics.quadrotor import CONTROL_UNITS
from quadsim.files.strict_yaml import FileError
from quadsim.limit.limits import SOLUTIONS, dump, load
from quadsim.record.run import canonical, hostless, why_not_repeatable
from quadsim.record.schema import NumberChange
from quadsim.vehicle import load_vehicle
from quadsim.web.race.live_flight import LiveFlight
from quadsim.web.state.choices import Choices
from quadsim.web.state.numbers import Change
from tests.small import SHORT

# Long enough for a change in flight
BRIEF = {**SHORT, "first_iterations": 10, "timeout": 0.15}


@dataclass(frozen=True)
class Held:
    """A sampler: each control keeps one random value for some steps."""

    table: np.ndarray
    steps: int = 10

    def sample(self, rng, samples, horizon, controls):
        pieces = rng.standard_normal((samples, -(-horizon // self.steps), controls))
        return self.table.diagonal()[:controls] * pieces.repeat(self.steps, axis=1)[:, :horizon]


def calm(x, x_next, u, target, p):
    """A cost term: the square of the yaw rate."""
    return u.wz * u.wz


def table(last=0.5):
    """Return a large matrix whose shape alone a record shows."""
    found = np.eye(150)
    found[3, 3] = last
    return found


def as_stored(record):
    """Return a record as a file holds it."""
    return json.loads(canonical(record))


def stored(run):
    """Return a run's spec as a file holds it."""
    return as_stored(run.spec)


FLIGHTS = {
    "whole numbers": ("figure8", BRIEF | {"thrust_to_weight": 3, "model_drag": 0, "timeout": 1}),
    "randomized": ("split_s_swift", BRIEF | {"sampler": "gaussian", "seed": 5, "randomize": 1.0}),
    "smooth": ("paper_flat", BRIEF | {"sampler": "smooth_star"}),
    "sensors": ("split_s_swift", BRIEF | {"sensing": "vio", "randomize": 1.0}),
    # The view term would be compiled for this flight alone.
    "displaced": (
        "split_s_swift",
        BRIEF | {"sensing": "gates", "displace_gates": 0.3, "view_weight": 0.0},
    ),
    "pilot": ("split_s_swift", {"pilot": "split_s_swift", "timeout": 0.3}),
    # In the loops of tests/controllers/test_race_caution.py
    "competition": (None, BRIEF | {"competition": "lsy_level2", "seed": 3}),
    "timed": ("figure8", BRIEF | {"penalties": True, "plant_dt": 0.002}),
    "faults": ("split_s_swift", BRIEF | {"fault": ("rotor=.7@.05", "commands=lost@.1-.12")}),
    "rotorpy": ("figure8", BRIEF | {"plant": "rotorpy"}),
}


# The loop of the competition would be compiled for this flight alone.
@pytest.mark.compiled
@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=[pytest.mark.regression] if name == "competition" else [])
        for name in FLIGHTS
    ],
)
def test_a_stored_run_flies_again_to_the_last_bit(name):
    if name == "rotorpy":
        pytest.importorskip("rotorpy")
    course, settings = FLIGHTS[name]
    run = quadsim.fly(course, **settings)
    assert why_not_repeatable(run) == ""
    assert quadsim.fly(stored(run)).digest() == run.digest()


def test_a_record_of_another_view_weight_gives_it_again():
    spec = Spec.of("split_s_swift", sensing="gates", displace_gates=0.3, view_weight=0.7)
    assert Spec.of_record(as_stored(spec.record())).view_weight == 0.7


def test_every_number_of_a_flight_is_recorded_and_read():
    numbers = {
        "seed": 3,
        "randomize": 0.5,
        "displace_gates": 0.3,
        "map_scale": 0.93,
        "known_from": 0.7,
        "fault": ("rotor2=0.5@3.2",),
        "excite": True,
        "penalties": True,
        "plant_dt": 0.002,
        "link_hz": 100.0,
        "link_latency": 0.01,
        "link_loss": 0.2,
        "link_burst": 3.0,
        "predict": False,
        "clock": "wall",
        "deadline_ms": 50.0,
    }
    # Gates are known from near by only without sensors, which manoeuvres have otherwise.
    spec = Spec.of("split_s_swift", plant="rigid", sensing="perfect", **numbers)
    again = Spec.of_record(as_stored(spec.record()))
    # Not every machine has the firmware, whose configuration is recorded.
    names = {field.name for field in fields(FlightNumbers)} - {"flight_controller"}
    assert names == numbers.keys()
    assert {name: getattr(again, name) for name in names} == numbers


def test_a_run_of_a_preset_that_is_no_more_flies_with_the_numbers_it_has():
    record = as_stored(Spec.of("lsy_level2", vehicle="crazyflie", margin=0.08, **SHORT).record())
    spec = Spec.of_record(record | {"preset": "race_small"})
    assert (spec.preset, spec.planner.cost.margin) == ("race_small", 0.08)
    assert spec.but(seed=7).planner == spec.planner


@pytest.mark.compiled
def test_the_digest_of_a_stored_run_tells_flights_apart():
    run = quadsim.fly("figure8", **BRIEF)
    other = quadsim.fly(stored(run), seed=run.spec["seed"] + 1)
    assert other.digest() != run.digest()


FRAMES = 16


def page_flight(changes):
    """Fly on the page, with changes {number of frames: Change}; return the run."""
    settings = {"horizon": BRIEF["horizon"], "first_iterations": BRIEF["first_iterations"]}
    choices = Choices(course="figure8", sampler="colored", seed=3, settings=settings)
    flight = LiveFlight(choices)
    for frame in range(FRAMES):
        if frame in changes:
            flight.change(changes[frame])
        flight.advance()
    spec = flight.now.record
    run = flight._recorder.run(spec)
    flight.close()
    return run


@pytest.mark.compiled
def test_changes_made_on_the_page_are_made_again():
    changes = {
        0: Change("samples", 512),
        4: Change("sigma", 1.7),
        8: Change("gamma_rates", 0.5),
        9: Change("temperature", 0.2),
        12: Change("target_ess", 0.0),
    }
    run = page_flight(changes)
    assert [change["name"] for change in run.spec["interactive"]][:3] == [
        "samples",
        "sigma",
        "gamma_rates",
    ]
    frames = quadsim.frames(stored(run))
    again = [next(frames) for _ in range(FRAMES)]
    frames.close()
    flown = np.array([frame.u for frame in again])
    seen = np.column_stack([run.telemetry[name] for name in CONTROL_UNITS])
    np.testing.assert_array_equal(flown, seen)
    # The whole run of the same spec has the same record, but for the host
    record = as_stored(Spec.of_record(stored(run)).record())
    assert hostless(record) == hostless(stored(run))
    without = page_flight({0: changes[0]})
    assert not np.array_equal(without.telemetry["a_cmd"], run.telemetry["a_cmd"])


def test_own_parts_are_given_again_and_have_to_be_the_same():
    parts = {"sampler": Held(table()), "terms": [(calm, 0.5)]}
    record = as_stored(Spec.of("figure8", **BRIEF, **parts).record())
    assert why_not_repeatable(two_laps(record)).startswith("it needs your own ")
    again = Spec.of_record(record, sampler=Held(table()), terms=[(calm, 0.5)])
    assert hostless(as_stored(again.record())) == hostless(record)
    with pytest.raises(RecordError, match=r"^sampler: the flight had one of your own, whose code"):
        quadsim.fly(record, terms=[(calm, 0.5)])
    with pytest.raises(RecordError, match=r"^sampler: expected the Held that flew, got one that"):
        quadsim.fly(record, sampler=Held(table(0.6)), terms=[(calm, 0.5)])
    with pytest.raises(RecordError, match=r"^terms: expected the calm 0.5 that flew, got one"):
        quadsim.fly(record, sampler=Held(table()), terms=[(calm, 0.6)])


class Plain:
    """A sampler without fields: white noise of one size."""

    def __init__(self, sigma=0.5):
        self.sigma = sigma

    def sample(self, rng, samples, horizon, controls):
        return self.sigma * rng.standard_normal((samples, horizon, controls))


class Named(NamedTuple):
    """A sampler that is a named tuple."""

    sigma: float = 0.5

    def sample(self, rng, samples, horizon, controls):
        return self.sigma * rng.standard_normal((samples, horizon, controls))


@pytest.mark.compiled
def test_a_flight_with_a_sampler_of_ones_own_is_flown_again():
    run = quadsim.fly("figure8", **BRIEF, sampler=Plain())
    assert quadsim.fly(stored(run), sampler=Plain()).digest() == run.digest()


@pytest.mark.parametrize("kind", [Plain, Named])
def test_a_sampler_of_any_class_is_given_again(kind):
    record = as_stored(Spec.of("figure8", **BRIEF, sampler=kind()).record())
    assert isinstance(Spec.of_record(record, sampler=kind()).planner.sampling, kind)
    with pytest.raises(RecordError, match=r"^sampler: the flight had .*sampler=..., or --sampler"):
        quadsim.fly(record)
    with pytest.raises(
        RecordError, match=r"^sampler: expected the .* that flew, got one that diff"
    ):
        quadsim.fly(record, sampler=kind(0.6))


def test_a_part_that_contains_itself_is_recorded_and_given_again():
    def looped(sigma):
        sampler = Plain(sigma)
        sampler.inside = [sampler]
        sampler.inside.append(sampler.inside)
        return sampler

    record = as_stored(Spec.of("figure8", **BRIEF, sampler=looped(0.5)).record())
    assert isinstance(Spec.of_record(record, sampler=looped(0.5)).planner.sampling, Plain)
    with pytest.raises(RecordError, match=r"^sampler: expected the Plain that flew"):
        Spec.of_record(record, sampler=looped(0.6))


@pytest.mark.compiled
def test_changes_in_flight_of_a_sampler_of_ones_own_are_made_again():
    spec = Spec.of("figure8", **BRIEF, sampler=Held(table()))
    mppi = replace(spec.planner.mppi, temperature=0.05)
    numbers = changeable_numbers(replace(spec.planner, mppi=mppi))
    change = NumberChange(0.05, "temperature", 1.0, 0.05, numbers)
    run = quadsim.fly(replace(spec, changes=(change,)))
    assert quadsim.fly(stored(run), sampler=Held(table())).digest() == run.digest()
    assert quadsim.fly(spec).digest() != run.digest()


def test_a_vehicle_with_methods_of_ones_own_is_refused():
    vehicle = load_vehicle("swift")

    class Weak(type(vehicle.rotors)):
        """Rotors that a record would show as sound ones."""

        def thrust(self, speed):
            return 0.7 * super().thrust(speed)

    weak = replace(vehicle, rotors=Weak(**vars(vehicle.rotors)))
    with pytest.raises(SettingError, match=r"^vehicle: expected one of quadsim's own .* got Weak"):
        quadsim.fly("figure8", **BRIEF, vehicle=weak)


def test_a_course_changed_in_python_is_a_part_of_ones_own():
    """Its text describes another course, so that the record alone cannot fly it."""
    course = load_course("figure8")
    moved = replace(course, gates=(replace(course.gates[0], yaw=0.1), *course.gates[1:]))
    record = as_stored(Spec.of(moved, **BRIEF).record())
    assert list(record["own"]) == ["course"]
    assert Spec.of_record(record, course=moved).course == moved
    with pytest.raises(RecordError, match=r"^course: expected the Course that flew"):
        Spec.of_record(record, course=course)
    with pytest.raises(RecordError, match=r"^course: .*fly quadsim.Spec.of_record\(run.spec, cour"):
        quadsim.fly(record)


def copied(path, folder, sink=0.0):
    """Copy a solution, with the path lowered by some metres."""
    folder.mkdir(parents=True, exist_ok=True)
    stored = load(path)
    x = stored.solution.x.copy()
    x[:, 2] -= sink
    lowered = replace(stored, solution=replace(stored.solution, x=x))
    (folder / path.name).write_bytes(dump(lowered))


def test_a_solution_that_was_followed_is_in_the_record_and_has_to_be_there(tmp_path, monkeypatch):
    def record(**settings):
        return as_stored(Spec.of("split_s_swift", preset="race_informed", **settings).record())

    followed = record()["reference"]
    source = next(path for path in SOLUTIONS.glob(f"*_{followed['key']}.npz"))
    monkeypatch.setattr("quadsim.limit.limits.SOLUTIONS", tmp_path / "none")

    limits = tmp_path / "runs" / "limits"
    runs_dir = str(tmp_path / "runs")
    copied(source, limits)
    flown = record(runs_dir=runs_dir)
    assert Spec.of_record(flown).record()["reference"] == flown["reference"]
    copied(source, limits, sink=0.05)
    assert record(runs_dir=runs_dir)["reference"] != flown["reference"]
    wanted = r"_3_rates.*: expected the solution that was followed, with sha256 .*, got 1 of other"
    with pytest.raises(FileError, match=wanted):
        quadsim.fly(flown)
    (limits / source.name).unlink()
    with pytest.raises(FileError, match=r"expected the solution that was followed.*got none"):
        quadsim.fly(flown)


def test_a_pilot_that_flew_has_to_be_the_same(tmp_path):
    file = tmp_path / "mine.npz"
    shutil.copy(PILOTS / "split_s_swift.npz", file)
    run = quadsim.fly("split_s_swift", pilot=str(file), timeout=0.1)
    moved = tmp_path / "moved.npz"
    file.rename(moved)
    with pytest.raises(FileError, match="no pilot"):
        quadsim.fly(stored(run))
    assert quadsim.fly(stored(run), pilot=str(moved)).digest() == run.digest()
    moved.rename(file)
    arrays = dict(np.load(file))
    arrays["layer_5"][0] += np.float32(1e-3)
    np.savez(file, **arrays)
    with pytest.raises(FileError, match=rf"{file}: expected the pilot that flew, sha256 .*changed"):
        quadsim.fly(stored(run))
    file.unlink()
    with pytest.raises(FileError, match="no pilot"):
        quadsim.fly(stored(run))


DAMAGED = {
    "no flight": ({}, "expected the record of a flight"),
    "another seed's vehicle": ({"seed": 7}, "variation: expected what this version"),
    "text": ({"laps": "3"}, r"expected the record of a flight.*laps"),
    "sampler": ({"sampler": "pink"}, "sampler: expected one of"),
    "number": ({"timeout": -1.0}, "timeout: expected"),
    "numbers": ({"model": {"drag": 1}}, r"expected the record of a flight.*model"),
    "course": ({"course": {"name": "figure8", "text": "gates: []"}}, "figure8"),
    "plant": ({"plant": "gazebo"}, "plant: expected 'bullet'"),
}
# A record obeys the ranges of the files that its parts come from: key, value, message
OUT_OF_RANGE = {
    "mass": (("vehicle", "mass"), 0.0, r"expected the record of a flight.*vehicle\.mass"),
    "inertia": (
        ("vehicle", "inertia", 0),
        0.0,
        r"expected the record of a flight.*vehicle\.inertia",
    ),
    "radius": (("vehicle", "radius"), -1.0, r"expected the record of a flight.*vehicle\.radius"),
    "latency": (("vehicle", "latency"), 1e9, r"expected the record of a flight.*vehicle\.latency"),
    "thrust": (("vehicle", "thrust_max"), 1e308, "vehicle: thrust_max: expected"),
    "thrust map": (("vehicle", "rotors", "thrust_map"), [0, 0, 0], "vehicle: rotors.thrust_map"),
    "rotors": (("vehicle", "rotors", "arm_l"), None, "vehicle: rotors: expected either arm_l"),
    "start": (("start",), {"position": [1e308, 0.0, 1.0], "yaw": 0.0}, "start: "),
    "yaw": (("start",), {"position": [-8.0, 0.0, 1.0], "yaw": float("nan")}, "start: expected"),
    "sensor": (("sensing", "pose", "rate"), 1e9, "sensing"),
}


@pytest.mark.parametrize("what", OUT_OF_RANGE)
def test_a_record_obeys_the_ranges_of_files(what):
    place, value, message = OUT_OF_RANGE[what]
    record = as_stored(Spec.of("figure8", **BRIEF, sensing="mocap").record())
    inner = record
    for key in place[:-1]:
        inner = inner[key]
    inner[place[-1]] = value
    with pytest.raises(RecordError, match=message) as error:
        quadsim.fly(record)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("what", DAMAGED)
def test_a_record_that_is_none_is_one_line(what):
    changes, message = DAMAGED[what]
    spec = stored_figure8()
    record = spec | changes if changes else {"course": "figure8"}
    with pytest.raises((RecordError, SettingError, FileError), match=message) as error:
        quadsim.fly(record)
    assert "\n" not in str(error.value)


def stored_figure8():
    """Return the record of a randomized flight."""
    return as_stored(Spec.of("figure8", **BRIEF, randomize=1.0).record())


def test_a_flight_by_the_wall_clock_is_not_called_repeatable():
    for settings in ({"clock": "wall"}, {"deadline_ms": 50.0}):
        run = two_laps(Spec.of("figure8", **settings).record())
        assert "wall clock" in why_not_repeatable(run)
    run = two_laps(Spec.of("figure8").record(), "interrupted")
    assert why_not_repeatable(run) == "the flight was interrupted"
