"""Races of several vehicles: their laws, from the start grid to the folder on the disk."""

import json
import shutil
from dataclasses import replace

import numpy as np
import pytest

import quadsim
from quadsim.cli.cli import race
from quadsim.controllers.lanes.threads import most_threads
from quadsim.controllers.plan import PlanStats
from quadsim.heat.archive import list_heats, read_heat
from quadsim.heat.launch import heat_frames
from quadsim.heat.line_up import line_up
from quadsim.heat.loop import Starter, end_flights
from quadsim.heat.result import HeatRecorder
from quadsim.heat.settings import HeatSettings
from quadsim.heat.spec import Entrant, HeatSpec
from quadsim.racing.flight import Planning
from quadsim.record.run import RunError
from quadsim.results.heat import fly_heat
from quadsim.vehicle import GRAVITY
from tests.small import SMALL


def heat(*entrants, course="figure8", seed=0, **settings):
    """Return the spec of a small race."""
    small = {**SMALL, "laps": 1, "first_iterations": 10}
    made, of_race = line_up(course, list(entrants) or ["colored", "gaussian"], small | settings)
    return HeatSpec(made, of_race, seed)


def flown(spec, seconds=None):
    """Fly a race, or its first seconds, and return it."""
    recorder = HeatRecorder(spec)
    for frame in heat_frames(spec):
        recorder.add(frame)
        if seconds is not None and frame.t >= seconds:
            break
    return recorder


def paths(recorder):
    """Return the positions of each vehicle  (vehicles, frames, 3)."""
    runs = recorder.runs()
    least = min(len(run.telemetry["t"]) for run in runs)
    axes = ("px", "py", "pz")
    return np.array([[run.telemetry[a][:least] for a in axes] for run in runs]).swapaxes(1, 2)


class Holds:
    """A controller that holds one command for a while, and then flies straight on.

    Races of such controllers compile nothing.
    """

    rest = np.array([0.0, 0.0, 0.0, GRAVITY])

    def __init__(self, roll=0.0, thrust=GRAVITY, seconds=0.1):
        self._command = np.array([roll, 0.0, 0.0, thrust])
        self._seconds = seconds

    def control(self, estimate, /):
        command = self._command if estimate.t < self._seconds - 1e-9 else self.rest
        return command, PlanStats(0.0, 0.0, 0.0)


class Fails(Holds):
    """A controller that raises an error at a time, or returns what is no control."""

    def __init__(self, at, error=None):
        super().__init__()
        self._at = at
        self._error = error

    def control(self, estimate, /):
        if estimate.t < self._at - 1e-9:
            return super().control(estimate)
        if self._error:
            raise self._error
        return np.full(4, np.nan), PlanStats(0.0, 0.0, 0.0)


def held(*controllers, timeout=None, **settings):
    """Return a race of such controllers; each stands on the left of the one before it."""
    entrants = (
        Entrant(f"vehicle {k}", quadsim.Spec.of("figure8", controller=one, laps=1, timeout=timeout))
        for k, one in enumerate(controllers, 1)
    )
    return HeatSpec(tuple(entrants), HeatSettings(**settings))


def towards_each_other(**settings):
    """Return a race of two that roll towards each other and soon meet."""
    return held(Holds(roll=-5.0), Holds(roll=5.0), downwash=False, **settings)


@pytest.mark.parametrize(
    ("error", "text"),
    [
        (ValueError("no plan today"), "ValueError: no plan today (test_heats.py, line "),
        (ZeroDivisionError("division by zero"), "ZeroDivisionError: division by zero (test_h"),
        (KeyError("a"), "KeyError: 'a' (test_heats.py, line "),
        (None, "controller: Fails.control: expected a control of 4 numbers"),
    ],
    ids=["ValueError", "ZeroDivisionError", "KeyError", "nan"],
)
@pytest.mark.parametrize("at", [pytest.param(0.0, marks=pytest.mark.regression), 0.05])
def test_an_entrant_whose_controller_fails_is_out_and_the_others_fly_on(at, error, text, tmp_path):
    spec = held(Holds(), Fails(at, error), timeout=0.2)
    race = fly_heat(spec)
    assert [run.outcome for run in race.runs] == ["timeout", "crashed"]
    assert race.runs[1].duration == pytest.approx(at)
    assert list(race.faults) == ["vehicle 2"]
    assert race.faults["vehicle 2"].startswith(text)
    assert f"vehicle 2 is out: crashed, {race.faults['vehicle 2']}" in str(race)
    stored = quadsim.load_heat(race.save(tmp_path))
    assert stored.faults == race.faults
    assert [run.fault for run in stored.runs] == ["", race.faults["vehicle 2"]]
    assert race.faults["vehicle 2"] in " ".join(stored.runs[1].report().split())
    assert str(stored) == str(race)


