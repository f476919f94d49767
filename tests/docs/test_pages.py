"""README.md and docs/*.md print what the project prints.

Every printed result (a comment behind a `print`, a block of output, a table with right-aligned
columns) is of one of these kinds:

* It is made here again and compared: examples in Python, reports of single flights, errors, and
  tables that a command prints without flying.
* It takes minutes to days: campaigns, searches, training, tables of flights. It is not verified:
  it stands below a command in the same section, and the command is one that the project takes.
* It depends on the wall clock: all that `race bench`, `tests/web/measure.py`, training and flights
  with `--clock wall` print, and the lines of a report on planning and simulation. It is never
  compared. A table of it stands below its command too; a report on a page leaves the lines out.

Another processor rounds otherwise, and without PyBullet another rigid body flies. So digits of
flights are compared on processors like the one that the pages were made on, and elsewhere times
within TOLERANCE and other numbers within FACTOR.

`make docs-check` makes the results again; the other tests here read the pages alone.
"""

import ast
import contextlib
import io
import os
import re
import shlex
import sys
from fnmatch import fnmatch
from functools import cache, partial
from pathlib import Path

import pytest
from cyclopts import CycloptsError, MissingArgumentError

import quadsim
from docs.results.machine import has_documented_digits
from quadsim.cli.cli import race
from quadsim.cli.parse import application
from tests.docs.names import is_taken, unknown_flags
from tests.docs.pages import PAGES, ROOT, Block, Result, blocks, results

# Commands that print their numbers without a flight.
QUICK = re.compile(r"race (courses|vehicles|check .*|limit .* --known|paper exploration --json)$")
# Commands that fly once, on the simulated clock.
FLIGHT = re.compile(r"race fly(?!.*--clock wall)")
# A result behind a printing statement has a number; another comment is a remark.
PRINTED = re.compile(r"print\(.*\)  # (?P<text>.*\d.*)$")
# A word in capitals in place of a value.
PLACEHOLDER = re.compile(r"\[?[A-Z]+\]?")
NUMBER = re.compile(r"-?\d+(?:\.\d+)?(?![\w.]*\w)")
# Seconds of a flight are printed with three decimals.
TIME = re.compile(r"-?\d+\.\d{3}")
# On a processor without AVX and FMA the splits of README's flight differ by 3 % at most, and the
# largest rate of change of its thrust by a factor of 3.4; laps differ by 12 ms at most
# (docs/reproducibility.md), and so do their differences.
TOLERANCE = 0.05
LEAST_TOLERANCE = 0.02  # [s]
FACTOR = 4.0
# A number with more characters is in full precision, as JSON has it.
EXACT = 12
FIGURE = re.compile(r"!\[[^]]*\]\(([^)]+\.(?:png|webp))\)")

FLY = quadsim.fly
RESULTS = [result for page in PAGES for result in results(page)]
MAKEFILE = (ROOT / "Makefile").read_text()


def as_typed(command: str) -> str:
    """Return a command as it is entered without make."""
    return "race fly" if command == "make race" else command


def made_by(pattern: re.Pattern, result: Result) -> bool:
    """Return whether all commands of a result fit a pattern."""
    commands = [as_typed(command) for command in result.commands]
    return bool(commands) and all(map(pattern.match, commands))


OUTPUTS = [r for r in RESULTS if r.block.kind == "" and r.block.output]
QUICK_OUTPUTS = [r for r in OUTPUTS if made_by(QUICK, r)]
REPORTS = [r for r in OUTPUTS if made_by(FLIGHT, r)]
QUICK_TABLES = [r for r in RESULTS if r.block.kind == "table" and made_by(QUICK, r)]
COMPARED = [r.block for r in (*QUICK_OUTPUTS, *REPORTS, *QUICK_TABLES)]
SLOW = [r for r in RESULTS if r.block not in COMPARED]

by_place = partial(pytest.mark.parametrize, ids=lambda result: result.block.name)


