"""Claims about what can be chosen on the page, and how its numbers are written."""

import os
from dataclasses import replace
from itertools import pairwise
from types import SimpleNamespace

import pytest
from web_cases import Gliders, choices, competitor, served, until
from wire import link, press_start

from quadsim.config.reference import followed_problem
from quadsim.controllers.presets import PRESETS
from quadsim.course import load_course
from quadsim.limit.limits import dump, limits_folder, load
from quadsim.vehicle import load_vehicle
from quadsim.web.page.parts.elements import rounded
from quadsim.web.race.live_flight import LiveFlight
from quadsim.web.race.notices import Notices
from quadsim.web.state.choices import PILOT, Choices, HeatChoices
from quadsim.web.state.menu import Menu
from quadsim.web.state.numbers import SLIDERS, Change
from quadsim.web.state.offered_presets import offered_presets
from tests.small import SMALL

QUICK = SMALL | {"samples": 512}  # more than the fewest that a deadline leaves


@pytest.mark.parametrize(
    ("course", "vehicle", "laps", "can_follow"),
    [
        ("split_s_swift", "swift", 3, True),
        ("split_s_swift", "swift", 1, False),
        ("lsy_level2", "crazyflie", 1, True),
        ("lsy_level2", "swift", 1, False),
    ],
)
def test_a_preset_that_follows_a_solution_is_offered_where_one_is_stored(
    tmp_path, monkeypatch, course, vehicle, laps, can_follow
):
    """START agrees: it flies what is offered, and refuses what is not."""
    monkeypatch.chdir(tmp_path)  # no solutions of this machine's own
    offered = offered_presets(PRESETS, {"race"}, load_course(course), vehicle, laps, "runs")
    assert ("race_informed" in offered) == can_follow
    assert {"paper", "race"} <= set(offered)
    chosen = Choices(course=course, vehicle=vehicle, preset="race_informed", laps=laps)
    if can_follow:
        assert chosen.spec().reference is not None
    else:
        with pytest.raises(ValueError, match="race limit"):
            chosen.spec()
        kept = offered_presets(
            PRESETS, {"race_informed"}, load_course(course), vehicle, laps, "runs"
        )
        assert "race_informed" in kept  # while it is the one that is chosen


@pytest.fixture
def hall(tmp_path, monkeypatch):
    """A course of lsy_level2's gates in a wider hall, whose solution does not come with quadsim."""
    monkeypatch.chdir(tmp_path)
    narrow, wide = "[[-2.5, 2.5], [-1.5, 1.5], [0, 2]]", "[[-3, 3], [-2, 2], [0, 3]]"
    text = load_course("lsy_level2").text
    assert text.count(narrow) == 1
    file = tmp_path / "hall.yaml"
    file.write_text(text.replace(narrow, wide))
    return str(file)


def solve(hall, runs_dir, sooner=0.0):
    """Store the narrow hall's solution as that of the wide one, as `race limit` would.

    sooner: by how much its lap time is less than it is, for a fastest one of several [s].
    """
    weights = PRESETS["race_informed"]["colored"].cost
    crazyflie = load_vehicle("crazyflie")
    narrow, wide = (
        followed_problem(load_course(name), crazyflie, 1, weights) for name in ("lsy_level2", hall)
    )
    (shipped,) = narrow.files()
    solution = load(shipped)
    times = tuple(time - sooner for time in solution.lap_times)
    folder = limits_folder(runs_dir)
    folder.mkdir(parents=True, exist_ok=True)
    stored = replace(solution, course=wide.course.name, lap_times=times, key=wide.key)
    (folder / wide.file_name).write_bytes(dump(stored))
    return stored.time


def test_a_solution_among_the_runs_is_offered_and_followed_and_none_of_another_folder(
    tmp_path, hall
):
    told = str(tmp_path / "told")
    solve(hall, "runs", sooner=0.005)  # the folder of runs where no other is named
    informed = Choices(hall, vehicle="crazyflie", preset="race_informed", runs_dir=told)

    def offered():
        return offered_presets(PRESETS, {"race"}, load_course(hall), "crazyflie", 1, told)

    assert "race_informed" not in offered()
    with pytest.raises(ValueError, match=f"race limit .* --runs-dir {told}$"):
        informed.spec()
    time = solve(hall, told)
    assert "race_informed" in offered()
    assert informed.spec().reference.time == time
    race = HeatChoices((informed, replace(informed, sampler="gaussian")))
    assert [entrant.spec.reference.time for entrant in race.spec().entrants] == [time, time]


