"""`race paper`: runs are flown once and kept, an interrupted command goes on, numbers and files come out."""

import csv
import json

import pytest
from campaign_cases import row

from quadsim.app.campaign import runner
from quadsim.app.campaign.attempt import attempt_key
from quadsim.app.campaign.pool import Pool
from quadsim.app.campaign.variants import Variant
from quadsim.app.cli import race
from quadsim.app.paper import table2
from quadsim.app.paper.command import EXPERIMENTS
from quadsim.app.paper.result import flown, load_runs, table1_row
from quadsim.app.paper.table2 import TABLE2
from quadsim.race.spec import Spec
from quadsim.record.metrics import accumulated_cost
from quadsim.record.run import RunError

SMALL = {"samples": 128, "horizon": 20, "timeout": 0.15}


@pytest.fixture
def here(monkeypatch):
    """Attempts in this process instead of workers."""
    monkeypatch.setattr(runner, "open_pool", lambda *_: Pool())


def small(sampler="gaussian"):
    return Variant(sampler, Spec.of("table2", sampler=sampler, **SMALL))


def test_a_finished_run_is_never_made_twice(here, tmp_path, capsys):
    (first,) = flown([small()], 2, tmp_path)
    assert "2/2 table2 gaussian seed 1: finished" in capsys.readouterr().err
    assert flown([small()], 2, tmp_path) == [first]
    assert capsys.readouterr().err == ""
    (more,) = flown([small()], 3, tmp_path)
    assert more[:2] == first
    assert "2 of 3 attempts are kept from before" in capsys.readouterr().err


def test_a_row_s_cost_is_that_of_its_telemetry(here, tmp_path):
    (rows,) = flown([small()], 2, tmp_path)
    costs = [accumulated_cost(run) for run in load_runs(rows, tmp_path)]
    assert costs == [r.result["cost"] for r in rows]
    assert costs[0] != costs[1]


def test_an_attempt_that_is_lost_with_its_worker_is_one_line(here, tmp_path, monkeypatch):
    monkeypatch.setattr(runner, "fly_all", lambda pool, specs: [(spec, None) for spec in specs])
    with pytest.raises(RunError, match="lost twice; the same command goes on"):
        flown([small()], 1, tmp_path)


def test_a_campaign_that_cannot_be_kept_is_one_line(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(RunError, match="cannot keep the campaign here"):
        flown([small()], 1, tmp_path / "file")


def test_no_two_cells_are_one_variant_and_no_two_seeds_one_attempt():
    cells = [table2.variant(name, sigma) for name in table2.CHOICES for sigma in table2.SIGMAS]
    assert len({cell.key for cell in cells}) == len({cell.name for cell in cells}) == 36
    assert len({attempt_key(spec) for spec in cells[0].attempts(3)}) == 3
    assert cells[0].key == table2.variant("gaussian", 0.5).key


def test_table2_has_every_cell_of_the_paper_and_six_rows_more(tmp_path, monkeypatch, capsys):
    """With runs that a stand-in has made."""
    one = row(result={"cost": 100.0, "plan_ms": {"p50": 1.0}})
    monkeypatch.setattr(table2, "flown", lambda variants, runs, folder: [[one] * runs for _ in variants])
    assert race(["paper", "table2", "--runs", "2", "--json", "--runs-dir", str(tmp_path)]) == 0
    cells = json.loads(capsys.readouterr().out)["cells"]
    assert {(c["sampler"], c["sigma"]) for c in cells if c["paper_mean"]} == set(TABLE2)
    assert len(TABLE2) == 18
    assert len(cells) == 36
    assert {"sampler", "sigma", "runs", "mean", "sd", "paper_mean", "paper_sd", "ms"} <= set(cells[0])
    with (tmp_path / "paper" / "table2.csv").open() as file:
        assert [r["mean"] for r in csv.DictReader(file)] == ["100.0"] * 36
    assert race(["paper", "table2", "--runs", "2", "--runs-dir", str(tmp_path)]) == 0
    assert "smooth_star_corrected" in capsys.readouterr().out


@pytest.mark.parametrize("name", ["noise", "exploration"])
def test_figures_come_as_png_and_svg_with_their_numbers(tmp_path, capsys, name):
    assert race(["paper", name, "--runs-dir", str(tmp_path)]) == 0
    out = capsys.readouterr().out
    made = {path.name for path in (tmp_path / "paper").iterdir()}
    assert made == {f"{name}.{kind}" for kind in ("png", "svg", "csv")}
    assert all(name in out for name in made)
    assert (tmp_path / "paper" / f"{name}.png").read_bytes().startswith(b"\x89PNG")


def test_an_interrupted_command_says_where_the_runs_are(here, tmp_path, monkeypatch, capsys):
    def stopped(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(runner, "fly_all", stopped)
    assert race(["paper", "table2", "--runs-dir", str(tmp_path)]) == 130
    err = capsys.readouterr().err
    assert str(tmp_path / "paper" / "campaign.sqlite") in err
    assert "the same command goes on there" in err


@pytest.mark.parametrize(
    ("argv", "said"),
    [
        ("paper tabel2", "no experiment 'tabel2': did you mean 'table2'?"),
        ("paper table2 --runs 0", "--runs: expected a whole number >= 1"),
    ],
)
def test_a_mistake_is_one_line(argv, said, capsys):
    assert race(argv.split()) == 2
    err = capsys.readouterr().err
    assert said in err
    assert err.count("\n") == 1


def test_all_stands_for_every_experiment():
    assert set(EXPERIMENTS) == {"noise", "exploration", "table2", "double_integrator", "quadrotor", "offroad"}


def test_times_are_those_of_the_attempts_that_finished():
    ends = [("finished", 8.0), ("crashed", 1.0), ("finished", 9.0), ("timeout", 40.0)]
    numbers = table1_row("quadrotor", "colored", [row(i, outcome, (t,)) for i, (outcome, t) in enumerate(ends)])
    assert (numbers["finished"], numbers["attempts"], numbers["mean"], numbers["min"]) == (2, 4, 8.5, 8.0)
    assert numbers["sd"] == pytest.approx(0.5**0.5)
    assert 0 < numbers["success_low"] < 0.5 < numbers["success_high"] < 1
    assert (numbers["paper_mean"], numbers["paper_valid"], numbers["paper_attempts"]) == (8.691, 9, 21)
    none = table1_row("offroad", "gaussian", [row(outcome="stuck")])
    assert (none["finished"], none["mean"], none["sd"], none["min"]) == (0, None, None, None)
