"""Stages: the content of each visitor's scene: a race, a course, or the course in work."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from quadsim.course import Course
from quadsim.web.page.forms.course_editor import CourseEditor
from quadsim.web.page.parts.course_map import Map
from quadsim.web.page.parts.elements import EMPTY, Element
from quadsim.web.race.competitor import Competitor
from quadsim.web.race.next_start import NextStart
from quadsim.web.race.snapshot import Snapshot
from quadsim.web.state.page_state import EVERYBODY


@dataclass(frozen=True, eq=False)
class Stage:
    """The content of a scene. The scene is built anew for another stage.

    Attributes:
        course: None: nothing is shown yet, or the course is edited.
        race: number of the race on it; 0: none.
        entries: the competitors when the stage was made.
        is_edited: whether the course of the editor is shown.
    """

    course: Course | None = None
    race: int = 0
    entries: tuple[Competitor, ...] = ()
    is_edited: bool = False

    @cached_property
    def map(self) -> Map:
        """The map of the course. Raises AssertionError: there is none."""
        assert self.course is not None
        return Map(self.course)

    @cached_property
    def plain_map(self) -> Element:
        """The map of the course without a race; empty without a course."""
        return self.map.draw([]) if self.course else EMPTY


class Stages:
    """The stages of a page, of which each visitor sees one.

    Args:
        start: what the next START flies, whose course may be shown in place of the last race.
        editor: of the course in work.

    Attributes:
        raced: the stage of the last race.
    """

    def __init__(self, start: NextStart, editor: CourseEditor):
        self._start = start
        self._editor = editor
        self.raced = Stage()
        self._preview = Stage()  # the course that was chosen since
        self._edited = Stage(is_edited=True)
        self._race = 0  # number of the last race
        self._passed_over: Course | None = None  # course that was chosen during that race

    @property
    def course(self) -> Course | None:
        """The course of the last race, or else the chosen one; None: there is none yet."""
        return self.raced.course or self._preview.course

    def update(self, s: Snapshot) -> None:
        """Put the race and the chosen course on their stages.

        A race is on its stage once every competitor has a frame.
        """
        chosen = self._chosen_course(s)
        if chosen and any(entry.course.text == chosen.text for entry in s.competitors):
            chosen = None  # the race is on it
        if chosen is not self._preview.course:
            self._preview = Stage(chosen)
        has_frames = s.competitors and all(len(entry.t) for entry in s.competitors)
        if self.raced.race != s.race and has_frames:
            self.raced = Stage(s.competitors[0].course, s.race, s.competitors)
        if self.raced.race and not s.competitors:
            self.raced = Stage()

    def of(self, visitor: int) -> Stage:
        """Return what a visitor sees: the course in work, the race, or the chosen course.

        A course that is chosen after a race is shown to the visitor who chose it; others go on
        watching the race.
        """
        if self._editor.is_open_for(visitor):
            return self._edited
        is_chooser = self._start.desk.state.chooser in (EVERYBODY, visitor)
        if self._preview.course and (is_chooser or not self.raced.race):
            return self._preview
        return self.raced

    def _chosen_course(self, s: Snapshot) -> Course | None:
        """Return the course that was chosen after the race, None if none was."""
        course = self._start.course()
        if s.flying or s.race != self._race:
            # Choices for the next race do not hide this one.
            self._race = s.race
            self._passed_over = course
        elif course is not self._passed_over:
            self._passed_over = None
        return course if self._passed_over is None else None
