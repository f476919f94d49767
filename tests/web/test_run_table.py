"""Claims about the table of stored runs: read once, checked, named by its rows alone."""

import json
import os
import shutil
import time

import msgspec
import pytest
from run_cases import SPEC, save, two_laps
from web_cases import Glider, choices, run_of, store, stored

import quadsim
from quadsim.campaign.document import Document, Heading, Line, Table
from quadsim.limit.limits import limit_of
from quadsim.web.stored import run_table
from quadsim.web.stored.campaign_reports import CampaignReports, Report
from quadsim.web.stored.run_table import RunTable
from tests.small import SHORT


def old(folder):
    """Let a folder have changed some time ago, as its time is not exact within a moment."""
    past = time.time() - 60.0
    os.utime(folder, (past, past))


def test_a_row_says_what_the_run_says(tmp_path):
    change = {"t": 0.1, "name": "sigma", "from": 1.0, "to": 2.0}
    probe = save(tmp_path, two_laps(SPEC)) / "run.json"
    record = json.loads(probe.read_text())
    record["spec"] |= {"sensing": {"name": "gates"}, "interactive": [change, change]}
    # a mark after which the rest of a line would be read from right to left
    record["spec"]["vehicle"]["name"] = "<b>\u202eswift"
    probe.write_text(json.dumps(record))
    folder = stored(tmp_path, "gaussian", laps=3)
    table = RunTable(str(tmp_path))
    assert table.refresh()
    of_glider, of_probe = sorted(table.rows, key=lambda row: row.cells["course"])
    record = json.loads((folder / "run.json").read_text())
    best = limit_of(record["spec"]).time
    time_flown = sum(record["laps"])
    assert of_glider.name == folder.name
    cells = dict(of_glider.cells)
    assert cells.pop("when")[:2] == "20"
    assert cells.pop("above") == pytest.approx(100 * (time_flown / best - 1), abs=0.06)
    assert cells == {
        "course": "figure8",
        "flown_by": "gaussian",
        "time": time_flown,
        "outcome": "finished",
        "seed": 0,
        "progress": "3/3",
        "vehicle": "swift",
        "preset": "race",
        "sensing": "perfect",
        "numbers": "",
        "changes": 0,
    }
    assert of_probe.cells["vehicle"] == "<b>\N{REPLACEMENT CHARACTER}swift"
    assert [of_probe.cells[key] for key in ("sensing", "changes", "above")] == ["gates", 2, None]


def test_a_row_names_the_numbers_and_settings_that_distinguish_it(tmp_path):
    numbers = {"samples": 256, "temperature": 0.2}
    flown = choices("colored", numbers=numbers, clock="wall", deadline_ms="8")
    store(tmp_path, run_of(Glider(flown)))
    (row,) = refreshed(tmp_path)
    assert set(row.cells["numbers"].split(", ")) >= {"samples 256", "temperature 0.2"}
    assert "wall clock, deadline 8" in row.other_settings
    shutil.rmtree(tmp_path / row.name)
    stored(tmp_path)
    (plain,) = refreshed(tmp_path)
    assert plain.cells["numbers"] == ""
    assert "deadline" not in plain.other_settings


def refreshed(root):
    table = RunTable(str(root))
    assert table.refresh()
    return table.rows


def test_a_look_at_the_same_folder_reads_nothing_and_a_new_run_arrives(tmp_path, monkeypatch):
    stored(tmp_path)
    table = RunTable(str(tmp_path))
    old(tmp_path)
    assert table.refresh()
    with monkeypatch.context() as closed:
        closed.setattr(run_table, "read_row", None)
        closed.setattr(os, "scandir", None)
        for _ in range(3):
            assert not table.refresh()
    (before,) = table.rows
    arrived = stored(tmp_path, "gaussian")
    read = []
    reads = run_table.read_row
    monkeypatch.setattr(run_table, "read_row", lambda path: read.append(path) or reads(path))
    assert table.refresh()
    assert read == [arrived]
    assert {row.name for row in table.rows} == {before.name, arrived.name}
    shutil.rmtree(arrived)
    assert table.refresh()
    assert table.rows == (before,)


def test_a_limit_that_is_found_later_is_compared_with(tmp_path, monkeypatch):
    monkeypatch.setattr(run_table, "limit_of", lambda spec, folder: None)
    stored(tmp_path, laps=3)
    table = RunTable(str(tmp_path))
    table.refresh()
    assert table.rows[0].cells["above"] is None
    monkeypatch.undo()
    (tmp_path / "limits").mkdir()
    assert table.refresh()
    assert table.rows[0].cells["above"] is not None


@pytest.mark.slow
@pytest.mark.parametrize(
    "content", [b"", b"{", b"{}", b"\xff\xfe", b'{"outcome": "won"}', b"[" * 100_000]
)
def test_a_damaged_run_is_a_row_that_says_so(tmp_path, content):
    stored(tmp_path)
    broken = stored(tmp_path, "gaussian")
    (broken / "run.json").write_bytes(content)
    table = RunTable(str(tmp_path))
    table.refresh()
    rows = {row.name: row for row in table.rows}
    assert len(rows) == 2
    assert rows[broken.name].problem.startswith("damaged: ")
    assert "\n" not in rows[broken.name].problem
    assert [row.problem for row in table.rows if row.name != broken.name] == [""]


