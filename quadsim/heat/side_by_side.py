"""Make the plans of several vehicles at one instant side by side, on the threads of the loops.

A plan is made faster by two threads than by one, but not twice as fast: parts of it run on one
thread. So where several vehicles plan at the same instant, each gets a share of the threads.
"""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor, wait
from types import TracebackType

from quadsim.racing.flight import Planning
from quadsim.racing.heat import in_turn


class SideBySide:
    """Makes the plans of one instant, several at a time.

    The plans are the same to the last bit as if they were made in turn. First plans are made in
    turn, as loops may be compiled for them. So are all where the threads of the loops serve one
    caller at a time.

    Use it as a context: its threads end with it.
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
        """Make some plans."""
        # Imported here, as it loads the compiler
        from controllers.lanes.threads import can_run_side_by_side, threads

        shared = threads()
        few = min(len(plannings), shared) < 2
        if few or any(planning.is_first for planning in plannings) or not can_run_side_by_side():
            in_turn(plannings)
            return
        if self._pool is None:
            self._pool = ThreadPoolExecutor(shared, thread_name_prefix="plans")
        share = max(shared // len(plannings), 1)
        futures = [self._pool.submit(_plan, planning, share) for planning in plannings]
        wait(futures)
        for future in futures:
            future.result()


def _plan(planning: Planning, share: int) -> None:
    """Make a plan on some of the threads."""
    from controllers.lanes.threads import use_threads

    use_threads(share)
    planning.run()
