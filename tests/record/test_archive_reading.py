"""Reading a run folder checks everything in it."""

import json
import os
import shutil
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from quadsim.record.archive import list_runs, read_run
from quadsim.record.planner_snapshot import TERM
from quadsim.record.run import RunError
from tests.run_cases import save, two_laps


def edit(path, **changes):
    record = json.loads((path / "run.json").read_text())
    (path / "run.json").write_text(json.dumps(record | changes))


def edit_npz(path, **changes):
    columns = dict(np.load(path / "telemetry.npz")) | changes
    np.savez(path / "telemetry.npz", **{k: v for k, v in columns.items() if v is not None})


SEEN = np.array([0, 10])
BEST = np.zeros((2, 8, 5, 3), np.float32)


def cut_json(path):
    (path / "run.json").write_text('{"format": "quadsim run 3", "spec"')


def binary_json(path):
    (path / "run.json").write_bytes(b"\xff\x00")


def pipe_json(path):
    (path / "run.json").unlink()
    os.mkfifo(path / "run.json")


def empty_npz(path):
    (path / "telemetry.npz").write_bytes(b"")


def changed_json(**changes):
    return partial(edit, **changes)


def changed_npz(**changes):
    return partial(edit_npz, **changes)


# Name -> what harms the folder, and what the error names
DAMAGE = {
    "newer": (changed_json(format="quadsim run 99"), "got 'quadsim run 99'"),
    "no format": (changed_json(format=None), "got none: read it with commit .* of quadsim"),
    "format": (changed_json(format=1), "damaged"),
    "no laps": (changed_json(spec={"course": "x"}), "spec: expected the spec of a flight"),
    "outcome": (changed_json(outcome="won"), "'won'"),
    "edited lap": (changed_json(events=[]), "digest"),
    "event": (changed_json(events=[{"t": "soon"}]), r"events\[0\].t"),
    "cut json": (cut_json, "damaged"),
    "binary json": (binary_json, "damaged"),
    "no json": (lambda path: (path / "run.json").unlink(), "no such file"),
    "pipe": (pipe_json, "got a folder, a pipe or a device"),
    "no npz": (lambda path: (path / "telemetry.npz").unlink(), "no such file"),
    "empty npz": (empty_npz, "damaged"),
    "column": (changed_npz(vz=None), "missing or unknown: vz"),
    "length": (changed_npz(vz=np.zeros(3)), "vz: "),
    "pickle": (changed_npz(vz=np.array([{}])), "damaged"),
    "best": (changed_npz(pictured=SEEN, best=np.zeros((2, 8, 3))), "best: "),
    "four states": (
        changed_npz(pictured=SEEN, best=np.zeros((2, 8, 5, 4), np.float32)),
        "best: ",
    ),
    "pictured alone": (changed_npz(pictured=SEEN), "missing or unknown: pictured"),
    "no path": (changed_npz(pictured=SEEN, best=BEST[:, :0]), "best: "),
    "past the end": (changed_npz(pictured=SEEN + 60, best=BEST), "pictured: "),
    "falling": (changed_npz(pictured=SEEN[::-1], best=BEST), "pictured: "),
    "term": (
        changed_npz(pictured=SEEN, best=BEST, **{f"{TERM}crash": np.zeros(2)}),
        "cost.crash: ",
    ),
    "term alone": (
        changed_npz(**{f"{TERM}crash": np.zeros(61)}),
        "cost.crash: ",
    ),
    "bit": (changed_npz(vz=np.full(61, 1e-300)), "digest"),
}


def test_damaged_folder_is_one_line_that_names_it(tmp_path):
    whole = save(tmp_path, two_laps())
    for damage, (harm, message) in DAMAGE.items():
        path = tmp_path / damage
        shutil.copytree(whole, path)
        harm(path)
        with pytest.raises(RunError, match=message) as error:
            read_run(path)
        assert str(error.value).startswith(str(path))
        assert "\n" not in str(error.value), damage


@pytest.mark.slow
@pytest.mark.parametrize("name", ["run.json", "telemetry.npz"])
def test_random_damage_never_gets_past_the_reader_unseen(tmp_path, name):
    run = two_laps()
    path = save(tmp_path, run)
    whole, rng = (path / name).read_bytes(), np.random.default_rng(0)
    for _ in range(150):
        data = bytearray(whole)
        data[rng.integers(len(data))] ^= 1 << rng.integers(8)
        (path / name).write_bytes(data[: rng.integers(len(data)) if rng.random() < 0.3 else None])
        try:
            loaded = read_run(path)
        except RunError:
            continue
        assert loaded.digest() == run.digest()


def test_a_missing_run_is_an_error_that_names_it():
    with pytest.raises(RunError, match=r"^nowhere: "):
        read_run(Path("nowhere"))
    assert list_runs("nowhere") == []
