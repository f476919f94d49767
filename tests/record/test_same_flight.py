"""Two runs are the same flight only if all that was flown is the same, to the last bit."""

from dataclasses import replace

import numpy as np
import pytest

from quadsim.record.run import same_flight
from tests.run_cases import two_laps


def test_a_run_is_the_same_flight_as_its_copy():
    run = two_laps()
    copied = {name: column.copy() for name, column in run.telemetry.items()}
    assert same_flight(run, replace(run, telemetry=copied))


@pytest.mark.parametrize("name", ["px", "qw", "a_cmd", "passed"])
def test_one_bit_of_one_column_makes_another_flight(name):
    run = two_laps()
    column = run.telemetry[name].copy()
    column.view(np.uint8)[-1] ^= 1
    assert not same_flight(run, replace(run, telemetry=run.telemetry | {name: column}))
