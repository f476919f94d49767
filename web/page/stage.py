"""Stage: what stands in the scene of a visitor: a race, a course, or the course in work."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from quadsim.course import Course
from quadsim.web.page.parts.course_map import Map
from quadsim.web.page.parts.elements import EMPTY, Element
from quadsim.web.race.competitor import Competitor


@dataclass(frozen=True, eq=False)
class Stage:
    """What stands in a scene, which is built anew for another stage.

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
