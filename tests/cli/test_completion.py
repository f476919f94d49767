"""Completion: a shell that has read the script of `race --completion` proposes what may follow."""

import shutil
import subprocess

import pytest

from quadsim.cli.cli import race
from quadsim.course import course_names
from quadsim.record.archive import list_runs
from quadsim.sensing import sensing_names
from quadsim.vehicle import vehicle_names


def proposals(words, capsys):
    """Return what is proposed for the last of the words."""
    assert race(["__complete", *words]) == 0
    return [line.split("\t")[0] for line in capsys.readouterr().out.splitlines()]


def test_names_that_exist_are_proposed(capsys):
    for words, known in (
        (["fly", ""], course_names),
        (["compare", ""], course_names),
        (["fly", "--vehicle", ""], vehicle_names),
        (["fly", "--sensing", ""], sensing_names),
        (["limit", "--vehicle", ""], vehicle_names),
    ):
        assert set(known()) <= set(proposals(words, capsys)), words


def test_stored_runs_are_proposed(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "runs" / "one").mkdir(parents=True)
    (tmp_path / "runs" / "one" / "run.json").write_text("{}")
    runs = [run.name for run in list_runs("runs")]
    assert set(proposals(["show", ""], capsys)) >= {"last", *runs}


@pytest.mark.slow
@pytest.mark.parametrize("shell", ["zsh", pytest.param("fish", marks=pytest.mark.regression)])
def test_other_shells_have_a_script_too(shell, capsys):
    assert race(["--completion", shell]) == 0
    script = capsys.readouterr().out
    assert "race" in script
    assert "--temperature" in script


@pytest.mark.process
@pytest.mark.skipif(not shutil.which("bash"), reason="no bash here")
def test_bash_completes_with_the_script(tmp_path, capsys):
    race(["--completion", "bash"])
    (tmp_path / "race.bash").write_text(capsys.readouterr().out)
    ask = """
    source race.bash
    COMP_WORDS=(race fly --temper); COMP_CWORD=2; COMP_LINE="race fly --temper"
    _race; echo "${COMPREPLY[@]}"
    """
    answer = subprocess.run(["bash", "-c", ask], cwd=tmp_path, capture_output=True, text=True)
    assert "--temperature" in answer.stdout.split()
