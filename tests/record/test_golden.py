"""A run of format 2, stored once: every version of this format reads, shows, draws and flies it.

It was written by `race fly figure8 --laps 1 --samples 512 --seed 1 --randomize 1`.
"""

import json
import re
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from plant_cases import needs_bullet

import quadsim
from quadsim.cli.cli import race
from quadsim.config.spec import Spec
from quadsim.dynamics.quadrotor import STATE
from quadsim.figures.run_figure import draw
from quadsim.physics.plant_state import MOTOR_UNITS
from quadsim.record.planner_snapshot import BEST, FRAMES, TERM
from quadsim.record.run import COLUMNS, SHARES, RunError
from quadsim.record.run_format import CSV_COLUMNS
from quadsim.record.schema import CHANGE_COLUMNS
from quadsim.sensing.estimate_record import ESTIMATE_UNITS
from quadsim.sensing.kept import TABLES
from quadsim.web.race.stored_competitor import stored_competitor
from tests.docs.pages import ROOT
from tests.small import SHORT

GOLDEN = Path(__file__).parent / "golden"
PAGE = ROOT / "docs" / "reproducibility.md"


@pytest.fixture(scope="module")
def run():
    return quadsim.load_run(GOLDEN)


def test_it_is_read(run):
    record = json.loads((GOLDEN / "run.json").read_text())
    assert record["format"] == "quadsim run 3"
    assert run.digest() == record["digest"], "nothing that the digest covers has changed"
    assert run.laps == [4.430911951186431]
    assert len(run.gates) == 8


def test_it_is_shown(capsys):
    assert race(["show", str(GOLDEN)]) == 0
    assert "4.431" in capsys.readouterr().out
    assert race(["show", str(GOLDEN), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["laps"] == [4.430911951186431]


def test_it_is_drawn(run):
    assert "figure8" in draw(run).get_suptitle()
    assert stored_competitor(GOLDEN).laps == (4.430911951186431,)


def test_its_record_is_that_of_a_flight_of_this_version(run):
    """A new setting counts up RUN_FORMAT, after which this run is flown again."""
    found = json.loads(json.dumps(Spec.of_record(run.spec).record()))
    assert found | {"host": run.spec["host"]} == run.spec


@needs_bullet
@pytest.mark.compiled
def test_the_same_vehicle_takes_off_from_the_same_place_by_a_smaller_planner(run):
    again = quadsim.fly(run.spec, **SHORT)
    assert again.spec["variation"] == run.spec["variation"]
    assert again.spec["vehicle"] == run.spec["vehicle"]
    for column in STATE:
        assert again.telemetry[column][0] == run.telemetry[column][0], column


@needs_bullet
@pytest.mark.regression
def test_it_is_flown_again(run):
    """Another CPU may round in another way, so that laps differ a little there. Since the run was
    stored, the temperature is solved in each iteration, which moves the start by 2.5 cm."""
    again = quadsim.fly(run.spec)
    assert again.outcome == "finished"
    np.testing.assert_allclose(again.laps, run.laps, atol=0.1)
    start = slice(0, 20)
    for column in ("px", "py", "pz"):
        ours, stored = again.telemetry[column][start], run.telemetry[column][start]
        np.testing.assert_allclose(ours, stored, atol=0.04)


STRANGE = {
    "no model": {"model": {}},
    "a text for a number": {"vehicle": {"name": "x", "mass": "heavy"}},
    "an own part of another kind": {"own": {"sampler": "os.system"}},
    "a term without a name": {"own": {"terms": [{}]}},
    "a fault that is none": {"drawn_faults": ["rotor9=5@x"]},
    "too many laps": {"laps": 10**7},
    "a name with control characters": {"course": {"name": "\x1b[31mred", "text": ""}},
    "no planner": {"planner": {}},
}


def test_a_spec_written_by_hand_is_one_line(tmp_path, capsys, run):
    """Its digest is right, as whoever writes a spec can compute that too."""
    folder = tmp_path / "20261123T000000Z_by_hand"
    shutil.copytree(GOLDEN, folder)
    record = json.loads((folder / "run.json").read_text())
    for what, entries in STRANGE.items():
        changed = replace(run, spec=run.spec | entries)
        record |= {"spec": changed.spec, "digest": changed.digest()}
        (folder / "run.json").write_text(json.dumps(record))
        for command in ("show", "plot"):
            assert race([command, str(folder)]) == 2, what
            error = capsys.readouterr().err.strip()
            assert "spec: expected the spec of a flight" in error, what
            assert "\n" not in error, what
        with pytest.raises(RunError):
            stored_competitor(folder)


def test_the_page_names_what_each_file_of_a_run_has():
    text = PAGE.read_text()
    named = set(re.findall(r"`([\w.]+)`", text))
    record = json.loads((GOLDEN / "run.json").read_text())
    assert set(record) | {"fault", "learned"} <= named
    assert {*CSV_COLUMNS, *CHANGE_COLUMNS} <= named
    # Ends of a row of columns stand for those between.
    columns = {*COLUMNS, *MOTOR_UNITS, *ESTIMATE_UNITS}
    between = {name for name in columns if name.startswith(("est_", "cov_", "share"))}
    assert columns - between <= named
    assert {
        *SHARES[::3],
        "est_px",
        "est_qz",
        "cov_xx",
        "cov_zz",
        FRAMES,
        BEST,
        f"{TERM}NAME",
    } <= named
    assert all(f"`{table.sensor}.*`" in text for table in TABLES)
