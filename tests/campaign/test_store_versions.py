"""Campaign files of older versions are brought to today's where they lie, all or nothing."""

import shutil
import sqlite3
from concurrent.futures import ThreadPoolExecutor
from threading import Barrier

import pytest

from quadsim.campaign.attempt import fly_attempt
from quadsim.campaign.store import Store
from quadsim.record.run import RunError
from tests.campaign_cases import specs


@pytest.fixture(scope="module")
def flown():
    """One attempt, flown once for all tests here."""
    (spec,) = specs(1)
    return spec, fly_attempt(spec)


def as_version_1(path, spec, flight):
    """A campaign file as version 1 wrote it: other keys, another name of one column and of the
    index."""
    with Store(path) as store:
        store.add(spec, "mine", flight)
        (kept,) = store.rows()
    with sqlite3.connect(path) as db:
        db.execute("UPDATE attempts SET key = 'k', variant = 'v'")
        db.execute("DROP INDEX attempts_by_variant")
        db.execute("ALTER TABLE attempts RENAME COLUMN variant TO arm")
        db.execute("CREATE INDEX attempts_by_arm ON attempts (arm, seed)")
        db.execute("PRAGMA user_version = 1")
    return kept


@pytest.mark.parametrize("create", [True, False], ids=["to write", "to read"])
def test_a_file_of_version_1_is_brought_to_version_4_where_it_lies(tmp_path, flown, create):
    kept = as_version_1(tmp_path / "c.sqlite", *flown)
    with Store(tmp_path / "c.sqlite", create) as store:
        assert store.rows() == [kept]
        assert not store.add(flown[0], "again", flown[1]), "its attempts still count"
    with sqlite3.connect(tmp_path / "c.sqlite") as db:
        assert db.execute("PRAGMA user_version").fetchone() == (4,)
        indices = {
            name for (name,) in db.execute("SELECT name FROM sqlite_master WHERE type = 'index'")
        }
    assert "attempts_by_variant" in indices
    assert "attempts_by_arm" not in indices


@pytest.mark.parametrize("kept", [True, False], ids=["with telemetry", "without"])
def test_results_of_version_3_get_what_telemetry_tells(tmp_path, flown, kept):
    path, later = tmp_path / "c.sqlite", ("rates_tv", "turned_back")
    with Store(path) as store:
        store.add(flown[0], "mine", flown[1], telemetry=kept)
        (whole,) = store.rows()
    with sqlite3.connect(path) as db:
        for name in later:
            db.execute("UPDATE attempts SET result = json_remove(result, ?)", (f"$.{name}",))
        db.execute("PRAGMA user_version = 3")
    with Store(path) as store:
        (row,) = store.rows()
    assert row.result == (
        whole.result if kept else {k: v for k, v in whole.result.items() if k not in later}
    )


def test_many_may_bring_one_file_to_version_4_at_once(tmp_path, flown):
    path = tmp_path / "c.sqlite"
    kept = as_version_1(path, *flown)
    at_once = Barrier(4)

    def rows(_):
        at_once.wait()
        with Store(path) as store:
            return store.rows()

    with ThreadPoolExecutor(4) as readers:
        assert list(readers.map(rows, range(4))) == [[kept]] * 4


def test_an_upgrade_that_fails_leaves_the_file_as_it_was(tmp_path, flown):
    path = tmp_path / "c.sqlite"
    as_version_1(path, *flown)
    with sqlite3.connect(path) as db:
        db.execute("DROP INDEX attempts_by_arm")
    with pytest.raises(RunError, match="no such index"):
        Store(path)
    with sqlite3.connect(path) as db:
        assert db.execute("PRAGMA user_version").fetchone() == (1,)
        assert db.execute("SELECT arm FROM attempts").fetchall()


def test_a_row_of_version_2_whose_telemetry_is_gone_is_kept_as_it_is(tmp_path, flown):
    as_version_1(tmp_path / "c.sqlite", *flown)
    shutil.rmtree(tmp_path / "c.flights")
    with Store(tmp_path / "c.sqlite") as store:
        assert [r.key for r in store.rows()] == ["k"]
