"""Many races: ratings are those of their model, and a campaign continues where it was ended."""

import json
import os
import signal
import sqlite3
import subprocess
import time

import msgspec
import numpy as np
import pytest

import quadsim
from quadsim.campaign.document import Line
from quadsim.campaign.heats import rating
from quadsim.campaign.heats.compare import fly_comparison
from quadsim.campaign.heats.paired import FlownHeats, HeatVariant, difference
from quadsim.campaign.heats.rating import bradley_terry
from quadsim.campaign.heats.runner import FlownHeat, HeatRunner
from quadsim.campaign.heats.stats import summary, summary_as_json
from quadsim.campaign.heats.store import HeatStore
from quadsim.campaign.heats.tables import overtakers_table, summary_blocks
from quadsim.campaign.run.database import code_of
from quadsim.campaign.run.pool import Pool
from quadsim.cli.cli import race
from quadsim.files.values import SettingError
from quadsim.heat.line_up import heats_of, line_up, parse_heat_variants
from quadsim.heat.spec import HeatSpec
from quadsim.record.provenance import this_provenance
from quadsim.record.run import RunError
from quadsim.record.schema import StoredEvent, StoredPlacing, StoredResult
from quadsim.statistics import clustered_mean, mean_interval, wilson
from tests.campaign_cases import RACE
from tests.small import SHORT, flags

SETTINGS = {**SHORT, "first_iterations": 1, "timeout": 0.2}


def fly_heats(heats, file, jobs):
    """Return the results of heats that a campaign's file has, and fly what it lacks."""
    with HeatRunner(file, jobs) as runner:
        return [row.result for row in runner(heats)]


def races(strengths, number, seed):
    """Return ranks of races whose pairs are drawn by Bradley and Terry's model.

    The times to the finish have a Gumbel distribution, so one race orders all entrants at once.
    """
    rng = np.random.default_rng(seed)
    names = list(strengths)
    pace = np.array(list(strengths.values())) * np.log(10.0) / 400.0
    late = -(pace + rng.gumbel(size=(number, len(names))))
    ranks = late.argsort(axis=1).argsort(axis=1) + 1
    return names, [dict(zip(names, map(int, row), strict=True)) for row in ranks]


STRENGTHS = {name: 1500.0 + 100.0 * k for name, k in zip("abcdefgh", range(-4, 5), strict=False)}
MEAN = np.mean(list(STRENGTHS.values())) - 1500.0


def covered(number, strengths=STRENGTHS, trials=60):
    """Return the share of the intervals that have the strength in them."""
    inside = 0
    for seed in range(trials):
        found = bradley_terry(*races(strengths, number, seed))
        inside += sum(
            abs(found[name][0] + MEAN - strength) <= found[name][1]
            for name, strength in strengths.items()
        )
    return inside / (trials * len(strengths))


def test_ratings_of_many_races_are_the_strengths_within_their_intervals(monkeypatch):
    """95 % of 480 intervals; the pairs of one race are dependent, and as if independent miss."""
    assert 0.92 <= covered(40) <= 0.98
    monkeypatch.setattr(rating, "_variances_by_race", lambda *_: np.zeros(len(STRENGTHS)))
    assert covered(40) < 0.85


def test_ratings_tell_strengths_apart():
    found = bradley_terry(*races({"a": 1700.0, "b": 1500.0, "c": 1300.0}, 200, 0))
    wrong = bradley_terry(*races({"a": 1500.0, "b": 1500.0, "c": 1500.0}, 200, 0))
    assert abs(found["a"][0] - 1700.0) <= found["a"][1]
    assert abs(wrong["a"][0] - 1700.0) > wrong["a"][1]


def test_who_always_wins_has_a_finite_rating():
    found = bradley_terry(["a", "b"], [{"a": 1, "b": 2}] * 20)
    assert found["a"][0] > 1500.0 > found["b"][0]
    assert np.isfinite(found["a"][1])
    # As wide as if each race counted alone, though all of them ended alike
    assert found["a"][1] > 100.0


def stored(order, *events):
    placings = [StoredPlacing(k, name, "finished", 10.0 + k) for k, name in enumerate(order, 1)]
    return StoredResult(placings, [StoredEvent(*event) for event in events], "", 1.0, {})


def of_setting(name, *results):
    return FlownHeats(name, ("a", "b"), 7, list(results))


