"""An attempt whose worker is lost is flown again, once; no finished attempt is flown twice, none is
left out."""

import asyncio
import multiprocessing as mp
import os
import signal
import subprocess
import sys
from concurrent.futures import BrokenExecutor, CancelledError, Future
from threading import Lock, Timer

import pytest

from quadsim.campaign.run.pool import Cluster, Pool, Processes, _fetch, fly_all, open_pool, run_all
from quadsim.record.run import RunError
from tests.campaign_cases import after_a_moment, specs


class Scripted(Pool):
    """A pool that loses the worker of some seeds.

    `losses` says how often it does so for each seed. It also loses flights that run at that time.
    """

    lost = (BrokenExecutor,)
    window = 3

    def __init__(self, losses: dict[int, int]):
        self.losses, self.flown, self.lock = losses, [], Lock()
        self.running: list[tuple[Future, int]] = []

    def submit(self, fly, spec) -> Future:
        future: Future = Future()
        with self.lock:
            self.running.append((future, spec.seed))
            self.flown.append(spec.seed)
        Timer(0.02, self.finish).start()
        return future

    def finish(self):
        with self.lock:
            ended, self.running = self.running, []
        dead = [seed for _, seed in ended if self.losses.get(seed)]
        for seed in dead:
            self.losses[seed] -= 1
        for future, seed in ended:
            self.end(future, seed, dead)

    def end(self, future, seed, dead):
        if dead:
            future.set_exception(BrokenExecutor())
        else:
            future.set_result(seed)


def test_a_lost_attempt_is_flown_again_alone_and_those_beside_it_too():
    pool = Scripted({1: 1})
    finished = {spec.seed: flown for spec, flown in fly_all(pool, specs(6))}
    assert finished == {s: s for s in range(6)}
    assert max(map(pool.flown.count, range(6))) == 2


def test_an_attempt_that_always_loses_its_worker_is_given_up_and_costs_no_other_attempt():
    pool = Scripted({1: 99})
    finished = {spec.seed: flown for spec, flown in fly_all(pool, specs(6))}
    assert finished == {s: None if s == 1 else s for s in range(6)}
    assert pool.flown.count(1) == 2


def test_what_an_attempt_raises_is_raised():
    pool = Scripted({})
    pool.end = lambda future, *_: future.set_exception(ValueError("expected more"))
    with pytest.raises(RunError, match=r"seed \d: ValueError: expected more"):
        list(fly_all(pool, specs(3)))


@pytest.mark.regression
def test_killing_a_worker_in_mid_campaign_loses_nothing():
    finished = []
    with Processes(2) as pool:
        for job, answer in run_all(pool, after_a_moment, range(12)):
            finished.append((job, answer))
            if len(finished) == 2:
                os.kill(mp.active_children()[0].pid, signal.SIGKILL)
    assert sorted(finished) == [(job, job) for job in range(12)]
    assert not mp.active_children(), "no worker stays behind"


GUARDLESS = """
import quadsim
found = quadsim.compare("figure8", ("gaussian", "colored"), attempts=1, jobs=1, laps=1, samples=64)
print("flown", found.attempts)
"""


@pytest.mark.process
def test_a_script_without_a_main_guard_is_one_line_and_no_result(tmp_path):
    script = tmp_path / "script.py"
    script.write_text(GUARDLESS)
    done = subprocess.run([sys.executable, script], capture_output=True, text=True)
    assert done.returncode == 1
    assert done.stdout == ""
    (line,) = done.stderr.splitlines()
    assert "put what the script does below `if __name__" in line


@pytest.mark.process
def test_a_script_on_standard_input_is_refused_in_one_line():
    done = subprocess.run([sys.executable, "-"], input=GUARDLESS, capture_output=True, text=True)
    assert done.returncode == 1
    (line,) = done.stderr.splitlines()
    assert "workers cannot read the script <stdin>" in line


def test_a_scheduler_that_is_gone_is_one_line():
    cluster = Cluster.__new__(Cluster)
    cluster._address = "tcp://127.0.0.1:8786"
    gone = Future()
    gone.cancel()
    with pytest.raises(RunError, match=r"the Dask scheduler at tcp://127\.0\.0\.1:8786 is gone"):
        cluster.error_of(gone)


def test_a_worker_without_a_module_of_the_users_names_it():
    cluster = Cluster.__new__(Cluster)
    failed = Future()
    try:
        try:
            raise ModuleNotFoundError("No module named 'mine'", name="mine")
        except ModuleNotFoundError as missing:
            raise RuntimeError("Error during deserialization of the task graph.") from missing
    except RuntimeError as error:
        failed.set_exception(error)
    with pytest.raises(RunError, match="a worker has no module 'mine'") as found:
        cluster.error_of(failed)
    assert "\n" not in str(found.value)


class Finished:
    """A future of Dask that has ended with an answer or an error."""

    def __init__(self, answer=None, error=None):
        self.answer, self.error, self.released = answer, error, False

    def __await__(self):
        yield from ()
        if self.error is not None:
            raise self.error
        return self.answer

    def release(self):
        self.released = True


@pytest.mark.parametrize("error", [None, ValueError("no"), CancelledError()])
def test_a_worker_forgets_an_answer_that_has_arrived(error):
    flying, answer = Finished(3, error), Future()
    asyncio.run(_fetch(flying, answer))
    assert flying.released
    if error is None:
        assert answer.result() == 3
    elif isinstance(error, CancelledError):
        assert answer.cancelled()
    else:
        assert answer.exception() is error


def test_slurm_needs_a_number_of_jobs():
    with pytest.raises(RunError, match=r"scheduler slurm: expected the number of jobs beside it"):
        open_pool(None, "slurm")


def test_a_machine_without_slurm_is_one_line(monkeypatch, tmp_path):
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(RunError, match=r"expected a machine that submits jobs to Slurm, got one"):
        open_pool(2, "slurm")
