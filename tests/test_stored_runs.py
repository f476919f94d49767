"""Claims about quadsim.runs: the stored runs of a folder as a list."""

import os
from datetime import datetime

import pytest
from run_cases import SPEC, same, save, two_laps

import quadsim
from quadsim.record.archive import load_run
from quadsim.results.stored_runs import LARGEST_RECORD
from web.stored_runs import titled_runs

PILOT = {"name": "ace", "sha256": "0" * 64}


@pytest.fixture
def root(tmp_path):
    """A folder with three runs, one of which a pilot flew."""
    save(tmp_path, two_laps())
    save(tmp_path, two_laps(SPEC | {"course": "other course", "seed": 4}, "timeout"))
    save(tmp_path, two_laps(SPEC | {"seed": 5, "pilot": PILOT}))
    return tmp_path


def seeds(runs):
    """Return the seeds of a list of runs."""
    return sorted(run.seed for run in runs)


def test_a_row_says_what_the_run_says(root):
    (row,) = quadsim.runs(root, seed=3)
    run = load_run(row.path)
    assert (row.name, row.course, row.vehicle) == (row.path.name, "test course", "probe")
    assert (row.sampler, row.preset, row.outcome) == ("colored", "race", "finished")
    assert list(row.laps) == run.laps
    assert row.laps_wanted == 2
    assert row.time == sum(run.laps)
    assert abs((datetime.now().astimezone() - row.when).total_seconds()) < 600
    assert same(row.load(), run)
    assert isinstance(row.load(), quadsim.Run)


def test_filters_are_patterns_and_all_must_fit(root):
    assert seeds(quadsim.runs(root)) == [3, 4, 5]
    assert seeds(quadsim.runs(root, course="test*")) == [3, 5]
    assert seeds(quadsim.runs(root, course="test*", seed=5)) == [5]
    assert seeds(quadsim.runs(root, outcome="timeout")) == [4]
    assert seeds(quadsim.runs(root, vehicle="pro?e", sampler="colored", preset="race")) == [3, 4, 5]
    assert seeds(quadsim.runs(root, pilot="*")) == [5]
    assert seeds(quadsim.runs(root, sampler="gaussian")) == []


def test_only_run_json_is_read(root):
    for path in root.glob("*/telemetry.npz"):
        path.unlink()
    assert len(quadsim.runs(root)) == 3


@pytest.mark.parametrize("content", [b"", b"{", b"{}", b"\xff\xfe", b'{"outcome": "won"}'])
def test_a_damaged_run_is_named_and_the_others_are_listed(root, content):
    folder = quadsim.runs(root)[0].path
    (folder / "run.json").write_bytes(content)
    runs = quadsim.runs(root)
    assert len(runs) == 2
    assert list(runs.damaged) == [folder]
    assert str(folder) in str(runs)
    assert "1 damaged" in repr(runs)


def large(file):
    with file.open("wb") as written:
        written.truncate(LARGEST_RECORD + 1)


@pytest.mark.parametrize("make", [os.mkfifo, lambda file: file.symlink_to("/dev/zero"), large])
def test_what_is_no_file_of_a_run_is_neither_waited_for_nor_read(make, root):
    folder = quadsim.runs(root)[0].path
    (folder / "run.json").unlink()
    make(folder / "run.json")
    runs = quadsim.runs(root)
    assert len(runs) == 2
    assert "expected the record of a flight" in runs.damaged[folder]
    assert len(titled_runs(str(root), 10)) == 3


def test_the_table_has_a_line_for_each_run(root):
    text = str(quadsim.runs(root))
    assert len(text.splitlines()) == 1 + 3
    assert "pilot ace" in text
    assert "\x1b" not in text
    assert "\n" not in repr(quadsim.runs(root))
    assert str(quadsim.runs(root / "nothing")) == "no stored run matches"


def test_names_are_not_taken_for_markup_or_html(tmp_path):
    save(tmp_path, two_laps(SPEC | {"sampler": "[bold]<b>x"}))
    runs = quadsim.runs(tmp_path)
    assert "[bold]<b>x" in str(runs)
    assert "[bold]&lt;b&gt;x" in runs._repr_html_()


def test_it_is_a_sequence_and_a_table_of_pandas(root):
    pytest.importorskip("pandas")
    runs = quadsim.runs(root)
    assert len(runs[1:]) == 2
    assert runs[1:][0] is runs[1]
    frame = runs.to_pandas()
    assert frame["name"].tolist() == [run.name for run in runs]
    assert frame["time"].isna().sum() == 1
    assert quadsim.runs(root, sampler="none").to_pandas().columns.tolist() == list(frame.columns)
