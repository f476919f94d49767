"""Many races: ratings are those of their model, and a campaign continues where it was ended."""

import json
import os
import signal
import sqlite3
import subprocess
import time

import numpy as np
import pytest

from quadsim.campaign.heat_tables import overtakers_table
from quadsim.campaign.heats import (
    PairStats,
    bradley_terry,
    fly_heats,
    summary,
)
from quadsim.campaign.paired_heats import FlownHeats, difference
from quadsim.campaign.pool import Pool
from quadsim.cli.cli import race
from quadsim.files.values import SettingError
from quadsim.heat.line_up import heats_of, line_up, parse_race_variants
from quadsim.record.run import RunError
from quadsim.record.schema import StoredEvent, StoredPlacing, StoredResult
from quadsim.record.statistics import mean_interval, wilson
from tests.campaign_cases import RACE
from tests.small import SHORT, flags

SETTINGS = {**SHORT, "first_iterations": 1, "timeout": 0.2}


def races(strengths, number, seed):
    """Return pair statistics of races whose winner is drawn by Bradley and Terry's model."""
    rng = np.random.default_rng(seed)
    names = list(strengths)
    pairs = []
    for k, a in enumerate(names):
        for b in names[k + 1 :]:
            p = 1.0 / (1.0 + 10 ** ((strengths[b] - strengths[a]) / 400.0))
            first = int(rng.binomial(number, p))
            pairs.append(PairStats(a, b, number, first, wilson(first, number)))
    return names, pairs


def test_ratings_of_many_races_are_the_strengths_within_their_intervals():
    strengths = {"a": 1700.0, "b": 1500.0, "c": 1300.0}
    inside = 0
    for seed in range(20):
        found = bradley_terry(*races(strengths, 200, seed))
        inside += sum(abs(found[name][0] - strengths[name]) <= found[name][1] for name in strengths)
    # 95 % intervals of 60 ratings: 57 of them are expected, and 51 are 3.6 standard deviations less
    assert 51 <= inside <= 60
    # and they tell these strengths from others
    wrong = bradley_terry(*races({"a": 1500.0, "b": 1500.0, "c": 1500.0}, 200, 0))
    assert abs(wrong["a"][0] - 1700.0) > wrong["a"][1]


def test_who_always_wins_has_a_finite_rating():
    found = bradley_terry(["a", "b"], [PairStats("a", "b", 20, 20, wilson(20, 20))])
    assert found["a"][0] > 1500.0 > found["b"][0]
    assert np.isfinite(found["a"][1])


def stored(order, *events):
    placings = [StoredPlacing(k, name, "finished", 10.0 + k) for k, name in enumerate(order, 1)]
    return StoredResult(placings, [StoredEvent(*event) for event in events], "")


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
    assert found.finished_ci == wilson(6, 6)
    assert found.pairs[0].a_first == 2
    assert a.rating > b.rating
    # gate 3 of the second lap is the tenth
    (overtaker,) = found.overtakers
    assert (overtaker.name, overtaker.other, overtaker.races) == ("a", "b", 1)
    assert overtaker.gates.mean == 10.0


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
    found = parse_race_variants("expect=own,soft=keep-weight=50+rules=physics,gaussian")
    assert found == {
        "expect=own": {"expect": "own"},
        "soft": {"keep_weight": "50", "rules": "physics"},
        "gaussian": {"sampler": "gaussian"},
    }
    with pytest.raises(SettingError, match="twice"):
        parse_race_variants("expect=own,expect=own")


@pytest.fixture
def in_this_process(monkeypatch):
    """Races are flown here instead of in workers."""
    monkeypatch.setattr("quadsim.campaign.heats.open_pool", lambda *_: Pool())


@pytest.mark.compiled
def test_race_compare_flies_each_setting_from_the_same_starts(tmp_path, capsys, in_this_process):
    line = ["compare", "figure8", "--line-up", "colored", "gaussian", *flags(SETTINGS)]
    settings = ["--starts=2", "--variants", "expect=velocity,expect=nothing"]
    assert race([*line, *settings, "--campaign", str(tmp_path / "a.sqlite"), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert set(found["settings"]) == {"expect=velocity", "expect=nothing"}
    (pair,) = found["differences"]
    assert (pair["a"], pair["b"], pair["races"]) == ("expect=velocity", "expect=nothing", 2)
    written = {file.suffix for file in (tmp_path / "a.report").iterdir()}
    assert written == {".md", ".png", ".svg"}
    with sqlite3.connect(tmp_path / "a.sqlite") as db:
        assert db.execute("SELECT count(*) FROM heats").fetchall() == [(4,)]


@pytest.mark.parametrize(
    ("words", "problem"),
    [
        (["--line-up", "colored", "--attempts=3"], "expected --starts in place of --attempts"),
        (["--starts=4"], "expected --line-up beside it"),
        (["--line-up", "colored", "colored", "--variants=nonsense"], "no sampler, preset or pilot"),
    ],
)
def test_flags_that_do_not_fit_a_line_up_are_one_line(words, problem, capsys):
    assert race(["compare", "figure8", *words]) == 2
    err = capsys.readouterr().err.strip()
    assert problem in err
    assert "\n" not in err


def small_heats(starts):
    made, of_race = line_up("figure8", ["colored", "gaussian"], SETTINGS)
    return heats_of(made, of_race, 0, starts)


def test_places_rotate_over_the_races():
    heats = small_heats(4)
    assert [heat.rotation for heat in heats] == [0, 1, 0, 1]
    assert [heat.seed for heat in heats] == [0, 1, 2, 3]
    assert heats[0].starts[0] == heats[1].starts[1]


@pytest.mark.compiled
@pytest.mark.process
def test_a_campaign_flies_each_race_once_and_the_same_in_parallel(tmp_path):
    sequence = fly_heats(small_heats(2), tmp_path / "a.sqlite", jobs=0)
    assert fly_heats(small_heats(2), tmp_path / "a.sqlite", jobs=0) == sequence
    with sqlite3.connect(tmp_path / "a.sqlite") as db:
        assert db.execute("SELECT count(*) FROM heats").fetchall() == [(2,)]
    parallel = fly_heats(small_heats(2), tmp_path / "b.sqlite", jobs=2)
    assert [r.digest for r in parallel] == [r.digest for r in sequence]


@pytest.mark.compiled
@pytest.mark.process
def test_a_killed_campaign_is_resumed_with_nothing_lost_and_nothing_twice(
    tmp_path, monkeypatch, capsys, in_this_process
):
    command = ["heat", "figure8", "--starts", "6", *flags(SETTINGS), "--json"]
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
    assert json.loads(out)["races"] == 6
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
    with pytest.raises(RunError, match=r"a\.sqlite: cannot keep races here"):
        fly_heats(small_heats(1), tmp_path / "a.sqlite", jobs=0)


@pytest.mark.compiled
@pytest.mark.parametrize("ended", [0, 1])
def test_an_interrupted_campaign_says_whether_races_are_kept(ended, tmp_path, monkeypatch):
    def interrupted(pool, fly, missing):
        for heat in missing[:ended]:
            yield heat, fly(heat)
        raise KeyboardInterrupt

    monkeypatch.setattr("quadsim.campaign.heats.run_all", interrupted)
    with pytest.raises(KeyboardInterrupt) as stop:
        fly_heats(small_heats(2), tmp_path / "a.sqlite", jobs=0)
    assert ("the same command continues" in str(stop.value)) == bool(ended)
