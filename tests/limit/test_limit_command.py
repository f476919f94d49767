"""`race limit`: what it finds, keeps and does when it is stopped; the solutions that are kept."""

import json
import os
import shlex
import signal
import tempfile
from contextlib import redirect_stdout
from dataclasses import replace
from io import StringIO
from pathlib import Path

import numpy as np
import pytest

from quadsim.campaign.flights.stats import best_known_time
from quadsim.cli import fly as fly_command
from quadsim.cli import limit as command
from quadsim.cli.cli import race
from quadsim.config.spec import Spec
from quadsim.course import parse_course
from quadsim.limit import keeper
from quadsim.limit.dynamics import dynamics
from quadsim.limit.limits import (
    LimitError,
    LimitProblem,
    dump,
    limit_of,
    limits_folder,
    load,
)
from quadsim.limit.replay import referee_of
from quadsim.limit.route import MARGIN
from quadsim.limit.search import Search, SolveAttempt, Solved
from quadsim.limit.verify import verify
from quadsim.record.archive import read_run
from quadsim.record.run import RunError
from quadsim.vehicle import load_vehicle, with_thrust_to_weight
from quadsim.vehicle.vehicle import VEHICLES
from quadsim.web.race.stored_competitor import stored_competitor
from tests.run_cases import save, two_laps
from tests.small import SMALL, flags

# The optimiser takes a second or more for each search.
optimised = pytest.mark.compiled

COURSE = """opening: [1.5, 1.5]
start: {position: [0, 0, 2], yaw_deg: 0}
gates:
  - {position: [4, 0, 2], yaw_deg: 0}
"""
SWIFT = load_vehicle("swift")


def run(capsys, *argv):
    code = race(list(argv))
    return (code, *capsys.readouterr())


def mine(text=COURSE, vehicle=SWIFT, laps=1):
    return LimitProblem.of(parse_course(text, "mine.yaml"), vehicle, laps)


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    """A folder with a course whose limit has been searched, and what the command printed."""
    folder = tmp_path_factory.mktemp("limit")
    (folder / "mine.yaml").write_text(COURSE)
    out = StringIO()
    with redirect_stdout(out):
        words = ["limit", f"{folder}/mine.yaml", "--runs-dir", f"{folder}/X", "--nodes", "8"]
        assert race([*words, "--json"]) == 0
    return folder, json.loads(out.getvalue())


@pytest.fixture
def found_again(place, monkeypatch):
    """The search begins and ends with the solution of `place`."""
    problem = mine()
    solution = problem.best_known(limits_folder(place[0] / "X")).solution
    verified = verify(solution, dynamics(SWIFT, problem.model), referee_of(problem))
    attempt = SolveAttempt("again", len(solution.t), verified.broken, Solved(solution, verified))
    monkeypatch.setattr(Search, "attempts", lambda *_: iter([attempt]))


@pytest.fixture
def one_start(monkeypatch):
    """The search begins from one speed along straight lines, not from three."""
    monkeypatch.setattr("quadsim.limit.search.line_speeds", lambda *_: (6.0,))


@optimised
def test_the_limit_is_told_with_its_starts_and_its_check(place):
    _, told = place
    assert told["course"] == "mine"
    assert told["time"] == pytest.approx(sum(told["lap_times"]))
    assert told["verified"]["broken"] == []
    assert told["verified"]["outcome"] == "finished"
    times = [s["time"] for s in told["starts"] if s["time"] and not s["broken"]]
    assert told["time"] == pytest.approx(min(times), abs=1e-4)


@optimised
def test_the_limit_is_kept_in_the_folder_of_runs_and_found_there_alone(place):
    folder, told = place
    kept = mine().best_known(limits_folder(folder / "X"))
    assert kept.time == told["time"]
    assert len(kept.solution.t) == told["nodes"]
    assert kept.solution.x[-1, 0] == pytest.approx(4.0, abs=1e-3)
    assert mine().best_known(limits_folder(folder / "runs")) is None


