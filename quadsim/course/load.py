"""Load courses by name: the project's files, a user's own files, and random tracks."""

from __future__ import annotations

from pathlib import Path

from quadsim.course.course import Course, parse_course
from quadsim.course.lsy_tracks import NAME, lsy_track
from quadsim.files.data_files import locate, names, read_text

COURSES = Path(__file__).parents[1] / "courses"


def course_names() -> tuple[str, ...]:
    """Return the names of the courses that come with the project."""
    return names(COURSES)


def load_course(name_or_path: str | Path) -> Course:
    """Return a course by name ("split_s_swift") or path ("mine.yaml").

    "lsy_level3-7" is the track with the number 7 of quadsim.course.lsy_tracks.

    Raises:
        FileError: there is no such course, or the file is not a course.

    Examples:
        >>> import quadsim
        >>> course = quadsim.load_course("split_s_swift")
        >>> len(course.gates), course.laps
        (7, 3)
    """
    track = NAME.fullmatch(str(name_or_path))
    if track:
        return lsy_track(int(track["number"]))
    path = locate(name_or_path, COURSES, "course")
    return parse_course(read_text(path), str(path))
