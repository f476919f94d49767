"""Flights that all tests of campaigns share."""

import shutil

import pytest

from quadsim.campaign.run.attempt import Flown
from quadsim.campaign.run.runner import Runner
from quadsim.record.provenance import this_provenance
from quadsim.record.run import RecordedRun
from tests.campaign_cases import specs, variant
from tests.run_cases import frame

SEEDS = 3


@pytest.fixture(scope="session")
def flown():
    """One attempt without a planner, three control periods long: (spec, Flown)."""
    (spec,) = specs(1)
    frames = [frame(0), frame(1), frame(2, outcome="timeout")]
    return spec, Flown(RecordedRun.from_frames(spec.record(), frames), this_provenance(), None)


@pytest.fixture(scope="session")
def _flown_campaign(tmp_path_factory):
    path = tmp_path_factory.mktemp("campaign") / "c.sqlite"
    with Runner(path, jobs=0) as runner:
        runner([variant("gaussian"), variant("colored")], SEEDS)
    return path


@pytest.fixture
def campaign(_flown_campaign, tmp_path):
    """A copy of a campaign of FLIGHT with both samplers and the seeds 0 to 2; it is compiled."""
    shutil.copytree(_flown_campaign.parent, tmp_path, dirs_exist_ok=True)
    return tmp_path / "c.sqlite"
