"""Stored solutions: a damaged or foreign file is one line, and never the limit of a race."""

import json
import shutil
from dataclasses import replace

import numpy as np
import pytest

from quadsim.config.spec import Spec
from quadsim.course import load_course, parse_course
from quadsim.files.arrays import npz_bytes
from quadsim.limit.limits import SOLUTIONS, LimitError, LimitProblem, dump, limit_of, load
from quadsim.vehicle import load_vehicle

(ORIGINAL,) = SOLUTIONS.glob("figure8_swift_3_rotors_*.npz")
FIGURE8 = LimitProblem.of(load_course("figure8"), load_vehicle("swift"), 3)
with np.load(ORIGINAL) as loaded:
    ARRAYS = dict(loaded)
FACTS = json.loads(str(ARRAYS["facts"]))


def but(**arrays):
    """Return the file with other arrays."""
    return npz_bytes(ARRAYS | arrays)


def saying(**facts):
    """Return the file with other facts; None stands for one that is missing."""
    changed = {name: value for name, value in (FACTS | facts).items() if value != "missing"}
    return but(facts=np.array(json.dumps(changed)))


def checked(**facts):
    """Return the file with another summary of its check."""
    changed = {k: v for k, v in (FACTS["verified"] | facts).items() if v != "missing"}
    return saying(verified=changed)


LAPS = FACTS["lap_times"]
DAMAGED = {
    "no archive": (b"PK", "zip"),
    "lap times of text": (saying(lap_times=["a"] * 3), "lap_times"),
    "lap times of null": (saying(lap_times=None), "lap_times"),
    "a lap time": (saying(lap_times=12.87), "lap_times"),
    "no lap times": (saying(lap_times=[]), "lap_times"),
    "a negative lap time": (saying(lap_times=[-5.0, *LAPS[1:]]), "lap_times"),
    "one lap time of three": (saying(lap_times=[sum(LAPS)]), "lap_times"),
    "other lap times": (saying(lap_times=[t / 2 for t in LAPS]), "lap_times"),
    "truths as lap times": (saying(lap_times=[True] * 3), "lap_times"),
    "no check": (saying(verified=None), "verified"),
    "a check without its numbers": (saying(verified={"broken": []}), "verified"),
    "a check without a residual": (checked(residual="missing"), "residual"),
    "a negative residual": (checked(residual=-1.0), "residual"),
    "events of text": (checked(events={"pass": "24"}), "events"),
    "a crash": (checked(outcome="crashed"), "outcome"),
    "a fault": (checked(broken=["referee: hit"]), "referee: hit"),
    "laps of text": (saying(laps="3"), "laps"),
    "no laps": (saying(laps=0), "laps"),
    "laps of a number": (saying(laps=3.5), "laps"),
    "another model": (saying(model="foo"), "foo"),
    "closed of text": (saying(closed="no"), "closed"),
    "a far margin": (saying(margin=1e308), "margin"),
    "a name of a number": (saying(course=3), "course"),
    "an unknown fact": (saying(wings=2), "wings"),
    "a fact that is missing": (saying(vehicle="missing"), "vehicle"),
    "deep JSON": (but(facts=np.array('{"verified": ' + "[" * 100_000)), "."),
    "states in a row": (but(x=ARRAYS["x"].ravel()), "x"),
    "one control": (but(u=ARRAYS["u"][:, :1]), "u"),
    "nine controls": (but(u=np.repeat(ARRAYS["u"], 3, axis=1)[:, :9]), "u"),
    "sixteen states": (but(x=ARRAYS["x"][:, 1:], costate=ARRAYS["costate"][:, 1:]), "16"),
    "far states": (but(x=ARRAYS["x"] * np.float32(1e30)), "x"),
    "no attitude": (but(x=ARRAYS["x"] * (np.arange(17) != 6).astype(np.float32)), "attitude"),
    "states backwards": (but(x=ARRAYS["x"][::-1].copy()), "velocities"),
    "a jump": (but(x=ARRAYS["x"] + (np.arange(723) == 300)[:, None].astype(np.float32)), "x: "),
    "a target too far": (but(target=ARRAYS["target"] + np.int16(3)), "target"),
    "the target 20000": (but(target=np.full_like(ARRAYS["target"], 20_000)), "target"),
    "targets in rows": (but(target=ARRAYS["target"][None]), "target"),
    "targets backwards": (but(target=ARRAYS["target"][::-1].copy()), "target"),
    "a negative target": (but(target=-ARRAYS["target"]), "target"),
    "slow times": (but(t=ARRAYS["t"] * 1e9), "t: "),
    "fast times": (but(t=ARRAYS["t"] * 1e-9), "t: "),
    "early times": (but(t=ARRAYS["t"] - 1e6), "t: "),
    "other times": (but(t=ARRAYS["t"] * 1.01), "lap_times"),
    "a node less": (but(x=ARRAYS["x"][:-1], t=ARRAYS["t"][:-1]), "length"),
    "nothing": (but(**{k: a[:0] for k, a in ARRAYS.items() if k != "facts"}), "node"),
}


