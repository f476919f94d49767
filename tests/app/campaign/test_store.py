"""The store: one row an attempt, telemetry before the row, two writers at once, one line for what goes wrong."""

import sqlite3
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from threading import Barrier

import pytest

from quadsim.app.campaign.attempt import attempt_key, fly_attempt
from quadsim.app.campaign.store import Store
from quadsim.record.archive import list_runs, load_run
from quadsim.record.run import RunError
from tests.campaign_cases import specs


@pytest.fixture(scope="module")
def flown():
    """One attempt, flown once for all tests here."""
    (spec,) = specs(1)
    return spec, fly_attempt(spec)


def test_what_goes_in_comes_out_with_its_telemetry(tmp_path, flown):
    spec, flight = flown
    with Store(tmp_path / "c.sqlite") as store:
        assert store.add(spec, "mine", flight)
        (row,) = store.rows([attempt_key(spec)])
        assert store.spec(row.key)["seed"] == spec.seed
        assert store.rows(["another"]) == []
    assert (row.name, row.outcome, row.seed) == ("mine", "timeout", 0)
    run = load_run(tmp_path / row.folder)
    assert run.digest() == flight.run.digest() == row.result["digest"]


def test_the_same_attempt_of_the_same_commit_is_kept_once(tmp_path, flown):
    spec, flight = flown
    other = replace(flight, provenance=flight.provenance | {"git": "f" * 40})
    with Store(tmp_path / "c.sqlite") as store, Store(tmp_path / "c.sqlite") as second:
        assert store.add(spec, "mine", flight)
        assert not second.add(spec, "theirs", flight)
        assert second.add(spec, "later", other), "another commit's flight is another row"
        assert [r.name for r in store.rows()] == ["mine", "later"]
    assert len(list_runs(tmp_path / "c.flights")) == 2, "no telemetry without a row"


def test_many_may_make_the_same_campaign_at_once(tmp_path):
    at_once = Barrier(4)

    def make(path):
        at_once.wait()
        with Store(path) as store:
            return store.rows()

    with ThreadPoolExecutor(4) as makers:
        for i in range(20):
            assert list(makers.map(make, [tmp_path / f"{i}.sqlite"] * 4)) == [[]] * 4
    with sqlite3.connect(tmp_path / "0.sqlite") as db:
        assert db.execute("PRAGMA journal_mode").fetchone() == ("wal",)


def test_an_attempt_is_the_same_run_wherever_it_flies(flown):
    spec, flight = flown
    assert fly_attempt(spec).run.digest() == flight.run.digest()
    assert fly_attempt(replace(spec, seed=1)).run.digest() != flight.run.digest()


def test_a_planner_that_gives_up_in_mid_flight_is_a_crash_with_its_reason(monkeypatch):
    (spec,) = specs(1)

    def stall(spec, plant, controller, referee):
        yield from flights(spec, plant, controller, referee)
        raise FloatingPointError("no finite cost")

    from quadsim.app.campaign import attempt

    flights = attempt.launch
    monkeypatch.setattr(attempt, "launch", stall)
    flight = fly_attempt(spec)
    assert (flight.run.outcome, flight.fault) == ("crashed", "no finite cost")
    assert attempt.result(flight)["crash"]["kind"] == "planner"


@pytest.mark.parametrize(
    ("content", "said"), [(b"not a database" * 100, "file is not a database"), (b"", None), (None, "version 1, got 99")]
)
def test_a_file_that_is_no_campaign_is_one_line(tmp_path, content, said):
    path = tmp_path / "c.sqlite"
    if content is None:
        with sqlite3.connect(path) as db:
            db.execute("PRAGMA user_version = 99")
    else:
        path.write_bytes(content)
    if said is None:  # an empty file is an empty database
        with Store(path) as store:
            assert store.rows() == []
        return
    with pytest.raises(RunError, match=said) as error:
        Store(path)
    assert "\n" not in str(error.value)