@optimised
def test_a_report_finds_the_limit_in_the_runs_folder_that_it_is_given(place, capsys, tmp_path):
    """The run may lie elsewhere; another folder of runs has no limit of this race."""
    folder, told = place
    course = parse_course(COURSE, "mine.yaml")
    spec = Spec.of(course).record()
    stored = save(tmp_path, two_laps(spec))
    for runs_dir, known in ((folder / "X", True), (folder / "other", False)):
        code, out, _ = run(capsys, "show", str(stored), "--runs-dir", str(runs_dir), "--json")
        assert code == 0
        limit = json.loads(out)["limit"]
        assert (limit is not None) == known
        if known:
            assert limit["time"] == told["time"]
    assert limit_of(spec, limits_folder(folder / "X")).time == told["time"]


@optimised
def test_a_comparison_finds_the_limit_in_the_runs_folder_that_it_is_given(place):
    folder, told = place
    record = Spec.of(parse_course(COURSE, "mine.yaml")).record()
    assert best_known_time(record, folder / "X") == told["time"]
    assert np.isnan(best_known_time(record, folder / "other"))


OTHER_RACES = {
    "gate": mine(COURSE.replace("[4, 0, 2]", "[4.1, 0, 2]")),
    "opening": mine(COURSE.replace("opening: [1.5, 1.5]", "opening: [1.4, 1.5]")),
    "thrust": mine(vehicle=with_thrust_to_weight(SWIFT, 3.0)),
    "model": replace(mine(), model="rates"),
    "laps": mine(laps=2),
}


@optimised
def test_a_limit_belongs_to_its_race_alone(place):
    for what, other in OTHER_RACES.items():
        assert other.best_known(limits_folder(place[0] / "X")) is None, what


def test_names_and_remarks_make_no_other_race():
    assert mine("# a remark\nname: other\nsource: elsewhere\n" + COURSE).key == mine().key
    assert mine(vehicle=replace(SWIFT, name="twin", source="elsewhere")).key == mine().key


@optimised
def test_a_damaged_solution_is_one_line_that_names_the_file(place, tmp_path):
    (kept,) = limits_folder(place[0] / "X").iterdir()
    cut = tmp_path / kept.name
    cut.write_bytes(kept.read_bytes()[:-200])
    with np.load(kept) as data:
        arrays = dict(data)
    short = tmp_path / "short.npz"
    np.savez(short, **arrays | {"u": arrays["u"][:-1]})
    for damaged in (cut, short):
        with pytest.raises(LimitError) as error:
            load(damaged)
        assert str(error.value).startswith(f"{damaged}: ")
        assert "\n" not in str(error.value)


@optimised
def test_a_slower_solution_does_not_replace_a_faster_one(place, found_again, tmp_path, capsys):
    folder, told = place
    stored = mine().best_known(limits_folder(folder / "X"))
    faster = told["time"] - 0.1
    limits_folder(tmp_path).mkdir()
    file = limits_folder(tmp_path) / mine().file_name
    nodes = replace(stored.solution, t=stored.solution.t * faster / told["time"])
    file.write_bytes(dump(replace(stored, lap_times=(faster,), solution=nodes)))
    words = ("limit", str(folder / "mine.yaml"), "--nodes", "8", "--runs-dir", str(tmp_path))
    code, out, _ = run(capsys, *words)
    assert code == 0
    assert f"{faster:.3f} s" in out
    assert mine().best_known(limits_folder(tmp_path)).time == pytest.approx(faster)


# Command -> the setting that its error names
WRONG = {
    "limit alphapilot --laps 2": "alphapilot: ",
    "limit alphapilot --closed": "--closed: ",
    "limit paper_flat --vehicle paper": "--model: ",
    "limit lsy_level2 --vehicle kingfisher --nodes 3": "--nodes: ",
    "limit alphapilot --reserve 0.1": "--reserve: ",
}


def test_a_mistake_is_one_line_that_names_the_setting(capsys, tmp_path):
    for line, named in WRONG.items():
        code, out, err = run(capsys, *line.split(), "--runs-dir", str(tmp_path))
        assert (code, out) == (2, ""), line
        assert err.startswith(f"race limit: {named}")
        assert err.count("\n") == 1, line


