"""Controllers of one's own by name: package.module:Class, from the command line and from Python."""

import re

import pytest

import quadsim
from quadsim.campaign.flights.compare import comparison_stem
from quadsim.campaign.run.variants import make_variants, parse_variants
from quadsim.cli.cli import race
from quadsim.heat.line_up import line_up, parts_of
from quadsim.record.run import canonical
from tests.small import SHORT, flags

MODULE = """
class Pd:
    def __init__(self, gain=4.0):
        self.gain = gain

    def control(self, x):
        return 0.0, 0.0, 0.0, 9.81 + self.gain * (2.0 - x[2]) - 3.0 * x[5]


class Sized(Pd):
    def __init__(self, spec):
        super().__init__(10.0 * spec.vehicle.mass)


class Nothing:
    pass


strong = Pd(8.0)
"""
NEEDED = "the flight had one of your own, whose code is not in the record; give it again as "


@pytest.fixture(autouse=True)
def laws(tmp_path, monkeypatch):
    """Make the module `laws` importable, and give the test a folder of its own."""
    (tmp_path / "laws.py").write_text(MODULE)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.chdir(tmp_path)
    import laws

    return laws


def fly(*words):
    """Run `race fly` with a short flight, and return its exit code."""
    return race(["fly", "figure8", *flags(SHORT), *words])


def test_a_class_a_function_of_the_spec_and_an_object_fly(laws):
    for name, part in (("Pd", laws.Pd()), ("Sized", laws.Pd(8.7)), ("strong", laws.strong)):
        named = quadsim.fly("figure8", controller=f"laws:{name}", **SHORT)
        given = quadsim.fly("figure8", controller=part, **SHORT)
        assert (named.telemetry["pz"] == given.telemetry["pz"]).all(), name


@pytest.mark.parametrize(
    ("name", "problem"),
    [
        ("laws:Nothing", "the class has no method 'control'"),
        ("laws:Missing", "module 'laws' has no attribute 'Missing'"),
        ("no_such_module:Pd", "No module named 'no_such_module'"),
        ("laws", "expected package.module:Class, got 'laws'"),
        ("laws:MODULE", "module 'laws' has no attribute 'MODULE'"),
    ],
)
def test_what_is_no_controller_is_refused_in_one_line(name, problem, capsys):
    assert fly("--controller", name) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("race fly: --controller: expected package.module:Class")
    assert problem in line


def test_a_stored_flight_is_flown_again_with_its_controller(capsys):
    assert fly("--controller", "laws:Pd") == 1
    capsys.readouterr()
    assert race(["fly", "--from", "last"]) == 2
    line = f"race fly: controller: {NEEDED}controller=..., or --controller\n"
    assert capsys.readouterr().err == line
    assert race(["fly", "--from", "last", "--controller", "laws:Pd"]) == 1
    assert "the same flight as the stored run, to the last bit" in capsys.readouterr().err
    assert race(["fly", "--from", "last", "--controller", "laws:strong"]) == 2
    assert "expected the Pd that flew" in capsys.readouterr().err


def test_a_flight_with_an_object_is_flown_again_by_the_name_of_its_class(laws):
    run = quadsim.fly("figure8", controller=laws.Pd(), **SHORT)
    assert quadsim.fly(run.spec, controller="laws:Pd").digest() == run.digest()
    assert quadsim.fly(run.spec, controller=laws.Pd()).digest() == run.digest()
    other = quadsim.fly("figure8", controller=laws.Pd(5.0), **SHORT)
    with pytest.raises(quadsim.FileError, match="expected the Pd that flew"):
        quadsim.fly(other.spec, controller="laws:Pd")


def test_a_controller_is_a_variant_of_a_comparison(laws):
    (pd,) = make_variants(["figure8"], parse_variants("pd=controller=laws:Pd"), SHORT)
    assert pd.spec.controller is laws.Pd


@pytest.mark.parametrize("flag", [["--controller", "laws:Pd"], ["--pilot", "split_s_swift"]])
def test_a_search_for_the_planners_numbers_takes_no_other_controller(flag, capsys):
    """It searched among numbers of a planner that did not fly."""
    assert race(["tune", "split_s_swift", *flag]) == 2
    wanted = "expected none, as the search is for the planner's numbers"
    assert capsys.readouterr().err == f"race tune: {flag[0]}: {wanted}\n"


def remark(capsys):
    """Return the line on settings without effect; one on a missing PyBullet may precede it."""
    (line,) = (x for x in capsys.readouterr().err.splitlines() if "without effect" in x)
    return line


def test_settings_of_the_planner_are_without_effect_beside_a_controller(capsys):
    """They were taken without a word."""
    assert fly("--controller", "laws:Pd", "--sampler", "gaussian") == 1
    why = "of your own, unless read from the Spec"
    used = "--sampler, --samples, --horizon, --iterations"
    told = remark(capsys)
    head, _, rest = told.partition(": without effect beside the ")
    assert (head.split(": ")[0], rest) == ("race fly", f"controller Pd {why}")
    assert sorted(head.split(": ")[1].split(", ")) == sorted(used.split(", "))
    # the other settings have their effect
    short = ["--laps", "1", "--timeout", ".1"]
    assert race(["fly", "figure8", *short, "--controller", "laws:Pd", "--dt", ".02"]) == 1
    assert "without effect" not in capsys.readouterr().err
    line_up = ["--entrants", "a=controller=laws:Pd", "b=controller=laws:strong", "--samples", "64"]
    assert race(["heat", "figure8", *short, *line_up]) == 1  # nobody finishes
    told = remark(capsys)
    assert told == f"race heat: --samples: without effect beside the controllers Pd {why}"


