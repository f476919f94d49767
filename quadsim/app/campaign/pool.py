"""Where attempts fly: processes of this machine, or the workers of a Dask cluster. Both are concurrent.futures."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Iterator
from concurrent.futures import BrokenExecutor, Future
from socket import create_connection
from typing import Any, Protocol
from urllib.parse import urlsplit

from quadsim.app.campaign.attempt import Flown, fly_attempt
from quadsim.app.flags import UsageError
from quadsim.app.workers import cores, end_workers, finished, start_workers
from quadsim.race.spec import Spec


class Pool(Protocol):
    """Flies attempts; `with pool:` ends its workers, at once."""

    @property
    def size(self) -> int:
        """Workers now."""
        ...

    window: int  # attempts worth having under way
    lost: tuple[type[BaseException], ...]  # what a future raises whose worker has died

    def submit(self, spec: Spec) -> Future[Flown]: ...
    def __enter__(self) -> Pool: ...
    def __exit__(self, *_: object) -> None: ...


class Processes:
    """Worker processes of this machine, one compiled-loop thread each."""

    lost: tuple[type[BaseException], ...] = (BrokenExecutor,)

    def __init__(self, jobs: int | None = None):
        self.window = jobs or cores()
        self._executor = start_workers(self.window)

    @property
    def size(self) -> int:
        return self.window

    def submit(self, spec: Spec) -> Future[Flown]:
        try:
            return self._executor.submit(fly_attempt, spec)
        except BrokenExecutor:  # one worker lost, all are gone
            end_workers(self._executor)
            self._executor = start_workers(self.window)
            return self._executor.submit(fly_attempt, spec)

    def __enter__(self) -> Processes:
        return self

    def __exit__(self, *_: object) -> None:
        end_workers(self._executor)


class Cluster:
    """Workers of a Dask scheduler; Dask itself flies an attempt again whose worker is lost."""

    def __init__(self, address: str):
        try:
            from distributed import Client, KilledWorker
        except ImportError:
            raise UsageError("--scheduler: needs the extra 'cluster': pip install 'quadsim[cluster]'") from None
        try:
            _knock(address)
            self._client: Any = Client(address, timeout=10, set_as_default=False)
        except (OSError, ValueError) as error:
            raise UsageError(f"--scheduler: no Dask scheduler at {address!r}: {error}") from None
        self.lost: tuple[type[BaseException], ...] = (KilledWorker,)
        self.window = 10**6  # the scheduler queues them, for workers that come later too
        self._executor: Any = self._client.get_executor(pure=False)

    @property
    def size(self) -> int:
        return max(1, sum(self._client.ncores().values()))

    def submit(self, spec: Spec) -> Future[Flown]:
        return self._executor.submit(fly_attempt, spec)

    def __enter__(self) -> Cluster:
        return self

    def __exit__(self, *_: object) -> None:
        self._executor.shutdown(wait=False)
        self._client.close()


def _knock(address: str) -> None:
    """OSError or ValueError at once where nobody listens: the client would try for its whole timeout."""
    where = urlsplit(address)
    if not where.hostname or not where.port:
        raise ValueError("expected tcp://HOST:PORT")
    create_connection((where.hostname, where.port), timeout=5).close()


def open_pool(jobs: int | None, scheduler: str | None) -> Pool:
    """Raises UsageError where there is no scheduler."""
    return Cluster(scheduler) if scheduler else Processes(jobs)


def fly_all(pool: Pool, specs: Iterable[Spec]) -> Iterator[tuple[Spec, Flown | None]]:
    """Every attempt, as they finish. One whose worker is lost is flown again, once and alone; None if lost again.

    What an attempt itself raises comes out here.
    """
    todo = deque((spec, False) for spec in specs)
    under_way: dict[Future[Flown], tuple[Spec, bool]] = {}
    while todo or under_way:
        while todo and _room(pool, under_way, suspect=todo[0][1]):
            spec, suspect = todo.popleft()
            under_way[pool.submit(spec)] = spec, suspect
        for future in finished(under_way):
            spec, suspect = under_way.pop(future)
            if not isinstance(future.exception(), pool.lost):
                yield spec, future.result()
            elif suspect:
                yield spec, None
            else:
                todo.append((spec, True))


def _room(pool: Pool, under_way: dict, suspect: bool) -> bool:
    """A suspect flies alone, or it would take the innocent down with it twice."""
    alone = suspect or any(s for _, s in under_way.values())
    return len(under_way) < (1 if alone else pool.window)
