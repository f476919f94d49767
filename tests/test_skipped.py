"""A test that every session skips is found, and one that some session runs is not."""

from types import SimpleNamespace

from tests.skipped import main, never_run, write_outcomes


def skipped(name, reason):
    return SimpleNamespace(nodeid=name, longrepr=("file.py", 1, f"Skipped: {reason}"))


def ran(name):
    return SimpleNamespace(nodeid=name)


def test_a_reason_that_every_session_shares_fails(tmp_path, capsys):
    nothing = tmp_path / "none"
    assert main(nothing) == 1
    shared = skipped("tests/a.py::one", "no torch")
    browser = skipped("tests/b.py::two", "no browser")
    write_outcomes(tmp_path, {"skipped": [shared, browser], "passed": [ran("tests/c.py::three")]})
    write_outcomes(tmp_path, {"skipped": [shared], "failed": [ran("tests/b.py::two")]})
    capsys.readouterr()
    assert main(tmp_path) == 1
    assert capsys.readouterr().out == "1 skipped by every part: no torch: tests/a.py::one\n"
    write_outcomes(tmp_path, {"passed": [ran("tests/a.py::one")]})
    assert main(tmp_path) == 0


def test_a_file_that_is_skipped_as_a_whole_counts_until_one_of_its_tests_runs(tmp_path):
    write_outcomes(tmp_path, {"skipped": [skipped("tests/a.py", "no torch")]})
    assert never_run(tmp_path) == {"tests/a.py": "no torch"}
    write_outcomes(tmp_path, {"passed": [ran("tests/a.py::one")]})
    assert never_run(tmp_path) == {}
