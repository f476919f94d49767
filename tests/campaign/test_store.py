"""The store: one row for each attempt, telemetry before the row, two writers at once, one line for
every error."""

import sqlite3
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from threading import Barrier

import pytest

from quadsim.campaign import attempt
from quadsim.campaign.attempt import attempt_key, fly_attempt, result
from quadsim.campaign.store import Store
from quadsim.record.archive import RunFolder, list_runs, load_run
from quadsim.record.run import RunError
from tests.campaign_cases import specs


@pytest.fixture(scope="module")
def flown():
    """One attempt, flown once for all tests here."""
    (spec,) = specs(1)
    return spec, fly_attempt(spec)


def test_a_stored_attempt_is_read_back_with_its_telemetry(tmp_path, flown):
    spec, flight = flown
    with Store(tmp_path / "c.sqlite") as store:
        assert store.add(spec, "mine", flight)
        (kept,) = store.rows([attempt_key(spec.record())])
        assert store.spec(kept.key)["seed"] == spec.seed
        assert store.rows(["another"]) == []
    assert (kept.name, kept.outcome, kept.seed) == ("mine", "timeout", 0)
    run = load_run(tmp_path / kept.folder)
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
        for i in range(20):
            assert list(makers.map(make, [tmp_path / f"{i}.sqlite"] * 4)) == [[]] * 4
    with sqlite3.connect(tmp_path / "0.sqlite") as db:
        assert db.execute("PRAGMA journal_mode").fetchone() == ("wal",)


def test_an_attempt_may_be_kept_without_its_telemetry(tmp_path, flown):
    with Store(tmp_path / "c.sqlite") as store:
        assert store.add(flown[0], "mine", flown[1], telemetry=False)
        (kept,) = store.rows()
    assert (kept.folder, kept.result["digest"]) == ("", flown[1].run.digest())
    assert not (tmp_path / "c.flights").exists()


DAMAGED = {  # column -> values that no flight has written
    "result": ["", "null", "{", "[]", "{}", '{"laps": 3}', b"\xff\xfe", 7],
    "outcome": ["finishe", ""],
    "seed": ["one", 0.5],
}


@pytest.mark.parametrize(
    ("column", "value"), [(c, v) for c, values in DAMAGED.items() for v in values]
)
def test_a_damaged_row_is_named_and_flown_again(tmp_path, flown, capsys, column, value):
    path = tmp_path / "c.sqlite"
    with Store(path) as store:
        store.add(flown[0], "mine", flown[1])
        (kept,) = store.rows()
    with sqlite3.connect(path) as db:
        db.execute(f"UPDATE attempts SET {column} = ?", (value,))
    with Store(path) as store:
        assert store.rows() == store.rows([kept.key]) == []
        assert store.add(*flown[:1], "mine", flown[1])
        assert [r.result for r in store.rows()] == [kept.result]
    said = capsys.readouterr().err
    assert said.startswith(f"{path}: row 1, the attempt mine seed ")
    assert said.count("\n") == 1


@pytest.mark.parametrize("key", ["laps", "crash", "fault", "thrust_tv", "plan_ms", "digest"])
def test_a_row_that_lacks_a_number_is_damaged_one_of_an_older_version_is_not(
    tmp_path, flown, capsys, key
):
    with Store(tmp_path / "c.sqlite") as store:
        store.add(flown[0], "mine", flown[1])
        for missing, rows in (("cost", 1), (key, 0)):
            store._db.execute(f"UPDATE attempts SET result = json_remove(result, '$.{missing}')")
            assert len(store.rows()) == rows
    assert key in capsys.readouterr().err


def test_a_kill_between_row_and_folder_loses_nothing(tmp_path, flown):
    """The next campaign that is opened gives the folder its name; what has no row is removed."""
    with Store(tmp_path / "c.sqlite") as store, pytest.MonkeyPatch.context() as patch:
        patch.setattr(RunFolder, "finish", lambda folder: None)
        store.add(flown[0], "mine", flown[1])
        (tmp_path / "c.flights" / "20260101T000000Z_x.part").mkdir()
        (kept,) = store.rows()
    assert list_runs(tmp_path / "c.flights") == []
    with Store(tmp_path / "c.sqlite"):
        assert [p.name for p in (tmp_path / "c.flights").iterdir()] == [Path(kept.folder).name]
    assert load_run(tmp_path / kept.folder).digest() == flown[1].run.digest()


def test_an_attempt_is_the_same_run_wherever_it_flies(flown):
    spec, flight = flown
    assert fly_attempt(spec).run.digest() == flight.run.digest()
    assert fly_attempt(replace(spec, seed=1)).run.digest() != flight.run.digest()


def test_a_planner_that_raises_an_error_in_flight_is_a_crash_with_its_reason(monkeypatch):
    (spec,) = specs(1)

    def stall(spec, plant, controller, referee):
        yield from flights(spec, plant, controller, referee)
        raise FloatingPointError("no finite cost")

    flights = attempt.launch
    monkeypatch.setattr(attempt, "launch", stall)
    flight = fly_attempt(spec)
    assert (flight.run.outcome, flight.fault) == ("crashed", "no finite cost")
    assert result(flight)["crash"]["kind"] == "planner"


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b"not a database" * 100, "file is not a database"),
        (b"", None),
        (None, "version 4 or older, got 99"),
    ],
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
