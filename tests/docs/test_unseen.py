"""The courses of docs/results/unseen.py: valid, of many shapes, and the same for the same seed."""

from itertools import pairwise

import numpy as np

from docs.results.unseen import (
    GATES,
    HIGHEST,
    OPENING,
    THRUST_TO_WEIGHT,
    UnseenFlight,
    add_row,
    fastest_run,
    rows_of,
    unseen_races,
)

RACES = list(unseen_races(8, seed=1))


def test_the_same_seed_gives_the_same_courses_and_more_begin_with_them():
    assert [race.text for race in unseen_races(3, seed=1)] == [race.text for race in RACES[:3]]
    assert next(unseen_races(1, seed=2)).text != RACES[0].text


def test_numbers_are_within_their_ranges():
    for race in RACES:
        assert GATES[0] <= len(race.course.gates) <= GATES[1]
        assert THRUST_TO_WEIGHT[0] <= race.thrust_to_weight <= THRUST_TO_WEIGHT[1]
        for gate in race.course.gates:
            assert OPENING[0] <= gate.opening[0] <= OPENING[1]
            assert gate.opening[1] / 2.0 < gate.position[2] <= HIGHEST


def test_there_are_vertical_gates_stacked_gates_and_turns_back():
    gates = [gate for race in RACES for gate in race.course.gates]
    assert any(abs(gate.rotation[2, 0]) > 0.99 for gate in gates)
    pairs = [pair for race in RACES for pair in pairwise(race.course.gates)]
    stacked = [np.hypot(*np.subtract(a.position, b.position)[:2]) < 0.1 for a, b in pairs]
    back = [a.rotation[:, 0] @ b.rotation[:, 0] < -0.8 for a, b in pairs]
    assert any(stacked)
    assert any(back)
    assert any(s and b for s, b in zip(stacked, back, strict=True))
    assert any(s and not b for s, b in zip(stacked, back, strict=True))


def test_limits_begin_with_the_fastest_flight_that_has_finished(tmp_path):
    def flight(outcome, time, run):
        return UnseenFlight("a", 3, 1.0, 4.0, 1.5, "colored", outcome, time, 9.0, run)

    table = tmp_path / "flights.csv"
    assert rows_of(table) == []
    add_row(table, flight("crashed", 0.0, "first"))
    assert fastest_run(rows_of(table), "a") is None
    add_row(table, flight("finished", 2.5, "second"))
    add_row(table, flight("finished", 2.25, "third"))
    assert fastest_run(rows_of(table), "a") == "third"
    assert fastest_run(rows_of(table), "b") is None
