"""The search: the preset file is the planner that flew, a kill loses no trial, no point of the
front is dominated."""

import errno
import json
import os

import pytest

pytest.importorskip("optuna", reason="extra 'tune'")

from quadsim.spec.preset_file import parse_planner

from controllers.presets import PRESETS
from quadsim.campaign.search import (
    STARTUP,
    Search,
    objective,
    parameters,
    pareto,
    preset_text,
    with_parameters,
)
from quadsim.campaign.summary_stats import variant_stats
from quadsim.cli.cli import race
from quadsim.record.run import RunError
from tests.campaign_cases import FLIGHT, row

ONE_GATE = """
opening: [1.6, 1.6]
start: {position: [0, 0, 1.5], yaw_deg: 0}
gates:
  - {position: [1.5, 0, 1.5], yaw_deg: 0}
"""
GROUPS = ("sigma", "gamma", "temperature", "cost", "margin", "horizon")


@pytest.mark.parametrize("preset", PRESETS)
@pytest.mark.parametrize("sampler", ["gaussian", "colored"])
def test_preset_file_is_the_planner_that_flew_and_its_own_parameters_change_nothing(
    preset, sampler
):
    base = PRESETS[preset][sampler]
    found = list(parameters(base, sampler, GROUPS))
    assert with_parameters(base, {p.name: p.base for p in found}) == base
    planner = with_parameters(
        base, {p.name: int(p.high) if p.step else (0.7 * p.low + 0.3 * p.high) for p in found}
    )
    assert planner != base
    assert (
        parse_planner(preset_text(planner, preset, "two\nlines"), "tuned.yaml", sampler, PRESETS)
        == planner
    )


def test_gaussian_noise_has_no_exponents_to_search():
    assert not list(parameters(PRESETS["race"]["gaussian"], "gaussian", ["gamma"]))


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
    wild = variant_stats(
        "wild", [row(s, "finished" if s else "crashed", laps=(5.0,)) for s in range(4)], 20.0
    )
    assert objective(safe, 1.0) < objective(wild, 1.0)
    assert objective(wild, 0.75) < objective(safe, 0.75), (
        "with a floor of three in four the fast one wins"
    )


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


@pytest.mark.parametrize("stopped", ["told", "asked", "failed"])
def test_a_search_that_was_stopped_proposes_what_it_would_have(tmp_path, stopped):
    found = list(parameters(PRESETS["race"]["colored"], "colored", ["sigma", "margin"]))

    def proposals(name, stop):
        search, proposed = Search(tmp_path / f"{name}.journal", "s", found), []
        for k in range(STARTUP + 4):
            (trial,) = search.ask(1)
            if k in stop and stopped == "asked":
                search = Search(tmp_path / f"{name}.journal", "s", found)
                (trial,) = search.ask(1)
            proposed.append(trial.params)
            if k == 3 and stopped == "failed":
                search.fail(trial)
            else:
                lap = 5.0 + trial.params["sigma_thrust"]
                search.tell(trial, variant_stats("a", [row(0, laps=(lap,))], 20.0), 1.0)
            if k in stop and stopped != "asked":
                search = Search(tmp_path / f"{name}.journal", "s", found)
        return proposed

    whole = proposals("whole", ())
    assert proposals("stopped", (0, 3, STARTUP + 1)) == whole
    assert len({str(params) for params in whole}) == len(whole), "no proposal twice"


def test_tune_stopped_and_started_again_ends_where_it_would_have(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "near.yaml").write_text(ONE_GATE)
    argv = [
        "tune",
        "near.yaml",
        "--samples",
        "128",
        "--horizon",
        "40",
        "--iterations",
        "1",
        "--timeout",
        "3",
    ]
    argv += ["--attempts", "1", "--search", "sigma", "--jobs", "1", "--json"]
    assert race([*argv, "--trials", "2"]) == 0
    capsys.readouterr()
    assert race([*argv, "--trials", "3"]) == 0
    out, err = capsys.readouterr()
    said = json.loads(out)
    assert said["trials"] == 3
    assert err.startswith("3/3 trial 2: "), "the first two are kept"
    assert {f["attempts"] for f in said["finals"]} == {4}
    assert race(["check", "tuned.yaml"]) == 0


def searched(path, trials=3):
    """A journal with so many trials, and how the search with it begins."""
    found = list(parameters(PRESETS["race"]["colored"], "colored", ["margin"]))
    search = Search(path, "s", found)
    for _ in range(trials):
        search.tell(search.ask(1)[0], variant_stats("a", [row(0)], 20.0), 1.0)
    return lambda: Search(path, "s", found)


@pytest.mark.parametrize("torn", [1, 30, -1])
def test_half_a_line_at_the_end_is_cut_and_said_and_the_search_goes_on(tmp_path, capsys, torn):
    path = tmp_path / "s.journal"
    again = searched(path)
    whole = path.read_bytes()
    path.write_bytes(whole + whole.splitlines()[-1][:torn])
    assert again().done == 3
    (said,) = capsys.readouterr().err.splitlines()
    assert said.startswith(f"{path}: the last line was not written to its end and is removed: ")
    assert again().done == 3
    assert capsys.readouterr().err == ""


@pytest.mark.parametrize(
    "text", [b"{", b"null", b"\x00\xff", b'{"op_code":4}', b'{"op_code":99}', b"{}"]
)
def test_damage_further_up_names_file_and_line_and_what_to_do(tmp_path, text):
    path = tmp_path / "s.journal"
    again = searched(path)
    lines = path.read_bytes().splitlines()
    lines[4] = text
    path.write_bytes(b"\n".join(lines) + b"\n")
    with pytest.raises(RunError) as error:
        again()
    assert str(error.value).startswith(f"{path}:5: damaged: ")
    assert str(error.value).endswith(
        "; cut the file before this line, or move it away to search anew"
    )
    assert "\n" not in str(error.value)
    path.write_bytes(b"\n".join(lines[:4]) + b"\n")
    assert again().done == 0


def test_a_full_disk_in_mid_search_is_one_line_and_costs_no_trial(tmp_path, monkeypatch):
    path = tmp_path / "s.journal"
    again = searched(path)
    whole, search = path.read_bytes(), again()

    def full(handle):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    with monkeypatch.context() as patch:
        patch.setattr("quadsim.campaign.journal.os.fsync", full)
        with pytest.raises(
            RunError, match=r"s\.journal: cannot keep the search here: No space left on device$"
        ):
            search.ask(1)
    assert path.read_bytes().startswith(whole)
    assert path.read_bytes().endswith(b"\n")
    assert again().done == 3


def test_a_search_that_finished_nothing_writes_no_preset(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    argv = ["tune", *FLIGHT, "--attempts", "1", "--search", "sigma", "--jobs", "1", "--trials", "1"]
    assert race(argv) == 1
    said = capsys.readouterr().err.splitlines()
    assert said[-1] == "race tune: no attempt finished on fresh seeds: tuned.yaml is not written"
    assert not (tmp_path / "tuned.yaml").exists()


@pytest.mark.parametrize("out", [".", "", "file/tuned.yaml"])
def test_where_the_preset_cannot_be_written_nothing_is_flown(tmp_path, capsys, monkeypatch, out):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "file").write_text("")
    assert race(["tune", *FLIGHT, "--out", out]) == 2
    assert capsys.readouterr().err.count("\n") == 1
    assert [p.name for p in tmp_path.iterdir()] == ["file"]