def test_a_summary_counts_wins_contacts_and_overtakes():
    found = summary(
        ["a", "b"],
        [
            stored("ab", ("overtake", "a", "b", 3, 2), ("overtake", "a", "b", 1, 3)),
            stored("ba", ("contact", "a", "b")),
            stored("ab"),
        ],
        gates=7,
    )
    a, b = found.entrants
    assert (a.wins, b.wins) == (2, 1)
    assert (a.overtakes.mean, b.overtaken.mean) == (pytest.approx(2 / 3), pytest.approx(2 / 3))
    assert (found.with_contact, found.contacts) == (1, 1)
    assert found.finished_ci == pytest.approx(wilson(3, 3))  # by race
    assert found.pairs[0].a_first == 2
    assert a.rating > b.rating
    # gate 3 of the second lap is the tenth
    (overtaker,) = found.overtakers
    assert (overtaker.name, overtaker.other, overtaker.races) == ("a", "b", 1)
    assert overtaker.gates.mean == 10.0


def test_what_is_pooled_over_the_flights_of_a_race_has_the_race_as_its_unit():
    """Two races of four in which all do alike are two results, and not eight."""

    def race_of_four(time):
        placings = [StoredPlacing(k, name, "finished", time) for k, name in enumerate("abcd", 1)]
        return StoredResult(placings, [], "", 1.0, {})

    results = [race_of_four(time) for time in (10.0, 11.0, 12.0)]
    found = summary(list("abcd"), results, gates=7)
    assert found.race == clustered_mean([[10.0] * 4, [11.0] * 4, [12.0] * 4])
    by_race = mean_interval([10.0, 11.0, 12.0])
    assert (found.race.low, found.race.high) == pytest.approx((by_race.low, by_race.high))
    later = [race_of_four(time) for time in (10.5, 11.7, 12.6)]
    of_a, of_b = (
        FlownHeats(name, tuple("abcd"), 7, races) for name, races in (("a", results), ("b", later))
    )
    paired = mean_interval([0.5, 0.7, 0.6])
    assert difference(of_a, of_b).time.high == pytest.approx(paired.high)


def test_what_an_entrant_has_raised_is_in_its_row_and_in_the_report():
    fault = "KeyError: '[a]' (mine.py, line 3)"
    row = msgspec.structs.replace(stored("ab"), faults={"b": fault})
    assert msgspec.json.decode(msgspec.json.encode(row), type=StoredResult) == row
    found = summary(["a", "b"], [stored("ab"), row, row], gates=7)
    assert summary_blocks(found)[-1] == Line(f"b was out by an error in 2 of 3 races: {fault}")
    assert summary_as_json(found)["faults"] == {"b": [fault, fault]}


def test_few_overtakes_have_a_mean_without_an_interval():
    def first_at(laps):
        races = [stored("ab", ("overtake", "a", "b", 1, lap)) for lap in laps]
        return overtakers_table(summary(["a", "b"], races, gates=7)).rows[0][-1]

    assert first_at([1, 3]) == "8.0"
    assert first_at([1] * 5 + [3]) == "3.3 (1.0 to 9.3)"
    # The interval would begin before the first gate.
    assert mean_interval([1.0] * 5 + [15.0]).low < 1.0


def test_settings_are_compared_race_by_race():
    contact = ("contact", "a", "b")
    calm = of_setting("calm", stored("ab"), stored("ab"), stored("ab", contact), None)
    wild = of_setting("wild", stored("ab", contact), stored("ba", contact), stored("ab"), None)
    found = difference(calm, wild)
    # the race that one of them lost is left out
    assert found.races == 3
    assert (found.contact_a_only, found.contact_b_only) == (1, 2)
    assert found.contacts.mean == pytest.approx(1 / 3)
    # a and b change places in the second race: a comes in 1 s later, b 1 s earlier
    assert found.time.n == 6
    assert found.time.mean == pytest.approx(0.0)
    assert difference(calm, calm).contacts.mean == 0.0


def test_settings_of_races_are_read_with_and_without_names():
    found = parse_heat_variants("expect=own,soft=keep-weight=50+rules=physics,gaussian")
    assert found == {
        "expect=own": {"expect": "own"},
        "soft": {"keep_weight": "50", "rules": "physics"},
        "gaussian": {"sampler": "gaussian"},
    }
    with pytest.raises(SettingError, match="twice"):
        parse_heat_variants("expect=own,expect=own")


@pytest.fixture
def in_this_process(monkeypatch):
    """Races are flown here instead of in workers."""
    monkeypatch.setattr("quadsim.campaign.run.runner.open_pool", lambda *_: Pool())


