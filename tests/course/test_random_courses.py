"""Random courses: every one is valid, and the seed alone decides what it is."""

import numpy as np
import pytest

from quadsim.cli.check import examine
from quadsim.cli.cli import race
from quadsim.course.random_courses import APART, random_courses
from quadsim.course.swept import SweptGates
from quadsim.racing.referee import check
from quadsim.vehicle import load_vehicle, vehicle_names


@pytest.mark.slow
def test_every_file_passes_the_check_and_the_seed_decides_its_text(tmp_path, capsys):
    written = []
    for folder, seed in (("a", 3), ("b", 3), ("c", 4)):
        words = ["--generate", "6", "--seed", str(seed), "--out", str(tmp_path / folder)]
        assert race(["courses", *words]) == 0
        written.append([f.read_text() for f in sorted((tmp_path / folder).iterdir())])
    assert capsys.readouterr().out.count("\n") == 18
    assert all(examine(str(f))["ok"] for f in tmp_path.glob("*/*.yaml"))
    assert written[0] == written[1]
    assert not set(written[0]) & set(written[2])
    assert len(set(written[0])) == 6


@pytest.mark.slow
def test_every_vehicle_fits_and_legs_are_long_enough():
    for course in random_courses(10, 0):
        for name in vehicle_names():
            radius = load_vehicle(name).radius
            check(course, course.laps, SweptGates(course.gates, radius).all, radius)
        p = np.array([g.position for g in course.gates])
        assert np.linalg.norm(np.roll(p, -1, 0) - p, axis=1).min() >= APART


def test_more_courses_of_a_seed_begin_with_the_same():
    assert random_courses(3, 7) == random_courses(5, 7)[:3]


def test_wrong_numbers_are_one_line(tmp_path, capsys):
    for options, expected in (
        (["--generate", "0"], "--generate: expected a whole number >= 1 and <= 10000, got 0"),
        (["--generate", "2", "--seed", "-1"], "--seed: expected a whole number >= 0"),
        (["--generate", "x"], "--generate"),
        (["--seed", "3"], "--seed: expected --generate N with it"),
        ([], "--out: expected --generate N with it"),
    ):
        assert race(["courses", *options, "--out", str(tmp_path)]) == 2
        err = capsys.readouterr().err
        assert expected in err
        assert err.count("\n") == 1


def test_wrong_numbers_are_one_line_in_python_too():
    with pytest.raises(ValueError, match="number: expected a whole number of at least 1, got 0"):
        random_courses(0, 0)
