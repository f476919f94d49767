"""The `race` command: what a user can do wrong is one line and exit code 2; what flies leaves a run
behind."""

import json
import os
import subprocess
from pathlib import Path

import pytest
from matplotlib.figure import Figure

from quadsim.cli.cli import race
from quadsim.cli.fly import BLACKBOX, _save
from quadsim.cli.regress import flags_text
from quadsim.config.checks import expect_new_log
from quadsim.config.spec import Spec
from quadsim.files.values import SettingError
from quadsim.record.archive import RunFolder, read_run
from tests.campaign_cases import RACE
from tests.run_cases import save, two_laps
from tests.small import SHORT, SMALL, flags

FLY = ["fly", "mine.yaml", *flags(SHORT)]
COURSE = """opening: [1.5, 1.5]
start: {position: [0, 0, 2], yaw_deg: 0}
gates:
  - {position: [4, 0, 2], yaw_deg: 0}
"""


@pytest.fixture
def cwd(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine.yaml").write_text(COURSE)
    return tmp_path


def outcome(argv, capsys):
    """Exit code, stdout, stderr."""
    code = race(argv.split())
    said = capsys.readouterr()
    return code, said.out, said.err


# Command line -> what its one line begins with, after the command's name.
WRONG = {
    "cours": "no command 'cours': did you mean 'courses'?",
    "fly split_s_swfit": "no course 'split_s_swfit': did you mean 'split_s_swift'?",
    "fly xyzzy": "no course 'xyzzy'",
    "fly --plant-dt 1e-9": "--plant-dt: expected",
    "compare paper_flat --variants colred": "--variants: no sampler, preset or pilot 'colred'",
    "compare paper_flat --variants a\x07=colored": "--variants: expected",
    "compare paper_flat --campaign .": "'.': expected",
    "compare paper_flat --campaign=": "'.': expected",
    "results --campaigns .": "'.': expected",
    "results --campaigns /dev/null": "'/dev/null': expected",
    # Where nothing can be stored nothing is flown
    "heat mine.yaml --runs-dir /proc/x": "/proc/x: cannot write here",
    "heat mine.yaml --plot /proc/x/p.png": "/proc/x: cannot write here",
    "compare-heats mine.yaml --campaign /proc/x/c.sqlite": "/proc/x/c.report: cannot write here",
    "tune mine.yaml --out /proc/x/p.yaml": "/proc/x: cannot write here",
    "compare mine.yaml --out /proc/x/r": "/proc/x/r: cannot write here",
    "compare-heats mine.yaml --out /proc/x/r": "/proc/x/r: cannot write here",
    "heat mine.yaml --starts 2": "no flag --starts: use race compare-heats with --entrants",
    "compare mine.yaml --line-up colored": "no flag --line-up: use race compare-heats with",
    "compare mine.yaml --starts 2": "no flag --starts",
    "compare-heats mine.yaml --attempts 2": "no flag --attempts",
    "compare-heats mine.yaml --variants nonsense": "--variants: no sampler, preset or pilot",
    "compare-heats mine.yaml --threads 2": "--threads: races fly on one thread each; set --jobs",
    "paper noise --runs-dir /proc/x": "/proc/x/paper: cannot write here",
    "fly mine.yaml --runs-dir=": "--runs-dir: expected text that is not empty, got ''",
    "heat mine.yaml --runs-dir=": "--runs-dir: expected text that is not empty, got ''",
    "show last --runs-dir=": "--runs-dir: expected text that is not empty, got ''",
    "fly mine.yaml --blackbox=": "--blackbox: expected text that is not empty, got ''",
    "check no\x1b[2J.yaml": "no\\x1b[2J.yaml: no such file",
    "fly --vehicle swft": "no vehicle 'swft': did you mean 'swift'?",
    "fly --sampler colred": "--sampler: no sampler 'colred': did you mean 'colored'?",
    "fly --preset rac": "no preset 'rac': did you mean 'race'?",
    "fly --preset none.yaml": "none.yaml: no such file",
    "fly none.yaml": "none.yaml: no such file",
    "fly /dev/zero": "/dev/zero: expected",
    "fly --sampels 3": "no flag --sampels: did you mean '--samples'?",
    "fly --rate-tau 1": "no flag --rate-tau: did you mean '--model-rate-tau'?",
    "fly --sigma -0.3 1 1 1": "--sigma: expected",
    "fly --sigma 1 1": "--sigma: expected",
    "fly --sigma 1 1 x 1": "--sigma: expected",
    "fly --sigma=1 1": "--sigma: expected",
    "fly --horizon 1": "--horizon: expected",
    "fly --samples 1": "--samples: expected",
    "fly --samples 1e3": "--samples: expected",
    "fly --samples=-5": "--samples: expected",
    "fly --samples=": "--samples: expected",
    "fly --samples 1000000 --horizon 10000": "--samples: expected",
    "fly --temperature 0": "--temperature: expected",
    "fly --target-ess nan": "--target-ess: expected",
    "fly --target-ess 5000": "--target-ess: expected",
    "fly --dt 0.0033": "--dt: expected",
    "fly --dt": "--dt: expected",
    "fly --law exat": "--law: expected",
    "fly --laps 0": "--laps: expected",
    "fly --laps None": "--laps: expected",
    "fly mine.yaml --laps 2": "mine: expected 1 lap",
    "fly --timeout inf": "--timeout: expected",
    "fly --seed -1": "--seed: expected",
    "fly --seed 1 --seed 2": "--seed: expected",
    "fly --threads 1000": "--threads: expected",
    "fly --threads x": "--threads: expected",
    "fly --model-thrust-max 5": "--model-thrust-max: expected",
    "fly --model-rate-tau 1 1": "--model-rate-tau: expected",
    "fly --smooth --no-smooth": "--no-smooth: expected",
    "fly --smooth=maybe": "--smooth: expected",
    "fly --sampler": "--sampler: expected",
    "fly --sampler nowhere:S": "--sampler: expected",
    "fly --gamma 1 1 1 1 --sampler gaussian": "--gamma: it is a setting of colored sampling only",
    "fly --off-path 1": "--off-path: it is a setting of ReferenceWeights only",
    "fly --system offroad": "no flag --system",
    "fly mine.yaml split_s_swift": "unexpected 'split_s_swift'",
    "web figure8": "'figure8': expected a stored run, got a course: use --course figure8",
    "show": "no runs in 'runs'",
    "show nowhere/x": "nowhere/x: expected",
    "plot last": "no runs in 'runs'",
    "check": "expected one FILE",
    "check swif": "swif: no such file",
    "compare mine.yaml --threads 2": "--threads: ",
    "--completion basic": "--completion: expected",
}


@pytest.mark.slow
def test_every_mistake_is_one_line_and_exit_code_2(cwd, capsys):
    wrong = {}
    for argv, expected in WRONG.items():
        code, out, err = outcome(argv, capsys)
        # `race check` names the file first, as it checks several.
        problem = err if argv.startswith("check ") else err.partition(": ")[2]
        is_one_line = (code, out, err.count("\n")) == (2, "", 1)
        if not is_one_line or not problem.startswith(expected):
            wrong[argv] = (code, out, err)
    assert wrong == {}
    assert not (cwd / "runs").exists()


def test_the_log_of_another_flight_is_not_written_over(cwd, capsys):
    (cwd / "flight.bbl").write_bytes(b"another")
    command = "fly mine.yaml --flight-controller betaflight --blackbox flight.bbl"
    code, out, err = outcome(command, capsys)
    assert (code, out) == (2, "")
    assert err.startswith("race fly: --blackbox: expected a new file, of the log of this flight")
    assert (cwd / "flight.bbl").read_bytes() == b"another"
    with pytest.raises(SettingError, match="blackbox: expected a new file"):
        expect_new_log(cwd / "flight.bbl")


def test_the_folder_of_a_run_gets_a_copy_of_the_firmwares_log(cwd):
    run = two_laps(Spec.of("mine.yaml").record())
    (cwd / "flight.bbl").write_bytes(b"H Product:Blackbox")
    with RunFolder.open("runs", run.spec) as folder:
        assert _save(folder, run, "flight.bbl") is None
    assert (folder.path / BLACKBOX).read_bytes() == b"H Product:Blackbox"
    assert read_run(folder.path).digest() == run.digest()


@pytest.mark.compiled
def test_a_file_in_the_place_of_runs_is_seen_before_the_flight(cwd, capsys):
    (cwd / "runs").write_text("")
    for words, place in (([], "runs"), (["--runs-dir", "mine.yaml"], "mine.yaml")):
        code, out, err = outcome(" ".join([*FLY, *words]), capsys)
        assert (code, out) == (2, "")
        assert err.startswith(f"race fly: {place}: cannot make a folder for runs here")


def test_check_says_ok_or_where_it_is_wrong(cwd, capsys):
    (cwd / "bad.yaml").write_text(COURSE.replace("yaw_deg: 0}\n", "yaw_deg: north}\n"))
    code, out, err = outcome("check mine.yaml bad.yaml swift", capsys)
    assert code == 2
    assert "mine.yaml: ok, course: 1 gate," in out
    assert "swift.yaml: ok, vehicle" in out
    assert err.startswith("bad.yaml:2:39: start.yaw_deg: expected a number [deg], got 'north'\n")


def test_a_preset_file_is_as_strict_as_a_flag(cwd, capsys):
    (cwd / "p.yaml").write_text("base: race\nmppi: {samples: 1}\n")
    code, _, err = outcome("fly --preset p.yaml", capsys)
    assert (code, err) == (
        2,
        "race fly: p.yaml:2:17: mppi.samples: expected a whole number >= 2 and <= 1e+06, got 1\n",
    )


@pytest.mark.compiled
def test_an_unknown_course_flies_from_its_yaml_and_the_run_shows_the_same(cwd, capsys):
    words = ["fly", "mine.yaml", "--json", "--seed", "4", "--timeout", "3", *flags(SMALL)]
    code, out, err = outcome(" ".join(words), capsys)
    report = json.loads(out)
    assert (report["course"], report["seed"], report["preset"]) == ("mine", 4, "race")
    assert code == {"finished": 0, "crashed": 1, "timeout": 1}[report["outcome"]]
    assert {
        "laps",
        "gates",
        "events",
        "chatter",
        "plan_ms",
        "real_time_factor",
        "run_dir",
    } <= report.keys()
    assert "real time" not in err, "no live line where stderr is no terminal"
    assert json.loads(outcome("show last --json", capsys)[1]) == report
    assert outcome("show s4", capsys)[0] == 0


@pytest.mark.compiled
def test_a_full_disk_costs_the_run_but_not_its_report(cwd, capsys, monkeypatch):
    def full(fd):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("quadsim.record.archive.os.fsync", full)
    code, out, err = outcome(" ".join(FLY), capsys)
    assert code == 2
    assert "not stored" in out
    assert err.splitlines()[-1].endswith("No space left on device")
    monkeypatch.undo()
    assert outcome(f"show --runs-dir {cwd}/runs", capsys)[0] == 2, "nothing that looks finished"


def test_plot_writes_a_png_and_an_svg(cwd, capsys, monkeypatch):
    """The page that it writes is empty here: drawing takes a second a file."""
    monkeypatch.setattr("quadsim.figures.run_figure.draw", lambda *_: Figure())
    save(cwd / "runs", two_laps(Spec.of("mine.yaml").record()))
    code, out, _ = outcome("plot last --out pictures", capsys)
    png, svg = (Path(name).read_bytes() for name in out.split())
    assert code == 0
    assert png.startswith(b"\x89PNG")
    assert svg.rstrip().endswith(b"</svg>")
    code, out, _ = outcome("plot last --out one.pdf", capsys)
    assert (code, out) == (0, "one.pdf\n")
    assert Path("one.pdf").read_bytes().startswith(b"%PDF")


@pytest.mark.compiled
def test_flags_take_values_after_a_space_or_an_equals_sign(cwd, capsys):
    digests = []
    for words in (
        "--model-drag 0.2 --no-predict --sigma 1 1 .5 4e0",
        "--model-drag=0.2 --predict=false --sigma=1 1 .5 4",
    ):
        assert race([*FLY, *words.split(), "--json"]) == 1
        digests.append(json.loads(capsys.readouterr().out)["digest"])
    assert digests[0] == digests[1]


@pytest.mark.process
def test_a_reader_who_leaves_early_sees_no_traceback():
    read, write = os.pipe()
    os.close(read)
    command = [*RACE, "courses"]
    done = subprocess.run(command, stdout=write, stderr=subprocess.PIPE, text=True, check=False)
    os.close(write)
    assert (done.returncode, done.stderr) == (141, "")


@pytest.mark.process
@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no /dev/full on this system")
def test_a_full_disk_behind_stdout_is_one_line():
    command = [*RACE, "courses", "--json"]
    with open("/dev/full", "w") as full:
        done = subprocess.run(command, stdout=full, stderr=subprocess.PIPE, text=True, check=False)
    assert (done.returncode, done.stderr) == (2, "race courses: stdout: No space left on device\n")


def test_a_pipe_that_nobody_writes_to_does_not_hang(tmp_path, capsys):
    os.mkfifo(tmp_path / "pipe.yaml")
    for command in ("check", "fly", "regress"):
        code, _, err = outcome(f"{command} {tmp_path}/pipe.yaml", capsys)
        assert code == 2, command
        assert f"{tmp_path}/pipe.yaml: expected a YAML file" in err
        assert err.count("\n") == 1, command


def test_no_control_character_of_a_file_reaches_the_terminal(cwd, capsys):
    name = "a\x1b[2J\rb.yaml"
    (cwd / name).write_text(COURSE)
    assert race(["check", name]) == 0
    assert capsys.readouterr().out.startswith("a\\x1b[2Jb.yaml: ok, course")


def test_check_says_all_that_is_wrong_with_a_file(tmp_path, capsys):
    """It said one error at a time; what lies in wrong keys is said before what does not fit."""
    file = tmp_path / "c.yaml"
    wrong = COURSE.replace("opening", "openin").replace("yaw_deg", "yaw")
    file.write_text(wrong)
    code, _, err = outcome(f"check {file}", capsys)
    assert code == 2
    errors = [line for line in err.splitlines() if line.startswith(str(file))]
    assert len(errors) == len(set(errors)) == 2 * (1 + wrong.count("yaw:"))  # unknown and missing
    _, out, _ = outcome(f"check {file} --json", capsys)
    (found,) = json.loads(out)
    assert [found["error"], *(other["error"] for other in found["others"])] == errors


def test_the_flags_that_regress_adds_are_text():
    assert flags_text({"sigma": ("1", "2"), "preset": "p.yaml"}) == "--sigma 1 2 --preset p.yaml"


def test_check_refuses_a_preset_whose_vehicle_does_not_exist(tmp_path, capsys):
    (tmp_path / "p.yaml").write_text("base: race\nvehicle: swft\n")
    code, _, err = outcome(f"check {tmp_path}/p.yaml", capsys)
    assert code == 2
    assert err.startswith(f"{tmp_path}/p.yaml:2:10: vehicle: no vehicle 'swft'")


@pytest.mark.parametrize("text", ["? [1]\n: 2\n", "? {a: b}\n: 2\n", "[1]", "1", "[base, race]"])
def test_a_file_of_any_yaml_is_checked_in_one_line(text, tmp_path, capsys):
    (tmp_path / "p.yaml").write_text(text)
    code, out, err = outcome(f"check {tmp_path}/p.yaml", capsys)
    assert (code, out) == (2, "")
    assert err.startswith(f"{tmp_path}/p.yaml:1:")


NARROW = """opening: [1.5, 0.3]
start: {position: [0, 0, 2], yaw_deg: 0}
gates:
  - {position: [4, 0, 2], yaw_deg: 0}
"""


def test_a_course_is_checked_for_the_vehicles_beside_it(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "narrow.yaml").write_text(NARROW)
    # by itself, and for a small vehicle, it can be flown
    assert race(["check", "narrow.yaml"]) == 0
    assert race(["check", "narrow.yaml", "crazyflie"]) == 0
    capsys.readouterr()
    assert race(["check", "narrow.yaml", "crazyflie", "flightmare"]) == 2
    printed = capsys.readouterr()
    assert printed.err.startswith("narrow.yaml: for ")
    assert "flightmare" in printed.err
    assert "gates[0]" in printed.err
    assert printed.err.count("\n") == 1
    assert "crazyflie.yaml: ok" in printed.out