def test_without_the_extra_one_line_says_what_to_install(capsys, monkeypatch):
    monkeypatch.setattr(command, "find_spec", lambda name: None)
    code, out, err = run(capsys, "limit", "paper_flat")
    assert (code, out) == (2, "")
    assert "pip install" in err
    assert "casadi" in err
    assert err.count("\n") == 1


@optimised
@pytest.mark.parametrize("sent", [signal.SIGINT, signal.SIGTERM])
def test_a_search_that_is_stopped_says_so_and_has_kept_nothing(place, tmp_path, capsys, sent):
    course = str(place[0] / "mine.yaml")
    progress = command._progress

    def interrupted(stopped, quiet):
        show = progress(stopped, quiet)

        def tell(name, nodes):
            os.kill(os.getpid(), sent)
            return show(name, nodes)

        return tell

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(command, "_progress", interrupted)
        code, out, _ = run(capsys, "limit", course, "--runs-dir", str(tmp_path))
    assert code == 130
    assert "no solution is known" in out
    assert list(tmp_path.iterdir()) == []


def never(*_):
    raise AssertionError("the search began")


@optimised
def test_a_folder_that_cannot_be_written_is_told_before_the_search(place, monkeypatch, capsys):
    monkeypatch.setattr(Search, "attempts", never)
    course = str(place[0] / "mine.yaml")
    code, out, err = run(capsys, "limit", course, "--runs-dir", "/proc/x")
    assert (code, out) == (2, "")
    assert err.startswith("race limit: /proc/x/limits: cannot write here")
    assert err.count("\n") == 1


@optimised
def test_a_damaged_solution_is_told_before_the_search(place, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(Search, "attempts", never)
    limits_folder(tmp_path).mkdir()
    file = limits_folder(tmp_path) / mine().file_name
    file.write_bytes(b"PK")
    course = str(place[0] / "mine.yaml")
    code, out, err = run(capsys, "limit", course, "--runs-dir", str(tmp_path))
    assert (code, out) == (2, "")
    assert err.startswith(f"race limit: {file}: ")
    assert err.count("\n") == 1


@optimised
def test_what_cannot_be_stored_after_the_search_is_kept_elsewhere(
    place, found_again, tmp_path, monkeypatch, capsys
):
    """The disk fills while the search runs."""
    write = keeper.write_whole

    def full(path, data):
        if str(path).startswith(str(tmp_path / "runs")):
            raise RunError(f"{path}: cannot write: No space left on device")
        write(path, data)

    (tmp_path / "other").mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "other"))
    monkeypatch.setattr(keeper, "write_whole", full)
    words = ("limit", str(place[0] / "mine.yaml"), "--nodes", "8")
    code, out, err = run(capsys, *words, "--runs-dir", str(tmp_path / "runs"))
    assert code == 2
    assert "best known limit" in out
    last = err.splitlines()[-1]
    (kept,) = (tmp_path / "other").glob("*/*.npz")
    assert str(kept) in last
    assert "No space left on device" in last
    assert mine().read(kept).time == pytest.approx(place[1]["time"], rel=0.01)


@optimised
def test_a_search_that_is_stopped_keeps_what_it_has_found(place, tmp_path, capsys):
    course = str(place[0] / "mine.yaml")
    progress = command._progress
    starts = []

    def interrupted(stopped, quiet):
        show = progress(stopped, quiet)

        def tell(name, nodes):
            starts.append(name)
            if len(starts) > 1 and limits_folder(tmp_path).exists():
                os.kill(os.getpid(), signal.SIGINT)
            return show(name, nodes)

        return tell

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(command, "_progress", interrupted)
        words = ("limit", course, "--nodes", "8", "--runs-dir", str(tmp_path))
        code, out, _ = run(capsys, *words)
    assert code == 130
    assert "best known limit" in out
    assert mine().best_known(limits_folder(tmp_path)).time < 1.1 * place[1]["time"]


