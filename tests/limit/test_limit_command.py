"""`race limit`: what it says, keeps and does when it is stopped; the solutions that are kept."""

import json
import os
import re
import signal
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from quadsim.cli import limit as command
from quadsim.cli.cli import race
from quadsim.course import parse_course
from quadsim.record.archive import load_run
from quadsim.record.limits import LIMITS, LimitError, Race, dump, load
from quadsim.vehicle import load_vehicle, with_thrust_to_weight
from web.stored_runs import stored_competitor

COURSE = """opening: [1.5, 1.5]
start: {position: [0, 0, 2], yaw_deg: 0}
gates:
  - {position: [4, 0, 2], yaw_deg: 0}
"""
SWIFT = load_vehicle("swift")


def said(capsys, *argv):
    code = race(list(argv))
    return (code, *capsys.readouterr())


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    """A folder with a course whose limit has been searched, and what the command printed."""
    folder = tmp_path_factory.mktemp("limit")
    (folder / "mine.yaml").write_text(COURSE)
    words = [
        sys.executable,
        "-c",
        "from quadsim.cli.cli import main; main()",
        "limit",
        "mine.yaml",
        "--json",
    ]
    done = subprocess.run(
        [*words, "--nodes", "8"], cwd=folder, capture_output=True, text=True, check=True
    )
    return folder, json.loads(done.stdout)


def mine(text=COURSE, vehicle=SWIFT, laps=1):
    return Race.of(parse_course(text, "mine.yaml"), vehicle, laps)


def test_the_limit_is_told_with_its_starts_and_its_check(place):
    _, told = place
    assert told["course"] == "mine"
    assert told["time"] == pytest.approx(sum(told["lap_times"]))
    assert told["verified"]["broken"] == []
    assert told["verified"]["outcome"] == "finished"
    times = [s["time"] for s in told["starts"] if s["time"] and not s["broken"]]
    assert told["time"] == pytest.approx(min(times), abs=1e-4)


def test_the_limit_is_kept_and_found_again(place):
    folder, told = place
    kept = mine().best_known(folder / "runs" / LIMITS)
    assert kept.time == told["time"]
    assert len(kept.solution.t) == told["nodes"]
    assert kept.solution.x[-1, 0] == pytest.approx(4.0, abs=1e-3)


@pytest.mark.parametrize(
    "other",
    [
        mine(COURSE.replace("[4, 0, 2]", "[4.1, 0, 2]")),
        mine(COURSE.replace("opening: [1.5, 1.5]", "opening: [1.4, 1.5]")),
        mine(vehicle=with_thrust_to_weight(SWIFT, 3.0)),
        replace(mine(), model="rates"),
        mine(laps=2),
    ],
    ids=["gate", "opening", "thrust", "model", "laps"],
)
def test_a_limit_belongs_to_its_race_alone(place, other):
    assert other.best_known(place[0] / "runs" / LIMITS) is None


def test_names_and_remarks_make_no_other_race():
    assert mine("# a remark\nname: other\nsource: elsewhere\n" + COURSE).key == mine().key
    assert mine(vehicle=replace(SWIFT, name="twin", source="elsewhere")).key == mine().key


def test_a_damaged_solution_is_one_line(place, tmp_path):
    (kept,) = (place[0] / "runs" / LIMITS).iterdir()
    (tmp_path / kept.name).write_bytes(kept.read_bytes()[:-200])
    with pytest.raises(LimitError, match="expected the solution of a race"):
        load(tmp_path / kept.name)
    with np.load(kept) as data:
        arrays = dict(data)
    np.savez(tmp_path / "short.npz", **arrays | {"u": arrays["u"][:-1]})
    with pytest.raises(LimitError, match="its arrays are not of one length"):
        load(tmp_path / "short.npz")


