"""Claims about who leads, by how much, and over what."""

from dataclasses import replace

import numpy as np
import pytest
from web_cases import SPEED, Glider, choices, competitor, run_of

from quadsim.heat.result import placings
from quadsim.report.metrics import chatter
from quadsim.web.race.competitor import named
from quadsim.web.race.lap_timing import at_place_of_first, lap_timings
from quadsim.web.race.snapshot import Snapshot
from quadsim.web.race.standings import Way, gap, standings_at, time_at


@pytest.fixture(scope="module")
def two():
    return named([competitor("colored"), competitor("gaussian")])


def timings_at(entries, t):
    return lap_timings(Snapshot(t=t, end=99.0, competitors=tuple(entries)))


def names(standings):
    return [one.entry.name for one in standings.order]


def said(entries, t):
    return standings_at(entries, t).headline.words


def ended(entry, t, outcome):
    """The same flight, which ends at t."""
    return replace(entry.until(t), outcome=outcome)


def test_progress_grows_from_zero_to_the_length_of_the_race(two):
    for one in two:
        assert one.progress[0] == pytest.approx(0.0, abs=0.5)
        assert one.progress[-1] == pytest.approx(one.legs.length)
        assert (np.diff(one.progress) >= 0).all()


def test_the_gap_of_two_steady_flights_grows_with_the_way(two):
    """v t = s: behind by s (1/v2 - 1/v1)."""
    place = np.linspace(1.0, two[0].legs.length - 1.0, 50)
    first, second = (Way(one.t, one.progress) for one in two)
    found = gap(place, second, first)
    assert np.allclose(found, place * (1 / 36.0 - 1 / 40.0), atol=0.03)
    assert not np.allclose(found, 0.0, atol=0.03)


def test_a_place_not_reached_has_no_time():
    way = Way(t=np.array([0.0, 1.0, 2.0]), progress=np.array([0.0, 5.0, 5.0]))
    assert time_at(np.array([2.5, 5.0]), way).tolist() == [0.5, 1.0]
    assert np.isnan(time_at(np.array([5.1]), way)).all()


@pytest.mark.parametrize("t", [0.5, 1.0, 2.0, 4.0])
def test_the_faster_one_leads_by_the_gap_at_one_place_in_either_order(two, t):
    """v t = s: at the same place the slower one is later by s (1/v2 - 1/v1), s = v2 t."""
    for entries in (two, two[::-1]):
        standings = standings_at(entries, t)
        first, second = standings.order
        assert names(standings) == ["colored", "gaussian"]
        assert (first.gap, first.rank, second.rank) == (0.0, 1, 2)
        assert second.gap == second.interval
        assert second.gap == pytest.approx(t * (1 - SPEED["gaussian"] / SPEED["colored"]), abs=0.03)


def test_nobody_leads_by_less_than_nothing(two):
    """The faster one's last frame is earlier, so that it is behind and yet ahead in time."""
    fast, slow = two
    flown = [ended(slow, 0.09, None), ended(fast, 0.08, None)]
    _, second = standings_at(flown, 0.09).order
    assert second.gap < -0.005
    assert said(flown, 0.09) == "gaussian is level with colored"


def test_where_ghosts_are_drawn_does_not_change_who_leads(two):
    """Beside the first one, whoever it is, the others are drawn where it is."""
    for entries in (two, two[::-1]):
        timings = timings_at(entries, 1.0)
        drawn = at_place_of_first(timings)
        assert [one.standing for one in drawn] == [one.standing for one in timings]
        me, other = drawn
        assert me.i == timings[0].i
        assert other.i != timings[1].i
        assert other.entry.progress[other.i] == pytest.approx(me.entry.progress[me.i], abs=0.5)


def test_the_headline_names_the_leader_and_counts_the_others(two):
    assert said(two, 0.0) == "colored is level with gaussian"
    assert said(two, 1.0) == "colored leads gaussian by 0.10 s"
    three = named([*two, competitor("gaussian", seed=1)])
    assert said(three, 1.0).endswith("; 1 more behind")
    assert said([*three, ended(two[1], 0.5, "crashed")], 1.0).endswith("; 1 more behind, 1 out")
    assert said([*two, ended(two[1], 0.5, "crashed")], 1.0).endswith("; 1 out")
    assert "more" not in said(three, 0.0)
    both = said(two, 99.0)
    behind = sum(two[1].laps) - sum(two[0].laps)
    assert both == f"colored beats gaussian by {behind:.2f} s"


