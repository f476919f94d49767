"""Claims about quadsim.runs: the stored runs of a folder as a list."""

import csv
import json
import os
import re
import zipfile
from datetime import datetime
from pathlib import Path

import pytest
from run_cases import SPEC, same, save, two_laps

import quadsim
from quadsim.cli.cli import race
from quadsim.heat.line_up import line_up
from quadsim.record.archive import read_run
from quadsim.results.stored_row import LARGEST_RECORD, columns
from quadsim.web.stored.run_table import RunTable, page_columns

PILOT = {"name": "ace", "sha256": "0" * 64}


@pytest.fixture
def root(tmp_path):
    """A folder with three runs, one of which a pilot flew."""
    save(tmp_path, two_laps())
    other = {"name": "other course", "text": ""}
    save(tmp_path, two_laps(SPEC | {"course": other, "seed": 4}, "timeout"))
    save(tmp_path, two_laps(SPEC | {"seed": 5, "pilot": PILOT}))
    return tmp_path


def seeds(runs):
    """Return the seeds of a list of runs."""
    return sorted(run.seed for run in runs)


def test_a_row_says_what_the_run_says(root):
    (row,) = quadsim.runs(root, seed=3)
    run = read_run(row.path)
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
    assert seeds(quadsim.runs(root, vehicle="pro?e", sampler="colored")) == [3, 4, 5]
    # a pilot flies with the numbers of no preset
    assert seeds(quadsim.runs(root, preset="race")) == [3, 4]
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


def test_a_pipe_in_place_of_the_record_of_a_race_is_not_waited_for(root):
    race = root / "20991231T000000Z_figure8_heat_s0_00000000"
    race.mkdir()
    os.mkfifo(race / "heat.json")
    runs = quadsim.runs(root)
    assert len(runs) == 3
    assert "expected the record of a race" in runs.damaged[race]


@pytest.mark.parametrize("make", [os.mkfifo, lambda file: file.symlink_to("/dev/zero"), large])
def test_what_is_no_file_of_a_run_is_neither_waited_for_nor_read(make, root):
    folder = quadsim.runs(root)[0].path
    (folder / "run.json").unlink()
    make(folder / "run.json")
    runs = quadsim.runs(root)
    assert len(runs) == 2
    assert "expected the record of a flight" in runs.damaged[folder]
    table = RunTable(str(root))
    assert table.refresh()
    assert all(row.problem for row in table.rows if row.name == folder.name)
    assert sum(not row.problem for row in table.rows) == 2


def test_the_table_has_a_line_for_each_run(root):
    text = str(quadsim.runs(root))
    assert len(text.splitlines()) == 1 + 3
    assert "pilot ace" in text
    assert "\x1b" not in text
    assert "\n" not in repr(quadsim.runs(root))
    assert str(quadsim.runs(root / "nothing")) == "no stored run matches"


def test_terminal_notebook_and_page_show_the_same_columns(root):
    printed = [column.title for column in columns().values() if column.is_printed]
    runs = quadsim.runs(root)
    assert str(runs).splitlines()[0].split() == " ".join(printed).split()
    assert re.findall("<th[^>]*>([^<]+)</th>", runs._repr_html_()) == printed
    by_name = [column.title for column in columns().values() if not column.is_in_name]
    assert set(runs.by_name().splitlines()[0].split()) <= set(" ".join(["run", *by_name]).split())
    assert set(page_columns()) == {"above", *columns()}


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
    assert list(runs[0].as_json()) == list(frame.columns)


class Climb:
    def control(self, x):
        return 0.0, 0.0, 0.0, 11.0


@pytest.fixture
def raced(root):
    """The folder with a race of two beside its three runs, and the race."""
    line_up = {
        name: {"controller": Climb(), "vehicle": vehicle}
        for name, vehicle in (("up", "swift"), ("[b]off", "kingfisher"))
    }
    heat = quadsim.race(line_up, "figure8", laps=1, timeout=0.05, seed=9)
    heat.save(root)
    return heat


def test_races_of_several_are_listed_beside_the_runs(root, raced):
    stored = quadsim.runs(root)
    assert (len(stored), len(stored.flights), len(stored.races)) == (4, 3, 1)
    (row,) = stored.races
    assert (row.course, row.seed, row.entrants) == ("figure8", 9, ("up", "[b]off"))
    assert (row.vehicle, row.laps_wanted, row.time) == ("swift, kingfisher", 1, None)
    assert row.outcome == f"0 of 2 finished, {raced.order[0].name} first"
    assert row.load().digest() == raced.digest()
    assert "race: up, [b]off" in str(stored)
    assert row.name in stored.by_name()
    assert [row.controller for row in stored.flights] == [None] * 3


