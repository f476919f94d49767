"""Completion: what the shell proposes in the place of the last word."""

import os
import subprocess
import sys
from pathlib import Path
from shutil import which

import pytest

from quadsim.cli.cli import COMMANDS, race
from quadsim.cli.completion import COMPLETE, SHELLS
from quadsim.cli.flags import flag, flight_settings

PROPOSED = {  # typed so far -> some of what is proposed
    "fl": {"fly"},
    "fly ": {"split_s_swift", "figure8"},
    "fly split_s_": {"split_s_swift", "split_s_song"},
    "fly --vehicle ": {"swift", "kingfisher"},
    "fly --vehicle sw": {"swift", "swift_40ms"},
    "fly paper_flat --preset ": {"paper", "race"},
    "fly --sampler c": {"colored"},
    "fly --law ": {"exact", "paper", "library"},
    "fly --smooth split_s_sw": {"split_s_swift"},
    "compare --variants gau": {"gaussian"},
    "web --course fig": {"figure8"},
    "check kingf": {"kingfisher"},
    "paper tab": {"table2"},
    "show ": {"last", "20261120T133511Z_figure8"},
    "export last 2026": {"20261120T133511Z_figure8"},
    "plot --runs-dir empty ": {"last"},
    "--completion z": {"zsh"},
    "fly --seed ": set(),
    "fly mine": set(),
    "flight ": set(),
}
EXACT = {
    "fly split_s_",
    "fly --vehicle sw",
    "fly --sampler c",
    "fly --smooth split_s_sw",
    "plot --runs-dir empty ",
}


@pytest.fixture(autouse=True)
def stored(tmp_path, monkeypatch):
    """One stored run, by its name."""
    (tmp_path / "runs" / "20261120T133511Z_figure8").mkdir(parents=True)
    (tmp_path / "runs" / "20261120T133511Z_figure8" / "run.json").write_text("{}")
    monkeypatch.chdir(tmp_path)


def proposed(typed, capsys):
    assert race([COMPLETE, *typed.split(" ")]) == 0
    said = capsys.readouterr()
    assert said.err == ""
    return set(said.out.splitlines())


@pytest.mark.parametrize("typed", PROPOSED)
def test_names_of_what_there_is_are_proposed(typed, capsys):
    found, wanted = proposed(typed, capsys), PROPOSED[typed]
    assert found == wanted if typed in EXACT or not wanted else found >= wanted


@pytest.mark.parametrize("command", COMMANDS)
def test_flags_of_every_command_are_proposed(command, capsys):
    found = proposed(f"{command} --", capsys)
    assert race([command, "--help"]) == 0
    shown = capsys.readouterr().out
    assert [name for name in found if name not in shown] == []
    if command == "fly":
        assert found >= {flag(name) for name in flight_settings(())}


def test_flags_are_those_of_what_the_words_ask_for(capsys):
    assert "--gamma" not in proposed("fly --sampler gaussian --", capsys)
    assert "--gamma" in proposed("fly --sampler colored --", capsys)
    assert "--gamma" in proposed("fly --system nothing --", capsys)


ASKED = {  # shell -> how it is asked, once the script has been read
    "bash": 'COMP_WORDS=(race fly split_s_sw); COMP_CWORD=2; _race; printf "%s\\n" "${COMPREPLY[@]}"',
    "zsh": 'compadd() { print -rl -- "${(@P)2}" }; words=(race fly split_s_sw); CURRENT=3; _race',
    "fish": "complete -C 'race fly split_s_sw'",
}
BEFORE = {"zsh": "compdef() { }"}  # which is there in a shell that completes


@pytest.mark.parametrize("shell", SHELLS)
def test_a_shell_completes_with_the_printed_script(shell, capsys):
    if not which(shell):
        pytest.skip(f"{shell} is not installed")
    assert race(["--completion", shell]) == 0
    text = "\n".join([BEFORE.get(shell, ""), capsys.readouterr().out, ASKED[shell]])
    path = f"{Path(sys.executable).parent}:{os.environ['PATH']}"
    done = subprocess.run(
        [shell, "-c", text],
        capture_output=True,
        text=True,
        check=True,
        env=os.environ | {"PATH": path},
    )
    assert done.stdout.split() == ["split_s_swift"]


@pytest.mark.parametrize("shell", SHELLS)
def test_every_shell_has_a_script_that_asks_race(shell, capsys):
    assert race(["--completion", shell]) == 0
    assert f"race {COMPLETE}" in capsys.readouterr().out
