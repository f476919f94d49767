"""A run folder: nothing lost, nothing half, nothing that only looks finished."""

import csv
import errno
import json
import os
import re
import signal
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest

from quadsim.record.archive import RunFolder, list_runs, read_run, remove_unfinished
from quadsim.record.run import COLUMNS, RecordedRun, RunError
from quadsim.record.whole_files import write_whole
from tests.run_cases import SPEC, same, save, snapshot, two_laps


def full(_):
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


@pytest.mark.parametrize("seen", [None, snapshot(), snapshot(terms=())])
def test_round_trip_is_exact(tmp_path, seen):
    run = two_laps(snapshot=seen)
    assert same(read_run(save(tmp_path, run)), run)


def test_interrupted_run_without_a_frame_survives_the_round_trip(tmp_path):
    run = RecordedRun.from_frames(SPEC, [])
    assert same(read_run(save(tmp_path, run)), run)


def test_plant_that_blew_up_is_saved_with_its_nan(tmp_path):
    run = two_laps()
    run.telemetry["a"][-1] = np.nan
    path = save(tmp_path, run)
    assert same(read_run(path), run)


def test_run_json_says_what_flew_and_where(tmp_path):
    run = two_laps()
    record = json.loads((save(tmp_path, run) / "run.json").read_text())
    assert record["format"] == "quadsim run 3"
    assert record["spec"] == run.spec
    assert record["laps"] == run.laps
    assert record["units"] == COLUMNS
    assert record["digest"] == run.digest()
    assert record["versions"].keys() == {
        "python",
        "quadsim",
        "numpy",
        "scipy",
        "pybullet",
        "numba",
        "rotorpy",
        "crazyflow",
        "jax",
    }
    assert record["argv"] == sys.argv
    assert {
        "git",
        "cpu",
        "course_sha256",
        "plan_ms",
        "real_time_factor",
        "gates",
        "events",
    } <= record.keys()


def test_events_csv_has_a_row_an_event(tmp_path):
    rows = list(csv.DictReader((save(tmp_path, two_laps()) / "events.csv").open()))
    assert [r["kind"] for r in rows] == [e.kind for e in two_laps().events]
    assert float(rows[0]["t"]) == 0.095


def test_folder_is_named_after_time_course_sampler_seed_and_spec(tmp_path):
    name = r"\d{8}T\d{6}Z_test-course_colored_s3_[0-9a-f]{8}"
    path = save(tmp_path, two_laps())
    assert re.fullmatch(name, path.name)
    other = save(tmp_path, two_laps(SPEC | {"host": {"threads": 9}}))
    assert other.name[17:].startswith(path.name[17:])
    assert save(tmp_path, two_laps(SPEC | {"lam": 1})).name[-8:] != path.name[-8:]


def test_two_runs_of_one_second_do_not_clash(tmp_path, monkeypatch):
    monkeypatch.setattr("quadsim.record.archive.time.strftime", lambda *_: "20260102T030405Z")
    with RunFolder.open(tmp_path, SPEC) as first, RunFolder.open(tmp_path, SPEC) as second:
        paths = [first.save(two_laps()), second.save(two_laps()), save(tmp_path, two_laps())]
    assert len(set(paths)) == 3
    assert list_runs(tmp_path) == sorted(paths)


def test_exception_in_flight_leaves_nothing(tmp_path):
    with suppress(ZeroDivisionError), RunFolder.open(tmp_path, SPEC) as folder:
        assert list(tmp_path.iterdir()) == [folder.part]
        raise ZeroDivisionError
    assert list(tmp_path.iterdir()) == []


@pytest.mark.process
def test_kill_in_flight_leaves_only_a_part_that_is_no_run(tmp_path):
    flight = f"""
import os, signal
from quadsim.record.archive import RunFolder
with RunFolder.open({str(tmp_path)!r}, {SPEC!r}):
    os.kill(os.getpid(), signal.SIGKILL)
"""
    assert subprocess.run([sys.executable, "-c", flight]).returncode == -signal.SIGKILL
    (part,) = tmp_path.iterdir()
    assert part.name.endswith(".part")
    (part / "run.json").write_text("{}")  # had it come a moment later
    assert list_runs(tmp_path) == []
    with pytest.raises(RunError, match=r"\.part"):
        read_run(part)
    remove_unfinished(tmp_path)
    assert list(tmp_path.iterdir()) == [], "the next flight removes it"


