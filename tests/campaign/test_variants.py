"""Variants are settings: what `race fly` would fly with the same flags."""

import re

import pytest

from quadsim.campaign.run.attempt import attempt_key, variant_key
from quadsim.campaign.run.variants import Variant, make_variants, named_variants, parse_variants
from quadsim.cli.cli import race
from quadsim.config.setting_texts import named_parts, parse_parts, resolve
from quadsim.config.settings import SettingError
from quadsim.heat.line_up import KINDS
from quadsim.record.provenance import this_provenance
from tests.campaign_cases import COURSE, SETTINGS, variant


def test_a_variant_is_what_the_same_settings_fly():
    text = "soft=race+gaussian+target-ess=20+sigma=2:2:.3:4+smooth=yes,colored"
    soft, plain = make_variants([COURSE], parse_variants(text), SETTINGS)
    settings = {"preset": "race", "target_ess": 20, "sigma": (2, 2, 0.3, 4), "smooth": True}
    assert soft.spec == variant("gaussian", **settings).spec
    assert plain.spec == variant("colored").spec


def test_every_course_meets_every_variant_in_order():
    variants = make_variants(
        ["figure8", "split_s_song"], parse_variants("gaussian,colored"), {"laps": 1}
    )
    assert [(v.course, v.name) for v in variants] == [
        (course, name) for course in ("figure8", "split_s_song") for name in ("gaussian", "colored")
    ]


def test_a_term_of_one_s_own_keeps_its_colon():
    assert parse_variants("calm=race+term=mine:calm=50") == {
        "calm": {"preset": "race", "term": ("mine:calm=50",)}
    }


def test_a_variant_may_have_several_faults_and_a_fault_keeps_its_colons():
    weak, sound = make_variants(
        [COURSE],
        parse_variants("weak=race+sensing=vio+fault=gyro=.1:0:0@3+fault=commands=lost~.1,colored"),
        {},
    )
    assert weak.spec.fault == ("gyro=.1:0:0@3", "commands=lost~.1")
    assert sound.spec.fault == ()


def test_a_fault_makes_another_variant_and_what_a_seed_draws_of_it_does_not():
    sound = variant("colored", vehicle="swift").spec
    weak = variant("colored", vehicle="swift", fault="rotor=.5").spec
    assert variant_key(weak.record()) != variant_key(sound.record())
    assert variant_key(weak.but(fault="rotor=.7").record()) != variant_key(weak.record())
    one, other = Variant("weak", weak).attempts(2)
    assert one.drawn_faults != other.drawn_faults
    assert variant_key(one.record()) == variant_key(other.record())
    assert attempt_key(one.record()) != attempt_key(other.record())


def test_settings_of_other_samplers_are_left_out():
    exponents = SETTINGS | {"gamma": (1, 1, 1, 1)}
    white, colored = make_variants([COURSE], parse_variants("gaussian,colored"), exponents)
    assert white.spec == variant("gaussian").spec
    assert colored.spec.planner.sampling.gamma == (1.0, 1.0, 1.0, 1.0)


def test_the_key_is_decided_by_all_that_decides_a_flight_and_by_nothing_else():
    one = variant().spec.record()
    same = resolve(COURSE, SETTINGS | {"sampler": "colored", "vehicle": "swift"}).record()
    assert attempt_key(one) == attempt_key(same)
    for name, value in {"margin": 0.2, "randomize": 0.5, "thrust_to_weight": 3}.items():
        other = variant("colored", **{name: value}).spec.record()
        assert attempt_key(other) != attempt_key(one), name
        assert variant_key(other) != variant_key(one), name


def test_the_seed_decides_the_attempt_and_not_the_variant():
    one = variant().spec.record()
    other = variant(seed=1).spec.record()
    assert attempt_key(other) != attempt_key(one)
    assert variant_key(other) == variant_key(one)


def test_a_library_of_another_version_flies_another_attempt_and_one_that_only_measures_does_not():
    one, here = variant().spec.record(), this_provenance()["versions"]
    assert attempt_key(one) == attempt_key(one, here | {"scipy": "0", "python": "0"})
    for library in ("numpy", "numba", "pybullet"):
        other = here | {library: "0.1"}
        assert attempt_key(one, other) != attempt_key(one)
        assert variant_key(one, other) != variant_key(one)


# Settings whose names are taken as names where a part follows: "ahead" belongs to one cost alone.
NAMES = ("mine", "ahead", "speed", "height", "seed", "sigma", "expect", "ahead-share", "penalties")


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("parts", ["gaussian", "controller=geo:Geo", "race+seed=3", "margin=.3"])
def test_a_name_stands_before_a_part_though_a_setting_has_it(name, parts):
    """A race took `ahead=controller=geo:Geo` for the setting."""
    assert named_parts(f"{name}={parts}", KINDS) == (name, parts)
    assert parse_variants(f"{name}={parts}") == {name: parse_parts(parts)}