@optimised
def test_the_margin_that_is_told_is_the_one_that_is_kept(place, one_start, tmp_path, capsys):
    flags = ("--nodes", "8", "--margin", "1", "--model", "rates", "--runs-dir", str(tmp_path))
    course = str(place[0] / "mine.yaml")
    assert run(capsys, "limit", course, *flags)[0] == 0
    _, out, _ = run(capsys, "limit", course, *flags, "--known")
    # half of what is left of 1.5 m beside the vehicle
    kept = (0.75 - SWIFT.radius - MARGIN) / 2
    assert f"{kept:.3g} m from the frames" in out
    assert "of 1 m" in out
    told = json.loads(run(capsys, "limit", course, *flags, "--known", "--json")[1])
    assert told["margin"] == 1.0
    assert told["margin_kept"] == pytest.approx(kept, abs=0.01)


@optimised
def test_the_advice_for_a_preset_that_follows_a_path_is_a_command_that_works(
    one_start, tmp_path, monkeypatch, capsys
):
    """Course and vehicle are named as they were given: by their files."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(fly_command, "simulate", lambda parts: iter(()))
    (tmp_path / "my course.yaml").write_text(COURSE)
    (tmp_path / "v.yaml").write_text((VEHICLES / "swift.yaml").read_text())
    flown = ("--vehicle", "v.yaml", "--thrust-to-weight", "3", "--runs-dir", "X")
    fly = ("fly", "my course.yaml", "--preset", "race_informed", *flown, *flags(SMALL))
    code, _, err = run(capsys, *fly)
    assert code == 2
    assert err.count("\n") == 1
    advice = shlex.split(err.partition("search for one with race ")[2])
    assert run(capsys, *advice, "--nodes", "8")[0] == 0
    # A flight without a frame counts as interrupted.
    assert run(capsys, *fly)[0] == 130


@optimised
def test_what_is_known_is_kept_as_a_run_that_the_page_can_race(place, capsys):
    folder, told = place
    words = ("limit", f"{folder}/mine.yaml", "--known", "--runs-dir", f"{folder}/X", "--json")
    code, out, _ = run(capsys, *words)
    assert code == 0
    flown = read_run(json.loads(out)["run_dir"])
    assert flown.outcome == "finished"
    assert flown.duration == pytest.approx(told["time"], abs=1e-4)
    assert [event.kind for event in flown.events] == ["pass"]
    speed = np.gradient(flown.telemetry["px"], flown.telemetry["t"])
    assert np.abs(speed - flown.telemetry["vx"])[1:-2].max() < 0.1
    assert flown.telemetry["a"].max() <= SWIFT.thrust_max * 1.001
    competitor = stored_competitor(Path(json.loads(out)["run_dir"]))
    assert competitor.progress[-1] == pytest.approx(competitor.legs.length, abs=0.01)


def test_without_a_known_limit_known_keeps_nothing(tmp_path, capsys):
    (tmp_path / "mine.yaml").write_text(COURSE)
    runs = tmp_path / "runs"
    code, _, _ = run(capsys, "limit", f"{tmp_path}/mine.yaml", "--known", "--runs-dir", str(runs))
    assert code == 1
    assert not runs.exists()


LOOP = """opening: [1.5, 1.5]
loop: true
start: {position: [0, 0, 2], yaw_deg: 0}
gates:
  - {position: [4, 0, 2], yaw_deg: 0}
  - {position: [4, 5, 2], yaw_deg: 180}
"""


@optimised
def test_a_closed_lap_is_found_again(one_start, tmp_path, capsys):
    (tmp_path / "loop.yaml").write_text(LOOP)
    words = ("limit", f"{tmp_path}/loop.yaml", "--closed", "--runs-dir", str(tmp_path))
    code, out, _ = run(capsys, *words, "--nodes", "8", "--json")
    assert code == 0
    told = json.loads(out)
    code, out, _ = run(capsys, *words, "--known", "--json")
    assert code == 0
    assert json.loads(out)["time"] == told["time"]