def test_a_run_that_does_not_fit_its_telemetry_becomes_a_row_that_says_so(tmp_path):
    honest, faster, reseeded, bare = (stored(tmp_path, laps=2) for _ in range(4))
    for folder, changed in ((faster, {"laps": [0.1, 0.1]}), (reseeded, {"seed": 9})):
        record = json.loads((folder / "run.json").read_text())
        part = record if "laps" in changed else record["spec"]
        part |= changed
        (folder / "run.json").write_text(json.dumps(record))
    (bare / "telemetry.npz").unlink()
    table = RunTable(str(tmp_path))
    table.refresh()
    assert not any(row.problem for row in table.rows)
    while table.check_next():
        pass
    problems = {row.name: row.problem for row in table.rows}
    assert problems[honest.name] == ""
    assert "outcome and laps are not those of its events" in problems[faster.name]
    assert "do not give the stored digest" in problems[reseeded.name]
    assert "telemetry.npz: expected a file of a run" in problems[bare.name]
    # A line of the page names the row, and gives no time to sort by.
    assert not any(str(tmp_path) in problem for problem in problems.values())
    assert [row.cells["time"] for row in table.rows if row.problem] == [None] * 3
    arrived = stored(tmp_path)
    assert table.refresh()
    assert table.check_next()
    assert not table.check_next()
    assert next(row for row in table.rows if row.name == arrived.name).problem == ""


def test_a_pipe_in_place_of_a_record_is_not_waited_for(tmp_path):
    (tmp_path / "20260101T000000Z_pipe").mkdir()
    os.mkfifo(tmp_path / "20260101T000000Z_pipe" / "run.json")
    folder = stored(tmp_path)
    table = RunTable(str(tmp_path))
    table.refresh()
    assert [row.name for row in table.rows] == [folder.name]


@pytest.mark.parametrize("name", ["", ".", "..", "../runs", "limits", "/etc", "x\0y"])
def test_only_a_listed_name_is_a_folder(tmp_path, name):
    folder = stored(tmp_path)
    (tmp_path / "limits").mkdir()
    table = RunTable(str(tmp_path))
    table.refresh()
    assert table.path(folder.name) == folder
    assert table.path(name) is None


OWN = Document((Line("own"),))


def test_reports_beside_the_runs_are_listed_and_read_by_their_listed_names_alone(tmp_path):
    folder = tmp_path / "campaigns" / "race.report"
    folder.mkdir(parents=True)
    written = Document((Heading("figure8"), Table(("a", "b"), (("1", "2"),))))
    (folder / "a_b.json").write_bytes(msgspec.json.encode(written))
    (folder / "a_b.md").write_text("the same as Markdown")
    (folder / "a_b.png").write_bytes(b"\x89PNG\r\n\x1a\n...")
    (tmp_path / "secret.md").write_text("secret")
    reports = CampaignReports(str(tmp_path / "runs"))
    reports.refresh()
    (row,) = reports.rows
    assert (row.campaign, row.title) == ("race.sqlite", "a_b")
    report = reports.read(row.name)
    assert report.document == written
    assert report.figure.startswith("data:image/png;base64,")
    (folder / "a_b.png").write_text("<svg onload=alert(1)>")
    assert reports.read(row.name).figure == ""
    for name in ("secret.md", "campaigns/race.report/../../secret.md", str(tmp_path / "secret.md")):
        with pytest.raises(ValueError, match="expected a report of the list"):
            reports.read(name)
    (folder / "a_b.json").write_text('{"blocks": 3}')
    with pytest.raises(ValueError, match=r"^a_b\.json: expected a report of race compare: "):
        reports.read(row.name)


def test_a_report_that_is_a_link_to_another_place_is_not_shown(tmp_path):
    secret = tmp_path / "secret"
    secret.mkdir()
    (secret / "a.json").write_text("secret")
    (secret / "a.png").write_bytes(b"\x89PNG\r\n\x1a\nsecret")
    here = tmp_path / "here"
    report = here / "campaigns" / "race.report"
    report.mkdir(parents=True)
    (report / "link.json").symlink_to(secret / "a.json")
    (report / "own.json").write_bytes(msgspec.json.encode(OWN))
    (report / "own.png").symlink_to(secret / "a.png")
    (here / "campaigns" / "other.report").symlink_to(secret)
    reports = CampaignReports(str(here / "runs"))
    reports.refresh()
    (row,) = reports.rows
    assert reports.read(row.name) == Report(OWN, "")
    # A report that becomes a link after it was listed
    (report / "own.json").unlink()
    (report / "own.json").symlink_to(secret / "a.json")
    with pytest.raises(ValueError, match="got a link to another place"):
        reports.read(row.name)


def test_campaigns_may_lie_on_another_disk(tmp_path):
    report = tmp_path / "disk" / "race.report"
    report.mkdir(parents=True)
    (report / "own.json").write_bytes(msgspec.json.encode(OWN))
    (tmp_path / "here").mkdir()
    (tmp_path / "here" / "campaigns").symlink_to(tmp_path / "disk")
    reports = CampaignReports(str(tmp_path / "here" / "runs"))
    reports.refresh()
    (row,) = reports.rows
    assert reports.read(row.name).document == OWN


@pytest.mark.compiled
def test_a_campaign_is_shown_as_a_table_and_other_files_are_left_alone(tmp_path):
    campaign = tmp_path / "campaigns" / "race.sqlite"
    quadsim.compare("figure8", ("colored",), attempts=2, campaign=campaign, **SHORT)
    foreign = tmp_path / "campaigns" / "notes.sqlite"
    foreign.write_bytes(b"")
    reports = CampaignReports(str(tmp_path / "runs"))
    reports.refresh()
    (row,) = reports.rows
    head, common, table = reports.read(row.name).document.blocks
    assert head == Heading("race.sqlite")
    assert common.text.startswith("course figure8, vehicle swift, randomized 0, commit ")
    assert table.rows[0][1:3] == ("colored", "0-1")
    assert foreign.read_bytes() == b""
