"""Reading a run folder checks everything, and still reads what was written long ago."""

import json
from pathlib import Path

import numpy as np
import pytest
from run_cases import save, snapshot, two_laps

from quadsim.record.archive import list_runs, load_run
from quadsim.record.planner_snapshot import TERM
from quadsim.record.run import RunError


def edit(path, **changes):
    record = json.loads((path / "run.json").read_text())
    (path / "run.json").write_text(json.dumps(record | changes))


def edit_npz(path, **changes):
    columns = dict(np.load(path / "telemetry.npz")) | changes
    np.savez(path / "telemetry.npz", **{k: v for k, v in columns.items() if v is not None})


def test_snapshots_in_the_early_layout_a_row_a_frame_load_as_well(tmp_path):
    run = two_laps(snapshot=snapshot())
    path = save(tmp_path, run)
    dense = np.full((61, *run.snapshots.best.shape[1:]), np.nan, np.float32)
    dense[[3, 7]] = run.snapshots.best[:2]
    terms = {
        f"{TERM}{name}": np.where(np.isin(np.arange(61), [3, 7]), 1, np.nan)
        for name in run.snapshots.terms
    }
    edit_npz(
        path,
        pictured=None,
        best=dense,
        **{name: column.astype(np.float32) for name, column in terms.items()},
    )
    old = load_run(path)
    assert old.snapshots.frames.tolist() == [3, 7]
    assert np.array_equal(old.snapshots.best, run.snapshots.best[:2])
    assert old.snapshots.latest(6)[1].terms == dict.fromkeys(run.snapshots.terms, 1.0)


SEEN, BEST = np.array([0, 10]), np.zeros((2, 8, 5, 3), np.float32)
DAMAGE = {
    "newer": (
        lambda p: edit(p, schema_version=2),
        "expected schema_version 1, got 2; it comes from a newer quadsim",
    ),
    "no version": (lambda p: edit(p, schema_version=None), "damaged: Expected `int`"),
    "outcome": (lambda p: edit(p, outcome="won"), "damaged: Invalid enum value 'won'"),
    "edited lap": (lambda p: edit(p, events=[]), "do not give the stored digest"),
    "event": (
        lambda p: edit(p, events=[{"t": "soon"}]),
        r"damaged: Expected `float`, got `str` - at `\$.events\[0\].t`",
    ),
    "cut json": (
        lambda p: (p / "run.json").write_text('{"schema_version": 1, "spec"'),
        "damaged: ",
    ),
    "binary json": (lambda p: (p / "run.json").write_bytes(b"\xff\x00"), "damaged: "),
    "no json": (lambda p: (p / "run.json").unlink(), "cannot read: No such file"),
    "no npz": (lambda p: (p / "telemetry.npz").unlink(), "cannot read: No such file"),
    "empty npz": (lambda p: (p / "telemetry.npz").write_bytes(b""), "damaged: "),
    "column": (lambda p: edit_npz(p, vz=None), "missing or unknown: vz"),
    "length": (
        lambda p: edit_npz(p, vz=np.zeros(3)),
        r"vz: expected float64 \(61,\), got float64 \(3,\)",
    ),
    "pickle": (lambda p: edit_npz(p, vz=np.array([{}])), "vz: expected float64"),
    "best": (
        lambda p: edit_npz(p, pictured=SEEN, best=np.zeros((2, 8, 3))),
        "best: expected float32",
    ),
    "four states": (
        lambda p: edit_npz(p, pictured=SEEN, best=np.zeros((2, 8, 5, 4), np.float32)),
        "1 to 3",
    ),
    "pictured alone": (lambda p: edit_npz(p, pictured=SEEN), "missing or unknown: pictured"),
    "no path": (lambda p: edit_npz(p, pictured=SEEN, best=BEST[:, :0]), "best: expected float32"),
    "past the end": (
        lambda p: edit_npz(p, pictured=SEEN + 60, best=BEST),
        "pictured: expected rising frames below 61",
    ),
    "falling": (
        lambda p: edit_npz(p, pictured=SEEN[::-1], best=BEST),
        "pictured: expected rising frames below 61",
    ),
    "term": (
        lambda p: edit_npz(p, pictured=SEEN, best=BEST, **{f"{TERM}crash": np.zeros(2)}),
        r"cost.crash: expected float32 .*, got float64 \(2,\)",
    ),
    "term alone": (
        lambda p: edit_npz(p, **{f"{TERM}crash": np.zeros(61)}),
        "cost.crash: expected float32",
    ),
    "bit": (lambda p: edit_npz(p, vz=np.full(61, 1e-300)), "do not give the stored digest"),
}


@pytest.mark.parametrize("damage", DAMAGE)
def test_damaged_folder_is_one_line_that_names_it(tmp_path, damage):
    path = save(tmp_path, two_laps())
    harm, message = DAMAGE[damage]
    harm(path)
    with pytest.raises(RunError, match=message) as error:
        load_run(path)
    assert str(error.value).startswith(str(path))
    assert "\n" not in str(error.value)


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
            loaded = load_run(path)
        except RunError:
            continue
        assert loaded.digest() == run.digest()


def test_missing_run_is_one_line():
    with pytest.raises(RunError, match=r"^nowhere: expected a run folder, found nothing$"):
        load_run(Path("nowhere"))
    assert list_runs("nowhere") == []
