"""Distances of a race that follow from the vehicles, the openings and the room on the course."""

import json
from dataclasses import replace

import pytest

import quadsim
from quadsim.heat.archive import recorded_heat
from quadsim.heat.distances import default_keep, default_spacing
from quadsim.heat.line_up import line_up
from quadsim.heat.settings import Awareness
from quadsim.heat.spec import Entrant, HeatSpec
from quadsim.results.heat import fly_heat

# Small drones that start near to each other, with openings of this size [m]
TWO_SMALL = """\
opening: [{0}, {0}]
frame_width: 0.1
start: {{position: [0, 0, 0.3], yaw_deg: 0}}
gates:
  - {{position: [1.5, 0, 0.6], yaw_deg: 0}}
  - {{position: [3, 0, 0.6], yaw_deg: 0}}
"""
RACING = ("cpc", "flightmare", "kingfisher", "kolibri", "swift", "swift_40ms")
WIDE = ("alphapilot", "figure8", "paper_flat", "split_s_song", "split_s_swift")


def small_course(tmp_path, opening):
    file = tmp_path / "small.yaml"
    file.write_text(TWO_SMALL.format(opening))
    return str(file)


def race_of(course, *entrants, **settings):
    """Return the specification of a race."""
    return HeatSpec(*line_up(course, entrants, settings))


@pytest.mark.parametrize("course", WIDE)
@pytest.mark.parametrize("vehicle", RACING)
def test_racing_vehicles_on_racing_courses_keep_what_they_always_kept(course, vehicle):
    radius = quadsim.load_vehicle(vehicle).radius
    assert default_keep(quadsim.load_course(course), [radius] * 4) == 0.6


@pytest.mark.parametrize(
    ("opening", "radius", "keep"),
    [
        (0.4, 0.07, 0.2),  # half of the opening
        (0.5, 0.07, 0.25),
        (1.2, 0.07, 0.6),
        (0.4, 0.14, 0.35),  # two that touch at 0.28 m keep farther apart than that
        (0.9, 0.25, 0.6),
    ],
)
def test_the_clearance_follows_from_openings_and_radii(tmp_path, opening, radius, keep):
    course = quadsim.load_course(small_course(tmp_path, opening))
    assert default_keep(course, [radius, radius]) == keep


def test_the_narrowest_opening_and_the_largest_vehicles_decide():
    course = quadsim.load_course("figure8")
    narrow = replace(course.gates[3], opening=(2.0, 0.5))
    course = replace(course, gates=(*course.gates[:3], narrow, *course.gates[4:]))
    assert default_keep(course, [0.07, 0.07]) == 0.25
    assert default_keep(course, [0.07, 0.17, 0.07, 0.15]) == 0.4


def test_a_race_records_the_distances_that_it_uses(tmp_path):
    spec = race_of(
        small_course(tmp_path, 0.4), "colored", "colored+patience=1", vehicle="crazyflie"
    )
    record = json.loads(json.dumps(spec.record()))
    assert [one["awareness"]["keep"] for one in record["entrants"]] == [0.2, 0.2]
    assert (record["settings"]["keep"], record["settings"]["spacing"]) == (0.2, 1.0)
    again = recorded_heat(record)
    assert again.settings == spec.settings
    assert again.awareness(1) == spec.awareness(1)


def test_given_distances_are_used_as_they_are_given(tmp_path):
    course = small_course(tmp_path, 0.4)
    spec = race_of(
        course, "colored", "colored+keep=1.5", vehicle="crazyflie", keep=0.9, spacing=0.3
    )
    assert [spec.awareness(k).keep for k in range(2)] == [0.9, 1.5]
    assert spec.settings.spacing == 0.3


def test_an_entrants_own_awareness_gets_the_default_of_its_race(tmp_path):
    flight = quadsim.Spec.of(small_course(tmp_path, 0.5), vehicle="crazyflie")
    spec = HeatSpec((Entrant("a", flight), Entrant("b", flight, Awareness(expect="velocity"))))
    assert spec.awareness(1) == Awareness(expect="velocity", keep=0.25)


def test_starts_are_a_metre_apart_or_as_far_as_there_is_room():
    """On split_s_song a start a metre aside has 0.29 m to a frame, 0.3 m are wanted."""
    songs = quadsim.load_course("split_s_song")
    assert default_spacing(quadsim.load_course("split_s_swift"), [0.14] * 8) == 1.0
    assert default_spacing(songs, [0.14] * 2) == 0.95
    lsy = quadsim.load_course("lsy_level2")
    assert [default_spacing(lsy, [0.07] * n) for n in (2, 4, 8)] == [1.0, 0.45, 0.45]
    assert len(race_of("lsy_level2", *["colored"] * 8, vehicle="crazyflie").starts) == 8


def test_without_room_for_all_the_error_is_that_of_a_metre():
    with pytest.raises(quadsim.SettingError, match=r"^spacing: no room for a start at \(-0\.65"):
        race_of("lsy_level2", *["colored"] * 8, vehicle="swift")


@pytest.mark.regression
@pytest.mark.parametrize("opening", [0.4, 0.5])
@pytest.mark.parametrize("seed", range(3))
def test_two_small_drones_do_not_block_each_other(tmp_path, opening, seed):
    """With a clearance of 0.6 m both are stuck at gate 1."""
    small = {"vehicle": "crazyflie", "spacing": 0.3, "seed": seed}
    spec = race_of(small_course(tmp_path, opening), "colored", "colored", **small)
    raced = fly_heat(replace(spec, seed=seed))
    assert [run.outcome for run in raced.runs] == ["finished", "finished"]
