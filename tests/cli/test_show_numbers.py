"""`race show --numbers` prints the numbers that follow from the flight, with their laws."""

import json

import pytest

from quadsim.cli.cli import race
from tests.small import SHORT, flags


@pytest.mark.compiled
def test_the_derived_numbers_of_a_run_are_printed_with_their_laws(tmp_path, capsys):
    folder = ["--runs-dir", str(tmp_path)]
    race(["fly", "figure8", *flags(SHORT), *folder])
    capsys.readouterr()
    assert race(["show", "last", "--numbers", *folder]) == 0
    printed = " ".join(capsys.readouterr().out.split())
    assert "40, given; law: 100" in printed
    assert "3.3 sqrt(leg 9.3 m" in printed
    assert race(["show", "last", "--numbers", "--json", *folder]) == 0
    found = {number["name"]: number["value"] for number in json.loads(capsys.readouterr().out)}
    assert (found["horizon"], found["samples"]) == (100, 1024)
