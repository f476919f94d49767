"""Worker processes of this machine: one compiled-loop thread each, gone with their parent, quick to answer Ctrl-C."""

from __future__ import annotations

import multiprocessing as mp
import os
import signal
from collections.abc import Collection
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from threading import Event, Thread

WAKE = 0.5  # [s] a signal that another thread received waits at most so long for the main thread to run


def cores() -> int:
    """That this process may run on."""
    return len(os.sched_getaffinity(0))


def start_workers(count: int) -> ProcessPoolExecutor:
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # or the workers' BLAS threads spin against each other
    spawn = mp.get_context("spawn")  # a fork would inherit the locks of threads that it does not have
    return ProcessPoolExecutor(count, mp_context=spawn, initializer=_settle)


def end_workers(pool: ProcessPoolExecutor) -> None:
    """At once: what they have not finished is lost. None is left when this returns."""
    for worker in list((pool._processes or {}).values()):
        worker.terminate()
    pool.shutdown(wait=True, cancel_futures=True)


def finished(futures: Collection[Future]) -> set[Future]:
    """Those that have ended, at least one; Ctrl-C comes through while it waits."""
    while not (done := wait(futures, WAKE, FIRST_COMPLETED).done):
        pass
    return done


def until_interrupted() -> None:
    """Raises KeyboardInterrupt when that comes, also where another thread received the signal."""
    never = Event()
    while True:
        never.wait(WAKE)


def _settle() -> None:
    """Ctrl-C is the parent's to answer; a worker whose parent is gone, by SIGKILL too, goes as well."""
    from controllers.rollout.threads import use_threads

    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    use_threads(1)
    Thread(target=_follow, daemon=True).start()


def _follow() -> None:
    parent = mp.parent_process()
    if parent:
        parent.join()
        os._exit(1)
