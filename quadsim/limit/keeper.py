"""Keeper: the file of the best solution that a search of a limit has found so far."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path
from tempfile import mkdtemp

from quadsim.limit.limits import LimitError, LimitProblem, StoredSolution, dump
from quadsim.record.run import RunError
from quadsim.record.whole_files import write_whole


class Keeper:
    """Keeps the best known solution of a race in its file."""

    def __init__(self, problem: LimitProblem, folder: Path, best: StoredSolution | None):
        """Take the race, the folder of its file, and the best solution known before."""
        self.best = best
        # The fastest solution of this search, None if one that was known before is faster
        self.found: StoredSolution | None = None
        self._problem = problem
        self._path = folder / problem.file_name
        self._failure: RunError | None = None

    def keep(self, found: StoredSolution | None) -> None:
        """Keep a solution if it is the fastest; `finish` raises if it could not be written."""
        if found is None or not self._is_fastest(found):
            return
        self.best = self.found = found
        self._failure = None
        try:
            write_whole(self._path, dump(found))
        except RunError as error:
            self._failure = error

    def finish(self) -> None:
        """Keep what could not be written among the temporary files, so that no search is lost.

        Raises:
            RunError: the solution is not in its own file; the message says where it is.
        """
        if self._failure is None or self.found is None:
            return
        try:
            place = Path(mkdtemp(prefix="quadsim-limit-")) / self._path.name
            write_whole(place, dump(self.found))
        except (OSError, RunError):
            raise RunError(f"{self._failure}: nor among the temporary files") from None
        advice = f"the solution is kept as {place}: move it to {self._path.parent}"
        raise RunError(f"{self._failure}: {advice}")

    def _is_fastest(self, found: StoredSolution) -> bool:
        """Return whether a solution is faster than all others, also of other processes."""
        with suppress(LimitError):
            newest = self._problem.best_known(self._path.parent)
            if newest and (self.best is None or newest.time < self.best.time):
                self.best = newest
        return self.best is None or found.time < self.best.time
