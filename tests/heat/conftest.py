"""A race of two on a short course, which several files read."""

import pytest

from quadsim.heat.line_up import line_up
from quadsim.heat.spec import HeatSpec
from quadsim.results.heat import fly_heat
from tests.small import SMALL

# A course that is flown in two seconds, with gates so wide that a small planner flies it
TWO_GATES = """\
opening: [4, 4]
start: {position: [0, 0, 3], yaw_deg: 0}
gates:
  - {position: [4, 0, 3], yaw_deg: 0}
  - {position: [8, 0, 3], yaw_deg: 0}
"""


@pytest.fixture(scope="session")
def two_gates(tmp_path_factory):
    """Return the file of a short course."""
    file = tmp_path_factory.mktemp("courses") / "two_gates.yaml"
    file.write_text(TWO_GATES)
    return str(file)


@pytest.fixture(scope="session")
def raced(two_gates):
    """Return a race of two entrants with settings of their own, with disturbances."""
    entrants = ["fast=colored+margin=.2", "gaussian+expect=velocity"]
    made, of_race = line_up(two_gates, entrants, {**SMALL, "randomize": 1})
    return fly_heat(HeatSpec(made, of_race, seed=5))


@pytest.fixture(scope="session")
def stored(raced, tmp_path_factory):
    """Return the folder of that race on the disk."""
    return raced.save(tmp_path_factory.mktemp("races"))
