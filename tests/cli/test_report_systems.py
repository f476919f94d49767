"""What the report of a run says about systems without gates, and about parts of the user's own."""

import re
from dataclasses import replace

import numpy as np
import pytest
from test_report import printed, run

from quadsim.cli.model_differences import differing
from quadsim.cli.report import summary
from quadsim.figures.run_figure import title
from quadsim.race.events import Event, Frame
from quadsim.record.metrics import chatter
from quadsim.record.run import Run
from quadsim.spec.spec import Spec

PASSES = ((3.0, 1, 0.5, 5.0), (5.5, 2, -1.25, 6.0))  # t, leg, left of the centre line, speed
WALL = Event(6.0, "wall", 0, 1, (-3.71, 0.0), 4.2, (20.0, 20.0, 0.0))


def passed(t, leg, left, speed):
    return Event(t, "pass", leg, 1, (left, 0.0), speed, (1.0, 2.0, 0.0))


def drive(end=WALL, outcome="crashed"):
    """Two legs of the corridor; the steering alternates by .1 every .02 s, the throttle is
    constant."""
    events = (*(passed(*p) for p in PASSES), *([end] if end else ()))
    frames = [
        Frame(
            t,
            (6.0 + t, 0.0, 1.0, 0.0, 1.0, 0.0, 0.0, 0.0),
            (0.5, 0.1 * (k % 2)),
            0,
            1,
            1,
            50.0,
            1.0,
            2.0,
            5.0,
            t,
        )
        for k, t in enumerate((np.arange(301) * 0.02).tolist())
    ]
    frames[-1] = replace(frames[-1], events=events, outcome=outcome)
    return Run.from_frames(Spec.of("zigzag").record(), frames)


def test_a_drive_lists_its_legs_and_says_where_and_how_it_ended():
    text = printed(drive())
    assert "crashed  2 of 5 legs, 6.000 s" in text
    assert re.search(
        r"\n +1 +3\.000 +14\.0 +\+0\.50 +5\.0\n +2 +2\.500 +21\.5 +-1\.25 +6\.0\n", text
    )
    assert "touched a wall on leg 3, 3.71 m right of the centre line, at 4.2 m/s" in text
    assert "gate" not in text
    assert "lap" not in text
    assert "published" not in text


@pytest.mark.parametrize(
    ("end", "outcome", "said"),
    [
        (
            replace(WALL, kind="stuck", offset=(1.0, 0.0)),
            "stuck",
            "got stuck on leg 3, 1.00 m left",
        ),
        (replace(WALL, kind="timeout"), "timeout", "ran out of time on leg 3"),
        # by a referee of one's own
        (replace(WALL, kind="too slow"), "crashed", "too slow on leg 3"),
        (None, "interrupted", "interrupted on leg 3"),
        (None, "finished", "reached the goal"),
    ],
)
def test_every_end_of_a_drive_is_said_in_words(end, outcome, said):
    text = printed(drive(end, outcome))
    assert said in text
    assert "touched a wall" not in text


def test_the_variation_of_a_control_is_its_change_over_time_in_its_unit():
    found = chatter(drive())["commanded"]
    assert found["steer_cmd"] == {
        "unit": "1",
        "tv": pytest.approx(0.1 / 0.02),
        "slew_max": pytest.approx(0.1 / 0.02),
    }
    assert found["drive_cmd"] == {"unit": "1", "tv": 0.0, "slew_max": 0.0}
    assert re.search(r"steer_cmd +5\.00 +5\.0 +1/s", printed(drive()))


def test_the_nominal_model_is_held_against_the_driven_vehicle_field_by_field():
    spec = drive().spec
    assert differing(spec)["grip"] == {"model": [6.0], "vehicle": [5.5]}
    assert "brake" not in differing(spec), "which is the same in both"
    assert re.search(r"grip +6 +5\.5 +of the tyres", printed(drive()))
    same = replace(drive(), spec=spec | {"vehicle": spec["model"]})
    assert differing(same.spec) == {}
    assert "the planner's model has the vehicle's nominal parameters" in printed(same)


def move(states):
    frames = [
        Frame(0.015 * k, x, (1.0, 2.0), 0, 1, 1, 50.0, 1.0, 2.0, 5.0, 1.0)
        for k, x in enumerate(states)
    ]
    frames[-1] = replace(frames[-1], outcome="finished")
    return Run.from_frames(Spec.of("table2").record(), frames)


def test_the_cost_of_a_point_s_motion_is_summed_over_the_states_it_reached():
    """5 |p - g|^2 + .5 |v|^2 with the goal at (-4, -4); the first state was given, not reached."""
    flown = move([(-9.0, -9.0, 0.1, 0.1), (-7.0, -4.0, 2.0, 0.0), (-4.0, -4.5, 0.0, 4.0)])
    numbers = summary(flown, None)
    assert numbers["cost_terms"] == pytest.approx(
        {"distance": 5 * 9.0 + 5 * 0.25, "speed": 0.5 * 4.0 + 0.5 * 16.0}
    )
    assert numbers["accumulated_cost"] == pytest.approx(sum(numbers["cost_terms"].values()))
    assert numbers["end"] == pytest.approx({"distance": 0.5, "speed": 4.0})
    assert re.search(r"accumulated quadratic cost +56\.2", printed(flown))


def test_a_user_s_own_parts_are_named_in_one_line_and_in_the_title():
    part = {"class": "mine.drive.Straight", "parameters": {}}
    for role, head in (("sampler", "Straight sampling"), ("controller", "controller Straight")):
        flown = run()
        flown.spec.update(
            {"own": {role: part}} | ({"sampler": "Straight"} if role == "sampler" else {})
        )
        lines = [line.strip() for line in printed(flown).splitlines()]
        assert f"own parts  {role} Straight: run.json alone cannot fly it again" in lines
        assert lines[1].startswith(head)
        assert head in title(flown)
        assert summary(flown, None)["own_parts"] == {role: "Straight"}
    assert "own parts" not in printed(run())
