"""Stored solutions: a damaged or foreign file is one line, and never the limit of a race."""

import json
import shutil
from dataclasses import dataclass, fields, replace

import numpy as np
import pytest

from quadsim.config.spec import Spec
from quadsim.course import load_course, parse_course
from quadsim.course.gate import EstimatedGate
from quadsim.files.arrays import npz_bytes
from quadsim.limit.limits import SOLUTIONS, LimitError, LimitProblem, dump, limit_of, load
from quadsim.vehicle import Vehicle, load_vehicle
from quadsim.vehicle.vehicle import Rotors, VehicleFile

(ORIGINAL,) = SOLUTIONS.glob("figure8_swift_3_rotors_*.npz")
SWIFT = load_vehicle("swift")
FIGURE8 = LimitProblem.of(load_course("figure8"), SWIFT, 3)
LAPS = load(ORIGINAL).lap_times
with np.load(ORIGINAL) as loaded:
    ARRAYS = dict(loaded)
FACTS = json.loads(str(ARRAYS["facts"]))


def but(**arrays):
    """Return the file with other arrays; None stands for one that is missing."""
    return npz_bytes({n: a for n, a in (ARRAYS | arrays).items() if a is not None})


def saying(**facts):
    """Return the file with other facts."""
    return but(facts=np.array(json.dumps(FACTS | facts)))


DAMAGED = {
    "no archive": (b"PK", "zip"),
    "other lap times": (saying(lap_times=[t / 2 for t in LAPS]), "content has changed"),
    "other states": (but(x=ARRAYS["x"][::-1].copy()), "content has changed"),
    "other times": (but(t=ARRAYS["t"] * 1.01), "content has changed"),
    "no hash": (but(sha256=None), "content has changed"),
    "states in a row": (but(x=ARRAYS["x"].ravel()), "x"),
    "one control": (but(u=ARRAYS["u"][:, :1]), "u"),
    "no facts": (but(facts=np.array("null")), "."),
    "deep JSON": (but(facts=np.array('{"verified": ' + "[" * 100_000)), "."),
    "an unknown array": (but(wings=ARRAYS["t"]), "wings"),
    "a file of the next format": (
        saying(format="quadsim solution 2"),
        "format 'quadsim solution 1', got 'quadsim solution 2'",
    ),
    "a file from before the formats": (
        but(facts=np.array('{"laps": 3}'), sha256=None),
        "format 'quadsim solution 1', got none",
    ),
}


def test_a_damaged_solution_is_one_line(tmp_path, recwarn):
    path = tmp_path / ORIGINAL.name
    for name, (data, problem) in DAMAGED.items():
        path.write_bytes(data)
        with pytest.raises(LimitError, match=problem) as error:
            load(path)
        text = str(error.value)
        assert text.startswith(f"{path}: expected the solution of a race"), name
        assert text.isprintable(), name
        assert not recwarn.list, name


def test_what_is_written_is_read(tmp_path):
    stored = load(ORIGINAL)
    path = tmp_path / "x.npz"
    path.write_bytes(dump(stored))
    found = load(path)
    assert (found.key, found.digest) == (FIGURE8.key, stored.digest)
    assert (found.lap_times, found.verified) == (stored.lap_times, stored.verified)
    np.testing.assert_array_equal(found.solution.x, stored.solution.x)


def test_no_solution_of_the_project_passes_for_another(tmp_path):
    path = tmp_path / ORIGINAL.name
    others = [other for other in SOLUTIONS.glob("*.npz") if other != ORIGINAL]
    assert len(others) == 12
    for other in others:
        shutil.copy(other, path)
        with pytest.raises(LimitError, match="with the key") as error:
            FIGURE8.read(path)
        assert str(error.value).startswith(f"{path}: expected")
        assert "\n" not in str(error.value)


@dataclass(frozen=True)
class Painted(Vehicle):
    """A vehicle with a field more than a search knows."""

    colour: str = "red"


def test_a_field_that_the_search_does_not_read_makes_no_other_race():
    numbers = {name: getattr(SWIFT, name) for name in Vehicle.__dataclass_fields__}
    gates = tuple(EstimatedGate.of(gate, (0.0,) * 3, std=0.2) for gate in FIGURE8.course.gates)
    same = {
        "a new field of the vehicle": replace(FIGURE8, vehicle=Painted(**numbers)),
        "a new field of the gates": replace(FIGURE8, course=replace(FIGURE8.course, gates=gates)),
        "latency": replace(FIGURE8, vehicle=replace(SWIFT, latency=0.02)),
        "uncertainty": replace(FIGURE8, vehicle=replace(SWIFT, uncertainty=None)),
    }
    for what, problem in same.items():
        assert problem.key == FIGURE8.key, what


