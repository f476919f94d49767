"""A campaign whose workers are jobs of Slurm: a job that is lost costs nothing but its time."""

import signal
import time
from collections import Counter
from importlib.util import find_spec
from pathlib import Path

import pytest

# Without an import of dask_jobqueue, which replaces the handler of Ctrl-C
if find_spec("dask_jobqueue") is None:
    pytest.skip("the extra cluster is not installed", allow_module_level=True)

import dask

from quadsim.campaign.run.pool import open_pool, run_all, slurm_cluster
from quadsim.cli.cli import race
from tests.campaign.fake_slurm import FakeSlurm
from tests.campaign_cases import FLIGHT, LoggedJob, logged_moment

# A scheduler and its workers take seconds to start.
pytestmark = pytest.mark.regression
JOBS = 60
ROOT = Path(__file__).parents[2]


@pytest.fixture
def slurm(tmp_path, monkeypatch):
    """Commands of a Slurm that runs its jobs here, on the loopback only."""
    folder = tmp_path / "slurm"
    folder.mkdir()
    monkeypatch.setenv("PATH", str(folder), prepend=":")
    # The workers import tests.campaign_cases.
    monkeypatch.setenv("PYTHONPATH", str(ROOT))
    monkeypatch.chdir(tmp_path)
    options = {"scheduler-options": {"host": "127.0.0.1"}, "interface": "lo"}
    with dask.config.set({f"jobqueue.slurm.{key}": value for key, value in options.items()}):
        fake = FakeSlurm(folder)
        yield fake
        for job in fake.running():
            fake.kill(job)


def wait_for(condition):
    """Wait until a condition is true, at most 20 s."""
    end = time.monotonic() + 20.0
    while not condition():
        assert time.monotonic() < end, "timeout"
        time.sleep(0.05)


def test_the_cluster_of_slurm_leaves_ctrl_c_alone():
    slurm_cluster()
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_a_killed_job_loses_nothing_and_is_submitted_again(slurm, tmp_path, monkeypatch):
    monkeypatch.setattr("quadsim.campaign.run.pool.RESUBMIT", 0.2)
    log = tmp_path / "log"
    finished = []
    with (
        dask.config.set({"distributed.deploy.lost-worker-timeout": "200ms"}),
        open_pool(2, "slurm") as pool,
    ):
        wait_for(lambda: pool.size == 2)
        for _, answer in run_all(pool, logged_moment, [LoggedJob(n, log) for n in range(JOBS)]):
            finished.append(answer)
            if len(finished) == JOBS // 3:
                slurm.kill(slurm.jobs()[0])
            if len(finished) == JOBS - 1:
                wait_for(lambda: len(slurm.jobs()) == 3)
    assert sorted(finished) == [*range(JOBS)]
    # Answers that were on their way from the killed worker are lost; earlier answers are not.
    ended = Counter(map(int, log.read_text().split()))
    assert all(ended[job] == 1 for job in finished[: JOBS // 6])
    assert ended.total() < JOBS + JOBS // 6
    wait_for(lambda: not slurm.running())


def test_a_job_that_slurm_refuses_is_one_line(slurm, tmp_path, capsys):
    refuses = "#!/bin/sh\necho 'sbatch: error: Invalid account' >&2\nexit 1\n"
    (slurm.folder / "sbatch").write_text(refuses)
    flags = ["--campaign", str(tmp_path / "c.sqlite"), "--scheduler", "slurm", "--jobs", "2"]
    assert race(["compare", *FLIGHT, *flags]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "Slurm refuses the job: sbatch: error: Invalid account" in line
