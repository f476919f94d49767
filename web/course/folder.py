"""CourseFolder: the folder beside the runs for courses made on the page."""

from __future__ import annotations

from hashlib import sha256
from pathlib import Path

import msgspec

from quadsim.course import course_names
from quadsim.course.course_file import Name
from quadsim.record.whole_files import write_whole
from quadsim.web.course.draft import Draft

# Name of the folder among the runs
COURSES = "courses"
# Hashes of its files as the page wrote them: others, and those changed since, are not overwritten
WRITTEN = ".written.json"
LONGEST_NAME = 64


class CourseFolder:
    """The courses made on the page. Nothing is written outside of their folder.

    Args:
        runs_dir: the folder of runs.
    """

    def __init__(self, runs_dir: str | Path):
        self._folder = Path(runs_dir) / COURSES
        # The other text that the last save of a file has replaced
        self._replaced: dict[Path, str] = {}

    def files(self) -> tuple[str, ...]:
        """Return the paths of the courses, sorted."""
        return tuple(str(path) for path in sorted(self._folder.glob("*.yaml")))

    def save(self, draft: Draft, name: str) -> str:
        """Write a draft atomically, and return its path, which serves as the course's name.

        A file is overwritten only if its content was last written here.

        Args:
            draft: the course.
            name: the name of the file, without .yaml.

        Raises:
            ValueError: the name or the draft cannot be used.
            RunError: the file cannot be written.
        """
        _check_name(name)
        errors = draft.errors(name)
        if errors:
            raise ValueError(f"{errors[0]}: correct it before the course is saved")
        path = self._folder / f"{name}.yaml"
        if not self._may_write(path):
            raise ValueError(f"{path}: expected a new name, there is a course already")
        self._replaced.pop(path, None)
        before = path.read_text(encoding="utf-8") if path.exists() else ""
        text = draft.text()
        self._write(path, text)
        if before not in ("", text):
            self._replaced[path] = before
        return str(path)

    def replaced(self, path: str) -> str:
        """Return the text that the last save of a file has replaced, "" if none."""
        return self._replaced.get(Path(path), "")

    def put_back(self, path: str) -> None:
        """Write the text that the last save of a file has replaced.

        Raises:
            ValueError: no save has replaced a text, or the file was changed since.
            RunError: the file cannot be written.
        """
        file = Path(path)
        text = self.replaced(path)
        if not text:
            raise ValueError(f"{path}: expected a file that was written over, got another")
        if not self._may_write(file):
            raise ValueError(f"{path}: expected the course that was saved, got a changed file")
        self._write(file, text)
        del self._replaced[file]

    def _may_write(self, path: Path) -> bool:
        """Return whether a path is free, or a file with the content that was last saved here."""
        if not path.is_symlink() and not path.exists():
            return True
        try:
            return sha256(path.read_bytes()).hexdigest() == self._written().get(path.name)
        except OSError:
            return False

    def _write(self, path: Path, text: str) -> None:
        """Write a file, and its hash beside it. Raises RunError."""
        data = text.encode()
        write_whole(path, data)
        hashes = {**self._written(), path.name: sha256(data).hexdigest()}
        write_whole(self._folder / WRITTEN, msgspec.json.encode(hashes))

    def _written(self) -> dict[str, str]:
        """Return the hashes of the files as they were last written here, by their names."""
        try:
            return msgspec.json.decode((self._folder / WRITTEN).read_bytes(), type=dict[str, str])
        except (OSError, msgspec.DecodeError):
            return {}


def _check_name(name: str) -> None:
    """Raise ValueError unless a name is valid for a file and differs from shipped courses."""
    try:
        msgspec.convert(name, Name)
    except msgspec.ValidationError:
        expected = f"expected 1 to {LONGEST_NAME} letters, digits, - and _, got {name!r}"
        raise ValueError(f"name of the course: {expected}") from None
    if name.lower() in {known.lower() for known in course_names()}:
        problem = f"{name!r} comes with quadsim and is not written over"
        raise ValueError(f"name of the course: {problem}; choose another")
