"""Write the tables of results into the pages from docs/results/*.csv.

    python -m docs.results.tables

A page has "<!-- results NAME NAME: COLUMN, COLUMN -->" and "<!-- end of results -->". Between them
stand the commands, the table of their rows, and one line that tells when they were flown.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from docs.results.experiments import Flown, experiments, read

DOCS = Path(__file__).parents[1]
COMMAND = "python -m docs.results.tables"
TABLE = re.compile(
    r"(<!-- results (?P<names>[\w ]+): (?P<columns>[\w, ]+) -->\n\n)"
    r"(?P<table>.*?)"
    r"(<!-- end of results -->)",
    re.DOTALL,
)

Row = Mapping[str, str]


@dataclass(frozen=True)
class Column:
    """A column of a table: its heading, and the text of a row."""

    heading: str
    text: Callable[[Row], str]
    is_number: bool = True


def _fixed(name: str, digits: int, scale: float = 1.0, sign: str = "") -> Callable[[Row], str]:
    """Return a function that writes a number with `digits` decimals, and "" if it is unknown."""

    def text(row: Row) -> str:
        return f"{scale * float(row[name]):{sign}.{digits}f}" if row[name] else ""

    return text


def _interval(name: str, digits: int, sign: str = "") -> Callable[[Row], str]:
    """Return a function that writes a mean and its 95 % interval, if they are known."""

    def text(row: Row) -> str:
        ends = (name, f"{name}_low", f"{name}_high")
        mean, *interval = (
            f"{float(row[key]):{sign}.{digits}f}" if row[key] else "" for key in ends
        )
        return f"{mean} ({' to '.join(interval)})" if all(interval) else mean

    return text


def _percent(name: str) -> Callable[[Row], str]:
    """Return a function that writes the 95 % interval of a share."""

    def text(row: Row) -> str:
        low, high = (100.0 * float(row[f"{name}_{end}"]) for end in ("low", "high"))
        return f"{low:.0f} to {high:.0f} %"

    return text


def _spread(mean: str, sd: str, digits: int) -> Callable[[Row], str]:
    """Return a function that writes a mean and its standard deviation, if they are known."""

    def text(row: Row) -> str:
        return f"{float(row[mean]):.{digits}f} ± {float(row[sd]):.{digits}f}" if row[mean] else ""

    return text


def _paper_finished(row: Row) -> str:
    """Return how many attempts of the paper succeeded, and of how many, if it says so."""
    of = f" of {row['paper_attempts']}" if row["paper_attempts"] else ""
    return row["paper_valid"] + of


def _above_limit(row: Row) -> str:
    return f"{100.0 * float(row['above_limit']):.1f} %" if row["above_limit"] else ""


COLUMNS: dict[str, Column] = {
    "course": Column("course", lambda row: row["course"], is_number=False),
    "variant": Column("variant", lambda row: row["variant"], is_number=False),
    "setting": Column("setting", lambda row: row["setting"], is_number=False),
    "value": Column("value", lambda row: row["value"]),
    "crash_rate": Column("crashes per 100 gates, 95 %", _interval("crash_rate", 1)),
    "lap_change": Column(
        "lap less that at the first value, 95 % [s]", _interval("lap_change", 3, "+")
    ),
    "finished": Column("finished", lambda row: f"{row['finished']} of {row['attempts']}"),
    "interval": Column("95 %", _percent("finished")),
    "race": Column("median race [s]", _fixed("race_median", 3)),
    "lap": Column("mean lap [s]", _fixed("lap_mean", 3)),
    "lap_sd": Column("sd [s]", _fixed("lap_sd", 3)),
    "above_limit": Column("above the limit", _above_limit),
    "thrust": Column("thrust variation [m/s²/s]", _fixed("thrust_tv", 1)),
    "rates": Column("body rates, variation [rad/s²]", _fixed("rates_tv", 1)),
    "turned_back": Column("turned back", lambda row: row["turned_back"]),
    "lap_difference": Column("lap less the first, 95 % [s]", _interval("lap_difference", 3, "+")),
    "thrust_ratio": Column("ratio of thrust variations, 95 %", _interval("thrust_tv_ratio", 2)),
    "flights": Column("flights finished", lambda row: f"{row['finished']} of {row['flights']}"),
    "contacts": Column(
        "races with a contact", lambda row: f"{row['with_contact']} of {row['races']}"
    ),
    "contact_interval": Column("95 %", _percent("with_contact")),
    "overtakes": Column("overtakes in a race", _interval("overtakes", 2)),
    "heat_race": Column("race [s]", _interval("race", 3)),
    "race_mean": Column("mean race [s]", _spread("race_mean", "race_sd", 2)),
    "race_least": Column("fastest [s]", _fixed("race_min", 2)),
    "high_frequency": Column(
        "thrust's power above the motors' corner [%]", _fixed("high_frequency_fraction", 1, 100.0)
    ),
    "legs": Column("legs of 5 driven", _fixed("mean_legs", 0)),
    "paper_race": Column("paper: mean [s]", _spread("paper_mean", "paper_sd", 2)),
    "paper_least": Column("fastest [s]", _fixed("paper_min", 2)),
    "paper_finished": Column("finished", _paper_finished),
}
# The costs of Table II of the paper, here and in the paper, for each of its sigmas
for _sigma in ("0.5", "1.5", "3"):
    _key = _sigma.replace(".", "")
    COLUMNS[f"cost_{_key}"] = Column(
        f"sigma {_sigma}", _spread(f"mean_{_sigma}", f"sd_{_sigma}", 0)
    )
    COLUMNS[f"paper_cost_{_key}"] = Column(
        "paper", _spread(f"paper_mean_{_sigma}", f"paper_sd_{_sigma}", 0)
    )


# Columns whose texts an experiment may label
LABELLED = (COLUMNS["variant"], COLUMNS["setting"])
# Columns of sweeps whose texts are written once for the rows below each other
GROUPS = (COLUMNS["setting"], COLUMNS["value"])


def table(names: Sequence[str], columns: Sequence[str]) -> str:
    """Return the commands of experiments, their rows as one table, and how they were flown.

    Raises:
        KeyError: an experiment or a column has another name.
        FileNotFoundError: an experiment has not been flown.
    """
    flown = {name: read(name) for name in names}
    labels = {name: experiments()[name].labels for name in names}
    shown = [COLUMNS[column] for column in columns]
    rows = [
        [_cell(column, row, labels[name]) for column in shown]
        for name in names
        for row in _each_once(flown[name].rows)
    ]
    _leave_out_repeated(rows, sum(column in GROUPS for column in shown))
    lines = [f"    {one.command}" for one in flown.values()]
    lines += ["", _line([column.heading for column in shown])]
    lines += [_line(["---:" if column.is_number else "---" for column in shown])]
    lines += [_line(row) for row in rows]
    return "\n".join([*lines, "", *_provenance(flown.values()), "", ""])


def _each_once(rows: Iterable[Row]) -> Iterable[Row]:
    """Yield the rows of a table, the flights at the first values of a sweep once.

    The first value of each setting is often the default, with the same flights.
    """
    first: dict[str, str] = {}
    known: list[Row] = []
    for row in rows:
        setting = row.get("setting", "")
        value = row.get("value", "")
        if setting and value == first.setdefault(setting, value):
            flights = {key: text for key, text in row.items() if key not in ("setting", "value")}
            if flights in known:
                continue
            known.append(flights)
        yield row


def _leave_out_repeated(rows: Sequence[list[str]], columns: int) -> None:
    """Empty the cells of the first columns that are those of the row above."""
    above: list[str] = []
    for row in rows:
        here = row[:columns]
        same = 0
        while same < min(len(above), columns) and here[same] == above[same]:
            row[same] = ""
            same += 1
        above = here


def _cell(column: Column, row: Row, labels: Mapping[str, str]) -> str:
    text = column.text(row)
    if column is COLUMNS["value"]:
        return labels.get(f"{row['setting']}={text}", text)
    return labels.get(text, text) if column in LABELLED else text


def _line(cells: Sequence[str]) -> str:
    return f"| {' | '.join(cells)} |"


def _provenance(flown: Iterable[Flown]) -> list[str]:
    """Return one line for each day and machine, with the commits that flew then."""
    commits: dict[tuple[str, str], dict[str, None]] = {}
    for one in flown:
        commits.setdefault((one.date, one.machine), {}).update(dict.fromkeys(one.commit.split()))
    return [
        f"Flown on {date} at {_commits(known)}; {machine}."
        for (date, machine), known in commits.items()
    ]


def _commits(known: Iterable[str]) -> str:
    *others, last = (f"`{commit}`" for commit in known)
    return f"the commits {', '.join(others)} and {last}" if others else f"commit {last}"


def written(page: str) -> str:
    """Return the text of a page with the tables of the CSV files."""

    def replaced(found: re.Match[str]) -> str:
        names = found["names"].split()
        columns = [column.strip() for column in found["columns"].split(",")]
        return found[1] + table(names, columns) + found[5]

    return TABLE.sub(replaced, page)


if __name__ == "__main__":
    for path in sorted(DOCS.glob("**/*.md")):
        text = path.read_text(encoding="utf-8")
        if written(text) != text:
            path.write_text(written(text), encoding="utf-8")
            print(path.relative_to(DOCS))
