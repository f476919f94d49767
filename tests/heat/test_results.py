"""Order, overtakes and events of a race, by runs that are made by hand."""

import os
import shutil
from types import SimpleNamespace

import numpy as np
import pytest

import quadsim
from quadsim.cli.cli import race
from quadsim.course import load_course
from quadsim.heat.archive import run_folders
from quadsim.heat.result import heat_events, placings
from quadsim.racing.events import Event
from quadsim.record.archive import find_run
from quadsim.record.run import RunError
from tests.run_cases import save, two_laps
from tests.small import SHORT

COURSE = load_course("figure8")


def run(*passes, outcome="finished", duration=None, position=(0.0, 0.0, 1.5), ended_with=None):
    """Return a run that passes gates at these times [s]."""
    events = [
        Event(t, "pass", 1 + k % 8, 1 + k // 8, (0.0, 0.0), 9.0, (0.0, 0.0, 1.0))
        for k, t in enumerate(passes)
    ]
    if ended_with:
        events.append(ended_with)
    end = duration or (passes[-1] if passes else 0.0)
    telemetry = {
        "passed": np.array([len(passes)]),
        "lap": np.array([1 + max(len(passes) - 1, 0) // 8]),
        **{axis: np.array([p]) for axis, p in zip(("px", "py", "pz"), position, strict=True)},
    }
    laps = [passes[-1]] if outcome == "finished" else []
    return SimpleNamespace(
        events=tuple(events), outcome=outcome, duration=end, telemetry=telemetry, laps=laps
    )


def kinds(*runs, starts=None):
    names = "abcdefgh"[: len(runs)]
    found = heat_events(names, runs, starts or [0.0] * len(runs))
    return [(event.kind, event.name, event.other, event.gate) for event in found]


def test_a_change_of_order_is_an_overtake_at_the_gate_where_it_shows():
    assert kinds(run(1.0, 2.0, 3.0), run(1.2, 1.9, 2.8)) == [("overtake", "b", "a", 2)]
    assert kinds(run(1.0, 2.0, 3.0), run(1.2, 2.2, 3.2)) == []


def test_an_order_of_less_than_50_ms_decides_nothing():
    assert kinds(run(1.0, 2.0, 3.0), run(1.2, 1.96, 3.2)) == []
    # it shows one gate later
    assert kinds(run(1.0, 2.0, 3.0), run(1.2, 1.96, 2.9)) == [("overtake", "b", "a", 3)]


def test_who_is_out_is_not_overtaken():
    out = run(1.0, 2.0, outcome="crashed", duration=2.1)
    found = kinds(out, run(1.2, 2.2, 3.2))
    assert found == [("out", "a", "", 2)]


def test_who_flies_on_is_overtaken_though_it_never_passes_the_gate():
    late = run(1.0, outcome="timeout", duration=9.0)
    assert ("overtake", "b", "a", 2) in kinds(late, run(1.2, 2.2))


def test_staggered_starts_shift_the_times_of_the_race():
    assert kinds(run(1.0, 2.0), run(1.2, 1.7), starts=[0.0, 0.5]) == []


def test_a_contact_of_two_is_one_event():
    def touched(t, other):
        return Event(t, "contact", 0, 1, (0.0, 0.0), 9.0, (0.0, 0.0, 1.0), vehicle=other)

    a = run(1.0, outcome="crashed", duration=1.5, ended_with=touched(1.5, 2))
    b = run(1.2, outcome="crashed", duration=1.5, ended_with=touched(1.5, 1))
    assert kinds(a, b) == [("contact", "a", "b", 0), ("out", "a", "b", 0), ("out", "b", "a", 0)]


def test_the_order_is_time_then_how_far_along_the_race():
    gate = np.array(COURSE.gates[2].position)
    ahead = gate - 1.0 * np.array(COURSE.gates[2].axes[0])
    behind = gate - 3.0 * np.array(COURSE.gates[2].axes[0])
    runs = {
        "far": run(1.0, 2.0, outcome="crashed", position=behind),
        "near": run(1.0, 2.1, outcome="crashed", position=ahead),
        "first": run(*range(1, 9)),
        "one": run(1.0, outcome="crashed"),
        "second": run(*np.arange(1, 9) * 1.01),
    }
    found = placings(list(runs), list(runs.values()), COURSE)
    assert [placing.name for placing in found] == ["first", "second", "near", "far", "one"]
    assert [placing.rank for placing in found] == [1, 2, 3, 4, 5]
    assert found[2].to_next_gate == pytest.approx(1.0)


@pytest.mark.compiled
def test_a_stored_race_is_shown_and_drawn_as_a_whole(stored, tmp_path, capsys):
    folder = tmp_path / stored.name
    shutil.copytree(stored, folder)
    for name in ("last", "heat", str(folder)):
        assert race(["show", name, "--runs-dir", str(tmp_path)]) == 0
        assert "2 entrants, rules elimination" in capsys.readouterr().out
    # a run of it is a run
    assert race(["show", str(folder / "1_fast")]) == 0
    assert "entrants" not in capsys.readouterr().out
    figure = tmp_path / "a.png"
    assert race(["plot", "last", "--runs-dir", str(tmp_path), "--out", str(figure)]) == 0
    assert figure.stat().st_size > 10_000
    # a flight that is later is the last one
    quadsim.fly("figure8", **SHORT).save(tmp_path)
    capsys.readouterr()
    assert race(["show", "last", "--runs-dir", str(tmp_path)]) == 0
    assert "entrants" not in capsys.readouterr().out


@pytest.mark.parametrize("flags", [["--entrants", "colored"], ["--laps", "1"], ["--rotation", "1"]])
def test_a_race_that_is_flown_again_takes_no_other_flags(flags, capsys):
    assert race(["heat", "--from", "last", *flags]) == 2
    line = capsys.readouterr().err
    assert line.startswith("race heat: --from: expected neither a course nor other flags")
    assert line.count("\n") == 1


@pytest.fixture
def after_a_race(tmp_path):
    """A folder with a run and, newer, a race of two; its files alone, without telemetry."""
    flown = save(tmp_path, two_laps())
    heat = tmp_path / "20991231T000000Z_figure8_heat_s0_00000000"
    for name in ("1_colored", "2_gaussian"):
        shutil.copytree(flown, heat / name)
    (heat / "heat.json").write_text("{}")
    newer = flown.stat().st_mtime + 10
    os.utime(heat / "heat.json", (newer, newer))
    return flown, heat


def test_last_is_the_race_for_every_command_and_never_an_older_flight(after_a_race, tmp_path):
    flown, heat = after_a_race
    assert run_folders("last", str(tmp_path)) == [heat / "1_colored", heat / "2_gaussian"]
    for wanted in ("last", "heat_s0", str(heat)):
        with pytest.raises(RunError, match="is a race of several vehicles: name one of its runs"):
            find_run(wanted, str(tmp_path))
    with pytest.raises(RunError, match=r"quadsim\.load_heat"):
        quadsim.load_run("last", str(tmp_path))
    assert find_run(str(heat / "1_colored"), str(tmp_path)) == heat / "1_colored"
    (heat / "heat.json").unlink()
    assert find_run("last", str(tmp_path)) == flown


def test_a_race_is_exported_whole(after_a_race, tmp_path, capsys):
    _, heat = after_a_race
    out = tmp_path / "race.csv"
    command = ["export", heat.name, "--csv", "--out", str(out), "--runs-dir", str(tmp_path)]
    assert race(command) == 0
    runs = {line.split(",")[0] for line in out.read_text().splitlines()[1:]}
    assert runs == {"1_colored", "2_gaussian"}
    assert race(["fly", "--from", "last", "--runs-dir", str(tmp_path)]) == 2
    assert "use race heat --from" in capsys.readouterr().err
