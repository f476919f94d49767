"""Which state a controller is given: where its command will act, or as it is measured."""

import json

import numpy as np
import pytest

import quadsim
from quadsim.cli.cli import race
from quadsim.config.spec import Spec
from quadsim.controllers.plan import PlanStats
from quadsim.record.run import canonical
from quadsim.report.given_state import conditions, given_state

FLIGHT = {"laps": 1, "timeout": 1.0}
LATE = {"link_latency": 0.1}
PERIODS = 10  # control periods of this latency
PREDICTED_WITHIN = 0.01  # by the planner's model, over 100 ms [m]


class Step:
    """A control law that climbs by a step in height, and keeps the heights that it is given."""

    def __init__(self):
        self.heights = []

    def control(self, x):
        self.heights.append(x[2])
        return 0.0, 0.0, 0.0, 9.81 + 40.0 * (2.0 - x[2]) - 12.0 * x[5]


class Watching:
    """A controller that keeps its estimates."""

    rest = np.array([0.0, 0.0, 0.0, 9.81])

    def __init__(self):
        self.estimates = []

    def control(self, estimate):
        self.estimates.append(estimate)
        return np.array([0.0, 0.0, 0.0, 11.0]), PlanStats(0.0, 0.0, 0.0)


def errors(**settings):
    """Return how far the heights given are off the true height now and PERIODS later [m]."""
    law = Step()
    run = quadsim.fly("figure8", controller=law, **FLIGHT, **settings)
    given = np.array(law.heights)
    true = run.telemetry["pz"][: len(given)]
    now = abs(given - true).max()
    later = abs(given[:-PERIODS] - true[PERIODS:]).max()
    return now, later, run


def test_by_default_a_controller_is_given_the_state_in_which_its_command_acts():
    now, later, run = errors(**LATE)
    assert later < PREDICTED_WITHIN
    assert now > 10 * PREDICTED_WITHIN
    assert "state given 100 ms ahead of the measurement" in run.report()
    assert "State given 100 ms ahead of the measurement." in str(run)
    assert "given 100 ms ahead of the measurement" in run._repr_html_()


def test_without_a_prediction_a_controller_is_given_the_state_of_now():
    now, later, run = errors(**LATE, predict=False)
    assert now == 0.0
    assert later > 10 * PREDICTED_WITHIN
    assert "state given as measured, the command acts 100 ms later" in run.report()


def test_a_delay_harms_a_law_without_a_prediction_and_none_is_seen_with_one():
    """The overshoot beyond 2 m: the experiment that a study of delay makes."""
    top = {
        predict: quadsim.fly(
            "figure8", controller=Step(), link_latency=0.2, predict=predict, **FLIGHT
        )
        .telemetry["pz"]
        .max()
        for predict in (True, False)
    }
    assert top[True] < 2.01
    assert top[False] > 2.5


@pytest.mark.parametrize("settings", [{}, {"link_hz": 50.0}, LATE])
def test_the_measured_state_is_beside_the_predicted_one(settings):
    controller = Watching()
    run = quadsim.fly("figure8", controller=controller, **FLIGHT, **settings)
    measured = [estimate.measured[2] for estimate in controller.estimates]
    np.testing.assert_array_equal(measured, run.telemetry["pz"][: len(measured)])
    last = controller.estimates[-1]
    assert last.predicted
    assert (last.x[2] > last.measured[2]) == bool(settings)
    assert last.begins == last.acts


def test_sensors_without_a_prediction_give_their_estimate():
    controller = Watching()
    run = quadsim.fly(
        "figure8", controller=controller, sensing="mocap", predict=False, **LATE, **FLIGHT
    )
    given = [estimate.x[2] for estimate in controller.estimates]
    np.testing.assert_array_equal(given, run.telemetry["est_pz"][: len(given)])
    last = controller.estimates[-1]
    assert (last.x == last.measured).all()
    assert last.begins == last.t < last.acts


def test_in_a_race_of_several_each_has_the_state_that_it_asked_for():
    laws = {"now": Step(), "later": Step()}
    line_up = {name: {"controller": law, "predict": name == "later"} for name, law in laws.items()}
    heat = quadsim.race(line_up, "figure8", **LATE, **FLIGHT)
    for name, law in laws.items():
        true = heat[name].telemetry["pz"][: len(law.heights)]
        assert (law.heights == true.tolist()) == (name == "now")


def test_the_setting_is_flown_again():
    record = json.loads(canonical(quadsim.Spec.of("figure8", predict=False).record()))
    assert record["predict"] is False
    assert Spec.of_record(record).predict is False


def test_the_report_says_what_adds_to_the_latency():
    for settings, line in (
        ({}, ""),
        ({"predict": False}, "state given as measured, the command acts at once"),
        ({"vehicle": "swift_40ms"}, "state given 40 ms ahead of the measurement"),
        (
            {**LATE, "link_hz": 50.0, "clock": "wall"},
            "state given 100 ms plus the wait of up to 20 ms for a frame plus the planning time"
            " ahead of the measurement",
        ),
    ):
        assert given_state(quadsim.Spec.of("figure8", **settings).record()) == line


AHEAD = "state given 200 ms ahead of the measurement"
MEASURED = "state given as measured, the command acts 200 ms later"
LATE_LINK = {**FLIGHT, "timeout": 0.05, "link_latency": 0.2}


def test_a_race_says_how_late_commands_are_and_which_states_were_given(tmp_path, capsys):
    """Only the report of each entrant did."""
    given = {"ahead": {"controller": Step()}, "as is": {"controller": Step(), "predict": False}}
    heat = quadsim.race(given, "figure8", **LATE_LINK)
    lines = ["link late by 200 ms", f"ahead: {AHEAD}; as is: {MEASURED}"]
    assert str(heat).splitlines()[1:3] == lines
    heat.save(tmp_path)
    assert race(["show", "last", "--runs-dir", str(tmp_path)]) == 0
    shown = " ".join(capsys.readouterr().out.split())
    assert all(line in shown for line in lines)


def test_a_comparison_says_how_late_commands_are_and_which_states_were_given():
    given = {"ahead": {"controller": Step}, "as is": {"controller": Step, "predict": False}}
    found = quadsim.compare("figure8", given, attempts=1, **LATE_LINK)
    text = " ".join(str(found).split())
    assert f"link late by 200 ms ahead: {AHEAD}; as is: {MEASURED}" in text
    assert f"* ahead: {AHEAD}; as is: {MEASURED}" in found.document().markdown("x.png")
    settings = {"late": {"link_latency": 0.2}, "now": {}}
    line_up = {"one": {"controller": Step}, "two": {"controller": Step}}
    heats = quadsim.compare_heats(
        line_up, "figure8", settings, starts=1, **FLIGHT | {"timeout": 0.05}
    )
    assert heats.notes()[:2] == ["late: link late by 200 ms", f"late: {AHEAD}"]


def test_nothing_is_said_of_flights_in_which_nothing_is_late():
    record = quadsim.Spec.of("figure8").record()
    assert conditions({"a": record, "b": record}) == []
    behind = quadsim.Spec.of("figure8", link_hz=100).record()
    found = conditions({"a": record, "b": behind, "c": record})
    assert found[0] == "a, c: no link; b: link of 100 Hz"
    assert found[1].startswith("a, c: state given as measured; b: state given the wait of")