def test_a_slower_solution_does_not_replace_a_faster_one(place, tmp_path, capsys):
    folder, told = place
    kept, faster = folder / "runs" / LIMITS, tmp_path / LIMITS
    limit = mine().best_known(kept)
    faster.mkdir()
    (faster / mine().file_name).write_bytes(dump(replace(limit, lap_times=[told["time"] - 0.1])))
    code, out, _ = said(
        capsys, "limit", str(folder / "mine.yaml"), "--nodes", "8", "--runs-dir", str(tmp_path)
    )
    assert code == 0
    assert f"best known limit {told['time'] - 0.1:.3f} s" in out
    assert "found before, and not slower than what was found now" in out
    assert mine().best_known(faster).time == pytest.approx(told["time"] - 0.1)


WRONG = {
    "limit zigzag": "expected a course for a quadrotor, got 'zigzag' for the system offroad",
    "limit alphapilot --laps 2": "expected 1 lap, as the course is open, got 2",
    "limit alphapilot --closed": "--closed: expected a course whose last gate leads to the first, alphapilot is open",
    "limit paper_flat --vehicle paper": "--model: paper has no rotors: take rates",
    "limit lsy_level2 --vehicle kingfisher --nodes 3": "--nodes: expected a whole number >= 8 and <= 200, got 3",
}


@pytest.mark.parametrize("line", WRONG)
def test_a_mistake_is_one_line(line, capsys, tmp_path):
    code, out, err = said(capsys, *line.split(), "--runs-dir", str(tmp_path))
    assert (code, out) == (2, "")
    assert WRONG[line] in err
    assert err.count("\n") == 1


def test_without_the_extra_one_line_says_what_to_install(capsys, monkeypatch):
    monkeypatch.setattr(command, "find_spec", lambda name: None)
    code, out, err = said(capsys, "limit", "paper_flat")
    assert (code, out) == (2, "")
    assert re.fullmatch(
        r"race limit: casadi is not installed: \S+ -m pip install '?casadi\S*\n", err
    )


@pytest.mark.parametrize("sent", [signal.SIGINT, signal.SIGTERM])
def test_a_search_that_is_stopped_says_so(tmp_path, sent):
    (tmp_path / "mine.yaml").write_text(COURSE)
    words = [
        sys.executable,
        "-c",
        "from quadsim.cli.cli import main; main()",
        "limit",
        "mine.yaml",
        "--nodes",
        "200",
    ]
    search = subprocess.Popen(
        words, cwd=tmp_path, stderr=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    try:
        assert "straight lines" in search.stderr.readline()
        os.kill(search.pid, sent)
        out, _ = search.communicate(timeout=60)
    finally:
        search.kill()
    assert search.returncode == 130
    assert "best known limit" in out


def test_what_is_known_is_kept_as_a_run_that_the_page_can_race(place, capsys):
    folder, told = place
    runs = folder / "runs"
    code, out, _ = said(
        capsys, "limit", str(folder / "mine.yaml"), "--known", "--runs-dir", str(runs), "--json"
    )
    assert code == 0
    run = load_run(json.loads(out)["run_dir"])
    assert run.outcome == "finished"
    assert run.duration == pytest.approx(told["time"], abs=1e-4)
    speed = np.gradient(run.telemetry["px"], run.telemetry["t"])
    assert np.abs(speed - run.telemetry["vx"])[1:-2].max() < 0.1
    assert run.telemetry["a"].max() <= SWIFT.thrust_max * 1.001
    entry = stored_competitor(Path(json.loads(out)["run_dir"]))
    assert entry.progress[-1] == pytest.approx(entry.legs.length, abs=0.01)


def test_nothing_known_is_no_run(capsys, tmp_path):
    (tmp_path / "mine.yaml").write_text(COURSE)
    code, out, _ = said(
        capsys,
        "limit",
        str(tmp_path / "mine.yaml"),
        "--known",
        "--runs-dir",
        str(tmp_path / "runs"),
    )
    assert code == 1
    assert "no solution is known" in out
    assert not (tmp_path / "runs").exists()
