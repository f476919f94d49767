"""Claims about exported files."""

import csv
import io
import re
import shutil
import zipfile
from dataclasses import replace

import numpy as np
import pytest
from matplotlib.image import imread
from web_cases import Glider, choices, competitor, run_of, store, stored

from quadsim.cli.cli import race
from quadsim.palette import STYLES
from quadsim.record.archive import read_run
from quadsim.record.exchange import telemetry_csv
from quadsim.record.run import COLUMNS, RunError
from quadsim.record.run_format import write_csv
from quadsim.web.page.forms.export import picture, picture_name
from quadsim.web.race.competitor import named
from quadsim.web.race.snapshot import Snapshot
from quadsim.web.race.stored_competitor import stored_competitor
from quadsim.web.race.summary import summary_at


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return stored(tmp_path_factory.mktemp("runs"), laps=2)


def test_the_table_holds_every_number_of_the_run(folder, tmp_path, capsys):
    assert race(["export", str(folder), "--csv", "--out", str(tmp_path / "run.csv")]) == 0
    assert capsys.readouterr().out.strip() == str(tmp_path / "run.csv")
    head, *rows = csv.reader(io.StringIO((tmp_path / "run.csv").read_text()))
    assert head == [f"{name} [{unit}]" for name, unit in COLUMNS.items()]
    table = np.array(rows, float)
    for i, name in enumerate(COLUMNS):
        assert np.array_equal(table[:, i], read_run(folder).telemetry[name])


def test_two_runs_are_in_one_table_and_one_zip(folder, tmp_path):
    other = stored(tmp_path, "gaussian")
    for kind in ("csv", "zip"):
        out = str(tmp_path / f"two.{kind}")
        assert race(["export", str(folder), str(other), f"--{kind}", "--out", out]) == 0
    head, *rows = csv.reader(io.StringIO((tmp_path / "two.csv").read_text()))
    assert head == ["run", *(f"{name} [{unit}]" for name, unit in COLUMNS.items())]
    for path in (folder, other):
        px = [float(row[2]) for row in rows if row[0] == path.name]
        assert px == read_run(path).telemetry["px"].tolist()
    with zipfile.ZipFile(tmp_path / "two.zip") as archive:
        archive.extractall(tmp_path / "out")
    for path in (folder, other):
        assert read_run(tmp_path / "out" / path.name).digest() == read_run(path).digest()


def test_numbers_that_were_changed_in_flight_are_in_both_tables(folder, tmp_path):
    run = read_run(folder)
    changes = [
        {"t": 0.5, "name": "samples", "from": 4096.0, "to": 512.0},
        {"t": 0.9, "name": "samples", "from": 512.0, "to": 1024.0},
        {"t": 0.9, "name": "temperature", "from": 1.0, "to": 2.5},
    ]
    changed = replace(run, spec={**run.spec, "interactive": changes})

    events = list(csv.DictReader(io.StringIO(write_csv(changed).decode())))
    rows = [row for row in events if row["kind"] == "change"]
    told = [(float(r["t"]), r["number"], float(r["from"]), float(r["to"])) for r in rows]
    assert told == [tuple(change.values()) for change in changes]
    assert [float(row["t"]) for row in events] == sorted(float(row["t"]) for row in events)
    assert len(events) == len(run.events) + len(changes)
    assert b"number" not in write_csv(run)  # a run without changes has the table it has always had

    data = telemetry_csv([("plain", run), ("changed", changed)]).decode()
    table = list(csv.DictReader(io.StringIO(data)))
    for row in table:
        t = float(row["t [s]"])
        samples = 4096.0 if t < 0.495 else 512.0 if t < 0.895 else 1024.0
        wanted = ["", ""]
        if row["run"] == "changed":
            wanted = [str(samples), "1.0" if t < 0.895 else "2.5"]
        assert [row["changed samples"], row["changed temperature"]] == wanted

    by_hand = replace(run, spec={**run.spec, "interactive": [{"t": "soon"}]})
    with pytest.raises(RunError, match="interactive: "):
        telemetry_csv([("by hand", by_hand)])


