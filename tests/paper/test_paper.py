"""`race paper`: runs are computed once and kept; numbers and files come out."""

import csv
import json
import math
import sqlite3
from concurrent.futures import Future
from dataclasses import replace
from functools import partial
from types import SimpleNamespace

import numpy as np
import pytest

from quadsim.campaign.run import runner
from quadsim.campaign.run.pool import Pool
from quadsim.cli.cli import race
from quadsim.cli.paper import EXPERIMENTS
from quadsim.config.spec import Spec
from quadsim.paper import double_integrator, exploration, noise, offroad, quadrotor, runs, table2
from quadsim.paper.offroad import Drive, DriveTask
from quadsim.paper.runs import as_bytes, from_bytes, kept_runs, run_key
from quadsim.paper.table1 import MotionAttempt, table1_row
from quadsim.paper.table2 import (
    GOAL,
    SIGMAS,
    TABLE2,
    MotionTask,
    Score,
    accumulated_cost,
    move,
    samplings,
    score,
)
from quadsim.record.run import RunError
from tests.campaign_cases import row
from tests.small import SHORT, SMALL

FEWER = replace(table2.CONFIG, **SMALL)
TASKS = [MotionTask(samplings(1.5)["gaussian"], seed, FEWER, steps=10) for seed in range(3)]


def numbered(task):
    """Return a score in place of computing a run."""
    return Score(cost=100.0 + task.seed, plan_ms=1.0)


class Counted:
    """A function of a task that counts its calls."""

    def __init__(self, function):
        self.function = function
        self.calls = []

    def __call__(self, task):
        self.calls.append(task)
        return self.function(task)


@pytest.fixture
def here(monkeypatch):
    """Runs in this process instead of workers."""
    monkeypatch.setattr(runs, "open_pool", lambda *_: Pool())
    monkeypatch.setattr(runner, "open_pool", lambda *_: Pool())


@pytest.fixture
def small(here, monkeypatch):
    """Experiments with a small planner and for a moment only.

    The quadrotor flies by the cost of the preset `race`, which other tests compile as well.
    """

    def few(course, preset, sampler):
        assert preset == "paper"
        return Spec.of(course, sampler=sampler, **SHORT)

    drive = replace(offroad.CONFIG, **SMALL)
    task = partial(MotionTask, config=FEWER, steps=100)
    for module in (noise, exploration):
        monkeypatch.setattr(module, "HORIZON", SMALL["horizon"])
    monkeypatch.setattr(offroad, "CONFIG", drive)
    monkeypatch.setattr(offroad, "COLD", replace(drive, temperature=0.02))
    monkeypatch.setattr(offroad, "TIMEOUT", 0.3)
    monkeypatch.setattr(quadrotor, "Spec", SimpleNamespace(of=few))
    monkeypatch.setattr(table2, "MotionTask", task)
    monkeypatch.setattr(double_integrator, "MotionTask", task)


def test_a_finished_run_is_never_made_twice_and_more_of_them_are_added(here, tmp_path):
    counted = Counted(numbered)
    first = kept_runs(TASKS[:2], counted, Score, tmp_path)
    assert kept_runs(TASKS[:2], counted, Score, tmp_path) == first
    assert kept_runs(TASKS, counted, Score, tmp_path)[:2] == first
    assert counted.calls == TASKS


def test_a_command_that_is_killed_keeps_every_run_that_has_ended(here, tmp_path):
    def killed(task):
        if task == TASKS[2]:
            raise KeyboardInterrupt
        return numbered(task)

    with pytest.raises(KeyboardInterrupt, match=r"2 runs are kept in .*runs.sqlite"):
        kept_runs(TASKS, killed, Score, tmp_path)
    counted = Counted(numbered)
    kept_runs(TASKS, counted, Score, tmp_path)
    assert counted.calls == TASKS[2:]


def test_a_row_that_is_half_written_when_the_power_fails_is_not_there(here, tmp_path):
    kept_runs(TASKS[:1], numbered, Score, tmp_path)
    database = sqlite3.connect(tmp_path / runs.FILE)
    database.execute("INSERT INTO runs VALUES (?, ?)", (run_key(TASKS[1]), b"half"))
    database.close()  # without a commit
    counted = Counted(numbered)
    kept_runs(TASKS[:2], counted, Score, tmp_path)
    assert counted.calls == TASKS[1:2]


def test_a_run_is_known_by_all_that_decides_it():
    drives = [DriveTask(offroad.GAUSSIAN, offroad.CONFIG, seed, 40.0) for seed in range(2)]
    drives.append(replace(drives[0], config=offroad.COLD))
    drives.append(replace(drives[0], sampling=offroad.COLORED))
    motions = [
        MotionTask(sampling, 0) for sigma in SIGMAS for sampling in samplings(sigma).values()
    ]
    assert len({run_key(task) for task in (*drives, *motions)}) == 4 + 36
    assert run_key(drives[0]) == run_key(replace(drives[0]))
    assert f"numpy {np.__version__}" in run_key(drives[0])