def examples() -> list[tuple[Block, str]]:
    """Return each block of Python with a printed result, and the imports above it on its page.

    So such a block may use what is imported above it, but no variable of another block.
    """
    found = []
    for page in PAGES:
        imports = ""
        for block in (block for section in blocks(page) for block in section):
            if block.kind != "python":
                continue
            source = "\n".join(block.lines)
            if any(map(PRINTED.search, block.lines)):
                found.append((block, imports))
            for node in ast.parse(source).body:
                if isinstance(node, ast.Import | ast.ImportFrom):
                    imports += ast.unparse(node) + "\n"
    return found


EXAMPLES = examples()


@cache
def agrees(printed: str, found: str, flown: bool, digits: bool | None = None) -> bool:
    """Return whether a line of a page is the line that was found; spaces may differ.

    Args:
        printed: the page's line; "..." stands for any characters.
        found: a line of output.
        flown: whether its numbers are those of a flight.
        digits: whether all digits of a flight must agree; None: on a machine like that of the
            pages.
    """
    printed = " ".join(printed.split())
    found = " ".join(found.split())
    pattern = re.escape(printed).replace(re.escape("..."), r"\S*")
    if re.fullmatch(pattern, found):
        return True
    if not flown or (has_documented_digits() if digits is None else digits):
        return False
    return _about(printed.replace("...", ""), found)


def _about(printed: str, found: str) -> bool:
    """Return whether lines have the same words and similar numbers.

    Times differ by TOLERANCE or LEAST_TOLERANCE at most, other numbers by FACTOR, or by one in
    their last digit.
    """
    if NUMBER.split(printed) != NUMBER.split(found):
        return False
    pairs = zip(NUMBER.findall(printed), NUMBER.findall(found), strict=True)
    return all(_is_similar(there, float(here)) for there, here in pairs)


def _is_similar(there: str, here: float) -> bool:
    """Return whether another processor may find `here` where a page has `there`."""
    number = float(there)
    if TIME.fullmatch(there):
        return abs(number - here) <= max(TOLERANCE * abs(number), LEAST_TOLERANCE)
    last_digit = 10.0 ** -len(there.partition(".")[2])
    low, high = sorted((number / FACTOR, number * FACTOR))
    return low <= here <= high or ("." in there and abs(number - here) <= 1.001 * last_digit)


@cache
def fly_once(*args, **settings):
    """Fly on one thread; the same flight of another page is not flown again."""
    return FLY(*args, **settings, threads=1)


def row_of(name: str, output: str) -> str:
    """Return the lines of a printed table that begin with a name, or all where none does."""
    own = [line for line in output.splitlines() if line.split(" ")[0] == name.strip("`")]
    return "\n".join(own) or output


def filled(command: str, cells: dict[str, str]) -> str:
    """Return a command with the cells of a row in place of their columns' names in capitals."""
    words = [cells.get(word.lower(), word) if word.isupper() else word for word in command.split()]
    return " ".join(words)


def leading_numbers(cell: str) -> list[str]:
    """Return the numbers of a cell that holds numbers and units, none of one that is prose."""
    return NUMBER.findall(cell) if re.match(r"[\d-]", cell) else []


def is_among(number: str, found: list[str]) -> bool:
    """Return whether a page's number was printed, or a number of JSON rounds to it."""
    decimals = len(number.partition(".")[2])
    return any(
        number == one or (len(one) > EXACT and f"{float(one):.{decimals}f}" == number)
        for one in found
    )


def parses(command: str) -> bool:
    """Return whether `race` takes a command line, up to values that a sentence leaves out."""
    _, *words = shlex.split(command)
    words = [word for word in words if not word.startswith("[")]
    words = ["1" if PLACEHOLDER.fullmatch(word) else word for word in words]
    try:
        application().parse_args(words, print_error=False, exit_on_error=False)
    except MissingArgumentError:
        # A sentence names the flag without the rest of the command.
        return True
    except CycloptsError:
        return False
    return True


