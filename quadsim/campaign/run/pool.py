"""Pools fly attempts: in this process, in worker processes, with Dask, or as jobs of Slurm."""

from __future__ import annotations

import multiprocessing as mp
import os
import shutil
import signal
import subprocess
import sys
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import (
    FIRST_COMPLETED,
    BrokenExecutor,
    CancelledError,
    Future,
    ProcessPoolExecutor,
    wait,
)
from contextlib import suppress
from multiprocessing.process import BaseProcess
from pathlib import Path
from socket import create_connection
from threading import Event, Thread
from typing import Any, NamedTuple, Self, TypeVar
from urllib.parse import urlsplit

from quadsim.campaign.run.attempt import Flown, fly_attempt
from quadsim.config.build_cost import one_line
from quadsim.config.identity import place_in_own_code
from quadsim.config.spec import Spec
from quadsim.console import complain
from quadsim.files.extras import needs_extra
from quadsim.files.strict_yaml import FileError
from quadsim.files.values import SettingError
from quadsim.firmware.process import FirmwareError
from quadsim.record.run import RunError

# How long the main thread waits before it looks for a signal that another thread received [s].
WAKE = 0.5
QUEUED = 1000  # jobs that a Dask scheduler holds at once; more of them slow each other down
UNGUARDED = 78  # exit code of a worker whose script has no main guard
Job = TypeVar("Job")
Answer = TypeVar("Answer")
ANSWER = 5.0  # how long a Dask scheduler may take to answer [s]
SLURM = "slurm"  # in place of a scheduler's address
MEMORY = 2  # of a worker that is a job of Slurm [GB]
DASHBOARD = "127.0.0.1:0"  # address of Dask's own page, which nobody needs
RESUBMIT = 10.0  # how often lost jobs of Slurm are submitted again [s]


class ScriptError(SystemExit, RunError):
    """The running script cannot start workers: the reason and the remedy.

    A script that does not catch the error ends with its line alone, because Python prints no
    traceback for a SystemExit.
    """


class Pool:
    """A pool of no workers: this process flies one attempt after the other, on all threads.

    It is for scripts and notebooks.
    """

    size = 1  # workers
    window = 1  # attempts to submit at once
    in_this_process = True
    lost: tuple[type[BaseException], ...] = ()  # what the future of a worker that died raises

    def submit(self, fly: Callable[[Any], Any], job: Any) -> Future:
        """Begin one job. Return the future of what `fly` returns."""
        done: Future = Future()
        try:
            done.set_result(fly(job))
        except Exception as error:
            done.set_exception(error)
        return done

    def error_of(self, future: Future) -> BaseException | None:
        """Return the error of a job, or None. Raises RunError if the workers are gone."""
        return future.exception()

    def close(self) -> None:
        """End the workers at once; what they have not finished is lost."""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


class Processes(Pool):
    """Worker processes of this machine, each with one thread of the compiled loop.

    They end with their parent.
    """

    lost = (BrokenExecutor,)
    in_this_process = False

    def __init__(self, jobs: int | None = None):
        """Start a number of workers; None: one for each core.

        Raises:
            ScriptError: the running script is standard input, which workers cannot read.
        """
        _leave_a_worker_that_starts()
        _expect_a_script_that_workers_can_read()
        self.size = jobs or _cores()
        self.window = self.size
        self._workers: list[BaseProcess] = []
        self._executor = self._start()

    def submit(self, fly: Callable[[Any], Any], job: Any) -> Future:
        """Begin one job in a worker. Raises ScriptError if the script has no main guard."""
        future = None
        with suppress(BrokenExecutor):
            future = self._executor.submit(fly, job)
        if future is None:
            # After one worker is lost the executor cannot be used any more.
            self._expect_a_guard()
            self.close()
            self._executor = self._start()
            future = self._executor.submit(fly, job)
        self._workers = list((self._executor._processes or {}).values())
        return future

    def _expect_a_guard(self) -> None:
        """Raise ScriptError if a worker ended because it came to the start of workers itself."""
        for worker in self._workers:
            worker.join(timeout=1.0)
            if worker.exitcode == UNGUARDED:
                raise ScriptError(
                    "jobs: each worker runs the script again up to here: put what the script does "
                    'below `if __name__ == "__main__":`, or leave out jobs'
                )

    def _start(self) -> ProcessPoolExecutor:
        # The workers' BLAS threads would compete for the cores.
        os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
        # Python would look for its own modules in the current folder first.
        os.environ["PYTHONSAFEPATH"] = "1"
        # A fork would inherit the locks of threads that it does not have.
        spawn = mp.get_context("spawn")
        return ProcessPoolExecutor(self.size, mp_context=spawn, initializer=_prepare_worker)

    def close(self) -> None:
        """End the workers at once; what they have not finished is lost."""
        workers = self._executor._processes or {}
        for worker in list(workers.values()):
            worker.terminate()
        self._executor.shutdown(wait=True, cancel_futures=True)


