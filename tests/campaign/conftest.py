"""Flights that all tests of campaigns share."""

import shutil

import pytest

from quadsim.campaign.attempt import fly_attempt
from quadsim.campaign.runner import Runner
from tests.campaign_cases import specs, variant

SEEDS = 3


@pytest.fixture(scope="session")
def flown():
    """One attempt: (spec, Flown)."""
    (spec,) = specs(1)
    return spec, fly_attempt(spec)


@pytest.fixture(scope="session")
def _flown_campaign(tmp_path_factory):
    path = tmp_path_factory.mktemp("campaign") / "c.sqlite"
    with Runner(path, jobs=0) as runner:
        runner([variant("gaussian"), variant("colored")], SEEDS)
    return path


@pytest.fixture
def campaign(_flown_campaign, tmp_path):
    """A copy of a campaign of FLIGHT with both samplers and the seeds 0 to 2."""
    shutil.copytree(_flown_campaign.parent, tmp_path, dirs_exist_ok=True)
    return tmp_path / "c.sqlite"
