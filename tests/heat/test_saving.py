"""Races that are being saved while other processes clean up the folder of runs."""

import subprocess
import sys
import textwrap
from pathlib import Path

import pytest

from quadsim.heat.archive import list_heats
from quadsim.record.archive import ClaimedFolder, remove_unfinished

# A process that saves a race without vehicles, and stops in the middle of it.
SAVES = """
    import sys
    from types import SimpleNamespace
    from quadsim.heat import archive

    def pause(path, data):
        print("writing", flush=True)
        sys.stdin.readline()
        path.write_bytes(data)

    archive.write_whole = pause
    archive._json = lambda *of_heat: b"{}"
    archive.heat_name = lambda heat, record: "20260101T000000Z_figure8_heat_s0_00000000"
    archive.save_heat(SimpleNamespace(names=()), {}, (), sys.argv[1])
"""


@pytest.mark.process
def test_a_race_that_is_being_saved_is_not_taken_for_unfinished(tmp_path):
    saving = subprocess.Popen(
        [sys.executable, "-c", textwrap.dedent(SAVES), str(tmp_path)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    with saving:
        assert saving.stdout.readline() == "writing\n"
        remove_unfinished(tmp_path)  # as every flight does at its start
        saving.communicate("\n", timeout=60)
    assert saving.returncode == 0
    assert [heat.name for heat in list_heats(tmp_path)] == [
        "20260101T000000Z_figure8_heat_s0_00000000"
    ]


@pytest.mark.process
def test_a_race_whose_process_was_killed_is_removed(tmp_path):
    saving = subprocess.Popen(
        [sys.executable, "-c", textwrap.dedent(SAVES), str(tmp_path)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    with saving:
        assert saving.stdout.readline() == "writing\n"
        saving.kill()
    assert [path.suffix for path in tmp_path.iterdir()] == [".part"]
    remove_unfinished(tmp_path)
    assert list(tmp_path.iterdir()) == []


def test_two_folders_of_one_name_are_told_apart(tmp_path):
    name = "20260101T000000Z_figure8"
    with ClaimedFolder.open(tmp_path, name) as first, ClaimedFolder.open(tmp_path, name) as second:
        (first.part / "a").touch()
        (second.part / "a").touch()
        assert [Path(folder.finish()).name for folder in (first, second)] == [name, f"{name}-2"]