def _leave_a_worker_that_starts() -> None:
    """End this process if it is a worker that still runs the script of its parent.

    A script without a main guard starts workers again in each worker.
    """
    if getattr(mp.current_process(), "_inheriting", False):
        os._exit(UNGUARDED)


def _expect_a_script_that_workers_can_read() -> None:
    """Raise ScriptError if the running script is no file: a worker begins with reading it."""
    script = getattr(sys.modules["__main__"], "__file__", None)
    is_run_by_name = getattr(sys.modules["__main__"], "__spec__", None) is not None
    if script is not None and not is_run_by_name and not Path(script).exists():
        advice = "save the script as a file, or leave out jobs"
        raise ScriptError(f"jobs: workers cannot read the script {script}: {advice}")


def _cores() -> int:
    """Return the number of cores that this process may use."""
    if hasattr(os, "sched_getaffinity"):  # Linux
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


class Cluster(Pool):
    """Workers of a Dask scheduler. Dask itself flies an attempt again whose worker is lost."""

    in_this_process = False
    window = QUEUED  # also for workers that join later
    advice = "waiting for workers of {address}: dask worker {address}"

    def __init__(self, address: str, security: object = None):
        """Connect to a scheduler.

        Args:
            address: tcp://HOST:PORT, or tls://HOST:PORT.
            security: certificates, a Security of Dask; None: the connection is not encrypted.

        Raises:
            RunError: there is no such scheduler, or Dask is not installed.
        """
        try:
            from distributed import Client, KilledWorker
        except ImportError:
            raise RunError(needs_extra("distributed", "cluster")) from None
        try:
            _check_reachable(address)
            self._client: Any = Client(
                address, timeout=2 * ANSWER, set_as_default=False, security=security
            )
        except (OSError, ValueError) as error:
            raise RunError(f"no Dask scheduler at {address!r}: {error}") from None
        self._address = address
        if not self._client.scheduler_info()["workers"]:
            complain(self.advice.format(address=address))
        self.lost = (KilledWorker,)

    @property
    def size(self) -> int:
        """Return the number of workers now."""
        return max(1, sum(self._client.ncores().values()))

    def submit(self, fly: Callable[[Any], Any], job: Any) -> Future:
        """Hand one job to the scheduler."""
        answer: Future = Future()
        # Not pure: Dask would give equal jobs one answer
        flying = self._client.submit(fly, job, pure=False)
        self._client.loop.add_callback(_fetch, flying, answer)
        return answer

    def error_of(self, future: Future) -> BaseException | None:
        """Return the error of a job, None if it has none.

        Raises:
            RunError: the scheduler is gone, or a worker lacks a module of the user's.
        """
        if future.cancelled():
            raise RunError(f"the Dask scheduler at {self._address} is gone")
        error = future.exception()
        cause: BaseException | None = error
        while cause is not None:
            if isinstance(cause, ModuleNotFoundError):
                advice = "put it on the PYTHONPATH of scheduler and workers"
                raise RunError(f"a worker has no module {cause.name!r}: {advice}")
            cause = cause.__cause__ or cause.__context__
        return error

    def close(self) -> None:
        """Leave the cluster; what its workers have not finished is lost."""
        self._client.close()