def test_a_picture_has_a_dark_ground_everywhere_and_names_both_runs(folder):
    """The scene comes with a transparent ground: on white paper its pale lines could not be
    seen."""
    one = stored_competitor(folder)
    two = one.with_record({**one.record, "sampler": "gaussian"})
    render = np.zeros((200, 300, 4), np.uint8)
    render[50, 60] = 10, 200, 30, 255
    image = imread(io.BytesIO(picture(render, summary_at(named([one, two]), 1.0))))
    assert image.shape[:2] == (200 + 98, 300)
    assert image.shape[2] == 3 or (image[..., 3] == 1.0).all()
    assert np.allclose(image[98 + 50, 60, :3] * 255, [10, 200, 30], atol=2)
    assert image[98:, :, :3].mean() < 0.1
    assert (image[-1, -1, :3] < 0.1).all()
    for k, colour in enumerate(("colored", "gaussian")):
        # below the headline and the differences
        line = 255 * image[8 + 22 * (k + 2) : 8 + 22 * (k + 3), :, :3].reshape(-1, 3)
        assert abs(line - STYLES[colour].rgb).sum(axis=1).min() < 30


def test_what_leaves_the_browser_says_leader_differences_chatter_and_numbers():
    entries = named([competitor("gaussian", laps=2), competitor("colored", laps=1, seed=5)])
    found = summary_at(entries, 1.0)
    assert "figure8, 1.00 s: colored leads gaussian by 0.10 s over the first lap" in found.headline
    assert found.compared.startswith("They differ in sampler, ")
    first, second = (line.text for line in found.lines)
    assert first.startswith("colored: in its first lap, ")
    assert "seed 5" in first
    assert "+0.10 s" in second
    assert all("chatter" in line for line in (first, second))
    ended = summary_at(entries, 99.0).lines
    assert all("finished after" in line.text for line in ended)
    s = Snapshot(t=1.0, competitors=tuple(entries))
    assert picture_name(s) == "figure8_gaussian_colored_1.00s"
    evil = replace(entries[0], name="../<b>")
    assert "/" not in picture_name(replace(s, competitors=(evil,)))


def test_the_zip_holds_a_run_that_can_be_loaded(folder, tmp_path):
    assert race(["export", str(folder), "--zip", "--out", str(tmp_path / "run.zip")]) == 0
    with zipfile.ZipFile(tmp_path / "run.zip") as archive:
        archive.extractall(tmp_path)
    assert read_run(tmp_path / folder.name).digest() == read_run(folder).digest()


@pytest.mark.parametrize("link", ["notes.txt", "events.csv"])
def test_the_zip_does_not_follow_a_link_out_of_the_run(link, folder, tmp_path, capsys):
    copied = shutil.copytree(folder, tmp_path / folder.name)
    (tmp_path / "secret").write_text("secret")
    (copied / link).unlink(missing_ok=True)
    (copied / link).symlink_to(tmp_path / "secret")
    out = tmp_path / "run.zip"
    assert race(["export", str(copied), "--zip", "--out", str(out)]) == 2
    assert f"{link}: expected a file of the run, got a link" in capsys.readouterr().err
    assert not out.exists()


@pytest.mark.socket
def test_the_page_is_one_file_that_loads_nothing(folder, tmp_path):
    assert race(["export", str(folder), "--html", "--out", str(tmp_path / "race.html")]) == 0
    page = (tmp_path / "race.html").read_text()
    assert "splits by gate" in page
    assert not re.findall(r"<(?:script|link|img)[^>]+(?:src|href)=[\"']https?:", page)


@pytest.mark.socket
def test_the_page_names_a_run_that_was_changed_in_flight(tmp_path):
    run = run_of(Glider(choices()))
    change = {"t": 0.1, "name": "sigma", "from": 1.0, "to": 2.0}
    path = store(tmp_path, replace(run, spec=run.spec | {"interactive": [change]}))
    assert race(["export", str(path), "--html", "--out", str(tmp_path / "race.html")]) == 0
    assert "not comparable" in (tmp_path / "race.html").read_text()


@pytest.mark.parametrize("flags", [[], ["--csv", "--zip"]])
def test_one_kind_of_file_is_asked_for(folder, flags, capsys):
    assert race(["export", str(folder), *flags]) == 2
    err = capsys.readouterr().err.strip()
    assert err.startswith("race export: ")
    assert "\n" not in err


def test_a_damaged_run_is_not_handed_on(folder, tmp_path, capsys):
    copy = shutil.copytree(folder, tmp_path / "copy")
    (copy / "telemetry.npz").write_bytes(b"no zip")
    assert race(["export", str(copy), "--zip", "--out", str(tmp_path / "x.zip")]) == 2
    assert str(copy) in capsys.readouterr().err
    assert not (tmp_path / "x.zip").exists()