def test_a_damaged_solution_is_one_line(tmp_path, recwarn):
    path = tmp_path / ORIGINAL.name
    for name, (data, problem) in DAMAGED.items():
        path.write_bytes(data)
        with pytest.raises(LimitError, match=problem) as error:
            load(path)
        text = str(error.value)
        assert text.startswith(f"{path}: expected the solution of a race: "), name
        assert text.isprintable(), name
        assert not recwarn.list, name


def test_what_is_written_is_read_with_its_key(tmp_path):
    stored = replace(load(ORIGINAL), key=FIGURE8.key)
    path = tmp_path / "x.npz"
    path.write_bytes(dump(stored))
    found = load(path)
    assert found.key == FIGURE8.key
    assert found.lap_times == stored.lap_times
    assert found.verified == stored.verified
    np.testing.assert_array_equal(found.solution.x, stored.solution.x)


def test_a_closed_lap_may_end_a_little_behind_its_last_gate(tmp_path):
    path = tmp_path / "x.npz"
    lap = float(ARRAYS["t"][-1]) - 0.05
    path.write_bytes(saying(closed=True, laps=1, lap_times=[lap]))
    assert load(path).time == lap
    path.write_bytes(saying(closed=False, laps=1, lap_times=[lap]))
    with pytest.raises(LimitError, match="lap_times"):
        load(path)


FOREIGN = {
    "another course": {"course": "paper_flat"},
    "another vehicle": {"vehicle": "kingfisher"},
    "other laps": {"laps": 2, "lap_times": [sum(LAPS) / 2] * 2},
    "another model": {"model": "rates"},
    "a closed lap": {"closed": True},
    "a margin": {"margin": 0.03},
    "a reserve": {"reserve": 0.002},
    "another key": {"key": "0123456789abcdef"},
}


def test_the_solution_of_another_race_is_refused(tmp_path):
    path = tmp_path / ORIGINAL.name
    for name, facts in FOREIGN.items():
        path.write_bytes(saying(**facts))
        with pytest.raises(LimitError, match="expected") as error:
            FIGURE8.best_known(tmp_path)
        assert str(error.value).startswith(f"{path}: "), name
        assert "\n" not in str(error.value), name


def test_no_solution_of_the_project_passes_for_another(tmp_path):
    path = tmp_path / ORIGINAL.name
    passed = []
    for other in SOLUTIONS.glob("*.npz"):
        shutil.copy(other, path)
        try:
            passed.append((other, FIGURE8.read(path).time))
        except LimitError:
            continue
    assert passed == [(ORIGINAL, pytest.approx(sum(LAPS)))]


def test_a_solution_leads_through_the_gates_of_its_race(tmp_path):
    beside = ARRAYS["x"].copy()
    beside[:, 1] += 3.0
    path = tmp_path / ORIGINAL.name
    path.write_bytes(but(x=beside))
    # in itself it is whole
    assert load(path).laps == 3
    with pytest.raises(LimitError, match="gate 1"):
        FIGURE8.read(path)


def test_a_solution_stays_within_the_vehicles_commands(tmp_path):
    path = tmp_path / ORIGINAL.name
    for factor in (-1.0, 1.1, 100.0):
        path.write_bytes(but(u=ARRAYS["u"] * np.float32(factor)))
        with pytest.raises(LimitError, match="vehicle's limits"):
            FIGURE8.read(path)


def test_a_course_of_the_same_gates_shares_the_limit_under_another_name(tmp_path):
    course = parse_course(FIGURE8.course.text.replace("name: figure8", "name: mine"), "mine.yaml")
    twin = replace(FIGURE8, course=replace(course, name="mine"))
    assert twin.best_known().time == pytest.approx(sum(LAPS))
    # also where it was found here, and the file says its key
    path = tmp_path / twin.file_name
    path.write_bytes(saying(key=FIGURE8.key))
    assert twin.read(path).key == twin.key


def test_a_damaged_file_beside_a_whole_one_counts_as_none_with_a_remark(tmp_path):
    (tmp_path / ORIGINAL.name).write_bytes(b"PK")
    remarks = []
    spec = Spec.of("figure8", laps=3).record()
    assert limit_of(spec, tmp_path, remark=remarks.append).time == pytest.approx(sum(LAPS))
    (remark,) = remarks
    assert remark.startswith(str(tmp_path))