def test_a_fault_of_the_program_ends_a_race():
    """An error that no part of the user's own can have raised is not one entrant's."""
    item = Planning(Fails(0.0, KeyError("a")), None, 0.0, 4)
    item.error = KeyError("a")
    starter = Starter(0.0, None, None, None)
    assert end_flights({0: item}, [starter]) == {}
    assert not item.ends_flight


@pytest.mark.compiled
def test_a_race_of_one_is_the_flight_of_before(two_gates):
    spec = quadsim.Spec.of(two_gates, **SMALL, seed=3, randomize=1.0)
    alone = fly_heat(HeatSpec((Entrant("me", spec),), seed=3))
    (run,) = alone.runs
    assert run.digest() == quadsim.fly(spec).digest()
    assert "heat" not in run.spec
    assert alone.order[0].time == sum(run.laps)


def assert_same_on_threads(on_threads, spec, seconds):
    """Claim that a race is the same on one thread, on all of them, and on one again."""

    def digests(spec=spec):
        return [run.digest() for run in flown(spec, seconds).runs()]

    first, second, third = (on_threads(n, digests) for n in (1, most_threads(), 1))
    assert first == second == third
    other = digests(replace(spec, seed=2))
    assert all(a != b for a, b in zip(first, other, strict=True))


@pytest.mark.compiled
@pytest.mark.parametrize("expect", ["own", pytest.param("plans", marks=pytest.mark.regression)])
def test_the_same_seed_gives_the_same_bits_on_any_number_of_threads(expect, on_threads):
    spec = heat("colored", "gaussian+samples=192", expect=expect, seed=1)
    assert_same_on_threads(on_threads, spec, 0.3)


@pytest.mark.regression
@pytest.mark.parametrize("expect", ["own", "plans"])
@pytest.mark.parametrize("more", [["colored"], ["colored", "gaussian"]], ids=["three", "four"])
def test_the_same_seed_gives_the_same_bits_for_more_vehicles(more, expect, on_threads):
    spec = heat("colored", "gaussian+samples=192", *more, expect=expect, seed=1)
    assert_same_on_threads(on_threads, spec, 0.6)


@pytest.mark.compiled
def test_who_ignores_the_others_flies_as_if_alone_where_nothing_acts_on_it():
    both = heat(expect="nothing", downwash=False, seed=4)
    together = paths(flown(both, 0.4))[0, :40]
    alone = quadsim.fly(replace(both.flown_spec(0), timeout=0.4)).telemetry
    np.testing.assert_array_equal(together.T, [alone[axis][:40] for axis in ("px", "py", "pz")])


@pytest.mark.compiled
def test_planners_that_expect_each_other_keep_farther_apart():
    """They start nearer to each other than the distance that they keep."""
    settings = {"spacing": 0.5, "keep": 1.2}

    def gaps(expect):
        """Return the least distance after 0.2 s and the distance after 0.5 s [m]."""
        a, b = paths(flown(heat("colored", "colored", expect=expect, **settings), 0.5))
        apart = np.linalg.norm(a - b, axis=1)
        return np.array([apart[20:].min(), apart[-1]])

    ignored = gaps("nothing")
    for expect in ("own", "plans"):
        assert (gaps(expect) > ignored + np.array([0.1, 1.0])).all(), expect


def test_vehicles_start_on_the_grid_and_places_rotate():
    spec = held(*[Holds()] * 4)
    at = []
    for rotation in range(2):
        rotated = replace(spec, rotation=rotation)
        frames = list(heat_frames_until(rotated, 0.0))
        assert [frame.number for frame in frames] == [0, 1, 2, 3]
        at.append([frame.frame.x[:2] for frame in frames])
        assert at[-1] == [start.position[:2] for start in rotated.starts]
    assert at[1] == at[0][1:] + at[0][:1]
    assert len(set(at[0])) == 4


def test_staggered_vehicles_enter_one_after_the_other():
    frames = list(heat_frames_until(held(Holds(), Holds(), stagger=0.3), 0.5))
    assert frames[0].number == 0
    second = [frame for frame in frames if frame.number == 1]
    assert second[0].t == pytest.approx(0.3)
    assert second[0].frame.t == 0.0


