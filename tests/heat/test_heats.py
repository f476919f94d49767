"""Races of several vehicles: their laws, from the start grid to the folder on the disk."""

import json
from dataclasses import replace

import numpy as np
import pytest

import quadsim
from controllers.lanes.threads import most_threads, use_threads
from quadsim.campaign.line_ups import line_up
from quadsim.heat.archive import list_heats, load_heat, spec_of_heat
from quadsim.heat.launch import heat_frames
from quadsim.heat.result import HeatRecorder
from quadsim.heat.settings import HeatSettings
from quadsim.heat.spec import Entrant, HeatSpec
from quadsim.heats import fly_heat
from quadsim.record.run import RunError

pytestmark = pytest.mark.flight

# A course that is flown in two seconds
TWO_GATES = """\
opening: [2, 2]
start: {position: [0, 0, 2], yaw_deg: 0}
gates:
  - {position: [6, 0, 2], yaw_deg: 0}
  - {position: [12, 0, 2], yaw_deg: 0}
"""
SMALL = {"laps": 1, "samples": 128, "horizon": 60, "first_iterations": 10}


def heat(*entrants, course="figure8", seed=0, **settings):
    """Return the spec of a small race."""
    made, of_race = line_up(course, list(entrants) or ["colored", "gaussian"], SMALL | settings)
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


@pytest.fixture
def two_gates(tmp_path):
    """Return the file of a short course."""
    file = tmp_path / "two_gates.yaml"
    file.write_text(TWO_GATES)
    return str(file)


def test_a_race_of_one_is_the_flight_of_before(two_gates):
    spec = quadsim.Spec.of(two_gates, **SMALL, seed=3, randomize=1.0)
    alone = fly_heat(HeatSpec((Entrant("me", spec),), seed=3))
    (run,) = alone.runs
    assert run.digest() == quadsim.fly(spec).digest()
    assert "heat" not in run.spec
    assert alone.order[0].time == sum(run.laps)


@pytest.mark.parametrize("expect", ["own", "plans"])
def test_the_same_seed_gives_the_same_bits_on_any_number_of_threads(expect):
    spec = heat("colored", "gaussian", "colored+samples=192", expect=expect, seed=1)
    digests = []
    try:
        for threads in (1, most_threads(), 1):
            use_threads(threads)
            digests.append([run.digest() for run in flown(spec, 0.6).runs()])
    finally:
        use_threads(None)
    assert digests[0] == digests[1] == digests[2]
    other = [run.digest() for run in flown(replace(spec, seed=2), 0.6).runs()]
    assert all(a != b for a, b in zip(digests[0], other, strict=True))


def test_who_ignores_the_others_flies_as_if_alone_where_nothing_acts_on_it():
    both = heat(expect="nothing", downwash=False, seed=4)
    first = replace(both.flown_spec(0))
    together = flown(both, 0.8).recorders[0]
    alone = []
    for frame in quadsim.frames(first):
        alone.append(frame.x)
        if frame.t >= 0.8:
            break
    seen = together.views(quadsim.fly(first, timeout=0.1).telemetry)
    np.testing.assert_array_equal(seen["px"][:60], [x[0] for x in alone][:60])


def test_planners_that_expect_each_other_keep_farther_apart():
    def nearest(expect):
        gaps = []
        for seed in range(2):
            a, b = paths(flown(heat("colored", "colored", expect=expect, seed=seed), 1.0))
            gaps.append(np.linalg.norm(a - b, axis=1)[20:].min())
        return np.array(gaps)

    ignored = nearest("nothing")
    for expect in ("own", "plans"):
        assert (nearest(expect) > ignored + 0.1).all()


def test_vehicles_start_on_the_grid_and_places_rotate():
    spec = heat("colored", "gaussian", "colored", "gaussian")
    at = []
    for rotation in range(2):
        frames = heat_frames_until(replace(spec, rotation=rotation), 0.0)
        at.append([frame.frame.x[:2] for frame in frames])
    assert at[1] == at[0][1:] + at[0][:1]
    assert len(set(at[0])) == 4


def test_staggered_vehicles_enter_one_after_the_other():
    spec = heat(stagger=0.3)
    frames = [f for f in heat_frames_until(spec, 0.5) if f.number == 1]
    assert frames[0].t == pytest.approx(0.3)
    assert frames[0].frame.t == 0.0


def heat_frames_until(spec, seconds):
    for frame in heat_frames(spec):
        if frame.t > seconds:
            return
        yield frame


def test_a_collision_ends_both_flights_and_is_an_event_of_both_runs():
    # 0.12 m apart, both aim at the middle of gate 1 and ignore each other.
    spec = heat("colored", "colored", expect="nothing", spacing=0.12, downwash=False)
    found = fly_heat(spec)
    assert {run.outcome for run in found.runs} == {"crashed"}
    assert [run.events[-1].vehicle for run in found.runs] == [2, 1]
    kinds = [event.kind for event in found.events]
    assert kinds.count("contact") == 1
    assert kinds.count("out") == 2
    assert "contact of colored and colored 2" in str(found)


