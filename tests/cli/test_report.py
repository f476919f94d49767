"""The report of a run: every lap, gate and incident is in it, in any width."""

import re
from dataclasses import replace
from io import StringIO

import numpy as np
import pytest
from rich.console import Console

from quadsim.cli.report import report, summary
from quadsim.config.spec import Spec
from quadsim.dynamics.quadrotor import STATE
from quadsim.figures.run_figure import title
from quadsim.racing.events import Event, Frame
from quadsim.record.run import RecordedRun
from quadsim.report.metrics import splits
from quadsim.report.model_differences import differing
from quadsim.report.tables import lap_tables

GATES, LAPS = 7, 3


def spec(**model):
    return Spec.of(
        "split_s_swift", **{f"model_{name}": value for name, value in model.items()}
    ).record()


def event(k, kind="pass"):
    """The k-th gate of the race, .8 s apart, the second lap .01 s a gate quicker."""
    lap, gate = divmod(k, GATES)
    t = 0.8 * (k + 1) - 0.01 * min(max(k + 1 - GATES, 0), GATES)
    return Event(t, kind, gate + 1, lap + 1, (0.31, -0.22), 12.5, (1.0, 2.0, 3.0))


def run(gates=GATES * LAPS, outcome="finished", more=(), **model):
    """Return a race that passes `gates` gates.

    It has a frame every .1 s. The vehicle flies at 10 m/s, and twice as fast in the second lap.
    """
    events = tuple(sorted([*(event(k) for k in range(gates)), *more], key=lambda e: e.t))
    times = [e.t for e in events if e.kind == "pass"]
    frames = []
    for t in (*np.arange(0.0, events[-1].t, 0.1).tolist(), events[-1].t):
        passed = sum(e <= t for e in times)
        lap = min(passed // GATES + 1, LAPS)
        x = dict.fromkeys(STATE, 0.0) | {"vx": 20.0 if lap == 2 else 10.0, "a": 9.81}
        u = (0.0, 0.0, 0.0, 9.81 + np.sin(20 * t))
        frame = Frame(
            t=t,
            x=tuple(x.values()),
            u=u,
            passed=passed,
            lap=lap,
            gate=1,
            ess=50.0,
            temperature=1.0,
            cost=2.0,
            plan_ms=5.0,
            elapsed=2 * t,
        )
        frames.append(frame)
    frames[-1] = replace(frames[-1], events=events, outcome=outcome)
    return RecordedRun.from_frames(spec(**model), frames)


def printed(flown, width=80):
    console = Console(file=StringIO(), width=width, highlight=False)
    for part in report(flown, None, width):
        console.print(part, soft_wrap=isinstance(part, str))
    return console.file.getvalue()


def test_gates_that_no_lap_has_reached_are_said_in_one_line():
    table, *rest = lap_tables(run(gates=1, outcome="timeout"), gates=200, width=80)
    assert [column.header.split()[0] for column in table.columns][-2:] == ["7", "8"]
    assert rest == ["gates 9 to 200 were not passed"]


@pytest.mark.parametrize("width", [50, 80, 160])
def test_every_split_is_printed_in_any_width(width):
    flown = run()
    text = printed(flown, width)
    for lap, sectors in enumerate(splits(flown)):
        rows = " ".join(line for line in text.splitlines() if re.match(rf"\s+{lap + 1}  ", line))
        assert all(f"{t:.3f}" in rows for t in (flown.laps[lap], *sectors))
    assert "…" not in text.partition("  chatter")[0]
    assert max(map(len, text.partition("  chatter")[0].splitlines()[2:])) <= width


def test_an_unfinished_lap_shows_its_gates_and_no_time():
    text = printed(run(gates=10, outcome="timeout"))
    assert "timeout  1 of 3 laps" in text
    second = next(line for line in text.splitlines() if re.match(r"\s+2  ", line))
    assert second.split()[:3] == ["2", "-", "20.0"]
    assert second.split()[3:] == ["0.790", "0.790", "0.790", "-", "-", "-", "-"]


def test_incidents_name_lap_gate_and_offset():
    hit = replace(event(9, "hit"), t=7.9)
    text = printed(run(gates=9, outcome="crashed", more=(hit,)))
    assert re.search(r"7\.900 +2 +3 +hit +\+0\.31 +-0\.22 +12\.5", text)
    assert "no hits, no misses" not in text
    assert "no hits, no misses" in printed(run())


def test_penalties_are_shown_with_their_lap():
    hit = replace(event(9, "hit"), t=7.9)
    assert re.search(r"\n +2 +8\.530 +3 +20\.0", printed(run(more=(hit,))))
    assert "penalty" not in printed(run())


def test_own_times_stand_between_the_published_ones():
    ladder = printed(run()).partition("published")[2]
    times = [float(t) for t in re.findall(r"^ +(\d+\.\d{3})  ", ladder, re.M)]
    assert times == sorted(times)
    assert {16.73, 5.53, 17.465} <= set(times)
    assert "this run, 3 laps" in ladder


def changed_in_flight(flown, n):
    changes = [{"t": 1.0 + k, "name": "sigma", "from": 1.0, "to": 1.5} for k in range(n)]
    return replace(flown, spec=flown.spec | {"interactive": changes})


def test_a_run_changed_in_flight_is_named_so_in_one_line_and_no_other_is():
    for n, said in (
        (1, "interactive, not comparable: 1 change in flight"),
        (3, ": 3 changes in flight"),
    ):
        flown = changed_in_flight(run(), n)
        assert sum(said in line for line in printed(flown).splitlines()) == 1
        assert said in title(flown)
        assert len(summary(flown, None)["interactive"]) == n
    assert "comparable" not in printed(run()) + title(run())
    assert summary(run(), None)["interactive"] == []


def test_only_numbers_of_the_model_that_differ_from_the_vehicle_are_listed():
    assert differing(run().spec) == {}
    assert differing(run(drag=0.1).spec) == {"drag": {"model": [0.1], "vehicle": [0.4]}}
    assert re.search(r"drag +0\.1 +0\.4 +1/s", printed(run(drag=0.1)))


def test_summary_has_what_programs_ask_for(tmp_path):
    whole = summary(run(), tmp_path)
    assert whole["laps"] == pytest.approx([5.6, 5.53, 5.6])
    assert (whole["course"], whole["vehicle"], whole["run_dir"]) == (
        "split_s_swift",
        "swift",
        str(tmp_path),
    )
    assert whole["gates"][8] == {
        "gate": 2,
        "lap": 2,
        "t": 0.8 * 9 - 0.02,
        "offset": (0.31, -0.22),
        "speed": 12.5,
    }
    assert (
        whole["chatter"]["commanded"]["thrust_tv"]
        > whole["chatter"]["delivered"]["thrust_tv"]
        == 0.0
    )
    assert summary(run(), None)["run_dir"] is None


def test_a_user_s_own_parts_are_named_in_the_report_and_in_the_title():
    part = {"class": "mine.drive.Straight", "parameters": {}}
    for role, head in (("sampler", "Straight sampling"), ("controller", "controller Straight")):
        flown = run()
        flown.spec["own"] = {role: part}
        if role == "sampler":
            flown.spec["sampler"] = "Straight"
        lines = [line.strip() for line in printed(flown).splitlines()]
        reason = f"repeatable  not from run.json alone: it needs your own {role} Straight"
        assert reason in lines
        assert lines[1].startswith(head)
        assert head in title(flown)
        assert summary(flown, None)["own_parts"] == {role: "Straight"}
    assert "own parts" not in printed(run())