LINE_UP = ["--entrants", "pd=controller=laws:Pd", "strong=controller=laws:strong"]


def test_a_stored_race_is_flown_again_with_its_controllers(laws, capsys):
    assert race(["heat", "figure8", *LINE_UP, *flags(SHORT)]) == 1  # nobody finishes
    capsys.readouterr()
    assert race(["heat", "--from", "last"]) == 2
    error = capsys.readouterr().err
    assert error == (
        f"race heat: pd: controller: {NEEDED}parts={{'pd': {{'controller': ...}}}}, or --parts"
        " pd=controller=package.module:Class\n"
    )
    parts = [word.replace("--entrants", "--parts") for word in LINE_UP]
    assert race(["heat", "--from", "last", *parts]) == 1  # nobody finishes
    assert "the same race as the stored one, to the last bit" in capsys.readouterr().err

    stored = quadsim.load_heat()
    own = {"pd": {"controller": laws.Pd}, "strong": {"controller": laws.strong}}
    assert quadsim.race(stored.spec, parts=own).digest() == stored.digest()
    with pytest.raises(quadsim.FileError, match=re.escape("parts={'strong': {'controller': ...}}")):
        quadsim.race(stored.spec, parts={"pd": own["pd"]})
    with pytest.raises(
        quadsim.SettingError, match="parts of your own that flew as 'pd', got 'seed"
    ):
        quadsim.race(stored.spec, parts=own | {"pd": {**own["pd"], "seed": 3}})


def test_a_stored_race_is_flown_again_with_another_seed(laws, capsys):
    """It took no other seed, while `race fly --from` did."""
    settings = {**SHORT, "randomize": 1.0}
    assert race(["heat", "figure8", *LINE_UP, *flags(settings)]) == 1  # nobody finishes
    stored = quadsim.load_heat()
    parts = [word.replace("--entrants", "--parts") for word in LINE_UP]
    capsys.readouterr()
    assert race(["heat", "--from", "last", "--seed", "3", *parts]) == 1  # nobody finishes
    assert "the stored race was flown with seed 0" in capsys.readouterr().err
    other = quadsim.load_heat()
    fresh = quadsim.race(
        {"pd": {"controller": laws.Pd}, "strong": {"controller": laws.strong}},
        "figure8",
        **settings,
        seed=3,
    )
    assert other.digest() == fresh.digest() != stored.digest()
    own = {"pd": {"controller": laws.Pd}, "strong": {"controller": laws.strong}}
    assert quadsim.race(stored.spec, parts=own, seed=3).digest() == fresh.digest()
    assert quadsim.race(fresh.spec, parts=own, seed=0).digest() == stored.digest()
    with pytest.raises(quadsim.SettingError, match="seed: expected"):
        quadsim.race(stored.spec, parts=own, seed=-1)
    assert race(["heat", "--from", "last", "--seed", "x", *parts]) == 2
    assert capsys.readouterr().err.startswith("race heat: --seed: expected")


def test_parts_are_for_a_stored_race(capsys):
    assert race(["heat", "--parts", "pd=controller=laws:Pd"]) == 2
    assert capsys.readouterr().err.startswith("race heat: --parts: expected none without --from")
    # an entrant without a name is called by its whole text
    text = "controller=laws:Pd=controller=laws:Pd"
    assert parts_of([text]) == {"controller=laws:Pd": {"controller": "laws:Pd"}}
    for text in ("pd", "=controller=laws:Pd"):
        with pytest.raises(quadsim.SettingError, match="expected NAME=controller="):
            parts_of([text])


def test_the_record_of_a_flight_is_an_entrant(laws):
    """It said that `course_text` is no setting."""
    run = quadsim.fly("split_s_swift", pilot="split_s_swift", laps=1, timeout=0.05)
    (again,), _ = line_up("figure8", {"again": run.spec}, {})
    assert again.name == "again"
    assert canonical(again.spec.record()) == canonical(run.spec)
    line_up_of_two = {name: {"controller": laws.Pd} for name in ("pd", "other")}
    heat = quadsim.race(line_up_of_two, "figure8", **SHORT)
    with pytest.raises(quadsim.FileError, match="the run flew among others"):
        quadsim.race({"pd": heat["pd"].spec})


def test_the_files_of_a_report_have_no_colon_of_a_variants_name(tmp_path):
    variants = "controller=laws:Pd,hold=controller=laws:strong"
    found = quadsim.compare("figure8", variants, attempts=1, **SHORT)
    files = [file.name for file in found.save(tmp_path / "report", comparison_stem(found, "id"))]
    assert files[0] == "figure8_controller-laws-Pd_hold_id.md"