def missing(page: list[str], output: str, flown: bool, digits: bool | None = None) -> list[str]:
    """Return the lines of a page that an output does not have, in this order."""
    lines = iter(output.splitlines())
    return [
        line
        for line in page
        if not any(agrees(line, candidate, flown, digits) for candidate in lines)
    ]


@cache
def printed_by(command: str) -> str:
    """Return what a command prints, on stdout and stderr, in the present folder.

    `.ci/run` names in RACE_PRINTED the file with what `make race` has just printed: this flight of
    a minute is not flown twice there.
    """
    if command == "make race" and "RACE_PRINTED" in os.environ:
        return Path(os.environ["RACE_PRINTED"]).read_text()
    command = as_typed(command)
    words = shlex.split(command)[1:]
    if words[0] == "fly":
        # The other core may run other tests; the digits do not depend on the number of threads.
        words += ["--threads", "1"]
    shown = io.StringIO()
    with contextlib.redirect_stdout(shown), contextlib.redirect_stderr(shown):
        race(words)
    return shown.getvalue()


@pytest.fixture(scope="module", autouse=True)
def _in_a_folder_with_mine_yaml(tmp_path_factory):
    """Run this file in an empty folder with the wrong course that the pages show."""
    folder = tmp_path_factory.mktemp("pages")
    course = (ROOT / "courses" / "figure8.yaml").read_text()
    wrong = re.sub(r"yaw_deg: 45}\s+# middle, low", "yaw_deg: north}", course)
    assert wrong != course
    with contextlib.chdir(folder):
        Path("mine.yaml").write_text(wrong)
        yield


def test_the_pages_have_results_of_every_kind():
    assert EXAMPLES
    assert QUICK_OUTPUTS
    assert REPORTS
    assert QUICK_TABLES
    assert SLOW


@pytest.mark.docs
@pytest.mark.parametrize(("block", "imports"), EXAMPLES, ids=[block.name for block, _ in EXAMPLES])
def test_an_example_prints_the_numbers_behind_its_prints(block, imports, monkeypatch):
    monkeypatch.setenv("MPLBACKEND", "agg")
    monkeypatch.setattr(quadsim, "fly", fly_once)
    lines: dict[int, str] = {}

    def recorded(*values):
        number = sys._getframe(1).f_lineno
        lines[number] = " ".join(map(str, values))

    exec(imports + "\n".join(block.lines), {"print": recorded, "__name__": "__main__"})
    above = imports.count("\n")
    for number, line in enumerate(block.lines, above + 1):
        if match := PRINTED.search(line):
            assert agrees(match["text"], lines[number], flown=True), (line, lines[number])


@pytest.mark.docs
@by_place("result", QUICK_OUTPUTS)
def test_a_command_prints_the_block_below_it(result):
    printed = "".join(map(printed_by, result.commands))
    assert missing(result.block.output, printed, flown=False) == []


@pytest.mark.docs
@by_place("result", REPORTS)
def test_a_flight_prints_the_report_below_it(result):
    printed = "".join(map(printed_by, result.commands))
    assert missing(result.block.output, printed, flown=True) == []


@pytest.mark.docs
@by_place("result", QUICK_TABLES)
def test_commands_print_the_numbers_of_each_row_below_them(result):
    """The commands may name columns of the table in capitals."""
    heads, *rows = result.block.rows
    assert rows
    for row in rows:
        cells = dict(zip(heads, row, strict=True))
        texts = [row_of(row[0], printed_by(filled(c, cells))) for c in result.commands]
        found = [number for text in texts for number in NUMBER.findall(text)]
        numbers = [n for cell in row[1:] if "--" not in cell for n in leading_numbers(cell)]
        assert numbers, row
        assert [number for number in numbers if not is_among(number, found)] == [], row


