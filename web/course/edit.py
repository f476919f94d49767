"""CourseEdit: the course that visitors edit together, with its checks, file and limit.

Changes come from one thread, viser's event loop; any thread may read.
"""

from __future__ import annotations

import re
from pathlib import Path
from time import perf_counter
from typing import NamedTuple

import numpy as np

from quadsim.course import Course, parse_course
from quadsim.course.course import summary
from quadsim.files.strict_yaml import FileError
from quadsim.limit.limits import LimitError, LimitProblem, StoredSolution, limits_folder
from quadsim.racing.fits import misfit
from quadsim.vehicle import load_vehicle
from quadsim.web.course.draft import Draft, Item
from quadsim.web.course.folder import CourseFolder
from quadsim.web.course.history import History
from quadsim.web.course.limit_search import LimitSearch

# Keys of a course file that name an item
KEYS = re.compile(r"\b(gate|obstacle)s\[(\d+)\]|\b(start)\b")


class Checked(NamedTuple):
    """The result of `race check` for a draft and a vehicle, and the known limit."""

    # one line each; empty: the draft can be flown
    errors: tuple[str, ...]
    # items named by the errors
    wrong: frozenset[Item]
    # a summary of the course; "" with errors
    summary: str
    limit: StoredSolution | None = None


class CourseEdit:
    """One draft with its history; beginning a new draft can be undone, too.

    Args:
        runs_dir: the folder of runs.

    Attributes:
        replaced: the course that the last save has written over, in a few words; "" if none.
    """

    def __init__(self, runs_dir: str):
        self.history = History(Draft.empty())
        self.folder = CourseFolder(runs_dir)
        self.search: LimitSearch | None = None
        self.replaced = ""
        self._runs_dir = runs_dir
        self._saved: tuple[Draft, str] | None = None

    @property
    def draft(self) -> Draft:
        """The present draft."""
        return self.history.draft

    @property
    def saved_as(self) -> str:
        """The path of the file with this draft, "" if it was not saved."""
        if self._saved and self._saved[0].entries == self.draft.entries:
            return self._saved[1]
        return ""

    def begin(self, course: Course | None) -> None:
        """Edit a copy of a course, or an empty course.

        Raises:
            FileError: the course's text is not a course.
        """
        self.change(Draft.copy_of(course) if course else Draft.empty())

    def change(self, draft: Draft, what: object = None) -> None:
        """Replace the draft by a changed one; what: see History.change."""
        self.history = self.history.change(draft, what, perf_counter())

    def undo(self) -> None:
        """Go back by one change."""
        self.history = self.history.undo()

    def redo(self) -> None:
        """Redo the last undone change."""
        self.history = self.history.redo()

    def save(self, name: str) -> str:
        """Write the draft and return its path. Raises ValueError, RunError; see CourseFolder."""
        draft = self.draft
        path = self.folder.save(draft, name)
        self._saved = (draft, path)
        text = self.folder.replaced(path)
        course = parse_course(text, path) if text else None
        self.replaced = f"{Path(path).name}: {summary(course)}" if course else ""
        return path

    def put_back(self) -> str:
        """Put the course back that the last save has written over, and return its path.

        Raises:
            ValueError, RunError: see CourseFolder.put_back.
        """
        path = self._saved[1] if self._saved else ""
        self.folder.put_back(path)
        self._saved = None
        self.replaced = ""
        return path

    def check(self, name: str, vehicle: str) -> Checked:
        """Return the result of `race check NAME.yaml VEHICLE` for the draft."""
        draft = self.draft
        errors = draft.errors(name)
        lines = [str(error) for error in errors]
        named = [error.key for error in errors]
        if errors:
            return Checked(tuple(lines), items_in(named), "")
        course = draft.course(name)
        problem = self._misfit(course, vehicle)
        if problem:
            line = f"{name}.yaml: for {vehicle}: {problem}"
            return Checked((line,), items_in([problem]), "")
        return Checked((), frozenset(), summary(course), self._known_limit(course, vehicle))

    def begin_search(self, name: str, vehicle: str) -> None:
        """Search the limit of the present draft.

        Raises:
            ValueError: a search is running, the draft has errors, or the optimiser is missing.
        """
        if self.search and self.search.is_on:
            raise ValueError("a search is on: cancel it first")
        errors = self.check(name, vehicle).errors
        if errors:
            raise ValueError(f"{errors[0]}: correct it before the limit is searched")
        course = self.draft.course(name)
        problem = LimitProblem.of(course, load_vehicle(vehicle), course.laps)
        self.search = LimitSearch(problem, self._runs_dir)

    def cancel_search(self) -> None:
        """End a running search."""
        if self.search and self.search.is_on:
            self.search.cancel()

    def _misfit(self, course: Course, vehicle: str) -> str:
        """Return the reason why the vehicle cannot fly the course, "" if it can."""
        try:
            return misfit(course, load_vehicle(vehicle))
        except FileError as error:
            return str(error)

    def _known_limit(self, course: Course, vehicle: str) -> StoredSolution | None:
        """Return the best known solution, None if there is none or it is damaged."""
        problem = LimitProblem.of(course, load_vehicle(vehicle), course.laps)
        try:
            return problem.best_known(limits_folder(self._runs_dir))
        except LimitError:
            return None


def items_in(texts: list[str]) -> frozenset[Item]:
    """Return the items named by keys of a course file, such as "gates[3].position"."""
    found = set()
    for text in texts:
        for kind, index, start in KEYS.findall(text):
            found.add(Item("start") if start else Item(kind, int(index)))
    return frozenset(found)


def limit_path(limit: StoredSolution | None) -> np.ndarray | None:
    """Return the path of a solution  (n, 3) [m], None without one."""
    return None if limit is None else limit.path(rate=50.0)[:, 1:]
