"""`race paper`: runs are flown once and kept, an interrupted command goes on, numbers and files
come out."""

import csv
import json
from functools import partial
from importlib import import_module
from types import SimpleNamespace

import numpy as np
import pytest
from campaign_cases import row

from controllers.plan import PlanStats
from quadsim.campaign import runner
from quadsim.campaign.attempt import attempt_key, fly_attempt
from quadsim.campaign.attempt import result as attempt_result
from quadsim.campaign.pool import Pool
from quadsim.campaign.variants import Variant
from quadsim.cli.cli import race
from quadsim.paper import table2
from quadsim.paper.command import EXPERIMENTS
from quadsim.paper.result import flown, load_runs, table1_row
from quadsim.paper.table2 import TABLE2
from quadsim.record.archive import list_runs
from quadsim.record.metrics import accumulated_cost
from quadsim.record.run import RunError
from quadsim.spec.spec import Spec

SMALL = {"samples": 128, "horizon": 20, "timeout": 0.15}


@pytest.fixture
def here(monkeypatch):
    """Attempts in this process instead of workers."""
    monkeypatch.setattr(runner, "open_pool", lambda *_: Pool())


def small(sampler="gaussian"):
    return Variant(sampler, Spec.of("table2", sampler=sampler, **SMALL))


def test_a_finished_run_is_never_made_twice(here, tmp_path, capsys):
    first = flown([small()], 2, tmp_path)
    assert "2/2 table2 gaussian seed 1: finished" in capsys.readouterr().err
    assert flown([small()], 2, tmp_path) == first
    assert capsys.readouterr().err == ""
    assert flown([small()], 3, tmp_path)["gaussian"][:2] == first["gaussian"]
    assert "2 of 3 attempts are kept from before" in capsys.readouterr().err


def test_the_accumulated_cost_is_that_of_the_states_reached_and_kept_with_the_attempt(
    here, tmp_path
):
    attempts = flown([small()], 2, tmp_path)
    (rows,), (flights,) = attempts.values(), load_runs([small()], attempts, tmp_path).values()
    for kept, run in zip(rows, flights, strict=True):
        px, py, vx, vy = (run.telemetry[name][1:] for name in ("px", "py", "vx", "vy"))
        total = np.sum(5.0 * ((px + 4.0) ** 2 + (py + 4.0) ** 2) + 0.5 * (vx**2 + vy**2))
        assert kept.result["cost"] == accumulated_cost(run) == pytest.approx(total, rel=1e-12)
    assert rows[0].result["cost"] != rows[1].result["cost"]


def test_telemetry_that_is_not_kept_or_damaged_is_flown_again_and_the_same(here, tmp_path, capsys):
    kept = flown([small()], 1, tmp_path)
    (row,) = kept["gaussian"]
    (flight,) = load_runs([small()], kept, tmp_path)["gaussian"]
    bare = flown([small()], 1, tmp_path / "bare", telemetry=False)
    assert not list((tmp_path / "bare").glob("*.flights"))
    (tmp_path / row.folder / "telemetry.npz").write_bytes(b"half")
    capsys.readouterr()
    for attempts, folder in ((bare, tmp_path / "bare"), (kept, tmp_path)):
        (again,) = load_runs([small()], attempts, folder)["gaussian"]
        assert again.digest() == flight.digest()
    (said,) = capsys.readouterr().err.splitlines()
    assert said.startswith(f"{tmp_path / row.folder / 'telemetry.npz'}: damaged: ")
    assert said.endswith("; flown again")


@pytest.mark.parametrize(("flags", "folders"), [([], 0), (["--telemetry"], 12)])
def test_only_a_flag_keeps_the_telemetry_of_table2(here, tmp_path, monkeypatch, flags, folders):
    monkeypatch.setattr(table2, "Spec", SimpleNamespace(of=partial(Spec.of, **SMALL)))
    monkeypatch.setattr(table2, "SIGMAS", (0.5,))
    assert race(["paper", "table2", "--runs", "1", "--runs-dir", str(tmp_path), *flags]) == 0
    assert len(list_runs(tmp_path / "paper" / "campaign.flights")) == folders


class FullThrottle:
    """A driver that does not steer."""

    rest = np.zeros(2)

    def control(self, estimate):
        return np.array([1.0, 0.0]), PlanStats(0.0, 1.0, 1.0)