def heat_frames_until(spec, seconds):
    for frame in heat_frames(spec):
        if frame.t > seconds:
            return
        yield frame


def test_a_collision_ends_both_flights_and_is_an_event_of_both_runs():
    found = fly_heat(towards_each_other())
    assert {run.outcome for run in found.runs} == {"crashed"}
    assert [run.events[-1].vehicle for run in found.runs] == [2, 1]
    kinds = [event.kind for event in found.events]
    assert kinds.count("contact") == 1
    assert kinds.count("out") == 2
    assert "contact of vehicle 1 and vehicle 2" in str(found)


def test_under_physics_hits_cost_time_and_vehicles_push_each_other_away():
    spec = towards_each_other(rules="physics")
    assert all(entrant.spec.penalties for entrant in spec.entrants)
    recorder = flown(spec, 0.8)
    events = [event for own in recorder.recorders for event in own.events]
    assert {event.kind for event in events} >= {"contact"}
    assert all(own.last.outcome is None for own in recorder.recorders)
    a, b = paths(recorder)
    # Each stays on its own side.
    assert ((b - a)[:, 1] > 0.0).all()
    radius = spec.entrants[0].spec.vehicle.radius
    assert np.linalg.norm(a - b, axis=1).min() > 2 * radius - 0.01


@pytest.mark.slow
def test_downwash_pushes_who_flies_below_down_and_nobody_up():
    """One climbs by a metre, beside one that hovers."""
    climbs = Holds(thrust=3 * GRAVITY, seconds=0.1)

    def heights(downwash):
        spec = held(climbs, Holds(), downwash=downwash, spacing=0.15)
        return paths(flown(spec, 0.6))[..., 2]

    (above, below), (above_still, below_still) = heights(True), heights(False)
    assert above_still[-1] > below_still[-1] + 0.8
    np.testing.assert_array_equal(above, above_still)
    assert below[-1] < below_still[-1] - 0.05
    assert (np.diff(below - below_still) <= 1e-12).all()


@pytest.mark.compiled
def test_a_stored_race_is_read_and_flown_again_to_the_last_bit(raced, stored, capsys):
    assert {run.outcome for run in raced.runs} == {"finished"}
    assert list_heats(stored.parent) == [stored]
    loaded = read_heat(stored)
    assert [run.digest() for run in loaded.runs] == [run.digest() for run in raced.runs]
    assert quadsim.load_heat(stored).order == raced.order
    assert race(["heat", "--from", "last", "--runs-dir", str(stored.parent), "--json"]) == 0
    again = capsys.readouterr()
    assert json.loads(again.out)["digest"] == raced.digest()
    assert "the same race as the stored one" in again.err
    assert quadsim.race(quadsim.load_heat(stored).spec).digest() == raced.digest()
    record = json.loads((stored / "heat.json").read_text())
    assert record["order"][0]["rank"] == 1
    with pytest.raises(quadsim.FileError, match="race heat --from"):
        quadsim.fly(loaded.runs[0].spec)


@pytest.mark.parametrize(
    ("beside", "problem"),
    [
        ({"laps": 2}, "laps: expected nothing but parts, runs_dir, seed and threads beside"),
        ({"course": "figure8"}, "course: expected nothing but parts"),
        ({"parts": {"nobody": {}}}, "parts: expected one of colored, gaussian, got 'nobody'"),
    ],
)
def test_a_recorded_race_is_flown_as_it_was_or_not_at_all(beside, problem):
    made, of_race = line_up("figure8", ["colored", "gaussian"], SMALL)
    record = HeatSpec(made, of_race, seed=5).record()
    with pytest.raises(quadsim.SettingError) as error:
        quadsim.race(record, **beside)
    assert str(error.value).startswith(problem)


def test_what_is_no_record_of_a_race_is_one_line():
    with pytest.raises(quadsim.FileError, match="expected the record of a race") as error:
        quadsim.race({"entrants": [1], "seed": 0})
    assert "\n" not in str(error.value)
    with pytest.raises(quadsim.SettingError, match=r"expected parts only beside heat\.spec"):
        quadsim.race(["colored"], parts={"colored": {}})


