"""A stored run can be flown again from its spec, or one line says why it cannot."""

import json
import shutil
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
import pytest

import quadsim
from controllers.learned.pilot import PILOTS
from quadsim.course import load_course
from quadsim.dynamics.quadrotor import CONTROL_UNITS
from quadsim.files.strict_yaml import FileError
from quadsim.record.limits import SOLUTIONS
from quadsim.record.run import hostless, why_not_repeatable
from quadsim.spec.changes import PlannerChange
from quadsim.spec.recorded import RecordError, recorded_spec, spec_of_record
from quadsim.spec.settings import SettingError
from quadsim.spec.spec import Spec
from quadsim.vehicle import load_vehicle
from web.choices import Choices
from web.live_flight import LiveFlight
from web.numbers import Change

SMALL = {"samples": 256, "horizon": 40, "iterations": 1, "laps": 1, "timeout": 0.4}


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


def stored(run):
    """Return a run's spec as a file holds it."""
    return json.loads(json.dumps(run.spec))


FLIGHTS = {
    "whole numbers": ("figure8", SMALL | {"thrust_to_weight": 3, "model_drag": 0, "timeout": 1}),
    "randomized": ("split_s_swift", SMALL | {"sampler": "gaussian", "seed": 5, "randomize": 1.0}),
    "smooth": ("paper_flat", SMALL | {"preset": "paper", "sampler": "smooth_star"}),
    "sensors": ("split_s_swift", SMALL | {"sensing": "vio", "randomize": 1.0}),
    "displaced": ("split_s_swift", SMALL | {"sensing": "gates", "displace_gates": 0.3}),
    "reference": ("split_s_swift", {"preset": "race_informed", "samples": 256, "timeout": 0.3}),
    "pilot": ("split_s_swift", {"pilot": "split_s_swift", "timeout": 1.0}),
    "timed": ("figure8", SMALL | {"penalties": True, "plant_dt": 0.002}),
    "faults": ("split_s_swift", SMALL | {"fault": ("rotor=.7@.1", "commands=lost@.2-.3")}),
}


@pytest.mark.parametrize("name", FLIGHTS)
def test_a_stored_run_flies_again_to_the_last_bit(name):
    course, settings = FLIGHTS[name]
    run = quadsim.fly(course, **settings)
    assert why_not_repeatable(run) == ""
    again = quadsim.fly(stored(run))
    assert again.digest() == run.digest()
    other = quadsim.fly(stored(run), seed=run.spec["seed"] + 1)
    assert other.digest() != run.digest(), "the digest tells flights apart"


def test_a_run_on_rotorpy_flies_again():
    pytest.importorskip("rotorpy")
    run = quadsim.fly("figure8", **SMALL, plant="rotorpy")
    assert quadsim.fly(stored(run)).digest() == run.digest()


def page_flight(changes):
    """Fly on the page, with changes {number of frames: Change}; return the run."""
    flight = LiveFlight(
        Choices(course="figure8", preset="race", vehicle="swift", sampler="colored", seed=3)
    )
    for frame in range(40):
        if frame in changes:
            flight.change(changes[frame])
        flight.advance()
    spec = flight.now.spec
    run = flight._recorder.run(spec)
    flight.close()
    return run


def test_changes_made_on_the_page_are_made_again():
    changes = {
        0: Change("samples", 512),
        10: Change("sigma", 1.7),
        20: Change("gamma_rates", 0.5),
        21: Change("temperature", 0.2),
        30: Change("target_ess", 0.0),
    }
    run = page_flight(changes)
    assert [change["name"] for change in run.spec["interactive"]][:3] == [
        "samples",
        "sigma",
        "gamma_rates",
    ]
    frames = quadsim.frames(stored(run))
    again = [next(frames) for _ in range(40)]
    frames.close()
    flown = np.array([frame.u for frame in again])
    seen = np.column_stack([run.telemetry[name] for name in CONTROL_UNITS])
    np.testing.assert_array_equal(flown, seen)
    # The whole run of the same spec has the same record, but for the host
    record = json.loads(json.dumps(recorded_spec(stored(run), {}).record()))
    assert hostless(record) == hostless(stored(run))
    without = page_flight({})
    assert not np.array_equal(without.telemetry["a_cmd"], run.telemetry["a_cmd"])


def test_own_parts_are_given_again_and_have_to_be_the_same():
    parts = {"sampler": Held(table()), "terms": [(calm, 0.5)]}
    run = quadsim.fly("figure8", **SMALL, **parts)
    spec = stored(run)
    assert why_not_repeatable(run).startswith("it needs your own ")
    assert quadsim.fly(spec, sampler=Held(table()), terms=[(calm, 0.5)]).digest() == run.digest()
    with pytest.raises(RecordError, match=r"^sampler: the flight had one of your own, whose code"):
        quadsim.fly(spec, terms=[(calm, 0.5)])
    with pytest.raises(RecordError, match=r"^sampler: expected the Held that flew, got one that"):
        quadsim.fly(spec, sampler=Held(table(0.6)), terms=[(calm, 0.5)])
    with pytest.raises(RecordError, match=r"^terms: expected the calm 0.5 that flew, got one"):
        quadsim.fly(spec, sampler=Held(table()), terms=[(calm, 0.6)])


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


