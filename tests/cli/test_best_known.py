"""A race's time beside the best known limit of its race: report, JSON, picture, comparison."""

import json
from dataclasses import replace

import numpy as np
import pytest
from campaign_cases import row
from run_cases import save

from quadsim.campaign.flights.stats import best_known_time, variant_stats
from quadsim.campaign.flights.tables import comparison_tables, notes
from quadsim.cli.cli import race
from quadsim.config.spec import Spec
from quadsim.course import parse_course
from quadsim.dynamics.quadrotor import STATE
from quadsim.figures.run_figure import draw
from quadsim.limit import limits
from quadsim.limit.limits import (
    LIMITS,
    Check,
    LimitProblem,
    Solution,
    StoredSolution,
    dump,
    limit_of,
)
from quadsim.racing.events import Event, Frame
from quadsim.record.run import RecordedRun
from quadsim.vehicle import load_vehicle

COURSE = """opening: [1.5, 1.5]
start: {position: [0, 0, 2], yaw_deg: 0}
gates:
  - {position: [4, 0, 2], yaw_deg: 0}
"""
BEST = 0.8  # [s]
# The summary of a check
FOUND = Check(0.0, 0.0, 0.0, (0.0, 0.0, 0.0), "finished", {"pass": 1}, broken=())


def spec(**settings):
    return Spec.of(parse_course(COURSE, "mine.yaml"), **settings).record()


def flown(time=1.0, outcome="finished", **settings):
    passes = Event(time, "pass", 1, 1, (0.0, 0.0), 8.0, (4.0, 0.0, 2.0))
    state = tuple((dict.fromkeys(STATE, 0.0) | {"qw": 1.0, "pz": 2.0, "a": 9.81}).values())
    frames = [
        Frame(
            t=0.1 * k,
            x=state,
            u=(0.0, 0.0, 0.0, 9.81),
            passed=0,
            lap=1,
            gate=1,
            ess=50.0,
            temperature=1.0,
            cost=2.0,
            plan_ms=5.0,
            elapsed=0.2 * k,
        )
        for k in range(10)
    ]
    last = replace(
        frames[-1], t=time, events=(passes,) if outcome == "finished" else (), outcome=outcome
    )
    return RecordedRun.from_frames(spec(**settings), [*frames[:-1], last])


def limit():
    """4 m in .8 s at a constant 5 m/s."""
    x = np.zeros((3, 17))
    x[:, 0] = (0.0, 2.0, 4.0)
    x[:, 2] = 2.0
    x[:, 3] = 5.0
    # upright
    x[:, 6] = 1.0
    nodes = Solution(
        model="rotors",
        t=np.array([0.0, 0.4, 0.8]),
        x=x,
        u=np.zeros((2, 4)),
        costate=np.zeros((2, 17)),
        target=np.zeros(2, int),
    )
    return StoredSolution("mine", "swift", 1, False, (BEST,), FOUND, nodes)


@pytest.fixture
def runs(tmp_path, monkeypatch):
    """A folder of runs where the limit of the race is known."""
    monkeypatch.chdir(tmp_path)
    folder = tmp_path / "runs" / LIMITS
    folder.mkdir(parents=True)
    known = LimitProblem.of(parse_course(COURSE, "mine.yaml"), load_vehicle("swift"), 1)
    (folder / known.file_name).write_bytes(dump(replace(limit(), key=known.key)))
    return tmp_path / "runs"


def shown(folder, capsys, *more):
    assert race(["show", str(folder), *more]) == 0
    return capsys.readouterr().out


def test_the_report_says_how_far_above_the_limit_a_race_was(runs, capsys):
    folder = save(runs, flown())
    text = shown(folder, capsys)
    assert "25.0 %" in text
    assert "0.800 s" in text
    assert json.loads(shown(folder, capsys, "--json"))["limit"] == {
        "time": BEST,
        "above": pytest.approx(0.25),
    }


def test_a_race_that_did_not_finish_is_not_above_it(runs, capsys):
    folder = save(runs, flown(outcome="crashed"))
    assert "above the best known limit" not in shown(folder, capsys)
    assert json.loads(shown(folder, capsys, "--json"))["limit"] == {"time": BEST, "above": None}


@pytest.mark.parametrize(
    "settings", [{"vehicle": "kingfisher"}, {"penalties": True}, {"thrust_to_weight": 3.0}]
)
def test_another_race_has_another_limit(runs, settings):
    assert limit_of(spec(), runs / LIMITS).time == BEST
    assert limit_of(spec(**settings), runs / LIMITS) is None


def test_a_damaged_limit_does_not_keep_a_run_from_being_shown(runs, capsys):
    (file,) = (runs / LIMITS).iterdir()
    file.write_bytes(b"no zip")
    assert "best known limit" not in shown(save(runs, flown()), capsys)


def test_the_limits_path_is_drawn_with_the_run(runs):
    legends = [axes.get_legend() for axes in draw(flown(), limit()).axes]
    labels = [text.get_text() for legend in legends if legend for text in legend.texts]
    assert any("best known limit" in label for label in labels)
    path = limit().path()
    assert np.allclose(path[:, 1], 5.0 * path[:, 0])
    assert np.allclose(path[:, 0], np.linspace(0.0, 0.8, 81))


def test_a_comparison_says_how_far_above_the_limit_the_median_race_was(runs):
    rows = [row(seed, laps=(time,)) for seed, time in enumerate((0.9, 1.0, 1.2))]
    stats = variant_stats("colored", rows, 20.0, best_known_time(spec(), "runs"))
    assert stats.above_limit == pytest.approx(0.25)
    table = next(comparison_tables([stats], []))
    assert table.rows[0][table.head.index("above the\nlimit [%]")] == "25.0"
    assert any("best known limit" in note for note in notes([stats], [], 20.0))


def test_without_a_known_limit_nothing_is_said(monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    stats = variant_stats("colored", [row(laps=(1.0,))], 20.0, best_known_time(spec(), "runs"))
    assert "above the\nlimit [%]" not in next(comparison_tables([stats], [])).head
    assert not any("limit (race limit)" in note for note in notes([stats], [], 20.0))


def test_the_solutions_of_the_project_are_looked_up_first(runs, monkeypatch):
    monkeypatch.setattr(limits, "SOLUTIONS", runs / LIMITS)
    assert limit_of(spec()).time == BEST
