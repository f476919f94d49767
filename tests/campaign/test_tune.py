"""The search: the preset file is the planner that flew, a kill loses no trial, no point of the
front is dominated."""

import json
import multiprocessing as mp
import os
import random
import signal
import sqlite3
import time
from contextlib import closing
from dataclasses import fields, replace

import pytest

pytest.importorskip("optuna", reason="extra 'tune'")

from quadsim.campaign.flights.stats import variant_stats
from quadsim.campaign.run.attempt import fly_attempt
from quadsim.campaign.run.pool import Pool
from quadsim.campaign.run.runner import Runner
from quadsim.campaign.tune import search as search_module
from quadsim.campaign.tune.parameters import (
    GROUPS,
    parameters,
    preset_text,
    weights_of,
    with_parameters,
)
from quadsim.campaign.tune.search import Search, TrialStats
from quadsim.campaign.tune.tune import Goal, objective, pareto, tune
from quadsim.cli.cli import race
from quadsim.config.presets import parse_planner
from quadsim.config.spec import Spec
from quadsim.controllers.costs.race import RaceWeights
from quadsim.controllers.presets import PRESETS
from quadsim.racing.events import Event
from quadsim.record.run import RunError
from tests.campaign_cases import COURSE, FLIGHT, row, variant

COLORED = PRESETS["race"]["colored"]
MARGINS = list(parameters(COLORED, ["margin"]))


BASES = [
    (name, sampler, PRESETS[name][sampler])
    for name in PRESETS
    for sampler in ("gaussian", "colored")
]


def test_the_preset_file_is_the_planner_that_flew():
    for preset, sampler, base in BASES:
        values = {
            p.name: int(p.high) if p.step else 0.7 * p.low + 0.3 * p.high
            for p in parameters(base, GROUPS)
        }
        planner = with_parameters(base, values)
        assert planner != base
        text = preset_text(planner, preset, "two\nlines")
        read = parse_planner(text, "tuned.yaml", sampler)
        assert read == replace(planner, preset="tuned.yaml"), (preset, sampler)


def test_a_planner_s_own_parameters_change_nothing():
    for preset, sampler, base in BASES:
        own = {p.name: p.base for p in parameters(base, GROUPS)}
        assert with_parameters(base, own) == base, (preset, sampler)


def test_gaussian_noise_has_no_exponents_to_search():
    assert not list(parameters(PRESETS["race"]["gaussian"], ["gamma"]))


def test_every_group_of_a_colored_planner_has_parameters():
    for group in GROUPS:
        assert list(parameters(COLORED, [group])), group


def test_weights_are_searched_and_other_numbers_of_the_cost_are_not():
    found = set(weights_of(RaceWeights()))
    assert {"crash", "clearance", "heading"} <= found < {f.name for f in fields(RaceWeights)}
    assert not found & {"progress", "margin", "desired_speed", "opening"}


def test_the_front_is_the_points_that_no_other_dominates():
    points = [
        (5.0, -1.0, 30.0),
        (4.0, -0.9, 40.0),
        (5.1, -1.0, 30.0),
        (6.0, -1.0, 20.0),
        (4.0, -0.9, 40.0),
    ]
    assert pareto(points) == [0, 1, 3, 4], "equal points do not dominate each other"


def test_below_the_floor_attempts_that_do_not_finish_count():
    safe = variant_stats("safe", [row(s, laps=(6.0,)) for s in range(4)], 20.0)
    rows = [row(s, "finished" if s else "crashed", laps=(5.0,)) for s in range(4)]
    fast = variant_stats("fast", rows, 20.0)
    assert objective([safe], floor=1.0) < objective([fast], floor=1.0)
    assert objective([fast], floor=0.75) < objective([safe], floor=0.75)