def test_runs_of_different_numbers_of_laps_are_compared_over_the_laps_of_both():
    """The winner over one lap is the one that was faster there, whenever the other one ends."""
    long, short = named([competitor("colored", laps=2), competitor("gaussian", laps=1)])
    end = short.last_t
    assert said([long, short], 0.5).startswith("colored leads gaussian by ")
    assert said([long, short], 0.5).endswith(" s over the first lap")
    for t in (0.5, 99.0):
        shares = [one.share for one in standings_at([short, long], t).order]
        assert 0.0 < shares[1] <= shares[0] <= 1.0  # the bars of the tower have the order, too
    by = short.laps[0] - long.laps[0]
    assert by > 0.0
    for t in (end, end + 0.1, 99.0):
        standings = standings_at([short, long], t)
        assert names(standings) == ["colored", "gaussian"]
        assert standings.order[1].gap == pytest.approx(by)
        assert said([short, long], t) == f"colored beats gaussian by {by:.2f} s over the first lap"


def test_a_shorter_race_that_is_over_is_not_beaten_by_a_slower_one_in_its_second_lap():
    slow, fast = named([competitor("gaussian", laps=2), competitor("colored", laps=1)])
    between = (fast.laps[0] + slow.laps[0]) / 2
    assert said([slow, fast], between).startswith("colored leads gaussian by ")
    assert said([slow, fast], 99.0).startswith("colored beats gaussian by ")


def test_penalties_count_in_the_order_of_finished_races(two):
    fast, slow = two
    punished = replace(fast, laps=(fast.laps[0] + 5.0, *fast.laps[1:]))
    assert names(standings_at([punished, slow], 99.0)) == ["gaussian", "colored"]


def test_the_tower_the_rules_of_a_race_and_its_result_agree():
    """Of four entrants two finish and two crash, one of them farther along."""
    gliders = [Glider(choices(name, laps=2)) for name in ("gaussian", "colored") * 2]
    runs = [run_of(glider) for glider in gliders]
    course = gliders[0].now.course
    entries = named([competitor(name, laps=2) for name in ("gaussian", "colored") * 2])
    for k, t in ((2, 1.0), (3, 1.0)):
        cut = int(np.searchsorted(runs[k].telemetry["t"], t, side="right"))
        telemetry = {name: column[:cut] for name, column in runs[k].telemetry.items()}
        events = tuple(event for event in runs[k].events if event.t <= t)
        runs[k] = replace(runs[k], telemetry=telemetry, outcome="crashed", events=events)
    entries = [*entries[:2], *(ended(entry, 1.0, "crashed") for entry in entries[2:])]
    of_names = [entry.name for entry in entries]
    results = placings(of_names, runs, course)
    assert names(standings_at(entries, 99.0)) == [placing.name for placing in results]


def test_who_is_out_is_behind_and_the_last_one_flies_alone(two):
    fast, slow = two
    crashed = ended(fast, 1.0, "crashed")
    assert names(standings_at([crashed, slow], 0.5)) == ["colored", "gaussian"]
    assert names(standings_at([crashed, slow], 1.5)) == ["gaussian", "colored"]
    assert said([crashed, slow], 1.5) == "gaussian flies alone"
    assert said([crashed, slow], 99.0) == "gaussian has finished alone"
    both = [ended(slow, 0.8, "crashed"), crashed]
    assert said(both, 99.0) == "colored came farthest; nobody finished"


def test_a_dead_heat_and_a_double_crash_have_no_winner(two):
    same = named([two[0], two[0]])
    assert said(same, 99.0) == "colored finishes level with colored 2"
    late = replace(two[0], laps=(two[0].laps[0] + 0.002, *two[0].laps[1:]))
    assert said(named([two[0], late]), 99.0) == "colored beats colored 2 by 0.002 s"
    crashed = [ended(one, 1.0, "crashed") for one in same]
    assert said(crashed, 99.0) == "colored came as far as colored 2; nobody finished"


def test_flights_that_were_stopped_keep_their_order(two):
    stopped = [ended(one, 1.0, "interrupted") for one in two]
    assert said(stopped, 99.0) == said(two, 1.0)


def test_the_chatter_beside_a_name_is_the_one_of_race_show():
    run = run_of(Glider(choices("colored", laps=2)))
    (timing,) = timings_at([competitor("colored", laps=2)], 99.0)
    assert timing.chatter == pytest.approx(chatter(run)["commanded"]["thrust_tv"])
