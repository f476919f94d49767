"""The search: the preset file is the planner that flew, a kill loses no trial, no point of the front is dominated."""

import json

import pytest

pytest.importorskip("optuna", reason="extra 'tune'")

from controllers.presets import PRESETS
from quadsim.app.campaign.search import Search, objective, parameters, pareto, preset_text, with_parameters
from quadsim.app.campaign.summary_stats import variant_stats
from quadsim.app.cli import race
from quadsim.race.preset_file import parse_planner
from tests.campaign_cases import FLIGHT, row

GROUPS = ("sigma", "gamma", "temperature", "cost", "margin", "horizon")


@pytest.mark.parametrize("preset", PRESETS)
@pytest.mark.parametrize("sampler", ["gaussian", "colored"])
def test_preset_file_is_the_planner_that_flew_and_its_own_parameters_change_nothing(preset, sampler):
    base = PRESETS[preset][sampler]
    found = list(parameters(base, sampler, GROUPS))
    assert with_parameters(base, {p.name: p.base for p in found}) == base
    planner = with_parameters(base, {p.name: int(p.high) if p.step else (0.7 * p.low + 0.3 * p.high) for p in found})
    assert planner != base
    assert parse_planner(preset_text(planner, preset, "two\nlines"), "tuned.yaml", sampler, PRESETS) == planner


def test_gaussian_noise_has_no_exponents_to_search():
    assert not list(parameters(PRESETS["race"]["gaussian"], "gaussian", ["gamma"]))


def test_the_front_is_the_points_that_no_other_dominates():
    points = [(5.0, -1.0, 30.0), (4.0, -0.9, 40.0), (5.1, -1.0, 30.0), (6.0, -1.0, 20.0), (4.0, -0.9, 40.0)]
    assert pareto(points) == [0, 1, 3, 4], "equal points do not dominate each other"


def test_below_the_floor_attempts_that_do_not_finish_count():
    safe = variant_stats("safe", [row(s, laps=(6.0,)) for s in range(4)], 20.0)
    wild = variant_stats("wild", [row(s, "finished" if s else "crashed", laps=(5.0,)) for s in range(4)], 20.0)
    assert objective(safe, 1.0) < objective(wild, 1.0)
    assert objective(wild, 0.75) < objective(safe, 0.75), "with a floor of three in four the fast one wins"


def test_trials_that_a_kill_left_open_are_tried_again(tmp_path):
    planner = PRESETS["race"]["colored"]
    found = list(parameters(planner, "colored", ["margin"]))
    search = Search(tmp_path / "s.journal", "s", found)
    first, second = search.ask(2)
    own = {"margin": planner.cost.margin, "tighten": planner.mppi.tighten}
    assert first.params == own, "the first trial is the planner that the search begins with"
    search.tell(first, variant_stats("a", [row(0)], 20.0), 1.0)
    again = Search(tmp_path / "s.journal", "s", found)
    assert again.done == 1
    (retried,) = again.ask(1)
    assert retried.params == second.params


def test_tune_stopped_and_started_again_ends_where_it_would_have(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    argv = ["tune", *FLIGHT, "--attempts", "1", "--search", "sigma", "--jobs", "1", "--json"]
    assert race([*argv, "--trials", "2"]) == 0
    capsys.readouterr()
    assert race([*argv, "--trials", "3"]) == 0
    out, err = capsys.readouterr()
    said = json.loads(out)
    assert said["trials"] == 3
    assert err.startswith("3/3 trial 2: 0/1"), "the first two are kept"
    assert {f["attempts"] for f in said["finals"]} == {4}
    assert race(["check", "tuned.yaml"]) == 0