def test_a_result_comes_back_from_the_file_to_the_last_bit():
    t = np.array([0.0, 0.1])
    drive = Drive("stuck", math.pi, 2, 1 / 3, t, np.ones((2, 8)) / 3, np.zeros((2, 2)))
    back = from_bytes(as_bytes(drive), Drive)
    assert back[:4] == drive[:4]
    assert [type(x) for x in back] == [type(x) for x in drive]
    for one, other in zip(back[4:], drive[4:], strict=True):
        np.testing.assert_array_equal(one, other)


def test_a_worker_that_dies_is_one_line_and_other_runs_are_kept(monkeypatch, tmp_path):
    class Dying(Pool):
        lost = (OSError,)

        def submit(self, fly, job):
            if job == TASKS[1]:
                dead = Future()
                dead.set_exception(OSError())
                return dead
            return super().submit(fly, job)

    monkeypatch.setattr(runs, "open_pool", Dying)
    with pytest.raises(RunError, match="worker"):
        kept_runs(TASKS, numbered, Score, tmp_path)
    monkeypatch.setattr(runs, "open_pool", Pool)
    counted = Counted(numbered)
    kept_runs(TASKS, counted, Score, tmp_path)
    assert counted.calls == TASKS[1:]


def test_a_file_that_cannot_be_used_is_one_line_with_its_path(tmp_path):
    folder, text = tmp_path / "folder", tmp_path / "text"
    (folder / runs.FILE).mkdir(parents=True)
    text.mkdir()
    (text / runs.FILE).write_text("no database " * 100)
    for place in (folder, text):
        with pytest.raises(RunError) as error:
            kept_runs(TASKS, numbered, Score, place)
        assert str(error.value).startswith(f"{place / runs.FILE}: ")
        assert "\n" not in str(error.value)


@pytest.mark.compiled
def test_the_accumulated_cost_is_that_of_the_states_reached():
    motion = move(TASKS[0])
    px, py, vx, vy = motion.x[1:].T
    square = (px - GOAL.x) ** 2 + (py - GOAL.y) ** 2
    total = np.sum(5.0 * square + 0.5 * (vx**2 + vy**2))
    assert accumulated_cost(motion) == pytest.approx(total, rel=1e-12)
    assert score(TASKS[0]).cost == accumulated_cost(motion) != score(TASKS[1]).cost


def test_a_drive_ends_at_a_wall_and_the_same_seed_is_the_same_drive(monkeypatch):
    """With a driver that does not steer, in place of the planner."""
    straight = SimpleNamespace(control=lambda estimate: (np.array([1.0, 0.0]), None))
    monkeypatch.setattr(offroad, "planner", lambda *_: straight)
    task = DriveTask(offroad.GAUSSIAN, offroad.CONFIG, seed=0, timeout=40.0)
    drive = offroad.drive(task)
    again = offroad.drive(task)
    other = offroad.drive(replace(task, seed=1))
    assert (drive.outcome, drive.legs) == ("crashed", 1)
    assert drive.x[-1, 0] > 20.0
    assert drive.time == drive.t[-1]
    np.testing.assert_array_equal(again.x, drive.x)
    assert not np.array_equal(other.x[:100], drive.x[:100]), "another disturbance"


@pytest.mark.compiled
@pytest.mark.parametrize(
    ("name", "key", "files"),
    [
        ("double_integrator", "smooth_star", {"double_integrator"}),
        ("quadrotor", "variants", {"quadrotor", "quadrotor_laps"}),
        ("offroad", "variants", {"offroad", "offroad_paths", "offroad_controls"}),
    ],
)
def test_an_experiment_leaves_numbers_and_figures_and_is_not_computed_again(
    name, key, files, small, tmp_path, monkeypatch, capsys
):
    assert race(["paper", name, "--runs", "1", "--json", "--runs-dir", str(tmp_path)]) == 0
    assert key in json.loads(capsys.readouterr().out)
    made = (tmp_path / "paper").iterdir()
    assert files <= {path.stem for path in made if path.suffix in (".csv", ".png")}
    monkeypatch.setattr(runner, "open_pool", None)
    monkeypatch.setattr(runs, "open_pool", None)
    assert race(["paper", name, "--runs", "1", "--runs-dir", str(tmp_path)]) == 0
    assert f"{name}.csv" in capsys.readouterr().out


def test_table2_has_every_cell_of_the_paper_and_six_rows_more(tmp_path, monkeypatch, capsys):
    """With runs that a stand-in has made."""
    one = Score(cost=100.0, plan_ms=1.0)
    monkeypatch.setattr(table2, "kept_runs", lambda tasks, *_: [one] * len(tasks))
    assert race(["paper", "table2", "--runs", "2", "--json", "--runs-dir", str(tmp_path)]) == 0
    cells = json.loads(capsys.readouterr().out)["cells"]
    assert {(c["sampler"], c["sigma"]) for c in cells if c["paper_mean"]} == set(TABLE2)
    assert len(TABLE2) == 18
    assert len(cells) == 36
    with (tmp_path / "paper" / "table2.csv").open() as file:
        assert [r["mean"] for r in csv.DictReader(file)] == ["100.0"] * 36
    assert race(["paper", "table2", "--runs", "2", "--runs-dir", str(tmp_path)]) == 0
    assert "smooth_star_corrected" in capsys.readouterr().out


