"""`race paper`: runs are made once and kept, an interrupted command goes on, numbers and files come out."""

import csv
import json
import os
import signal

import pytest

from quadsim.app.cli import race
from quadsim.app.paper import table2
from quadsim.app.paper.command import EXPERIMENTS
from quadsim.app.paper.gather import gather
from quadsim.app.paper.published import TABLE2
from quadsim.app.paper.store import Store, run_key
from quadsim.app.paper.variants import variant_stats
from quadsim.record.run import RunError


def square(job):
    """A run as a worker makes it: touches a file, so that a second time would be seen."""
    number, folder = job
    with (folder / f"made_{number}").open("x"):
        pass
    return {"square": number * number}


def die(job):
    """A run whose worker is killed, as where memory runs out."""
    os.kill(os.getpid(), signal.SIGKILL)


def jobs(folder, count):
    return {f"job {n}": (n, folder) for n in range(count)}


def test_a_finished_run_is_never_made_twice(tmp_path, capsys):
    made = gather(jobs(tmp_path, 2), square, tmp_path / "s.jsonl")
    assert gather(jobs(tmp_path, 3), square, tmp_path / "s.jsonl") == made | {"job 2": {"square": 4}}
    assert "s: 3 of 3" in capsys.readouterr().err
    with pytest.raises(FileExistsError):
        square((0, tmp_path))  # as a second making would


def test_what_a_kill_left_half_written_is_dropped_and_the_rest_kept(tmp_path):
    path = tmp_path / "s.jsonl"
    store = Store(path)
    store.add("a", {"x": 1.5})
    store.add("b", {"x": 2.5})
    whole = path.read_bytes()
    path.write_bytes(whole + b'{"key":"c","rec')
    assert Store(path).records == {"a": {"x": 1.5}, "b": {"x": 2.5}}
    assert path.read_bytes() == whole
    Store(path).add("c", {"x": 3.5})
    assert list(Store(path).records) == ["a", "b", "c"]


def test_a_worker_that_dies_is_one_line_and_no_wait(tmp_path):
    with pytest.raises(RunError, match="a worker process has died"):
        gather(jobs(tmp_path, 1), die, tmp_path / "s.jsonl")
    assert Store(tmp_path / "s.jsonl").records == {}


def test_a_store_that_cannot_be_is_one_line(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(RunError, match="cannot keep runs here"):
        Store(tmp_path / "file" / "s.jsonl")


def test_every_number_of_a_run_is_in_its_key():
    one, other = (table2.variant("colored_1", sigma) for sigma in (1.5, 3.0))
    keys = {one.key(0), one.key(1), other.key(0), table2.variant("colored_2", 1.5).key(0), run_key({})}
    assert len(keys) == 5
    assert one.key(0) == table2.variant("colored_1", 1.5).key(0)


def test_table2_has_every_cell_of_the_paper_and_six_rows_more(tmp_path, monkeypatch, capsys):
    """With runs that a stand-in has made."""
    monkeypatch.setattr(table2, "gather", lambda jobs, make, path: {k: {"cost": 100.0, "ms": 1.0} for k in jobs})
    assert race(["paper", "table2", "--runs", "2", "--json", "--runs-dir", str(tmp_path)]) == 0
    cells = json.loads(capsys.readouterr().out)["cells"]
    assert {(c["sampler"], c["sigma"]) for c in cells if c["paper_mean"]} == set(TABLE2)
    assert len(TABLE2) == 18
    assert len(cells) == 36
    assert {"sampler", "sigma", "runs", "mean", "sd", "paper_mean", "paper_sd", "ms"} <= set(cells[0])
    with (tmp_path / "paper" / "table2.csv").open() as file:
        assert [row["mean"] for row in csv.DictReader(file)] == ["100.0"] * 36
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


def test_interrupted_command_says_where_the_runs_are(tmp_path, monkeypatch, capsys):
    def stopped(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(table2, "gather", stopped)
    assert race(["paper", "table2", "--runs-dir", str(tmp_path)]) == 130
    assert "the same command goes on from there" in capsys.readouterr().err


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
    numbers = variant_stats("quadrotor", "colored", [{"outcome": o, "time": t, "ms": 1.0} for o, t in ends])
    assert (numbers["finished"], numbers["attempts"], numbers["mean"], numbers["min"]) == (2, 4, 8.5, 8.0)
    assert numbers["sd"] == pytest.approx(0.5**0.5)
    assert 0 < numbers["success_low"] < 0.5 < numbers["success_high"] < 1
    nobody = variant_stats("offroad", "gaussian", [{"outcome": "stuck", "time": 9.0, "ms": 1.0}])
    assert (nobody["finished"], nobody["mean"], nobody["sd"], nobody["min"]) == (0, None, None, None)