@pytest.mark.socket
def test_a_page_offers_and_flies_the_solutions_of_its_own_folder_of_runs(tmp_path, hall):
    told = tmp_path / "told"
    limits_folder(told).mkdir(parents=True)
    os.utime(told, (0.0, 0.0))  # what is solved does not change the folder of runs itself
    solve(hall, "runs", sooner=0.005)
    vehicles = ("swift", "crazyflie")
    menu = Menu(("figure8", hall), vehicles, ("race", "race_informed"), ("colored",))
    flights = Gliders()
    with (
        served(told, flights, menu, Choices(hall, vehicle="crazyflie")) as page,
        link(page.port) as linked,
    ):

        def presets():
            return linked.form("competitors")[0]["preset"]["choices"]

        assert until(lambda: presets() == ["race"])
        assert linked.set("race", "course", "figure8") == ""
        time = solve(hall, told)
        assert linked.set("race", "course", hall) == ""
        assert until(lambda: "race_informed" in presets())
        assert linked.set("competitors", "preset", "race_informed") == ""
        assert linked.set("competitors", "vehicle", "crazyflie") == ""  # a preset brings its own
        press_start(page.port)
        assert until(lambda: flights.built)
    (flight,) = flights.built
    assert flight.flown.reference.time == time


def test_clock_and_deadline_reach_the_flight_and_every_entrant_of_a_race():
    spec = choices(clock="wall", deadline_ms="7.5", randomize="1").spec()
    assert spec.randomize == 1.0
    assert (spec.clock, spec.deadline_ms) == ("wall", 7.5)
    with pytest.raises(ValueError, match=r"deadline_ms.*soon"):
        choices(deadline_ms="soon").spec()
    plain = choices().spec()
    assert (plain.clock, plain.deadline_ms) == ("simulated", None)
    own = {"clock": "wall", "deadline_ms": "7.5"}
    heat = HeatChoices((choices("colored", **own), choices("gaussian", **own))).spec()
    for entrant in heat.entrants:
        assert (entrant.spec.clock, entrant.spec.deadline_ms) == ("wall", 7.5)


def test_a_learned_pilot_flies_beside_a_deadline_that_it_cannot_have():
    pilot = Choices(course="split_s_swift", sampler=f"{PILOT}split_s_swift", deadline_ms="5")
    assert pilot.spec().deadline_ms is None


@pytest.mark.compiled
def test_on_the_wall_clock_planning_takes_time_and_a_pause_does_not():
    flight = LiveFlight(choices(clock="wall", settings=QUICK))
    try:
        for _ in range(2):
            flight.advance()
        times = [flight.advance().t]
        with pytest.MonkeyPatch.context() as patch:
            # A visitor looks away for minutes, and each plan takes 50 ms.
            now = SimpleNamespace(t=0.0)
            patch.setattr("quadsim.racing.flight.perf_counter", lambda: now.t)
            inner = flight._planner.control

            def slow(estimate):
                now.t += 0.05
                return inner(estimate)

            patch.setattr(flight._planner, "control", slow)
            for _ in range(4):
                now.t += 100.0
                times.append(flight.advance().t)
        steps = [after - before for before, after in pairwise(times[1:])]
        assert steps == pytest.approx([0.05] * 3, abs=flight._plant.dt)
    finally:
        flight.end()
    assert flight.now.spec.clock == "wall"


@pytest.mark.compiled
def test_a_deadline_holds_also_after_a_number_was_changed_in_flight():
    """No plan can be made in a microsecond: the samples shrink to the least."""
    flight = LiveFlight(choices(deadline_ms="0.001", settings=QUICK))
    try:
        for _ in range(12):
            flight.advance()
        fewest = flight._planner.planner.samples
        assert fewest < 512
        flight.change(Change("temperature", 2.0))
        for _ in range(12):
            flight.advance()
        assert flight._planner.planner.config.temperature == 2.0
        assert flight._planner.planner.samples == fewest
    finally:
        flight.end()


def test_zero_has_no_sign():
    assert f"{rounded(-0.001, 2):+.2f}" == "+0.00"
    assert f"{rounded(-0.0, 2):.2f}" == "0.00"
    assert f"{rounded(-0.006, 2):+.2f}" == "-0.01"


def test_one_lap_is_no_laps():
    for laps, words in ((1, "1 lap in "), (2, "2 laps in ")):
        entry = competitor(laps=laps)
        notices = Notices()
        end = SimpleNamespace(t=entry.last_t, events=(), outcome="finished")
        notices.add_events(entry, end)
        (notice,) = notices.recent
        assert notice.text.startswith(words)


def test_every_slider_says_what_its_number_does():
    hints = [slider.hint for slider in SLIDERS.values()]
    assert len(set(hints)) == len(hints)
    assert all(len(hint) > 40 for hint in hints)