def test_a_race_is_found_by_any_of_its_entrants(root, raced):
    for settings, races in (
        ({"vehicle": "king*"}, 1),
        ({"vehicle": "cpc"}, 0),
        ({"course": "figure8"}, 1),
        ({"seed": 9}, 1),
        ({"seed": 3}, 0),
        ({"outcome": "timeout"}, 1),
        ({"outcome": "finished"}, 0),
        ({"pilot": "*"}, 0),
    ):
        assert len(quadsim.runs(root, **settings).races) == races, settings


@pytest.mark.parametrize("content", [b"", b"{", b"{}", b"\xff", b'{"course": "x", "order": []}'])
def test_a_damaged_race_is_named_and_the_runs_are_listed(root, raced, content):
    folder = quadsim.runs(root).races[0].path
    (folder / "heat.json").write_bytes(content)
    runs = quadsim.runs(root)
    assert (len(runs), list(runs.damaged)) == (3, [folder])
    assert len(str(runs).splitlines()) == 1 + 3 + 1


OTHERS = {
    "course": lambda record: record.update(course="split_s_swift"),
    "seed": lambda record: record["spec"].update(seed=77),
    "the name of an entrant": lambda record: record["spec"]["entrants"][0].update(name="EVIL"),
    "the order of the entrants": lambda record: record["spec"]["entrants"].reverse(),
    "the order of the runs": lambda record: record["runs"].reverse(),
    "a run twice": lambda record: record.update(runs=[record["runs"][0]] * 2),
    "the winner's name": lambda record: record["order"][0].update(name="EVIL"),
    "the winner's time": lambda record: record["order"][0].update(time=1.0),
    "the winner's outcome": lambda record: record["order"][0].update(outcome="finished"),
    "a placing that lacks": lambda record: record["order"].pop(),
    "no entrants": lambda record: record.update(
        order=[], runs=[], spec={"seed": 9, "entrants": []}
    ),
}


@pytest.mark.parametrize("changed", OTHERS)
def test_a_list_does_not_believe_a_race_whose_runs_say_something_else(root, raced, changed):
    folder = quadsim.runs(root).races[0].path
    record = json.loads((folder / "heat.json").read_text())
    OTHERS[changed](record)
    (folder / "heat.json").write_text(json.dumps(record))
    runs = quadsim.runs(root)
    assert (len(runs), runs.races) == (3, [])
    (problem,) = runs.damaged.values()
    assert "EVIL" not in str(runs).splitlines()[1]
    assert "heat.json" in problem
    assert "changed after the race" in problem


def test_the_command_lists_names_that_other_commands_take(root, raced, capsys):
    flags = ["--runs-dir", str(root)]
    assert race(["runs", *flags]) == 0
    lines = capsys.readouterr().out.splitlines()
    names = [line.split()[0] for line in lines[1:]]
    assert names == sorted(path.name for path in root.iterdir())
    (heat,) = [name for name in names if "_heat_" in name]
    assert race(["show", heat, *flags]) == 0
    capsys.readouterr()
    assert race(["runs", *flags, "--vehicle", "kingfisher", "--json"]) == 0
    shown = json.loads(capsys.readouterr().out)
    assert [row["name"] for row in shown["runs"]] == [heat]
    assert race(["runs", *flags, "--seed", "77"]) == 0
    assert "no stored run matches" in capsys.readouterr().out


def test_a_controller_of_ones_own_is_named_in_place_of_a_sampler(tmp_path):
    quadsim.fly("figure8", controller=Climb(), laps=1, timeout=0.05).save(tmp_path)
    (row,) = quadsim.runs(tmp_path)
    assert (row.controller, row.flown_by, row.sampler) == ("Climb", "controller Climb", "Climb")
    assert "controller Climb" in str(quadsim.runs(tmp_path))
    assert "_figure8_Climb_s0_" in row.name