@pytest.mark.parametrize("kind", [Plain, Named])
def test_a_sampler_of_any_class_is_given_again(kind):
    run = quadsim.fly("figure8", **SMALL, sampler=kind())
    assert quadsim.fly(stored(run), sampler=kind()).digest() == run.digest()
    with pytest.raises(RecordError, match=r"^sampler: the flight had .*sampler=..., or --sampler"):
        quadsim.fly(stored(run))
    with pytest.raises(
        RecordError, match=r"^sampler: expected the .* that flew, got one that diff"
    ):
        quadsim.fly(stored(run), sampler=kind(0.6))


def test_a_part_that_contains_itself_is_recorded_and_given_again():
    def looped():
        sampler = Plain()
        sampler.inside = [sampler]
        sampler.inside.append(sampler.inside)
        return sampler

    run = quadsim.fly("figure8", **SMALL, sampler=looped())
    assert quadsim.fly(stored(run), sampler=looped()).digest() == run.digest()


def test_changes_in_flight_of_a_sampler_of_ones_own_are_made_again():
    spec = Spec.of("figure8", **SMALL, sampler=Held(table()))
    mppi = replace(spec.planner.mppi, temperature=0.05)
    change = PlannerChange(0.1, "temperature", 1.0, 0.05, spec.planner.sampling, mppi)
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
        quadsim.fly("figure8", **SMALL, vehicle=weak)


def test_a_course_changed_in_python_is_a_part_of_ones_own():
    """Its text describes another course, so that the record alone cannot fly it."""
    course = load_course("figure8")
    moved = replace(course, gates=(replace(course.gates[0], yaw=0.1), *course.gates[1:]))
    run = quadsim.fly(moved, **SMALL)
    assert list(run.spec["own"]) == ["course"]
    assert quadsim.fly(spec_of_record(stored(run), course=moved)).digest() == run.digest()
    with pytest.raises(RecordError, match=r"^course: expected the Course that flew"):
        spec_of_record(stored(run), course=course)
    with pytest.raises(RecordError, match=r"^course: .*fly spec_of_record\(run.spec, course="):
        quadsim.fly(stored(run))


def copied(path, folder, sink=0.0):
    """Copy a solution, with the path lowered by some metres."""
    folder.mkdir(parents=True, exist_ok=True)
    arrays = dict(np.load(path))
    arrays["x"][:, 2] -= np.float32(sink)
    np.savez_compressed(folder / path.name, **arrays)
    return folder / path.name


def test_a_solution_that_was_followed_is_in_the_record_and_has_to_be_there(tmp_path, monkeypatch):
    settings = {"preset": "race_informed", "samples": 256, "timeout": 0.3}
    followed = quadsim.fly("split_s_swift", **settings).spec["reference"]
    source = next(path for path in SOLUTIONS.glob(f"*_{followed['key']}.npz"))
    monkeypatch.setattr("quadsim.record.limits.SOLUTIONS", tmp_path / "none")

    limits = tmp_path / "runs" / "limits"
    runs_dir = str(tmp_path / "runs")
    copied(source, limits)
    run = quadsim.fly("split_s_swift", **settings, runs_dir=runs_dir)
    copied(source, limits, sink=0.05)
    lower = quadsim.fly("split_s_swift", **settings, runs_dir=runs_dir)
    assert lower.spec["reference"] != run.spec["reference"]
    assert lower.digest() != run.digest()
    wanted = r"_3_rates.*: expected the solution that was followed, with sha256 .*, got 1 of other"
    with pytest.raises(FileError, match=wanted):
        quadsim.fly(stored(run))
    (limits / source.name).unlink()
    with pytest.raises(FileError, match=r"expected the solution that was followed.*got none"):
        quadsim.fly(stored(run))


def test_a_pilot_that_flew_has_to_be_the_same(tmp_path):
    file = tmp_path / "mine.npz"
    shutil.copy(PILOTS / "split_s_swift.npz", file)
    run = quadsim.fly("split_s_swift", pilot=str(file), timeout=0.5)
    assert quadsim.fly(stored(run)).digest() == run.digest()
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
    "course": ({"course_text": "gates: []"}, "figure8"),
    "plant": ({"plant": "gazebo"}, "plant: expected 'bullet'"),
}


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
    return json.loads(json.dumps(Spec.of("figure8", **SMALL, randomize=1.0).record()))


def test_a_flight_by_the_wall_clock_is_not_called_repeatable():
    run = quadsim.fly("figure8", **SMALL, clock="wall")
    assert "wall clock" in why_not_repeatable(run)
    run = quadsim.fly("figure8", **SMALL, deadline_ms=50.0)
    assert "wall clock" in why_not_repeatable(run)
    assert why_not_repeatable(replace(run, outcome="interrupted")) == "the flight was interrupted"