CHANGED = {
    "rules": lambda spec: spec["settings"].update(rules="physics"),
    "seed": lambda spec: spec.update(seed=6),
    "rotation": lambda spec: spec.update(rotation=1),
    "name": lambda spec: spec["entrants"][0].update(name="slow"),
    "place": lambda spec: [one.update(place=3 - one["place"]) for one in spec["entrants"]],
    "awareness": lambda spec: spec["entrants"][1]["awareness"].update(keep=0.1),
    "order": lambda spec: spec["entrants"].reverse(),
}


@pytest.mark.compiled
@pytest.mark.parametrize("what", CHANGED)
def test_what_a_race_says_of_itself_is_what_its_runs_say(what, stored, tmp_path):
    folder = shutil.copytree(stored, tmp_path / stored.name)
    record = json.loads((folder / "heat.json").read_text())
    CHANGED[what](record["spec"])
    (folder / "heat.json").write_text(json.dumps(record))
    with pytest.raises(RunError, match=r"heat\.json: spec: expected .*; changed after the race"):
        read_heat(folder)


@pytest.mark.compiled
def test_a_changed_race_is_refused(raced, stored, tmp_path):
    folder = shutil.copytree(stored, tmp_path / stored.name)
    file = folder / "heat.json"
    file.write_text(file.read_text().replace(raced.digest(), "0" * 64))
    with pytest.raises(RunError, match="changed after the race"):
        read_heat(folder)
    file.write_text("{")
    with pytest.raises(RunError, match="damaged"):
        read_heat(folder)


@pytest.mark.compiled
def test_a_race_that_cannot_be_written_leaves_nothing(raced, tmp_path):
    root = tmp_path / "file"
    root.write_text("")
    with pytest.raises(RunError):
        raced.save(root)
    assert list(tmp_path.iterdir()) == [root]


@pytest.mark.parametrize(
    ("entrants", "settings", "name", "said"),
    [
        (["colored"] * 9, {}, "entrants", ["1 to 8", "got 9"]),
        (["a=colored", "a=gaussian"], {}, "entrants", ["different names", "'a'"]),
        (["colord"], {}, "entrants", ["'colord'", "did you mean 'colored'"]),
        (["colored", "gaussian+laps=2"], {}, "entrants", ["laps 1", "'gaussian+laps=2'"]),
        (["colored", "gaussian"], {"spacing": 0.05}, "spacing", ["more than 0.1 m"]),
        (["colored", "gaussian"], {"spacing": 9}, "spacing", ["at most"]),
        (["colored"] * 8, {"spacing": 2.0}, "spacing", ["no room"]),
        (["colored", "gaussian"], {"rules": "fight"}, "rules", ["expected"]),
        (["colored+expect=hope"], {}, "expect", ["expected"]),
        (["colored+patiense=1"], {}, "patiense", ["did you mean 'patience'"]),
        (["colored", "gaussian"], {"plant": "rotorpy"}, "plant", ["bullet or rigid"]),
        (["colored", "gaussian"], {"displace_gates": 0.1}, "displace_gates", ["expected none"]),
        (["colored", "gaussian"], {"excite": True}, "excite", ["expected none"]),
        (
            ["colored", "gaussian"],
            {"randomization": "lsy_level2", "randomize": 1.0},
            "randomization",
            ["leaves gates and obstacles on the map"],
        ),
    ],
)
def test_what_cannot_race_is_one_line(entrants, settings, name, said):
    course = "lsy_level2" if settings.get("spacing") == 2.0 else "figure8"
    with pytest.raises(quadsim.SettingError) as error:
        heat(*entrants, course=course, **settings)
    assert error.value.name == name
    line = str(error.value)
    assert "\n" not in line
    assert [text for text in said if text not in line] == [], line


def test_a_pilot_that_does_not_exist_is_one_line():
    with pytest.raises(quadsim.FileError, match=r"^no pilot 'split': expected FILE\.npz, or one"):
        heat("pilot=split", "colored", course="figure8")


def test_a_text_is_no_list_of_entrants():
    with pytest.raises(quadsim.SettingError, match=r"^entrants: .*'colored'"):
        quadsim.race("colored")


def test_settings_of_all_planners_hold_unless_an_entrant_has_its_own():
    spec = heat("colored", "colored+keep=1.5", expect="velocity", keep=0.9)
    assert isinstance(spec.settings, HeatSettings)
    assert [spec.awareness(k).keep for k in range(2)] == [0.9, 1.5]
    assert [spec.awareness(k).expect for k in range(2)] == ["velocity"] * 2
