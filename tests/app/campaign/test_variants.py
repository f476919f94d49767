"""Variants are command lines: what `race fly` would fly with the same words."""

import pytest

from quadsim.app.campaign.attempt import attempt_key, variant_key
from quadsim.app.campaign.variants import parse_variants, resolve, split
from quadsim.app.cli import race
from tests.campaign_cases import FLIGHT, variant

COURSE, *FLAGS = FLIGHT


def test_an_arm_is_what_the_same_flags_fly():
    said = "soft=race+gaussian+target-ess=20+sigma=2:2:.3:4+smooth=yes,colored"
    soft, plain = parse_variants(said, [COURSE], FLAGS, "race")
    argv = ["--preset", "race", "--sampler", "gaussian", "--target-ess", "20"]
    argv += ["--sigma", "2", "2", ".3", "4", "--smooth"]
    assert soft.spec == resolve([*FLIGHT, *argv], "race")
    assert plain.spec == variant("colored").spec


def test_every_course_meets_every_arm_in_order():
    variants = parse_variants("gaussian,colored", ["figure8", "split_s_song"], ["--laps", "1"], "race")
    assert [(a.spec.course.name, a.name) for a in variants] == [
        (c, n) for c in ("figure8", "split_s_song") for n in ("gaussian", "colored")
    ]


def test_flags_of_fly_are_told_from_a_command_s_own():
    own, flight = split(
        ["a", "--sigma", "1", "2", "3", "4", "b", "--jobs", "3", "--penalties", "c", "--seed=4", "--json"]
    )
    assert own == ["a", "b", "--jobs", "3", "c", "--json"]
    assert flight == ["--sigma", "1", "2", "3", "4", "--penalties", "--seed=4"]


def test_key_is_decided_by_all_that_decides_a_flight_and_by_nothing_else():
    one = variant().spec
    same = resolve([*FLIGHT, "--sampler", "colored", "--vehicle", "paper"], "race")
    assert attempt_key(one) == attempt_key(same)
    for change in (["--seed", "1"], ["--margin", ".2"], ["--randomize", ".5"], ["--thrust-to-weight", "3"]):
        other = resolve([*FLIGHT, "--sampler", "colored", *change], "race")
        assert attempt_key(other) != attempt_key(one), change
        assert (variant_key(other) == variant_key(one)) == (change[0] == "--seed")


WRONG = {
    "compare": "expected one COURSE or more, got none",
    "compare paper_fla": "no course 'paper_fla': did you mean 'paper_flat'?",
    "compare paper_flat --variants gaussian,gaussian": "--variants: expected different names, got 'gaussian' twice",
    "compare paper_flat --variants gaussian,": "--variants: expected a sampler or NAME=part+part, got ''",
    "compare paper_flat --variants a=rac": "no preset 'rac': did you mean 'race'?",
    "compare paper_flat --variants a=race+es=3": "unrecognized options: --es 3",
    "compare paper_flat --variants a=race+smooth=3": "--variants: smooth: expected yes or no, got '3'",
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
