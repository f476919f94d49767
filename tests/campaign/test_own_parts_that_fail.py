"""A part of the user's own that fails costs its own attempts, and says which they are."""

import re
import sys
from pathlib import Path

import pytest

import quadsim
from quadsim.campaign.variants import expect_importable
from quadsim.config.spec import Spec
from quadsim.files.values import SettingError
from quadsim.record.run import RunError

FILE = Path(__file__).name


class Level:
    """A controller that holds the attitude, until it fails."""

    def __init__(self, fails_at=None):
        self.calls = 0
        self.fails_at = fails_at

    def control(self, x):
        self.calls += 1
        if self.calls == self.fails_at:
            raise ZeroDivisionError("division by zero")
        return (0.0, 0.0, 0.0, 9.81)


def compared(**controllers):
    variants = {name: {"controller": controller} for name, controller in controllers.items()}
    return quadsim.compare("figure8", variants, attempts=2, laps=1, timeout=0.2)


def test_an_attempt_whose_controller_raises_is_a_row_and_the_others_go_on():
    found = compared(fails=Level(fails_at=5), level=Level())
    outcomes = [(attempt.variant, attempt.outcome) for attempt in found.attempts]
    assert outcomes == [("fails", "crashed")] * 2 + [("level", "timeout")] * 2
    faults = {row.result["fault"] for rows in found.sections[0].rows for row in rows}
    (fault,) = faults - {None}
    assert re.fullmatch(rf"ZeroDivisionError: division by zero \({FILE}, line \d+\)", fault)


def test_a_controller_that_raises_at_once_is_one_line_with_the_seed():
    with pytest.raises(RunError, match="seed 0: ZeroDivisionError: division by zero"):
        compared(fails=Level(fails_at=1))


def test_a_part_of_a_notebook_is_refused_where_workers_fly(monkeypatch):
    spec = Spec.of("figure8", controller=Level())
    monkeypatch.setattr(sys.modules["__main__"], "__file__", "script.py", raising=False)
    monkeypatch.setattr(Level, "__module__", "__main__")
    expect_importable(spec)  # a script: workers read it again
    monkeypatch.delattr(sys.modules["__main__"], "__file__")
    with pytest.raises(SettingError, match="expected a controller that workers can import"):
        expect_importable(spec)