@pytest.mark.compiled
def test_race_compare_heats_flies_each_setting_from_the_same_starts(
    tmp_path, capsys, in_this_process
):
    line = ["compare-heats", "figure8", "--entrants", "colored", "gaussian", *flags(SETTINGS)]
    settings = ["--starts=2", "--variants", "expect=velocity,expect=nothing"]
    assert race([*line, *settings, "--campaign", str(tmp_path / "a.sqlite"), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert set(found["settings"]) == {"expect=velocity", "expect=nothing"}
    (pair,) = found["differences"]
    assert (pair["a"], pair["b"], pair["races"]) == ("expect=velocity", "expect=nothing", 2)
    written = {file.suffix for file in (tmp_path / "a.report").iterdir()}
    assert written == {".md", ".json", ".png", ".svg"}
    with sqlite3.connect(tmp_path / "a.sqlite") as db:
        assert db.execute("SELECT count(*) FROM heats").fetchall() == [(4,)]


def small_heats(starts):
    made, of_race = line_up("figure8", ["colored", "gaussian"], SETTINGS)
    return heats_of(made, of_race, 0, starts)


@pytest.mark.parametrize("starts", [0, -1, 2.5, "many"])
def test_a_number_of_races_that_is_none_is_one_line(starts):
    with pytest.raises(SettingError, match=r"^starts: expected a whole number >= 1, got ") as error:
        quadsim.compare_heats(["colored", "gaussian"], "figure8", starts=starts)
    assert "\n" not in str(error.value)


def test_places_rotate_over_the_races():
    heats = small_heats(4)
    assert [heat.rotation for heat in heats] == [0, 1, 0, 1]
    assert [heat.seed for heat in heats] == [0, 1, 2, 3]
    assert heats[0].starts[0] == heats[1].starts[1]


@pytest.mark.compiled
def test_a_campaign_flies_each_race_once(tmp_path):
    sequence = fly_heats(small_heats(2), tmp_path / "a.sqlite", jobs=0)
    assert fly_heats(small_heats(2), tmp_path / "a.sqlite", jobs=0) == sequence
    with sqlite3.connect(tmp_path / "a.sqlite") as db:
        assert db.execute("SELECT count(*) FROM heats").fetchall() == [(2,)]


@pytest.mark.regression
def test_a_campaign_flies_the_same_in_parallel(tmp_path):
    sequence = fly_heats(small_heats(2), tmp_path / "a.sqlite", jobs=0)
    parallel = fly_heats(small_heats(2), tmp_path / "b.sqlite", jobs=2)
    assert [r.digest for r in parallel] == [r.digest for r in sequence]


@pytest.mark.regression
def test_a_killed_campaign_is_resumed_with_nothing_lost_and_nothing_twice(
    tmp_path, monkeypatch, capsys, in_this_process
):
    command = ["compare-heats", "figure8", "--starts", "6", *flags(SETTINGS), "--json"]
    file = tmp_path / "campaigns" / "heats.sqlite"
    monkeypatch.chdir(tmp_path)
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    killed = subprocess.Popen([*RACE, *command, "--jobs", "1"], start_new_session=True, **pipes)
    kept = []
    while len(kept) < 2 and killed.poll() is None:
        time.sleep(0.05)
        kept = rows(file)
    os.killpg(killed.pid, signal.SIGKILL)
    killed.communicate()
    assert 2 <= len(rows(file)) < 6

    assert race(command) == 0
    out, err = capsys.readouterr()
    assert "are kept from before" in err
    assert json.loads(out)["settings"]["race"]["races"] == 6
    assert kept == rows(file)[: len(kept)]
    assert len(rows(file)) == 6


def rows(file):
    if not file.exists():
        return []
    try:
        with sqlite3.connect(file) as db:
            return db.execute("SELECT key, result FROM heats ORDER BY rowid").fetchall()
    except sqlite3.OperationalError:  # the table is not there yet
        return []


def test_a_damaged_file_is_one_line(tmp_path):
    (tmp_path / "a.sqlite").write_text("no database")
    with pytest.raises(RunError, match=r"a\.sqlite: cannot keep the campaign here"):
        fly_heats(small_heats(1), tmp_path / "a.sqlite", jobs=0)


@pytest.mark.compiled
@pytest.mark.parametrize("ended", [0, 1])
def test_an_interrupted_campaign_says_whether_races_are_kept(ended, tmp_path, monkeypatch):
    def interrupted(pool, fly, missing):
        for heat in missing[:ended]:
            yield heat, fly(heat)
        raise KeyboardInterrupt

    monkeypatch.setattr("quadsim.campaign.heats.runner.run_all", interrupted)
    with pytest.raises(KeyboardInterrupt) as stop:
        fly_heats(small_heats(2), tmp_path / "a.sqlite", jobs=0)
    assert ("the same command continues" in str(stop.value)) == bool(ended)


@pytest.fixture
def by_draw(monkeypatch):
    """Let the entrant that is named first win without a flight; return the seeds of such heats."""
    seeds = []

    def flown(pool, fly, missing):
        for heat in missing:
            seeds.append(heat.seed)
            result = stored(heat.names)
            yield heat, FlownHeat(result, heat.record(), this_provenance())

    monkeypatch.setattr("quadsim.campaign.heats.runner.run_all", flown)
    return seeds


def test_a_row_that_cannot_be_read_is_named_and_flown_again(tmp_path, by_draw, capsys):
    file = tmp_path / "a.sqlite"
    heats = small_heats(4)
    fly_heats(heats, file, jobs=0)
    missing_entrant = json.dumps({"order": [], "events": [], "digest": ""})
    with sqlite3.connect(file) as db:
        damage = "UPDATE heats SET result = ? WHERE seed = ?"
        db.execute(damage, ("{", 1))
        db.execute(damage, (missing_entrant, 2))
        db.execute(damage, ("null", 3))
    by_draw.clear()
    again = fly_heats(heats, file, jobs=0)
    assert by_draw == [1, 2, 3]
    assert [len(result.order) for result in again] == [2] * 4
    err = capsys.readouterr().err
    assert err.count("is damaged and does not count") == 3
    assert "the heat of seed 1" in err


def test_a_file_without_a_format_is_refused_in_one_line(tmp_path):
    file = tmp_path / "heats.sqlite"
    with sqlite3.connect(file) as db:
        db.execute("CREATE TABLE heats (key TEXT PRIMARY KEY, result TEXT)")
    with pytest.raises(RunError, match="expected a campaign of format 6, got 0; move it away"):
        fly_heats(small_heats(1), file, jobs=0)


def test_heats_of_another_commit_are_named_and_can_be_left_out(tmp_path, by_draw):
    file = tmp_path / "a.sqlite"
    heats = small_heats(2)
    fly_heats(heats, file, jobs=0)
    with sqlite3.connect(file) as db:
        db.execute("UPDATE heats SET code = 'another' WHERE seed = 0")
    by_draw.clear()
    variants = [HeatVariant("race", heats)]
    with HeatRunner(file, jobs=0) as runner:
        found = fly_comparison(variants, runner)
    assert by_draw == []
    assert any(note.startswith("MIXED COMMITS") for note in found.notes())
    with HeatRunner(file, jobs=0, this_commit=True) as runner:
        found = fly_comparison(variants, runner)
    assert by_draw == [0]
    assert found.settings[0].commits == (code_of(this_provenance()),)


def test_a_part_that_cannot_be_told_from_others_is_refused_before_anything_flies(tmp_path, by_draw):
    class Drawing:
        """A controller whose state is unknown."""

        rest = (0.0, 0.0, 0.0, 9.81)

        def __init__(self):
            self.numbers = (k for k in range(3))

        def control(self, estimate):
            return (0.0, 0.0, 0.0, 9.81)

    made, of_race = line_up("figure8", [{"controller": Drawing()}, "gaussian"], SETTINGS)
    with pytest.raises(SettingError, match="expected a controller that can be told from others"):
        fly_heats(heats_of(made, of_race, 0, 2), tmp_path / "a.sqlite", jobs=0)
    assert by_draw == []


def test_workers_that_fly_with_other_parts_are_refused(tmp_path, monkeypatch, by_draw):
    class Processes(Pool):
        in_this_process = False

    monkeypatch.setattr("quadsim.campaign.run.runner.open_pool", lambda *_: Processes())
    made, of_race = line_up("figure8", [{"controller": Level()}, "gaussian"], SETTINGS)
    heats = heats_of(made, of_race, 0, 1)
    assert fly_heats(heats, tmp_path / "same.sqlite", jobs=1)
    monkeypatch.setattr(Level, "climb", 0.1)  # this process has changed its class since
    flown_before = HeatSpec.record

    def record(heat):
        found = flown_before(heat)
        found["entrants"][0]["spec"]["own"]["controller"]["sha256"] = "of the worker"
        return found

    def flown(pool, fly, missing):
        for heat in missing:
            yield heat, FlownHeat(stored(heat.names), record(heat), this_provenance())

    monkeypatch.setattr("quadsim.campaign.heats.runner.run_all", flown)
    with pytest.raises(RunError, match="a worker flies with another controller"):
        fly_heats(heats, tmp_path / "other.sqlite", jobs=1)


class Level:
    """A controller that holds the attitude."""

    climb = 0.0

    def control(self, estimate):
        return (0.0, 0.0, 0.0, 9.81 + self.climb)


def test_a_comparison_of_line_ups_from_python(tmp_path, by_draw):
    variants = {"aware": {"expect": "velocity"}, "blind": {"expect": "nothing"}}
    found = quadsim.compare_heats(
        ["colored", "gaussian"],
        "figure8",
        variants,
        starts=3,
        campaign=tmp_path / "a.sqlite",
        **SETTINGS,
    )
    assert [(one.name, one.summary.races) for one in found.settings] == [("aware", 3), ("blind", 3)]
    (change,) = found.differences
    assert change.contacts.mean == 0.0
    assert "blind - aware" in str(found)
    assert set(found.as_json()) == {"settings", "differences"}
    with HeatStore(tmp_path / "a.sqlite") as store:
        assert len(store.rows()) == 6
