"""Pools fly attempts: in this process, in worker processes, or in the workers of a Dask cluster."""

from __future__ import annotations

import multiprocessing as mp
import os
import signal
import sys
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Future, ProcessPoolExecutor, wait
from contextlib import suppress
from multiprocessing.process import BaseProcess
from pathlib import Path
from socket import create_connection
from threading import Thread
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
NO_LIMIT = 10**6
UNGUARDED = 78  # exit code of a worker whose script has no main guard
Job = TypeVar("Job")
Answer = TypeVar("Answer")
ANSWER = 5.0  # how long a Dask scheduler may take to answer [s]


class ScriptError(SystemExit, RunError):
    """The running script cannot start workers: the reason and the remedy.

    A script that does not catch the error ends with its line alone, because Python prints no
    traceback for a SystemExit.
    """


class Pool:
    """This process flies one attempt after the other, each on every thread.

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
        """Return what a job has raised. Raises RunError if the workers are gone."""
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
    window = NO_LIMIT  # the scheduler queues them, also for workers that join later

    def __init__(self, address: str):
        """Connect to tcp://HOST:PORT. Raises RunError."""
        try:
            from distributed import Client, KilledWorker
        except ImportError:
            raise RunError(needs_extra("distributed", "cluster")) from None
        try:
            _check_reachable(address)
            self._client: Any = Client(address, timeout=2 * ANSWER, set_as_default=False)
        except (OSError, ValueError) as error:
            raise RunError(f"no Dask scheduler at {address!r}: {error}") from None
        self._address = address
        if not self._client.scheduler_info()["workers"]:
            complain(f"waiting for workers of {address}: dask worker {address}")
        self.lost = (KilledWorker,)
        self._executor: Any = self._client.get_executor(pure=False)

    @property
    def size(self) -> int:
        """Return the number of workers now."""
        return max(1, sum(self._client.ncores().values()))

    def submit(self, fly: Callable[[Any], Any], job: Any) -> Future:
        """Hand one job to the scheduler."""
        return self._executor.submit(fly, job)

    def error_of(self, future: Future) -> BaseException | None:
        """Return what a job has raised.

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
        self._executor.shutdown(wait=False)
        self._client.close()


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
        scheduler: tcp://HOST:PORT of a Dask cluster, which is used then.

    Raises:
        RunError: there is no such cluster.
    """
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
        pool: does the jobs.
        fly: does one of them, in a worker.
        specs: the jobs.

    Raises:
        Exception: what a job raises.
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
        RunError: the job has raised what no command expects, such as an error in a part of the
            user's own; the message names the seed.
        Exception: what else the job has raised.
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
