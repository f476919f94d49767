"""Claims about exported files."""

import csv
import io
import re
import zipfile

import numpy as np
import pytest
from web_cases import Glider, choices

from quadsim.app.cli import race
from quadsim.record.archive import RunFolder, load_run
from quadsim.record.run import COLUMNS, Run


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    flight = Glider(choices(laps=2))
    with RunFolder.open(tmp_path_factory.mktemp("runs"), flight.spec) as folder:
        return folder.save(Run.from_frames(flight.spec, list(flight.frames)))


def test_the_table_holds_every_number_of_the_run(folder, tmp_path, capsys):
    assert race(["export", str(folder), "--csv", "--out", str(tmp_path / "run.csv")]) == 0
    assert capsys.readouterr().out.strip() == str(tmp_path / "run.csv")
    head, *rows = csv.reader(io.StringIO((tmp_path / "run.csv").read_text()))
    assert head == [f"{name} [{unit}]" for name, unit in COLUMNS.items()]
    table = np.array(rows, float)
    for i, name in enumerate(COLUMNS):
        assert np.array_equal(table[:, i], load_run(folder).telemetry[name])


def test_the_zip_holds_a_run_that_can_be_loaded(folder, tmp_path):
    assert race(["export", str(folder), "--zip", "--out", str(tmp_path / "run.zip")]) == 0
    with zipfile.ZipFile(tmp_path / "run.zip") as archive:
        archive.extractall(tmp_path)
    assert load_run(tmp_path / folder.name).digest() == load_run(folder).digest()


def test_the_page_is_one_file_that_loads_nothing(folder, tmp_path):
    assert race(["export", str(folder), "--html", "--out", str(tmp_path / "race.html")]) == 0
    page = (tmp_path / "race.html").read_text()
    assert "splits by gate" in page
    assert not re.findall(r"<(?:script|link|img)[^>]+(?:src|href)=[\"']https?:", page)


def test_the_page_names_a_run_that_was_changed_in_flight(tmp_path):
    flight = Glider(choices(laps=1))
    spec = flight.spec | {"interactive": [{"t": 0.1, "name": "sigma", "from": 1.0, "to": 2.0}]}
    with RunFolder.open(tmp_path, spec) as folder:
        path = folder.save(Run.from_frames(spec, list(flight.frames)))
    assert race(["export", str(path), "--html", "--out", str(tmp_path / "race.html")]) == 0
    assert "interactive, not comparable: 1 change in flight" in (tmp_path / "race.html").read_text()


@pytest.mark.parametrize(
    ("flags", "said"),
    [
        ([], "expected one of --html, --csv, --zip, got none"),
        (["--csv", "--zip"], "expected one of --html, --csv, --zip, got csv and zip"),
    ],
)
def test_what_to_write_must_be_said_once(folder, flags, said, capsys):
    assert race(["export", str(folder), *flags]) == 2
    assert capsys.readouterr().err.strip() == f"race export: {said}"


def test_a_damaged_run_is_not_handed_on(folder, tmp_path, capsys):
    import shutil

    copy = shutil.copytree(folder, tmp_path / "copy")
    (copy / "telemetry.npz").write_bytes(b"no zip")
    assert race(["export", str(copy), "--zip", "--out", str(tmp_path / "x.zip")]) == 2
    assert "damaged" in capsys.readouterr().err
    assert not (tmp_path / "x.zip").exists()