def test_one_per_cent_counts_the_same_on_every_course():
    def flown(*laps):
        return [variant_stats("v", [row(0, laps=(lap,))], 50.0) for lap in laps]

    both = objective(flown(4.0, 20.0), floor=1.0)
    assert objective(flown(3.9, 20.0), floor=1.0) == pytest.approx(both * 0.975**0.5)
    assert objective(flown(4.0, 19.5), floor=1.0) == pytest.approx(both * 0.975**0.5)


def opened(path, space=MARGINS):
    return Search(path, "s", space)


def value_of(params):
    """Return a value in place of flying a trial."""
    return 5.0 + sum(params.values())


def tell(search, trial):
    value = value_of(trial.params)
    search.tell(trial, value, TrialStats(lap=value, finished=1, thrust_tv=10.0))


@pytest.mark.slow
def test_the_first_trial_is_the_planner_that_the_search_begins_with(tmp_path):
    with opened(tmp_path / "c.sqlite") as search:
        (first,) = search.ask(1)
    assert first.params == {"margin": COLORED.cost.margin, "tighten": COLORED.mppi.tighten}


def test_a_search_lies_in_the_file_of_any_name(tmp_path):
    with opened(tmp_path / "a?b%20{c}#d.sqlite") as search:
        tell(search, *search.ask(1))
    assert [path.name for path in tmp_path.iterdir()] == ["a?b%20{c}#d.sqlite"]
    with opened(tmp_path / "a?b%20{c}#d.sqlite") as search:
        assert search.done == 1


def test_trials_that_a_kill_left_open_are_tried_again(tmp_path):
    with opened(tmp_path / "c.sqlite") as search:
        first, second = search.ask(2)
        tell(search, first)
    with opened(tmp_path / "c.sqlite") as search:
        assert search.done == 1
        (again,) = search.ask(1)
        assert again.params == second.params


@pytest.mark.slow
def test_a_search_that_was_stopped_proposes_what_it_would_have(tmp_path, monkeypatch):
    """It is stopped after a trial was told, after one was asked, and after one was lost."""
    monkeypatch.setattr(search_module, "STARTUP", 3)

    def proposals(path, stops):
        search, proposed = opened(path), []
        for k in range(6):
            (trial,) = search.ask(1)
            if stops and k == 2:
                search = opened(path)
                (trial,) = search.ask(1)
            proposed.append(trial.params)
            if k == 3:
                search.give_up(trial)
            else:
                tell(search, trial)
            if stops and k in (0, 3, 4):
                search = opened(path)
        return proposed

    whole = proposals(tmp_path / "whole.sqlite", stops=False)
    assert proposals(tmp_path / "stopped.sqlite", stops=True) == whole
    assert len({str(params) for params in whole}) == len(whole), "no proposal twice"


def search_for_ever(path, log):
    """A process that asks two trials at a time, and notes each that it has told."""
    with opened(path) as search, log.open("a") as told:
        while True:
            for trial in search.ask(2):
                time.sleep(0.002)
                tell(search, trial)
                told.write(f"{trial.number}\n")
                told.flush()


@pytest.mark.regression
def test_a_search_that_is_killed_at_any_moment_loses_no_trial(tmp_path):
    path, log = tmp_path / "c.sqlite", tmp_path / "told"
    log.touch()
    rng = random.Random(0)
    for _ in range(6):
        process = mp.get_context("fork").Process(target=search_for_ever, args=(path, log))
        process.start()
        process.join(rng.uniform(0.05, 0.6))
        os.kill(process.pid, signal.SIGKILL)
        process.join()
    with opened(path) as search:
        flown = search.flown()
        assert {int(number) for number in log.read_text().split()} <= {t.number for t in flown}
        assert all(t.value == value_of(t.parameters) for t in flown)
        assert len({str(t.parameters) for t in flown}) == len(flown), "no proposal twice"
        (trial,) = search.ask(1)
        tell(search, trial)
        assert search.done == len(flown) + 1
    with closing(sqlite3.connect(path)) as db:
        assert db.execute("PRAGMA integrity_check").fetchall() == [("ok",)]


