"""The same campaign on a Dask cluster: same runs, and a killed worker loses nothing."""

import json
import os
import signal
import time
from threading import Thread

import pytest

distributed = pytest.importorskip("distributed", reason="extra 'cluster'")

from quadsim.cli.cli import race  # noqa: E402
from tests.campaign_cases import FLIGHT, seeds_flown  # noqa: E402


@pytest.fixture(scope="module")
def cluster():
    """A scheduler and two worker processes of one thread each, watched by nannies that start anew
    what dies."""
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, dashboard_address=None
    ) as cluster:
        yield cluster


def compare(campaign, *argv, attempts=12):
    argv = [
        "compare",
        *FLIGHT,
        "--attempts",
        str(attempts),
        "--campaign",
        str(campaign),
        "--json",
        *argv,
    ]
    return race(argv)


def kill_one_when(cluster, campaign, rows):
    """SIGKILL a worker once so many attempts are kept."""
    while len(seeds_flown(campaign)) < rows:
        time.sleep(0.01)
    pid = next(iter(cluster.workers.values())).pid
    os.kill(pid, signal.SIGKILL)


def test_every_attempt_is_there_once_although_a_worker_is_killed(cluster, tmp_path, capsys):
    campaign = tmp_path / "c.sqlite"
    killer = Thread(target=kill_one_when, args=(cluster, campaign, 3))
    killer.start()
    assert compare(campaign, "--scheduler", cluster.scheduler_address) == 0
    killer.join()
    assert [row[:2] for row in seeds_flown(campaign)] == [
        (s, i) for s in ("colored", "gaussian") for i in range(12)
    ]
    said = json.loads(capsys.readouterr().out)
    assert [a["attempts"] for a in said["variants"]] == [12, 12]


def test_a_cluster_flies_the_same_runs_as_this_machine(cluster, tmp_path, capsys):
    said = []
    for name, where in (
        ("here", ["--jobs", "1"]),
        ("there", ["--scheduler", cluster.scheduler_address]),
    ):
        assert compare(tmp_path / f"{name}.sqlite", *where, attempts=2) == 0
        variants = json.loads(capsys.readouterr().out)["variants"]
        said.append([{k: v for k, v in a.items() if k != "plan_ms"} for a in variants])
    assert said[0] == said[1]


def test_no_scheduler_is_one_line(tmp_path, capsys):
    assert compare(tmp_path / "c.sqlite", "--scheduler", "tcp://127.0.0.1:1") == 2
    said = capsys.readouterr().err
    assert "--scheduler: no Dask scheduler at 'tcp://127.0.0.1:1'" in said
    assert "Traceback" not in said
