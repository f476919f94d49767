"""Write the tables of settings, of the keys of files and of derived numbers into docs/.

    python -m quadsim.tables.write_tables

A table lies between two comments on its page, the first of which has its name.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

from quadsim.config.competition import competition_schema
from quadsim.config.settings import OWNERS, SETTINGS
from quadsim.course.course_file import CourseFile
from quadsim.physics.randomization_file import RandomizationRanges
from quadsim.sensing.sensing_file import SensingFile
from quadsim.tables.laws_table import laws_table
from quadsim.tables.settings_table import key_rows, markdown, setting_rows
from quadsim.vehicle.vehicle import VehicleFile

DOCS = Path(__file__).parents[2] / "docs"
COMMAND = "python -m quadsim.tables.write_tables"
# "<!-- table NAME, written by COMMAND -->", the table, "<!-- end of table -->"
TABLE = re.compile(r"(<!-- table (\S+), [^\n]*-->\n\n)(.*?)(\n<!-- end of table -->)", re.DOTALL)


def tables() -> dict[str, Callable[[], str]]:
    """Return the functions that make the tables, by name."""
    files = {
        "course": CourseFile,
        "vehicle": VehicleFile,
        "sensing": SensingFile,
        "competition": competition_schema(),
        "randomization": RandomizationRanges,
    }
    made: dict[str, Callable[[], str]] = {f"settings.{group}": _settings(group) for group in OWNERS}
    made |= {f"keys.{kind}": _keys(schema) for kind, schema in files.items()}
    return made | {"laws": laws_table}


def _settings(group: str) -> Callable[[], str]:
    """Return the function that makes the table of a group of settings."""
    has_presets = group in ("sampling", "mppi", "cost")

    def make() -> str:
        rows = tuple(row for row in setting_rows() if SETTINGS[row.name].group == group)
        return markdown(rows, "setting", has_presets)

    return make


def _keys(schema: type) -> Callable[[], str]:
    """Return the function that makes the table of a file's keys."""
    return lambda: markdown(key_rows(schema), "key", with_presets=False)


def written(page: str) -> str:
    """Return the text of a page with regenerated tables.

    Raises:
        KeyError: the page names an unknown table.
    """
    made = tables()

    def replaced(found: re.Match[str]) -> str:
        begin, name, _, end = found.groups()
        return f"{begin}{made[name]()}{end}"

    return TABLE.sub(replaced, page)


if __name__ == "__main__":
    for page in sorted(DOCS.glob("*.md")):
        text = page.read_text(encoding="utf-8")
        if written(text) != text:
            page.write_text(written(text), encoding="utf-8")
            print(page.name)
