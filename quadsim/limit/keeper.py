"""Store the best solution that a search of a limit has found so far."""

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
        """Prepare the file of a race in a folder, given the best solution known before."""
        self.best = best
        # The fastest solution of this search, None if one that was known before is faster
        self.found: StoredSolution | None = None
        self._problem = problem
        self._path = folder / problem.file_name
        self._failure: RunError | None = None

    def keep(self, found: StoredSolution | None) -> None:
        """Store a solution if it is the fastest; `finish` reports an error of writing."""
        if found is None or not self._is_fastest(found):
            return
        self.best = self.found = found
        self._failure = None
        try:
            write_whole(self._path, dump(found))
        except RunError as error:
            self._failure = error

    def finish(self) -> None:
        """Write a solution that could not be stored to a temporary file, so that it is not lost.

        Raises:
            RunError: the solution is in a temporary file, which the message names.
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
        """Return whether a solution is the fastest, also compared with other processes."""
        with suppress(LimitError):
            newest = self._problem.best_known(self._path.parent)
            if newest and (self.best is None or newest.time < self.best.time):
                self.best = newest
        return self.best is None or found.time < self.best.time