class Slurm(Cluster):
    """Workers that are jobs of Slurm, with a Dask scheduler in this process.

    A job that ends before the campaign, at its time limit say, is submitted again. With the
    campaign all jobs end: they are cancelled, or find their scheduler gone. Connections are
    encrypted and need the campaign's certificate, because other users can reach the ports.
    """

    advice = "waiting for Slurm to start the jobs: squeue --me"

    def __init__(self, jobs: int | None):
        """Submit a number of jobs, and begin without waiting for them.

        Raises:
            RunError: no number is given, Slurm is not here or refuses such a job, or a package of
                the extra cluster is missing.
        """
        if not jobs:
            raise RunError(
                f"scheduler {SLURM}: expected the number of jobs beside it, as --jobs 64"
            )
        if shutil.which("sbatch") is None:
            wanted = "expected a machine that submits jobs to Slurm"
            raise RunError(f"scheduler {SLURM}: {wanted}, got one without sbatch")
        try:
            from dask.config import get as configured
            from distributed.security import Security

            SLURMCluster = slurm_cluster()
            security = Security.temporary()
        except ImportError:
            raise RunError(needs_extra("dask-jobqueue", "cluster")) from None
        # The user's own configuration of dask-jobqueue goes before these values.
        cores = configured("jobqueue.slurm.cores") or 1
        options = configured("jobqueue.slurm.scheduler-options") or {}
        self._jobs: Any = SLURMCluster(
            cores=cores,
            processes=configured("jobqueue.slurm.processes") or cores,
            memory=configured("jobqueue.slurm.memory") or f"{MEMORY * cores}GB",
            scheduler_options={"dashboard_address": DASHBOARD, **options},
            security=security,
            shared_temp_directory=configured("jobqueue.slurm.shared-temp-directory") or os.getcwd(),
        )
        self._closing = Event()
        try:
            _expect_slurm_accepts(self._jobs.job_script())
            super().__init__(self._jobs.scheduler_address, security)
        except RunError:
            self._jobs.close()
            raise
        Thread(target=self._keep_jobs, args=(jobs,), daemon=True).start()

    def _keep_jobs(self, jobs: int) -> None:
        """Submit the jobs, and those that are lost again, until the campaign ends."""
        while not self._closing.is_set():
            self._jobs.scale(jobs=jobs)
            self._closing.wait(RESUBMIT)

    def close(self) -> None:
        """Cancel the jobs; what they have not finished is lost."""
        self._closing.set()
        super().close()
        self._jobs.close()


def slurm_cluster() -> Any:
    """Return the class SLURMCluster, and leave Ctrl-C as it is.

    The import of dask-jobqueue makes SIGINT end the process without a KeyboardInterrupt.

    Raises:
        ImportError: dask-jobqueue is not installed.
    """
    before = signal.getsignal(signal.SIGINT)
    try:
        from dask_jobqueue.slurm import SLURMCluster
    finally:
        if signal.getsignal(signal.SIGINT) is not before:
            signal.signal(signal.SIGINT, before)
    return SLURMCluster


def _expect_slurm_accepts(script: str) -> None:
    """Raise RunError unless Slurm would accept a job with this script."""
    tried = subprocess.run(
        ["sbatch", "--test-only"], input=script, capture_output=True, text=True, check=False
    )
    if tried.returncode:
        said = tried.stderr.strip().splitlines() or [f"exit code {tried.returncode}"]
        raise RunError(f"scheduler {SLURM}: Slurm refuses the job: {said[-1]}")


async def _fetch(flying: Any, answer: Future) -> None:
    """Move the answer of a worker to this process.

    The worker forgets it then. Dask would otherwise repeat the job if this worker is lost later.

    Args:
        flying: Dask's future of the job.
        answer: the future that takes its result or its error.
    """
    try:
        answer.set_result(await flying)
    except CancelledError:
        answer.cancel()
        answer.set_running_or_notify_cancel()  # this ends the wait for it
    except Exception as error:
        answer.set_exception(error)
    flying.release()