def test_each_number_that_the_search_reads_makes_another_race():
    course = FIGURE8.course
    first, *more = course.gates

    def of_gate(**changes):
        return replace(FIGURE8, course=replace(course, gates=(replace(first, **changes), *more)))

    def of_vehicle(**changes):
        return replace(FIGURE8, vehicle=replace(SWIFT, **changes))

    others = [
        of_gate(yaw=first.yaw + 0.1),
        of_gate(position=(0.1, 0.0, 1.5)),
        of_gate(frame_width=0.9),
        of_gate(frame_depth=0.9),
        of_vehicle(mass=1.5),
        of_vehicle(drag=(0.1, 0.2, 0.3)),
        of_vehicle(radius=0.3),
        of_vehicle(rate_lead=(0.01, 0.0, 0.0)),
        of_vehicle(rotors=replace(SWIFT.rotors, motor_tau=0.2)),
        of_vehicle(rotors=None),
        replace(FIGURE8, laps=2),
        replace(FIGURE8, model="rates"),
        replace(FIGURE8, closed=True),
        replace(FIGURE8, margin=0.01),
        replace(FIGURE8, reserve=0.01),
    ]
    assert len({problem.key for problem in [FIGURE8, *others]}) == 1 + len(others)


def test_a_course_of_the_same_gates_shares_the_limit_under_another_name(tmp_path):
    course = parse_course(FIGURE8.course.text.replace("name: figure8", "name: mine"), "mine.yaml")
    twin = replace(FIGURE8, course=replace(course, name="mine"))
    assert twin.best_known().time == pytest.approx(sum(LAPS))


def test_a_damaged_file_beside_a_whole_one_counts_as_none_with_a_remark(tmp_path):
    (tmp_path / ORIGINAL.name).write_bytes(b"PK")
    remarks = []
    spec = Spec.of("figure8", laps=3).record()
    assert limit_of(spec, tmp_path, remark=remarks.append).time == pytest.approx(sum(LAPS))
    (remark,) = remarks
    assert remark.startswith(str(tmp_path))


# Changes of a vehicle's numbers that leave its limit: names and origins, when commands arrive, what
# is drawn from, and a rotor's equation, of which the model has the lag alone.
LEAVE_THE_LIMIT = {"source", "latency", "uncertainty", "motor_response"}


def test_every_other_number_of_a_vehicle_makes_another_limit():
    """A solution of one vehicle is shown for no other."""
    changes = {
        "source": "elsewhere",
        "mass": 0.9,
        "inertia": (0.0026, 0.0021, 0.0043),
        "radius": 0.11,
        "rate_tau": (0.03, 0.03, 0.06),
        "rate_lead": (0.01, 0.01, 0.01),
        "omega_max": (9.0, 9.0, 3.0),
        "drag": (0.3, 0.3, 0.3),
        "latency": 0.02,
        "uncertainty": dict.fromkeys(("mass", "thrust", "rate_lag", "motor_lag", "drag"), 0.1),
    }
    of_rotors = {
        "arm_l": 0.2,
        "motor_omega_min": 160.0,
        "motor_omega_max": 2900.0,
        "motor_tau": 0.04,
        "motor_response": (30.0, 0.0, 30.0, 0.0),
        "thrust_map": (1.5e-6, 0.0, 0.0),
        "kappa": 0.02,
    }
    vehicles = {name: SWIFT.but(**{name: value}) for name, value in changes.items()}
    vehicles |= {name: SWIFT.but(rotors={name: value}) for name, value in of_rotors.items()}
    # thrust_max is a key of vehicles without rotors alone; rotor_x and rotor_y are another arm_l.
    keys = {f.name for record in (VehicleFile, Rotors) for f in fields(record)}
    assert vehicles.keys() == keys - {"thrust_max", "rotors", "rotor_x", "rotor_y"}

    for name, vehicle in vehicles.items():
        assert vehicle != SWIFT, name
        assert (replace(FIGURE8, vehicle=vehicle).key == FIGURE8.key) == (name in LEAVE_THE_LIMIT)