def test_a_result_that_is_not_made_again_stands_below_a_command():
    """Nothing more is known of these results: their flights take minutes to days."""
    assert [result.block.name for result in SLOW if not result.commands] == []


@pytest.mark.docs
def test_race_takes_the_commands_on_the_pages():
    commands = {c for page in PAGES for s in blocks(page) for b in s for c in b.commands}
    flown = [c for c in commands if c.startswith("race ") and not c.startswith("race --")]
    assert len(flown) > 50
    assert [command for command in flown if not parses(command)] == []
    wrong = [
        "race fly --sampels 3",
        "race fyl",
        "race render --frames two",
        "race fly --clock sundial",
    ]
    assert [command for command in wrong if parses(command)] == []


def test_the_figures_of_the_pages_are_made_by_make_docs_figures():
    recipe = MAKEFILE.partition("\ndocs-figures:")[2].partition("\n\n")[0]
    commands = re.findall(r"\$\(BIN\)/([^#\n]+)", recipe)
    assert [command for command in commands if not is_taken(command)] == []
    assert [flag for command in commands for flag in unknown_flags(command)] == []
    made = re.findall(r"docs/(?:gallery/)?([\w*]+\.(?:png|webp))", recipe)
    shown = {Path(name).name for page in PAGES for name in FIGURE.findall(page.read_text())}
    assert len(shown) > 10
    assert [name for name in shown if not any(fnmatch(name, one) for one in made)] == []


PAGE = """# Title

`race courses` lists them:

    split  2 laps, 15.735 s
    laps   5.343 s

| course | lap |
|---|---:|
| `split` | 5.343 |

## Formula

```text
x = 0.5 y
```

| x | 0.5 |
|---|---:|
| y | 1.5 |
"""


def test_a_result_belongs_to_the_command_above_it_in_its_section(tmp_path, monkeypatch):
    page = tmp_path / "page.md"
    page.write_text(PAGE)
    monkeypatch.setattr("tests.docs.pages.ROOT", tmp_path)
    found = [(result.block.line, result.block.kind, result.commands) for result in results(page)]
    assert found == [(5, "", ["race courses"]), (8, "table", ["race courses"]), (18, "table", [])]


@pytest.mark.parametrize(
    ("printed", "output", "same"),
    [
        (["a  15.735 s"], "first\na 15.735 s\nlast", True),
        (["a  15.735 s"], "a 15.736 s", False),
        (["a 15.735 s", "b 1"], "b 1\na 15.735 s", False),
        (["finished [4.467...]"], "finished [4.4676]", True),
        (["finished [4.467...]"], "finished [4.4686]", False),
    ],
)
def test_a_changed_digit_or_order_is_noticed(printed, output, same):
    assert (missing(printed, output, flown=False) == []) is same


@pytest.mark.parametrize(
    ("printed", "found", "same"),
    [
        ("1 lap  5.343 s  16.8 m/s", "1 lap 5.400 s 10.0 m/s", True),
        ("finished [4.467...]", "finished [4.5012345]", True),
        ("finished [4.467...]", "finished [4.7012345]", False),
        ("1 lap  5.343 s", "1 lap 5.700 s", False),
        ("1 lap  5.343 s", "1 lap 5.343 m", False),
        ("split  0.278 s", "split 0.297 s", True),
        ("split  0.278 s", "split 0.299 s", False),
        ("faster by -0.048 s", "faster by -0.070 s", False),
        ("3 laps  16.8 m/s", "3 laps 4.1 m/s", False),
        ("3 laps  16.8 m/s", "0 laps 16.8 m/s", False),
        ("thrust -4.0", "thrust 4.0", False),
        ("chatter 0.0", "chatter 0.1", True),
    ],
)
def test_elsewhere_times_agree_within_the_tolerance(printed, found, same, monkeypatch):
    monkeypatch.setitem(globals(), "has_documented_digits", lambda: False)
    assert agrees(printed, found, flown=True) is same
    assert not agrees(printed, found, flown=False)
