"""Where attempts are flown: worker processes of this machine, or the workers of a Dask cluster."""

from __future__ import annotations

import multiprocessing as mp
import os
import signal
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Future, ProcessPoolExecutor, wait
from socket import create_connection
from threading import Thread
from typing import Any, Self
from urllib.parse import urlsplit

from quadsim.campaign.attempt import Flown, fly_attempt
from quadsim.console import UsageError
from quadsim.files.extras import needs_extra
from quadsim.spec.spec import Spec

# [s] how long the main thread waits before it looks for a signal that another thread received
WAKE = 0.5


class Pool:
    """This process, one attempt after the other, each on every thread: for a script or a
    notebook."""

    size = 1  # workers
    window = 1  # attempts to submit at once
    lost: tuple[type[BaseException], ...] = ()  # what the future of a worker that died raises

    def submit(self, fly: Callable[[Any], Any], job: Any) -> Future:
        done: Future = Future()
        done.set_result(fly(job))
        return done

    def close(self) -> None:
        """End the workers at once; what they have not finished is lost."""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


class Processes(Pool):
    """Worker processes of this machine, each with one thread of the compiled loop. They end with
    their parent."""

    lost = (BrokenExecutor,)

    def __init__(self, jobs: int | None = None):
        # Linux, others
        cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
        self.size = self.window = jobs or cores or 1
        self._executor = self._start()

    def submit(self, fly: Callable[[Any], Any], job: Any) -> Future:
        try:
            return self._executor.submit(fly, job)
        except BrokenExecutor:  # after one worker is lost the executor cannot be used any more
            self.close()
            self._executor = self._start()
            return self._executor.submit(fly, job)

    def _start(self) -> ProcessPoolExecutor:
        # else the workers' BLAS threads compete for the cores
        os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
        # else Python looks for its own modules in the current folder first
        os.environ["PYTHONSAFEPATH"] = "1"
        # a fork would inherit the locks of threads that it does not have
        spawn = mp.get_context("spawn")
        return ProcessPoolExecutor(self.window, mp_context=spawn, initializer=_prepare_worker)

    def close(self) -> None:
        for worker in list((self._executor._processes or {}).values()):
            worker.terminate()
        self._executor.shutdown(wait=True, cancel_futures=True)


class Cluster(Pool):
    """Workers of a Dask scheduler; Dask itself flies an attempt again whose worker is lost."""

    window = 10**6  # the scheduler queues them, also for workers that join later

    def __init__(self, address: str):
        try:
            from distributed import Client, KilledWorker
        except ImportError:
            raise UsageError(f"--scheduler: {needs_extra('distributed', 'cluster')}") from None
        try:
            _check_reachable(address)
            self._client: Any = Client(address, timeout=10, set_as_default=False)
        except (OSError, ValueError) as error:
            raise UsageError(f"--scheduler: no Dask scheduler at {address!r}: {error}") from None
        self.lost = (KilledWorker,)
        self._executor: Any = self._client.get_executor(pure=False)

    @property
    def size(self) -> int:
        """Workers now."""
        return max(1, sum(self._client.ncores().values()))

    def submit(self, fly: Callable[[Any], Any], job: Any) -> Future:
        return self._executor.submit(fly, job)

    def close(self) -> None:
        self._executor.shutdown(wait=False)
        self._client.close()


def open_pool(jobs: int | None = None, scheduler: str | None = None) -> Pool:
    """A Dask cluster, worker processes (jobs None: one for each core), or with 0 this process.
    Raises UsageError."""
    if scheduler:
        return Cluster(scheduler)
    return Pool() if jobs == 0 else Processes(jobs)


def fly_all(pool: Pool, specs: Iterable[Spec]) -> Iterator[tuple[Spec, Flown | None]]:
    """Attempts as they finish. One whose worker dies is flown once more, alone; None if lost again.

    Raises what the attempt raises.
    """
    waiting = deque((spec, False) for spec in specs)
    running: dict[Future, tuple[Spec, bool]] = {}
    while waiting or running:
        while waiting and _may_submit(pool, running, waiting[0][1]):
            spec, again = waiting.popleft()
            running[pool.submit(fly_attempt, spec)] = spec, again
        for future in finished(running):
            spec, again = running.pop(future)
            if not isinstance(future.exception(), pool.lost):
                yield spec, future.result()
            elif again:
                yield spec, None
            else:
                waiting.append((spec, True))


def _may_submit(pool: Pool, running: dict[Future, tuple[Spec, bool]], again: bool) -> bool:
    """One that is flown again runs alone: if it kills its worker, all that run beside it are lost
    too."""
    alone = again or any(a for _, a in running.values())
    return len(running) < (1 if alone else pool.window)


def finished(futures: Iterable[Future]) -> set[Future]:
    """Those that have ended, at least one; Ctrl-C ends the wait."""
    while not (done := wait(futures, WAKE, FIRST_COMPLETED).done):
        pass
    return done


def _check_reachable(address: str) -> None:
    """OSError or ValueError at once where no scheduler listens: the client would try for its whole
    timeout."""
    where = urlsplit(address)
    if not where.hostname or not where.port:
        raise ValueError("expected tcp://HOST:PORT")
    create_connection((where.hostname, where.port), timeout=5).close()


def _prepare_worker() -> None:
    """The parent answers Ctrl-C; a worker ends when its parent has ended, by SIGKILL too."""
    from controllers.lanes.threads import use_threads

    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    use_threads(1)
    Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    parent = mp.parent_process()
    if parent:
        parent.join()
        os._exit(1)
