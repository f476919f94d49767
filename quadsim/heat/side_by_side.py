"""Make the plans of several vehicles at the same time, each on a share of the CPU threads.

Parts of a plan run on one thread only. Two plans on one thread each therefore take less time
than the same two plans one after the other on two threads.
"""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor, wait
from types import TracebackType

from quadsim.heat.loop import in_turn
from quadsim.racing.flight import Planning


class SideBySide:
    """Makes the plans of one instant, several at a time.

    The plans are bitwise equal to plans that are made in turn. They are made in turn if one of them
    is the first of its flight, for which loops may be compiled, or if the compiled loops serve only
    one caller at a time.

    Use it as a context manager: its threads end when the context ends.
    """

    def __init__(self) -> None:
        self._pool: ThreadPoolExecutor | None = None

    def __enter__(self) -> SideBySide:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        if self._pool:
            self._pool.shutdown()

    def __call__(self, plannings: Sequence[Planning]) -> None:
        """Make the plans, and return when all of them are made."""
        # Imported here, as it loads the compiler
        from quadsim.controllers.lanes.threads import threads

        # Make them in turn if threads cannot be shared, or if a loop may have to be compiled.
        available = threads()
        is_alone = len(plannings) < 2 or available < 2
        compiles = any(planning.is_first for planning in plannings)
        if is_alone or compiles:
            in_turn(plannings)
            return

        # Share the threads evenly.
        if self._pool is None:
            self._pool = ThreadPoolExecutor(available, thread_name_prefix="plans")
        share = max(available // len(plannings), 1)
        futures = [self._pool.submit(_plan, planning, share) for planning in plannings]

        # No plan outlives the race.
        wait(futures)
        for future in futures:
            future.result()


def _plan(planning: Planning, share: int) -> None:
    """Make one plan on a number of threads."""
    from quadsim.controllers.lanes.threads import use_threads

    use_threads(share)
    planning.run()