def test_what_another_process_or_a_user_has_there_is_not_removed(tmp_path):
    (tmp_path / "film.part").mkdir()
    with RunFolder.open(tmp_path, SPEC) as folder:
        there = sorted(tmp_path.iterdir())
        assert folder.part in there
        remove_unfinished(tmp_path)
        assert sorted(tmp_path.iterdir()) == there
        folder.write(two_laps())
    remove_unfinished(tmp_path, complete=lambda name: name == folder.path.name)
    assert same(read_run(folder.path), two_laps()), "it was complete but for its name"


def test_root_that_cannot_be_written_is_one_line_before_the_flight(tmp_path):
    (tmp_path / "file").write_text("")
    (tmp_path / "dangling").symlink_to(tmp_path / "file" / "nowhere")
    for root in ("file", "file/runs", "dangling"):
        with pytest.raises(RunError, match=f"^{tmp_path / root}: [^\n]+$"):
            RunFolder.open(tmp_path / root, SPEC)


def test_full_disk_is_one_line_and_nothing_looks_finished(tmp_path, monkeypatch):
    with RunFolder.open(tmp_path, SPEC) as folder, monkeypatch.context() as patch:
        patch.setattr("quadsim.files.atomic.os.fsync", full)
        with pytest.raises(RunError, match=r"telemetry\.npz: .*No space left on device$"):
            folder.save(two_laps())
    assert list(tmp_path.iterdir()) == []


def test_many_may_write_one_file_at_once_and_it_is_one_of_theirs(tmp_path):
    texts = [bytes([i]) * 100_000 for i in range(8)]
    for _ in range(10):
        with ThreadPoolExecutor(len(texts)) as pool:
            list(pool.map(lambda text: write_whole(tmp_path / "report.md", text), texts))
        assert (tmp_path / "report.md").read_bytes() in texts
    assert [p.name for p in tmp_path.iterdir()] == ["report.md"]


@pytest.mark.parametrize("named", [False, True], ids=["file without a name", "temporary name"])
def test_a_full_disk_leaves_the_older_file_as_it_was(tmp_path, monkeypatch, named):
    if named:
        monkeypatch.setattr("quadsim.files.atomic.unnamed_file", lambda folder: None)
    write_whole(tmp_path / "x.csv", b"older")
    monkeypatch.setattr("quadsim.files.atomic.os.fsync", full)
    with pytest.raises(RunError, match=r"x\.csv: .*No space left on device$"):
        write_whole(tmp_path / "x.csv", b"newer")
    assert [(p.name, p.read_bytes()) for p in tmp_path.iterdir()] == [("x.csv", b"older")]


@pytest.mark.process
def test_a_writer_that_is_killed_leaves_the_older_file_and_nothing_else(tmp_path):
    write_whole(tmp_path / "x.csv", b"older")
    code = f"""
import os, signal
from pathlib import Path
from quadsim.record import whole_files
os.fsync = lambda handle: os.kill(os.getpid(), signal.SIGKILL)
whole_files.write_whole(Path({str(tmp_path / "x.csv")!r}), b"newer")
"""
    assert subprocess.run([sys.executable, "-c", code]).returncode == -signal.SIGKILL
    assert [(p.name, p.read_bytes()) for p in tmp_path.iterdir()] == [("x.csv", b"older")]


def test_a_path_that_is_no_file_is_one_line(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "folder").mkdir()
    os.mkfifo("pipe")
    for name in ("", ".", "folder", "pipe", "/dev/null", "x" * 300):
        with pytest.raises(RunError) as error:
            write_whole(Path(name), b"")
        assert "\n" not in str(error.value), name