def test_a_controller_of_ones_own_counts_as_no_sampler(root, raced, capsys):
    """It was listed as "colored"."""
    quadsim.fly("figure8", controller=Climb(), laps=1, timeout=0.05, seed=7).save(root)
    assert seeds(quadsim.runs(root, sampler="colored")) == [3, 4, 5]
    assert seeds(quadsim.runs(root, controller="Cl*")) == [7, 9]
    assert seeds(quadsim.runs(root, sampler="Climb")) == [7, 9]
    assert quadsim.runs(root, controller="PID").races == []
    assert race(["runs", "--controller", "Climb", "--runs-dir", str(root)]) == 0
    lines = capsys.readouterr().out.splitlines()[1:]
    assert sorted("_heat_" in line for line in lines) == [False, True]


def test_an_entrant_without_a_name_is_called_by_its_controller():
    spec = quadsim.Spec.of("figure8", controller=Climb(), laps=1)
    made, _ = line_up("figure8", [{"controller": Climb}, spec], {"laps": 1})
    assert [one.name for one in made] == ["Climb", "Climb 2"]
    assert repr(spec).startswith("<Spec figure8: 1 lap, Climb, preset race")
    assert spec.sampler == spec.record()["sampler"] == "colored"


def export(root, *words):
    """Run `race export` on the runs of a folder, and return its exit code."""
    return race(["export", *words, "--runs-dir", str(root)])


def test_a_race_is_read_back_from_its_zip(root, raced, tmp_path, monkeypatch, capsys):
    """The zip had the runs alone: entrants, places and rules were lost."""
    monkeypatch.chdir(tmp_path)
    (name,) = [row.name for row in quadsim.runs(root).races]
    assert export(root, "last", "--zip") == 0
    assert capsys.readouterr().out.strip() == f"{name}.zip"
    with zipfile.ZipFile(f"{name}.zip") as archive:
        archive.extractall("elsewhere")
    assert race(["show", "last", "--runs-dir", "elsewhere"]) == 0
    assert "2 entrants, rules elimination" in capsys.readouterr().out
    stored = quadsim.load_heat("last", "elsewhere")
    assert stored.digest() == raced.digest()
    parts = {entrant: {"controller": Climb()} for entrant in stored.names}
    assert quadsim.race(stored.spec, parts=parts).digest() == raced.digest()


def test_a_damaged_race_is_not_handed_on(root, raced, tmp_path, capsys):
    folder = quadsim.runs(root).races[0].path
    (folder / "heat.json").write_text("{}")
    assert export(root, str(folder), "--zip", "--out", str(tmp_path / "x.zip")) == 2
    assert "heat.json: damaged" in capsys.readouterr().err
    assert not (tmp_path / "x.zip").exists()


def test_files_of_two_races_have_the_names_of_the_races(root, raced, tmp_path, monkeypatch, capsys):
    """Both were written as 1_up.csv, the second over the first."""
    monkeypatch.chdir(tmp_path)
    raced.save(root)
    one, other = (row.path for row in quadsim.runs(root).races)
    for folder in (one, other, one / "1_up"):
        assert export(root, str(folder), "--csv") == 0
    written = capsys.readouterr().out.split()
    assert written == [f"{one.name}.csv", f"{other.name}.csv", f"{one.name}_1_up.csv"]
    assert race(["plot", str(one / "1_up"), "--out", "figures"]) == 0
    assert f"figures/{one.name}_1_up.png" in capsys.readouterr().out.split()
    # within one table or zip, too, the runs can be told apart
    assert export(root, str(one), str(other), "--csv", "--out", "both.csv") == 0
    names = [f"{folder.name}_{run}" for folder in (one, other) for run in ("1_up", "2_-b-off")]
    rows = csv.DictReader(Path("both.csv").read_text().splitlines())
    assert list(dict.fromkeys(row["run"] for row in rows)) == names
    runs = [str(folder / "1_up") for folder in (one, other)]
    assert export(root, *runs, "--zip", "--out", "two.zip") == 0
    with zipfile.ZipFile("two.zip") as archive:
        folders = {file.partition("/")[0] for file in archive.namelist()}
    assert folders == {f"{folder.name}_1_up" for folder in (one, other)}


@pytest.mark.parametrize("out", [None, "keep.csv"])
def test_an_export_never_writes_over_a_file(out, root, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    row = quadsim.runs(root)[0]
    file = Path(out or f"{row.name}.csv")
    file.write_text("kept")
    assert export(root, row.name, "--csv", *(["--out", out] if out else [])) == 2
    wanted = "expected the name of a new file, got one that exists: name another, or remove it"
    assert capsys.readouterr().err == f"race export: {str(file)!r}: {wanted}\n"
    assert file.read_text() == "kept"
