"""Variants are settings: what `race fly` would fly with the same flags."""

import pytest

from quadsim.campaign.attempt import attempt_key, this_provenance, variant_key
from quadsim.campaign.variants import (
    Jobs,
    make_variants,
    parse_variants,
    resolve,
    words_as_settings,
)
from quadsim.cli.cli import race
from quadsim.cli.flags import Given, Json, run_command
from tests.campaign_cases import FLIGHT, variant

COURSE, SETTINGS = words_as_settings(FLIGHT)


def test_a_variant_is_what_the_same_flags_fly():
    said = "soft=race+gaussian+target-ess=20+sigma=2:2:.3:4+smooth=yes,colored"
    soft, plain = make_variants([COURSE], parse_variants(said), SETTINGS)
    flags = "--preset race --sampler gaussian --target-ess 20 --sigma 2 2 .3 4 --smooth"
    assert soft.spec == variant("colored", *flags.split()).spec
    assert plain.spec == variant("colored").spec


def test_every_course_meets_every_variant_in_order():
    variants = make_variants(
        ["figure8", "split_s_song"], parse_variants("gaussian,colored"), {"laps": 1}
    )
    assert [(a.spec.course.name, a.name) for a in variants] == [
        (c, n) for c in ("figure8", "split_s_song") for n in ("gaussian", "colored")
    ]


def test_flags_of_fly_are_told_from_a_command_s_own():
    came = []

    def command(*courses: str, jobs: Jobs = None, json: Json = False, settings: Given = None):
        came.append((courses, jobs, json, settings))
        return 0

    assert (
        run_command(
            command,
            "race x",
            [
                "a",
                "--sigma",
                "1",
                "2",
                "3",
                "4",
                "b",
                "--jobs",
                "3",
                "--penalties",
                "c",
                "--seed=4",
                "--json",
            ],
        )
        == 0
    )
    flight = {"sigma": ("1", "2", "3", "4"), "penalties": True, "seed": "4"}
    assert came == [(("a", "b", "c"), 3, True, flight)]


def test_settings_of_other_samplers_are_left_out_and_those_of_one_variant_hold_for_it_alone():
    white, colored = make_variants(
        [COURSE], parse_variants("gaussian,colored"), SETTINGS | {"gamma": (1, 1, 1, 1)}
    )
    assert white.spec == variant("gaussian").spec
    assert colored.spec.planner.sampling.gamma == (1.0, 1.0, 1.0, 1.0)


def test_key_is_decided_by_all_that_decides_a_flight_and_by_nothing_else():
    one = variant().spec.record()
    same = resolve(COURSE, SETTINGS | {"sampler": "colored", "vehicle": "paper"}).record()
    assert attempt_key(one) == attempt_key(same)
    for change in (
        ["--seed", "1"],
        ["--margin", ".2"],
        ["--randomize", ".5"],
        ["--thrust-to-weight", "3"],
    ):
        other = variant("colored", *change).spec.record()
        assert attempt_key(other) != attempt_key(one), change
        assert (variant_key(other) == variant_key(one)) == (change[0] == "--seed")


def test_a_library_of_another_version_flies_another_attempt_and_one_that_only_measures_does_not():
    one, here = variant().spec.record(), this_provenance()["versions"]
    assert attempt_key(one) == attempt_key(one, here | {"scipy": "0", "python": "0"})
    for library in ("numpy", "numba", "pybullet"):
        other = here | {library: "0.1"}
        assert attempt_key(one, other) != attempt_key(one)
        assert variant_key(one, other) != variant_key(one)


WRONG = {
    "compare": "expected one COURSE or more, got none",
    "compare paper_fla": "no course 'paper_fla': did you mean 'paper_flat'?",
    "compare paper_flat --variants gaussian,gaussian": "--variants: expected different names, got 'gaussian' twice",
    "compare paper_flat --arms gaussian,gaussian": "--variants: expected different names, got 'gaussian' twice",
    "compare paper_flat --variants gaussian,": "--variants: expected a sampler or NAME=part+part, got ''",
    "compare paper_flat --variants a=rac": "--variants: no sampler or preset 'rac': did you mean 'race'?",
    "compare paper_flat --variants a=race+es=3": "--es: no such setting, did you mean",
    "compare paper_flat --variants a=race+smooth=3": "--smooth: expected true or false, got '3'",
    "compare paper_flat --variants a=race+target-ess=x": "--target-ess: expected a number, got 'x'",
    "compare paper_flat --attempts 0": "--attempts: expected a whole number >= 1",
    "compare paper_flat --laps 2": "paper_flat: expected 1 lap, as the course is open, got 2",
    "compare paper_flat --threads 1": "--threads: attempts fly on one thread each; --jobs says how many at once",
    "compare paper_flat --jobs 0": "--jobs: expected a whole number >= 1",
    "tune paper_flat --jobs 0": "--jobs: expected a whole number >= 1",
    "regress": "expected one FILE.yaml or more, got none",
    "regress mine.yaml --jobs many": "--jobs: expected a whole number, got 'many'",
    "results": "campaigns/race.sqlite: no such campaign",
}


@pytest.mark.parametrize("argv", WRONG)
def test_mistakes_are_one_line_before_anything_flies(argv, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert race(argv.split()) == 2
    said = capsys.readouterr().err
    assert WRONG[argv] in said
    assert said.count("\n") == 1
    assert not list(tmp_path.iterdir()), "nothing was made"