@pytest.mark.parametrize(
    "text",
    [
        "controller=geo:Geo",
        "sampler=mine:Held+seed=3",
        "term=mine:calm=50",
        "fault=gyro=.1:0:0@3",
        "sigma=3:3:.6:6",
        "vehicle=paper",
        "vehicle=mine.yaml",
        "penalties=yes",
        "margin=.3",
        "expect=own",
        "rules=physics",
        "race+target-ess=200",
        "gaussian",
    ],
)
def test_a_setting_alone_has_no_name(text):
    """A comparison took `controller=geo:Geo` for a sampler with the name "controller"."""
    assert named_parts(text, KINDS) == (None, text)


def test_a_text_without_a_name_is_the_name_of_the_variant():
    assert parse_variants("controller=geo:Geo,race+seed=3") == {
        "controller=geo:Geo": {"controller": "geo:Geo"},
        "race+seed=3": {"preset": "race", "seed": "3"},
    }
    assert parse_variants("pilot=split_s_swift") == {"pilot": {"pilot": "split_s_swift"}}
    # in Python the key is the name, whatever it is
    assert named_variants({"vehicle": "paper"}) == {"vehicle": {"preset": "paper"}}


def test_a_text_that_names_no_variants_is_refused():
    for text in ("gaussian,gaussian", "gaussian,", "a=rac", "a=", "=race", "a\x07=colored"):
        with pytest.raises(SettingError) as error:
            parse_variants(text)
        assert error.value.name == "variants", text
        assert "\n" not in str(error.value), text


def test_a_wrong_setting_of_a_variant_is_named():
    for text, name in (
        ("a=race+es=3", "es"),
        ("a=race+smooth=3", "smooth"),
        ("a=target-ess=x", "target_ess"),
    ):
        with pytest.raises(SettingError) as error:
            make_variants([COURSE], parse_variants(text), SETTINGS)
        assert error.value.name == name


WRONG = {  # command line -> what the one line names
    "compare": "COURSE",
    "compare paper_fla": "'paper_fla'",
    "compare paper_flat --variants gaussian,gaussian": "--variants: ",
    "compare paper_flat --variants a=race+es=3": "--es: ",
    "compare paper_flat --attempts 0": "--attempts: ",
    "compare paper_flat --laps 2": "paper_flat: ",
    "compare paper_flat --threads 1": "--threads: ",
    "compare paper_flat --jobs 0": "--jobs: ",
    "tune paper_flat --jobs 0": "--jobs: ",
    "regress": "FILE.yaml",
    "regress mine.yaml --jobs many": "--jobs: ",
    "results": "campaigns/race.sqlite: ",
}


@pytest.mark.slow
def test_mistakes_are_one_line_before_anything_flies(capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for argv, named in WRONG.items():
        assert race(argv.split()) == 2, argv
        (line,) = capsys.readouterr().err.splitlines()
        assert line.startswith(f"race {argv.split()[0]}: "), argv
        assert named in line
    assert not list(tmp_path.iterdir()), "nothing was made"


def test_variants_in_python_are_mappings_or_texts():
    soft = {"preset": "race", "target_ess": "200"}
    assert named_variants({"soft": soft}) == {"soft": soft}
    assert named_variants({"soft": "race+target-ess=200"}) == {"soft": soft}
    assert named_variants("gaussian,soft=race+target-ess=200") == {
        "gaussian": {"sampler": "gaussian"},
        "soft": soft,
    }
    # A name is that of a sampler, or of a preset: it never flies as the default.
    assert named_variants(("colored", "race_informed")) == {
        "colored": {"sampler": "colored"},
        "race_informed": {"preset": "race_informed"},
    }
    assert named_variants({"gaussian": {"samples": 64}}) == {
        "gaussian": {"sampler": "gaussian", "samples": 64}
    }


@pytest.mark.parametrize(
    ("variants", "problem"),
    [
        (("fast",), "variants: no sampler, preset or pilot 'fast'"),
        ({"fast": 3}, "variants: fast: expected settings as a mapping or a text, got 3"),
        ([{"samples": 64}], "variants: expected texts, or a mapping {name: settings}, got"),
        (("colored", "colored"), "variants: expected different names, got 'colored' twice"),
    ],
)
def test_variants_that_are_none_are_one_line(variants, problem):
    with pytest.raises(SettingError, match=f"^{re.escape(problem)}"):
        named_variants(variants)
