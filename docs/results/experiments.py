"""The flights behind the tables of results: experiments.yaml, and what each of them has written.

A CSV file of docs/results/ has a row for each variant of an experiment, and one of
docs/results/flights/ a row for each flight. Both begin with lines "# key: value" that tell how
their rows were flown.
"""

from __future__ import annotations

import csv
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import yaml
from msgspec import Struct, convert

from quadsim.files.atomic import replace_file
from quadsim.files.csv_rows import csv_text

FOLDER = Path(__file__).parent
FLIGHTS = FOLDER / "flights"
FILE = FOLDER / "experiments.yaml"


class Experiment(Struct, forbid_unknown_fields=True, frozen=True):
    """One command of flights, and how its rows are named on a page."""

    command: str
    minutes: int  # on one quiet core
    # Variant, setting of a sweep, or setting=value -> its text in tables and figures
    labels: dict[str, str] = {}
    needs: str = ""  # extra or program that not every machine has


@dataclass(frozen=True)
class Flown:
    """The rows that the command of an experiment gave."""

    command: str
    commit: str
    date: str
    machine: str
    rows: Sequence[Mapping[str, str]] = field(repr=False)


def experiments() -> dict[str, Experiment]:
    """Return the experiments by name, in the order in which they are flown."""
    return convert(yaml.safe_load(FILE.read_text(encoding="utf-8")), dict[str, Experiment])


def csv_file(name: str) -> Path:
    """Return the file with a row for each variant of an experiment."""
    return FOLDER / f"{name}.csv"


def flights_file(name: str) -> Path:
    """Return the file with a row for each flight; races of several vehicles have none."""
    return FLIGHTS / f"{name}.csv"


def read(name: str) -> Flown:
    """Return the rows of an experiment's variants.

    Raises:
        FileNotFoundError: it was not flown yet.
    """
    return read_file(csv_file(name))


def write(name: str, flown: Flown) -> Path:
    """Write the rows of an experiment's variants, the whole file or nothing."""
    return write_file(csv_file(name), flown)


def read_file(path: Path) -> Flown:
    """Return the rows of one of the files of an experiment.

    Raises:
        FileNotFoundError: it was not flown yet.
    """
    lines = path.read_text(encoding="utf-8").splitlines()
    heads = [line for line in lines if line.startswith("# ")]
    known = dict(line.removeprefix("# ").split(": ", 1) for line in heads)
    rows = list(csv.DictReader(lines[len(heads) :]))
    return Flown(known["command"], known["commit"], known["date"], known["machine"], rows)


def write_file(path: Path, flown: Flown) -> Path:
    """Write one of the files of an experiment, the whole file or nothing."""
    heads = {
        "command": flown.command,
        "commit": flown.commit,
        "date": flown.date,
        "machine": flown.machine,
    }
    text = "".join(f"# {key}: {value}\n" for key, value in heads.items())
    text += csv_text(flown.rows).replace("\r\n", "\n")
    path.parent.mkdir(exist_ok=True)
    replace_file(path, text.encode())
    return path