def test_downwash_pushes_who_flies_below():
    def height(downwash):
        spec = heat(expect="nothing", downwash=downwash, spacing=0.15, seed=7)
        return paths(flown(spec, 1.0))[..., 2]

    assert not np.array_equal(height(True), height(False))


def test_a_stored_race_is_read_and_flown_again_to_the_last_bit(two_gates, tmp_path):
    entrants = ("fast=colored+margin=.2", "gaussian+expect=velocity")
    found = fly_heat(heat(*entrants, course=two_gates, randomize=1))
    assert {run.outcome for run in found.runs} == {"finished"}
    folder = found.save(tmp_path)
    assert list_heats(tmp_path) == [folder]
    loaded = load_heat(folder)
    assert [run.digest() for run in loaded.runs] == [run.digest() for run in found.runs]
    again = fly_heat(spec_of_heat(loaded))
    assert again.digest() == found.digest()
    assert again.order == quadsim.load_heat(folder).order == found.order
    record = json.loads((folder / "heat.json").read_text())
    assert record["order"][0]["rank"] == 1
    with pytest.raises(quadsim.FileError, match="race heat --from"):
        quadsim.fly(loaded.runs[0].spec)


def test_a_changed_race_is_refused(tmp_path):
    found = fly_heat(heat(timeout=0.3))
    folder = found.save(tmp_path)
    file = folder / "heat.json"
    file.write_text(file.read_text().replace(found.digest(), "0" * 64))
    with pytest.raises(RunError, match="changed after the race"):
        load_heat(folder)
    file.write_text("{")
    with pytest.raises(RunError, match="damaged"):
        load_heat(folder)


def test_a_race_that_cannot_be_written_leaves_nothing(tmp_path):
    found = fly_heat(heat(timeout=0.3))
    root = tmp_path / "file"
    root.write_text("")
    with pytest.raises(RunError):
        found.save(root)
    assert list(tmp_path.iterdir()) == [root]


@pytest.mark.parametrize(
    ("entrants", "settings", "problem"),
    [
        (["colored"] * 9, {}, "entrants: expected 1 to 8 of them, got 9"),
        (["a=colored", "a=gaussian"], {}, "entrants: expected different names, got 'a' 2 times"),
        (["colord"], {}, "entrants: no sampler, preset or pilot 'colord': did you mean 'colored'?"),
        (["colored", "gaussian+laps=2"], {}, "entrants: expected laps 1 for 'gaussian+laps=2'"),
        (["colored", "gaussian"], {"spacing": 0.05}, "spacing: expected starts more than 0.1 m"),
        (["colored", "gaussian"], {"spacing": 9}, "spacing: expected at most"),
        (["colored"] * 8, {"spacing": 2.0}, "spacing: no room for a start at"),
        (["colored", "gaussian"], {"rules": "fight"}, "rules: expected"),
        (["colored+expect=hope"], {}, "expect: expected"),
        (["colored+patiense=1"], {}, "patiense: no such setting of an entrant, did you mean 'pati"),
        (["colored", "gaussian"], {"plant": "rotorpy"}, "plant: expected bullet or rigid"),
        (["colored", "gaussian"], {"displace_gates": 0.1}, "displace_gates: expected none"),
    ],
)
def test_what_cannot_race_is_one_line(entrants, settings, problem):
    course = "lsy_level2" if settings.get("spacing") == 2.0 else "figure8"
    with pytest.raises(quadsim.SettingError) as error:
        heat(*entrants, course=course, **settings)
    assert problem in str(error.value)
    assert "\n" not in str(error.value)


def test_a_pilot_that_does_not_exist_is_one_line():
    with pytest.raises(quadsim.FileError, match=r"^no pilot 'split': expected FILE\.npz, or one"):
        heat("pilot=split", "colored", course="figure8")


def test_a_text_is_no_list_of_entrants():
    with pytest.raises(quadsim.SettingError, match=r"got the text 'colored': put it in a list"):
        quadsim.race("colored")


def test_under_physics_hits_cost_time_and_vehicles_push_each_other_away():
    spec = heat("colored", "colored", expect="nothing", spacing=0.3, rules="physics")
    assert all(entrant.spec.penalties for entrant in spec.entrants)
    recorder = flown(spec, 1.5)
    events = [event for own in recorder.recorders for event in own.events]
    assert {event.kind for event in events} >= {"contact"}
    assert all(own.last.outcome is None for own in recorder.recorders)
    a, b = paths(recorder)
    assert np.linalg.norm(a - b, axis=1).min() > 0.27


def test_settings_of_all_planners_hold_unless_an_entrant_has_its_own():
    made, of_race = line_up(
        "figure8", ["colored", "colored+keep=1.5"], SMALL | {"expect": "velocity", "keep": 0.9}
    )
    spec = HeatSpec(made, of_race)
    assert isinstance(of_race, HeatSettings)
    assert [spec.awareness(k).keep for k in range(2)] == [0.9, 1.5]
    assert [spec.awareness(k).expect for k in range(2)] == ["velocity"] * 2
