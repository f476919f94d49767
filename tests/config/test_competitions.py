"""A competition prescribes a course and settings; what is given beside it counts before them."""

import json

import pytest

from quadsim.cli.cli import race
from quadsim.config.competition import (
    competition_names,
    load_competition,
    parse_competition,
    prescribed_courses,
)
from quadsim.config.settings import SettingError
from quadsim.config.spec import Spec
from quadsim.files.strict_yaml import FileError
from quadsim.record.run import canonical


@pytest.mark.parametrize("name", competition_names())
def test_a_competition_is_flown_as_it_prescribes(name):
    competition = load_competition(name)
    assert competition.source
    spec = Spec.of(competition=name)
    assert spec.course.name == competition.course
    asked = Spec.of(competition.course, **competition.settings)
    assert spec.record() == asked.record()
    assert Spec.of_record(json.loads(canonical(spec.record()))).record() == spec.record()


def test_lsy_levels_differ_in_what_is_drawn_alone():
    first, second, third = (Spec.of(competition=f"lsy_level{k}") for k in range(3))
    for spec in (first, second, third):
        assert (spec.planner.mppi.dt, spec.plant_dt) == (0.02, 0.002)
        assert spec.variation.force == 0.1
    assert first.variation.mass == 0.0 != second.variation.mass
    assert first.flown_course == second.flown_course == first.course != third.flown_course


def test_what_is_given_counts_before_the_competition():
    spec = Spec.of("figure8", competition="lsy_level2", vehicle="swift", dt=0.01, known_from=1.0)
    assert (spec.course.name, spec.vehicle.name) == ("figure8", "swift")
    assert (spec.planner.mppi.dt, spec.known_from) == (0.01, 1.0)
    assert spec.randomization.name == "lsy_level2", "the rest is the competition's"


def test_another_competition_brings_its_own():
    level = Spec.of(competition="lsy_level2", seed=3)
    other = level.but(competition="aigp_physical")
    assert other == Spec.of(competition="aigp_physical", seed=3)
    assert level.but(competition=None).course.name == "split_s_swift"


def test_a_file_is_a_competition_too(tmp_path):
    file = tmp_path / "mine.yaml"
    file.write_text("course: figure8\nlaps: 1\nvehicle: kolibri\n")
    spec = Spec.of(competition=file)
    assert (spec.course.name, spec.laps, spec.vehicle.name) == ("figure8", 1, "kolibri")


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("laps: 1", "mine.yaml:1:1: course: missing"),
        ("course: figure8\nlaps: 0", "mine.yaml:2:7: laps: expected"),
        ("course: figure8\nseed: 3", "mine.yaml:2:1: seed: "),
    ],
)
def test_a_fault_of_a_file_is_one_line_with_its_place(text, expected):
    with pytest.raises(FileError) as caught:
        parse_competition(text, "mine.yaml")
    assert str(caught.value).startswith(expected)


def test_a_name_that_is_none_is_one_line(capsys):
    assert race(["fly", "--competition", "lsy_level9"]) == 2
    assert capsys.readouterr().err.startswith("race fly: no competition 'lsy_level9'")
    # The beginning of a name is enough for advice.
    assert race(["fly", "--competition", "aigp"]) == 2
    assert "did you mean 'aigp_physical'?" in capsys.readouterr().err
    with pytest.raises(SettingError, match=r"^competition: expected a name"):
        Spec.of(competition=3)


def test_commands_of_many_flights_take_the_course_of_a_competition():
    assert prescribed_courses({"competition": "lsy_level0", "seed": 3}) == ("lsy_track",)
    assert prescribed_courses({"seed": 3}) == prescribed_courses(None) == ()