@pytest.mark.slow
@pytest.mark.parametrize(
    "statement",
    ["UPDATE trials SET state = 'x'", "UPDATE trial_params SET distribution_json = '{'", None],
)
def test_a_damaged_search_is_one_line(tmp_path, statement):
    path = tmp_path / "c.sqlite"
    with opened(path) as search:
        for trial in search.ask(2):
            tell(search, trial)
    if statement is None:
        path.write_bytes(b"no database" * 1000)
    else:
        with closing(sqlite3.connect(path)) as db, db:
            db.execute(statement)
    with pytest.raises(RunError) as error, opened(path) as search:
        search.flown()
    assert str(error.value).startswith(f"{path}: ")
    assert "\n" not in str(error.value)


@pytest.fixture
def in_this_process(monkeypatch):
    """Attempts fly here instead of in workers."""
    monkeypatch.setattr("quadsim.campaign.run.runner.open_pool", lambda *_: Pool())


@pytest.fixture
def all_finish(monkeypatch, in_this_process):
    """Every attempt counts as finished after a lap of 4 s."""

    def finish(spec):
        flight = fly_attempt(spec)
        gates = len(spec.course.gates)
        passes = tuple(
            Event(4.0 * gate / gates, "pass", gate, 1, (0.0, 0.0), 8.0, (0.0, 0.0, 1.0))
            for gate in range(1, gates + 1)
        )
        return replace(flight, run=replace(flight.run, outcome="finished", events=passes))

    monkeypatch.setattr("quadsim.campaign.run.pool.fly_attempt", finish)


@pytest.mark.compiled
def test_tune_started_again_with_more_trials_goes_on(tmp_path, capsys, monkeypatch, all_finish):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("quadsim.campaign.tune.tune.FINALISTS", 1)
    monkeypatch.setattr("quadsim.campaign.tune.tune.REPEAT", 2)
    argv = ["tune", *FLIGHT, "--attempts", "1", "--search", "sigma", "--json"]
    assert race([*argv, "--trials", "2"]) == 0
    capsys.readouterr()
    assert race([*argv, "--trials", "3"]) == 0
    out, err = capsys.readouterr()
    found = json.loads(out)
    assert found["trials"] == 3
    assert err.startswith("3/3 trial 2: "), "the first two are kept"
    assert {(f["attempts"], f["lap_mean"]) for f in found["finals"]} == {(2, 4.0)}
    assert {f["course"] for f in found["finals"]} == {COURSE}
    assert found["pareto"]
    assert Spec.of(COURSE, preset="tuned.yaml").planner.sampling


@pytest.mark.compiled
def test_a_search_that_finished_nothing_writes_no_preset(
    tmp_path, capsys, monkeypatch, in_this_process
):
    monkeypatch.chdir(tmp_path)
    argv = ["tune", *FLIGHT, "--attempts", "1", "--search", "sigma", "--trials", "1"]
    assert race(argv) == 1
    assert "tuned.yaml" in capsys.readouterr().err.splitlines()[-1]
    assert not (tmp_path / "tuned.yaml").exists()


def test_where_the_preset_cannot_be_written_nothing_is_flown(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "file").write_text("")
    for out in (".", "", "file/tuned.yaml"):
        assert race(["tune", *FLIGHT, "--out", out]) == 2, out
        assert capsys.readouterr().err.count("\n") == 1, out
        assert [p.name for p in tmp_path.iterdir()] == ["file"], out


def test_a_search_whose_workers_die_ends_in_one_line(tmp_path, monkeypatch):
    asked = []

    def all_lost(runner, variants, attempts, quiet=False):
        asked.extend(variants)
        return [[] for _ in variants]

    monkeypatch.setattr(Runner, "__call__", all_lost)
    with pytest.raises(RunError, match="5 trials in a row were lost with their workers"):
        tune([variant("colored")], MARGINS, Goal(20, 2, 0.5), tmp_path / "t.sqlite", jobs=0)
    assert len(asked) == 5
