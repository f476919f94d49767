"""Turning back to a gate is seen in positions alone, and what a course asks for is no turning
back."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from quadsim.course import load_course, parse_course
from quadsim.limit.limits import SOLUTIONS, load
from quadsim.record.run import COLUMNS, RecordedRun
from quadsim.report.turning_back import turned_back, turns
from tests.run_cases import two_laps

COURSE = """\
opening: [1.5, 1.5]
start: {position: [-10, 0, 2], yaw_deg: 0}
gates:
  - {position: [0, 0, 2], yaw_deg: 0}
  - {position: [10, 0, 2], yaw_deg: 0}
"""
RUNS = {  # the way in x and y, and whether it turns back
    "straight through": ([(-10, 0), (0, 0), (10, 0)], []),
    "wide through": ([(-10, 5), (-3, 2), (0, 0), (10, 0)], []),
    "past the gate and round it": (
        [(-10, 0), (-3, 2), (4, 2.5), (4, 4), (-4, 4), (-4, 0), (0, 0), (10, 0)],
        [1],
    ),
    "back before the gate": ([(-10, 0), (-1, 2), (-4, 2), (0, 0), (10, 0)], [1]),
    "back by less than an opening": ([(-10, 0), (-1, 2), (-2.2, 2), (0, 0), (10, 0)], []),
    "hovering before the gate": ([(-10, 0), (-1, 0), (-1, 0), (-1, 0), (0, 0), (10, 0)], []),
    "past both": (
        [
            (-10, 0),
            (4, 2),
            (4, 5),
            (-4, 5),
            (-4, 0),
            (0, 0),
            (8, 2),
            (13, 2),
            (13, 5),
            (7, 5),
            (10, 0),
        ],
        [1, 2],
    ),
    "past the gate far away": ([(-10, 0), (-3, 9), (4, 9), (-4, 9), (-4, 0), (0, 0), (10, 0)], []),
}


def way(points, gates=((0.0, 0.0), (10.0, 0.0))):
    """Positions every 5 cm, and the gates passed at each; a gate is passed at its centre."""
    steps = [max(int(np.hypot(*np.subtract(b, a)) / 0.05), 2) for a, b in pairwise(points)]
    parts = [np.linspace(a, b, n) for (a, b), n in zip(pairwise(points), steps, strict=True)]
    xy = np.vstack(parts)
    passed, count = [], 0
    for p in xy:
        passed.append(count)
        count += count < len(gates) and np.hypot(*(p - gates[count])) < 1e-9
    return 0.01 * np.arange(len(xy)), np.column_stack([xy, np.full(len(xy), 2.0)]), np.array(passed)


@pytest.mark.parametrize("name", RUNS)
def test_turning_back_is_flying_backward_by_an_opening_after_an_approach(name):
    points, expected = RUNS[name]
    assert [turn["gate"] for turn in turns(parse_course(COURSE, "test"), *way(points))] == expected


def test_a_loop_to_the_gate_beside_the_one_just_passed_is_none():
    """The second gate stands 2 m beside the first and faces alike: past it, round, and through."""
    course = parse_course(COURSE.replace("[10, 0, 2]", "[0, -2, 2]"), "test")
    loop = [(-10, 0), (0, 0), (3, 0), (3, 3), (-4, 3), (-4, -2), (0, -2), (2, -2)]
    assert turns(course, *way(loop, ((0.0, 0.0), (0.0, -2.0)))) == []
    missed = [*loop[:6], (2, -3.5), (2, -5), (-4, -5), (-4, -2), (0, -2), (2, -2)]
    assert [turn["gate"] for turn in turns(course, *way(missed, ((0.0, 0.0), (0.0, -2.0))))] == [2]


def test_no_time_optimal_race_turns_back():
    """Split-S, hairpins and gates stacked above each other included: the negative control on real
    courses."""
    for path in SOLUTIONS.glob("*.npz"):
        limit = load(path)
        fine, s = limit.path(), limit.solution
        ends = [s.t[1:][s.target == k][-1] for k in range(int(s.target[-1]) + 1)]
        passed = np.searchsorted(ends, fine[:, 0])
        assert turns(load_course(limit.course), fine[:, 0], fine[:, 1:], passed) == [], path.stem


def test_a_stored_run_of_any_age_is_asked_by_its_telemetry():
    run = two_laps()
    t, p, passed = way(RUNS["past the gate and round it"][0])
    columns = {name: np.zeros(len(t)) for name in COLUMNS} | {"t": t, "passed": passed}
    columns |= dict(zip(("px", "py", "pz"), p.T, strict=True))
    spec = run.spec | {"course": {"name": "u", "text": COURSE}}
    flown = replace(run, spec=spec, telemetry=columns)
    (turn,) = turned_back(flown)
    assert (turn["gate"], turn["lap"]) == (1, 1)
    damaged = spec | {"course": {"name": "u", "text": "damaged"}}
    assert turned_back(replace(flown, spec=damaged)) == []
    assert isinstance(flown, RecordedRun)
