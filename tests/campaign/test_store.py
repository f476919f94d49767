"""The store: one row for each attempt, telemetry before the row, two writers at once, one line for
every error."""

import sqlite3
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from threading import Barrier

import pytest

from quadsim.campaign.run import attempt
from quadsim.campaign.run.attempt import attempt_key, fly_attempt, result
from quadsim.campaign.run.store import FORMAT, Store
from quadsim.record.archive import RunFolder, list_runs, read_run
from quadsim.record.run import RunError
from tests.campaign_cases import specs


def change(path, statement, *values):
    """Change a campaign's file past the program."""
    with closing(sqlite3.connect(path)) as db, db:
        db.execute(statement, values)


def test_a_stored_attempt_is_read_back_with_its_telemetry(tmp_path, flown):
    spec, flight = flown
    with Store(tmp_path / "c.sqlite") as store:
        assert store.add(spec, "mine", flight)
        (kept,) = store.rows([attempt_key(spec.record())])
        assert store.spec(kept.key)["seed"] == spec.seed
        assert store.rows(["another"]) == []
    assert (kept.name, kept.outcome, kept.seed) == ("mine", "timeout", 0)
    run = read_run(tmp_path / kept.folder)
    assert run.digest() == flight.run.digest() == kept.result["digest"]


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
        for i in range(10):
            assert list(makers.map(make, [tmp_path / f"{i}.sqlite"] * 4)) == [[]] * 4
    with closing(sqlite3.connect(tmp_path / "0.sqlite")) as db:
        assert db.execute("PRAGMA journal_mode").fetchone() == ("wal",)


def test_an_attempt_may_be_kept_without_its_telemetry(tmp_path, flown):
    spec, flight = flown
    with Store(tmp_path / "c.sqlite") as store:
        assert store.add(spec, "mine", flight, telemetry=False)
        (kept,) = store.rows()
    assert (kept.folder, kept.result["digest"]) == ("", flight.run.digest())
    assert not (tmp_path / "c.flights").exists()


def test_stored_numbers_can_be_asked_for_in_sql(tmp_path, flown):
    spec, flight = flown
    with Store(tmp_path / "c.sqlite") as store:
        store.add(spec, "mine", flight, telemetry=False)
    query = """SELECT sampler, seed, result ->> '$.thrust_tv.commanded', spec ->> '$.laps'
        FROM attempts WHERE outcome = 'timeout'"""
    with closing(sqlite3.connect(tmp_path / "c.sqlite")) as db:
        found = db.execute(query).fetchall()
    commanded = result(flight)["thrust_tv"]["commanded"]
    assert found == [("gaussian", 0, pytest.approx(commanded), spec.laps)]


DAMAGED = {  # column -> values that no flight has written
    "result": ["", "null", "{", "[]", "{}", '{"laps": 3}', b"\xff\xfe", 7],
    "outcome": ["finishe", ""],
    "seed": ["one", 0.5],
}


def kept_attempt(path, flown):
    """Make a campaign with one attempt. Return its row."""
    spec, flight = flown
    with Store(path) as store:
        store.add(spec, "mine", flight, telemetry=False)
        (kept,) = store.rows()
    return kept


def test_a_damaged_row_is_named_and_flown_again(tmp_path, flown, capsys):
    cases = [(column, value) for column, values in DAMAGED.items() for value in values]
    for number, case in enumerate(cases):
        column, value = case
        path = tmp_path / f"{number}.sqlite"
        kept = kept_attempt(path, flown)
        change(path, f"UPDATE attempts SET {column} = ?", value)
        with Store(path) as store:
            assert store.rows() == store.rows([kept.key]) == [], case
            assert store.add(flown[0], "mine", flown[1], telemetry=False), case
            assert [row.result for row in store.rows()] == [kept.result], case
        (line,) = capsys.readouterr().err.splitlines()
        assert line.startswith(f"{path}: row 1, the attempt mine seed "), case


def test_a_row_that_lacks_a_number_is_damaged(tmp_path, flown, capsys):
    for key in sorted(attempt.Result.__annotations__):
        path = tmp_path / f"{key}.sqlite"
        kept_attempt(path, flown)
        change(path, "UPDATE attempts SET result = json_remove(result, ?)", f"$.{key}")
        with Store(path) as store:
            assert not store.rows(), key
        assert key in capsys.readouterr().err


def test_a_kill_between_row_and_folder_loses_nothing(tmp_path, flown):
    """The next campaign that is opened gives the folder its name; what has no row is removed."""
    spec, flight = flown
    with Store(tmp_path / "c.sqlite") as store, pytest.MonkeyPatch.context() as patch:
        patch.setattr(RunFolder, "finish", lambda folder: None)
        store.add(spec, "mine", flight)
        (tmp_path / "c.flights" / "20260101T000000Z_x.part").mkdir()
        (kept,) = store.rows()
    assert list_runs(tmp_path / "c.flights") == []
    with Store(tmp_path / "c.sqlite"):
        assert [p.name for p in (tmp_path / "c.flights").iterdir()] == [Path(kept.folder).name]
    assert read_run(tmp_path / kept.folder).digest() == flight.run.digest()


@pytest.mark.compiled
def test_an_attempt_is_the_same_run_wherever_it_flies():
    (spec,) = specs(1)
    digest = fly_attempt(spec).run.digest()
    assert fly_attempt(spec).run.digest() == digest
    assert fly_attempt(replace(spec, seed=1)).run.digest() != digest


@pytest.mark.compiled
def test_a_planner_that_raises_an_error_in_flight_is_a_crash_with_its_reason(monkeypatch):
    (spec,) = specs(1)

    def stall(parts):
        yield from flights(parts)
        raise FloatingPointError("no finite cost")

    flights = attempt.simulate
    monkeypatch.setattr(attempt, "simulate", stall)
    flight = fly_attempt(spec)
    assert flight.run.outcome == "crashed"
    assert flight.fault.startswith("FloatingPointError: no finite cost (test_store.py, line ")
    assert result(flight)["crash"]["kind"] == "planner"


def test_an_empty_file_is_an_empty_campaign(tmp_path):
    (tmp_path / "c.sqlite").write_bytes(b"")
    with Store(tmp_path / "c.sqlite") as store:
        assert store.rows() == []


def test_a_file_that_is_no_campaign_is_one_line(tmp_path):
    path = tmp_path / "c.sqlite"
    path.write_bytes(b"not a database" * 100)
    with pytest.raises(RunError, match="not a database") as error:
        Store(path)
    assert "\n" not in str(error.value)


def test_a_campaign_of_another_format_is_refused_in_one_line_and_left_alone(tmp_path):
    for version in (1, FORMAT - 1, FORMAT + 1):
        path = tmp_path / f"{version}.sqlite"
        change(path, f"PRAGMA user_version = {version}")
        before = path.read_bytes()
        with pytest.raises(RunError, match=f"format {FORMAT}, got {version}") as error:
            Store(path)
        assert "\n" not in str(error.value)
        assert path.read_bytes() == before
