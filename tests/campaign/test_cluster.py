"""The same campaign on a Dask cluster: same runs, and a killed worker loses nothing."""

import os
import signal
import time
from threading import Thread

import pytest

distributed = pytest.importorskip("distributed", reason="extra 'cluster'")

from quadsim.campaign.run.runner import Runner  # noqa: E402
from quadsim.cli.cli import race  # noqa: E402
from tests.campaign_cases import FLIGHT, seeds_flown, variant  # noqa: E402

# A scheduler and its workers take seconds to start.
pytestmark = pytest.mark.regression
SAMPLERS = ("colored", "gaussian")


@pytest.fixture(scope="module")
def cluster():
    """A scheduler and two worker processes of one thread each, watched by nannies that start anew
    what dies."""
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, dashboard_address=None
    ) as cluster:
        yield cluster


def fly(campaign, attempts, **workers):
    with Runner(campaign, **workers) as runner:
        return runner([variant(sampler) for sampler in SAMPLERS], attempts)


def kill_one_when(cluster, campaign, rows):
    """SIGKILL a worker once the campaign holds `rows` attempts."""
    while len(seeds_flown(campaign)) < rows:
        time.sleep(0.01)
    pid = next(iter(cluster.workers.values())).pid
    os.kill(pid, signal.SIGKILL)


def test_every_attempt_is_there_once_although_a_worker_is_killed(cluster, tmp_path):
    campaign = tmp_path / "c.sqlite"
    killer = Thread(target=kill_one_when, args=(cluster, campaign, 3))
    killer.start()
    rows = fly(campaign, 6, scheduler=cluster.scheduler_address)
    killer.join()
    assert [[row.seed for row in of_variant] for of_variant in rows] == [[*range(6)]] * 2
    assert len(seeds_flown(campaign)) == 12


def test_a_cluster_flies_the_same_runs_as_this_machine(cluster, campaign):
    here = fly(campaign, 2, jobs=0)
    there = fly(campaign.with_name("there.sqlite"), 2, scheduler=cluster.scheduler_address)
    digests = [
        [[row.result["digest"] for row in of_variant] for of_variant in rows]
        for rows in (here, there)
    ]
    assert digests[0] == digests[1]


def test_a_missing_scheduler_is_one_line(tmp_path, capsys):
    flags = ["--campaign", str(tmp_path / "c.sqlite"), "--scheduler", "tcp://127.0.0.1:1"]
    assert race(["compare", *FLIGHT, *flags]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "tcp://127.0.0.1:1" in line
