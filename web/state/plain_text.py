"""Texts from files, such as names of courses, for one line of the page."""

from __future__ import annotations

LONGEST = 80  # of a text that is shown [characters]
UNSHOWN = "\N{REPLACEMENT CHARACTER}"  # in place of a line break, or a mark that turns a line round


def plain(text: object, longest: int = LONGEST) -> str:
    """Return a text from a file as one line of printable characters, shortened if it is long."""
    line = "".join(each if each.isprintable() else UNSHOWN for each in str(text))
    return line if len(line) <= longest else line[: longest - 3] + "..."