def test_a_drive_that_ends_at_a_wall_has_no_cost_and_says_where_it_ended():
    found = attempt_result(fly_attempt(Spec.of("zigzag", controller=FullThrottle())))
    assert found["cost"] is None
    assert found["crash"]["kind"] == "wall"
    assert found["crash"]["position"][0] > 20.0


@pytest.mark.parametrize(
    ("name", "key", "files"),
    [
        ("double_integrator", "smooth_star", {"double_integrator"}),
        ("quadrotor", "variants", {"quadrotor", "quadrotor_laps"}),
        ("offroad", "variants", {"offroad", "offroad_paths", "offroad_controls"}),
    ],
)
def test_an_experiment_flies_and_leaves_numbers_and_figures(
    name, key, files, here, tmp_path, monkeypatch, capsys
):
    """With a small planner and for a moment only."""
    module = import_module(f"quadsim.paper.{EXPERIMENTS[name][0]}")
    few = partial(Spec.of, samples=128, horizon=20, iterations=1, timeout=0.3)
    monkeypatch.setattr(module, "Spec", SimpleNamespace(of=few))
    assert race(["paper", name, "--runs", "1", "--json", "--runs-dir", str(tmp_path)]) == 0
    assert key in json.loads(capsys.readouterr().out)
    assert files <= {
        path.stem for path in (tmp_path / "paper").iterdir() if path.suffix in (".csv", ".png")
    }
    monkeypatch.setattr(runner, "fly_all", None)  # all is there
    assert race(["paper", name, "--runs", "1", "--runs-dir", str(tmp_path)]) == 0
    assert f"{name}.csv" in capsys.readouterr().out


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
    assert len({attempt_key(spec.record()) for spec in cells[0].attempts(3)}) == 3
    assert cells[0].key == table2.variant("gaussian", 0.5).key


def test_table2_has_every_cell_of_the_paper_and_six_rows_more(tmp_path, monkeypatch, capsys):
    """With runs that a stand-in has made."""
    one = row(result={"cost": 100.0, "plan_ms": {"p50": 1.0}})
    monkeypatch.setattr(
        table2, "flown", lambda variants, runs, *_: {v.name: [one] * runs for v in variants}
    )
    assert race(["paper", "table2", "--runs", "2", "--json", "--runs-dir", str(tmp_path)]) == 0
    cells = json.loads(capsys.readouterr().out)["cells"]
    assert {(c["sampler"], c["sigma"]) for c in cells if c["paper_mean"]} == set(TABLE2)
    assert len(TABLE2) == 18
    assert len(cells) == 36
    assert {"sampler", "sigma", "runs", "mean", "sd", "paper_mean", "paper_sd", "ms"} <= set(
        cells[0]
    )
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
    def stopped(pool, specs, flights=runner.fly_all):
        yield from flights(pool, specs[:flown_before])
        raise KeyboardInterrupt

    monkeypatch.setattr(runner, "fly_all", stopped)
    flown_before = 0
    assert race(["paper", "table2", "--runs-dir", str(tmp_path)]) == 130
    assert capsys.readouterr().err == "race paper: interrupted, nothing to keep\n"
    flown_before = 1
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
    assert set(EXPERIMENTS) == {
        "noise",
        "exploration",
        "table2",
        "double_integrator",
        "quadrotor",
        "offroad",
    }


def test_times_are_those_of_the_attempts_that_finished():
    ends = [("finished", 8.0), ("crashed", 1.0), ("finished", 9.0), ("timeout", 40.0)]
    numbers = table1_row(
        "quadrotor", "colored", [row(i, outcome, (t,)) for i, (outcome, t) in enumerate(ends)]
    )
    assert (numbers["finished"], numbers["attempts"], numbers["mean"], numbers["min"]) == (
        2,
        4,
        8.5,
        8.0,
    )
    assert numbers["sd"] == pytest.approx(0.5**0.5)
    assert 0 < numbers["success_low"] < 0.5 < numbers["success_high"] < 1
    assert (numbers["paper_mean"], numbers["paper_valid"], numbers["paper_attempts"]) == (
        8.691,
        9,
        21,
    )
    none = table1_row("offroad", "gaussian", [row(outcome="stuck")])
    assert (none["finished"], none["mean"], none["sd"], none["min"]) == (0, None, None, None)