def _check_reachable(address: str) -> None:
    """Raise OSError or ValueError at once if no scheduler listens.

    Dask's client would try for its whole timeout.
    """
    where = urlsplit(address)
    if not where.hostname or not where.port:
        raise ValueError("expected tcp://HOST:PORT")
    create_connection((where.hostname, where.port), timeout=ANSWER).close()


def open_pool(jobs: int | None = None, scheduler: str | None = None) -> Pool:
    """Return a pool.

    Args:
        jobs: the number of worker processes; None: one for each core, 0: fly in this process.
        scheduler: tcp://HOST:PORT of a Dask cluster, which is used then, or "slurm": `jobs` jobs of
            Slurm are the workers.

    Raises:
        RunError: there is no such cluster.
    """
    if scheduler == SLURM:
        return Slurm(jobs)
    if scheduler:
        return Cluster(scheduler)
    return Pool() if jobs == 0 else Processes(jobs)


class _Job(NamedTuple):
    """An attempt to fly."""

    spec: Any
    again: bool  # its worker was lost once


def fly_all(pool: Pool, specs: Iterable[Spec]) -> Iterator[tuple[Spec, Flown | None]]:
    """Yield attempts as they finish; see `run_all`."""
    return run_all(pool, fly_attempt, specs)


def run_all(
    pool: Pool, fly: Callable[[Job], Answer], specs: Iterable[Job]
) -> Iterator[tuple[Job, Answer | None]]:
    """Yield jobs as they finish, each with its answer.

    A job whose worker dies is done once more, alone. Its answer is None if its worker is lost
    again.

    Args:
        pool: pool whose workers do the jobs.
        fly: function that does a job, in a worker.
        specs: the jobs.

    Raises:
        Exception: a job has raised it.
    """
    waiting = deque(_Job(spec, again=False) for spec in specs)
    running: dict[Future, _Job] = {}
    while waiting or running:
        while waiting and _may_submit(pool, running, waiting[0]):
            job = waiting.popleft()
            running[pool.submit(fly, job.spec)] = job
        for future in finished(running):
            job = running.pop(future)
            error = pool.error_of(future)
            if not isinstance(error, pool.lost):
                yield job.spec, _answer(future, job.spec)
            elif job.again:
                yield job.spec, None
            else:
                waiting.append(_Job(job.spec, again=True))


def _answer(future: Future, spec: Any) -> Any:
    """Return the answer of a job.

    Raises:
        RunError: the job has raised an error that no command expects, such as one in a part of
            the user's own; the message names the seed.
        RunError, FileError, SettingError, FirmwareError: the job has raised it, with its own
            message.
    """
    try:
        return future.result()
    except (RunError, FileError, SettingError, FirmwareError):
        raise
    except Exception as error:
        seed = f"seed {spec.seed}: " if hasattr(spec, "seed") else ""
        place = place_in_own_code(error)
        at = "" if place is None else f" ({place})"
        raise RunError(f"{seed}{type(error).__name__}: {one_line(error)}{at}") from error


def _may_submit(pool: Pool, running: dict[Future, _Job], job: _Job) -> bool:
    """Return whether the pool has room for a job.

    A job that is flown again runs alone: if it kills its worker, all that run beside it are lost
    too.
    """
    if job.again or any(other.again for other in running.values()):
        return not running
    return len(running) < pool.window


def finished(futures: Iterable[Future]) -> set[Future]:
    """Wait until at least one future has ended, and return those that have.

    Ctrl-C ends the wait.
    """
    while True:
        done = wait(futures, WAKE, FIRST_COMPLETED).done
        if done:
            return done


def _prepare_worker() -> None:
    """Leave Ctrl-C to the parent, and end with the parent, even if SIGKILL has ended it."""
    from quadsim.controllers.lanes.threads import use_threads

    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    use_threads(1)
    Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    parent = mp.parent_process()
    if parent:
        parent.join()
        os._exit(1)