@pytest.mark.compiled
@pytest.mark.parametrize("name", ["noise", "exploration"])
def test_figures_come_as_png_and_svg_with_their_numbers(small, tmp_path, capsys, name):
    assert race(["paper", name, "--runs-dir", str(tmp_path)]) == 0
    out = capsys.readouterr().out
    made = {path.name for path in (tmp_path / "paper").iterdir()}
    assert made == {f"{name}.{kind}" for kind in ("png", "svg", "csv")}
    assert all(name in out for name in made)
    assert (tmp_path / "paper" / f"{name}.png").read_bytes().startswith(b"\x89PNG")


def test_an_interrupted_command_names_the_file_and_ends_with_130(
    small, tmp_path, monkeypatch, capsys
):
    scored = iter([numbered])

    def stopped(task):
        for function in scored:
            return function(task)
        raise KeyboardInterrupt

    monkeypatch.setattr(table2, "score", stopped)
    assert race(["paper", "table2", "--runs-dir", str(tmp_path)]) == 130
    assert str(tmp_path / "paper" / runs.FILE) in capsys.readouterr().err


@pytest.mark.parametrize(
    ("argv", "named"), [("paper tabel2", "'table2'"), ("paper table2 --runs 0", "--runs")]
)
def test_a_mistake_is_one_line_that_names_it(argv, named, capsys):
    assert race(argv.split()) == 2
    err = capsys.readouterr().err
    assert named in err
    assert err.count("\n") == 1


def test_all_makes_every_experiment(monkeypatch, tmp_path, capsys):
    made = []

    def module(name):
        def make(runs, folder):
            made.append((name, runs))
            return SimpleNamespace(numbers={}, shown=(), files=())

        return SimpleNamespace(make=make)

    monkeypatch.setattr("quadsim.cli.paper.import_module", module)
    assert race(["paper", "all", "--json", "--runs-dir", str(tmp_path)]) == 0
    assert list(json.loads(capsys.readouterr().out)) == list(EXPERIMENTS)
    assert made == [(f"quadsim.paper.{name}", e.runs) for name, e in EXPERIMENTS.items()]


@pytest.mark.compiled
def test_telemetry_of_a_lap_that_is_damaged_is_flown_again_and_the_same(small, tmp_path, capsys):
    quadrotor.make(1, tmp_path)
    spec = quadrotor.Spec.of("paper_flat", preset="paper", sampler="gaussian")
    variant = quadrotor.Variant("gaussian", spec)
    (kept,) = quadrotor.flown([variant], 1, tmp_path)["gaussian"]
    digest = quadrotor.load_flight(kept, spec, tmp_path).digest()
    (tmp_path / kept.folder / "telemetry.npz").write_bytes(b"half")
    capsys.readouterr()
    assert quadrotor.load_flight(kept, spec, tmp_path).digest() == digest
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith(f"{tmp_path / kept.folder / 'telemetry.npz'}: ")


def test_a_lap_that_is_lost_with_its_worker_is_one_line(here, tmp_path, monkeypatch):
    monkeypatch.setattr(runner, "fly_all", lambda pool, specs: [(spec, None) for spec in specs])
    variant = quadrotor.Variant("gaussian", Spec.of("paper_flat", preset="paper"))
    with pytest.raises(RunError, match="lost"):
        quadrotor.flown([variant], 1, tmp_path)


def test_times_are_those_of_the_attempts_that_finished():
    numbers = table1_row(
        "quadrotor",
        "colored",
        [
            MotionAttempt(8.0, 1.0),
            MotionAttempt(None, 2.0),
            MotionAttempt(9.0, 3.0),
            MotionAttempt(None, 5.0),
        ],
    )
    assert (numbers["finished"], numbers["attempts"]) == (2, 4)
    assert (numbers["mean"], numbers["min"], numbers["ms"]) == (8.5, 8.0, 2.5)
    assert numbers["sd"] == pytest.approx(0.5**0.5)
    assert 0 < numbers["success_low"] < 0.5 < numbers["success_high"] < 1
    assert numbers["paper_mean"] == 8.691
    assert (numbers["paper_valid"], numbers["paper_attempts"]) == (9, 21)
    none = table1_row("offroad", "gaussian", [MotionAttempt(None, 1.0)])
    assert (none["finished"], none["mean"], none["sd"], none["min"]) == (0, None, None, None)


def test_a_lap_counts_where_the_flight_finished():
    finished = row(0, "finished", (8.0,))
    assert quadrotor.attempt(finished).time == 8.0
    assert quadrotor.attempt(row(0, "crashed", (8.0,))).time is None
