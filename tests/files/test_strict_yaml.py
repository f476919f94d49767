"""Every mistake in a file gets one line with place, key, unit and what was found."""

from dataclasses import dataclass
from typing import Annotated, Literal

import pytest
from msgspec import Meta, Struct

from quadsim.files.data_files import SIZE_MAX, locate, read_text
from quadsim.files.strict_yaml import FileError, load, parse, unit

Metre = Annotated[float, unit("m")]


class Point(Struct, frozen=True):
    at: tuple[Metre, Metre, Metre]
    yaw_deg: Annotated[float, unit("deg")] = 0.0
    size: Annotated[float, unit("m", gt=0)] | None = None


class TextTable(Struct, frozen=True):
    points: Annotated[tuple[Point, ...], Meta(min_length=1)]
    laps: Annotated[int, Meta(ge=1, le=9)] = 1
    loop: bool = False
    name: str = ""
    law: Literal["exact", "paper"] = "exact"
    box: tuple[tuple[Metre, Metre], tuple[Metre, Metre]] | None = None


@dataclass(frozen=True)
class Planner:
    temperature: Annotated[float, unit("m/s")] = 0.3
    sigma: tuple[float, ...] = (1.0,)

    def __post_init__(self) -> None:
        if min(self.sigma) <= 0:
            raise ValueError(f"sigma: expected numbers > 0, got {self.sigma}")


@dataclass(frozen=True)
class Preset:
    planner: Planner
    title: str = ""


GOOD = "points:\n  - at: [0, 1.5, -2e0]\n"
BAD = {
    "unknown key": (
        "points:\n  - at: [0, 0, 0]\n    yaw: 3\n",
        "3:5: points[0].yaw: unknown key, did you mean 'yaw_deg'?",
    ),
    "nothing near": (
        GOOD + "q: 3\n",
        "3:1: q: unknown key, known are points, laps, loop, name, law, box",
    ),
    "duplicate key": (GOOD + "laps: 1\nlaps: 2\n", "4:1: laps: duplicate key, first on line 3"),
    "missing key": (
        "points:\n  - {yaw_deg: 3}\n",
        "2:5: points[0].at: missing, expected 3 numbers [m]",
    ),
    "missing list": ("laps: 2\n", "1:1: points: missing, expected 1 or more mappings with at"),
    "no items": ("points: []\n", "1:9: points: expected 1 or more mappings with at, got 0"),
    "not a list": ("points: 3\n", "1:9: points: expected 1 or more mappings with at, got '3'"),
    "not a mapping": ("points: [3]\n", "1:10: points[0]: expected a mapping (key: value), got '3'"),
    "wrong length": (
        "points: [{at: [1, 2]}]\n",
        "1:15: points[0].at: expected 3 numbers [m], got 2",
    ),
    "nested length": (
        GOOD + "box: [[1, 2]]\n",
        "3:6: box: expected 2 lists of 2 numbers [m], got 1",
    ),
    "word": (
        "points: [{at: [1, 2, up]}]\n",
        "1:22: points[0].at[2]: expected a number [m], got 'up'",
    ),
    "list for a number": (
        GOOD + "    yaw_deg: [1]\n",
        "3:14: points[0].yaw_deg: expected a number [deg], got a list of 1",
    ),
    "nothing": (
        GOOD + "    yaw_deg:\n",
        "3:13: points[0].yaw_deg: expected a number [deg], got nothing",
    ),
    "quoted": (
        GOOD + "    yaw_deg: '3'\n",
        "3:14: points[0].yaw_deg: expected a number [deg], got the quoted text '3'",
    ),
    "nan": (
        GOOD + "    yaw_deg: .nan\n",
        "3:14: points[0].yaw_deg: expected a number [deg], got '.nan' (not finite)",
    ),
    "inf": (
        GOOD + "    yaw_deg: -.inf\n",
        "3:14: points[0].yaw_deg: expected a number [deg], got '-.inf' (not finite)",
    ),
    "overflow": (
        GOOD + "    yaw_deg: 1e999\n",
        "3:14: points[0].yaw_deg: expected a number [deg], got '1e999'",
    ),
    "zero": (GOOD + "    size: 0\n", "3:11: points[0].size: expected a number [m] > 0, got 0"),
    "negative": (
        GOOD + "    size: -2\n",
        "3:11: points[0].size: expected a number [m] > 0, got -2",
    ),
    "yes for a number": (
        GOOD + "    yaw_deg: yes\n",
        "3:14: points[0].yaw_deg: expected a number [deg], got 'yes' (YAML reads it as true or false)",
    ),
    "octal": (
        GOOD + "    yaw_deg: 012\n",
        "3:14: points[0].yaw_deg: expected a number [deg], got '012' (YAML reads it as octal: drop the leading zero)",
    ),
    "base 60": (
        GOOD + "    yaw_deg: 22:30\n",
        "3:14: points[0].yaw_deg: expected a number [deg], got '22:30' (YAML reads it in base 60)",
    ),
    "hexadecimal": (
        GOOD + "    yaw_deg: 0x1F\n",
        "3:14: points[0].yaw_deg: expected a number [deg], got '0x1F'",
    ),
    "underscores": (GOOD + "laps: 1_0\n", "3:7: laps: expected a whole number, got '1_0'"),
    "fraction": (GOOD + "laps: 2.5\n", "3:7: laps: expected a whole number, got '2.5'"),
    "huge": (
        GOOD + f"laps: {'9' * 5000}\n",
        f"3:7: laps: expected a whole number, got '{'9' * 57}...'",
    ),
    "yes for a truth": (
        GOOD + "loop: yes\n",
        "3:7: loop: expected true or false, got 'yes' (YAML reads it as true or false)",
    ),
    "on for a text": (
        GOOD + "name: on\n",
        "3:7: name: expected text, got 'on' (YAML reads it as true or false; put it in quotes)",
    ),
    "number for a text": (
        GOOD + "name: 12\n",
        "3:7: name: expected text, got '12' (YAML reads it as int; put it in quotes)",
    ),
    "date for a text": (
        GOOD + "name: 2024-01-31\n",
        "3:7: name: expected text, got '2024-01-31' (YAML reads it as timestamp; put it in quotes)",
    ),
    "no such choice": (GOOD + "law: exakt\n", "3:6: law: expected 'exact' or 'paper', got 'exakt'"),
    "number as key": (
        GOOD + "1: 2\n",
        "3:1: '1': unknown key, known are points, laps, loop, name, law, box",
    ),
    "list as key": (GOOD + "? [1, 2]\n: 3\n", "3:3: expected a key, got a list of 2"),
    "merge key": (
        GOOD + "<<: {laps: 2}\n",
        "3:1: '<<': unknown key, known are points, laps, loop, name, law, box",
    ),
    "key that would break the line": (
        GOOD + '"a\\nb\\e[31m": 1\n',
        "3:1: 'a\\nb\\x1b[31m': unknown key, known are points, laps, loop, name, law, box",
    ),
    "empty": ("", "1:1: empty file, expected a mapping (key: value)"),
    "comments only": ("# nothing\n\n", "1:1: empty file, expected a mapping (key: value)"),
    "list as document": ("- 1\n- 2\n", "1:1: expected a mapping (key: value), got a list of 2"),
    "text as document": ("hello\n", "1:1: expected a mapping (key: value), got 'hello'"),
    "two documents": (GOOD + "---\n" + GOOD, "3:1: expected one document, found a second one"),
    "alias": ("points: &p [{at: [0, 0, 0]}]\nname: *p\n", "1:9: aliases are not allowed"),
    "alias alone": (GOOD + "name: *p\n", "3:7: aliases are not allowed"),
    "tag": (GOOD + "name: !!python/object/apply:os.getcwd []\n", "3:7: tags are not allowed"),
    "depth": ("points: " + "[" * 5000, "1:20: expected at most 12 levels of nesting, got more"),
    "tab": ("points:\n\t- at: [0, 0, 0]\n", "2:1: expected spaces, got a tab"),
    "unclosed": (
        "points: [{at: [0, 0, 0]}\nlaps: 1\n",
        "2:1: not YAML: expected ',' or ']', but got '<scalar>' (while parsing a flow sequence, line 1)",
    ),
    "control character": (GOOD + "name: a\x07b\n", "3:8: unprintable character '\\x07'"),
}


@pytest.mark.parametrize("name", BAD)
def test_each_mistake_has_its_one_line(name):
    text, message = BAD[name]
    with pytest.raises(FileError) as error:
        load(text, "my.yaml", TextTable)
    assert str(error.value) == f"my.yaml:{message}"


@pytest.mark.parametrize("name", BAD)
def test_excerpt_puts_the_caret_under_the_named_column(name):
    text, message = BAD[name]
    with pytest.raises(FileError) as error:
        load(text, "my.yaml", TextTable)
    line, column = (int(n) for n in message.split(":")[:2])
    if error.value.excerpt and column <= 50:
        source, caret = error.value.excerpt.split("\n")
        assert caret == " " * (column - 1) + "^"
        assert (
            [*text.split("\n"), ""][line - 1]
            .replace("\t", " ")
            .replace("\x07", " ")
            .startswith(source)
        )
    else:
        assert "empty file" in message


@pytest.mark.parametrize("text", ["1e-3", "1.0e-3", ".001", "+0.001", "1E-3", "0.1e-2"])
def test_a_number_in_a_numbers_place_is_that_number(text):
    sheet = load(f"points:\n  - {{at: [0, 0, 0], yaw_deg: {text}}}\n", "my.yaml", TextTable)
    assert sheet.points[0].yaw_deg == 0.001


def test_text_that_looks_like_a_number_only_to_some_is_text():
    assert load(GOOD + "name: 1e-3\n", "my.yaml", TextTable).name == "1e-3"


def test_defaults_fill_what_the_file_leaves_out():
    assert load(GOOD, "my.yaml", TextTable) == TextTable(points=(Point(at=(0.0, 1.5, -2.0)),))


def test_null_stands_for_an_optional_value_left_out():
    assert load(GOOD + "    size:\nbox: null\n", "my.yaml", TextTable) == load(
        GOOD, "my.yaml", TextTable
    )


def test_a_later_check_can_point_at_a_key_or_at_what_would_hold_it():
    document = parse(GOOD + "    yaw_deg: 7\n", "my.yaml")
    assert str(document.error("points[0].yaw_deg", "no")) == "my.yaml:3:14: points[0].yaw_deg: no"
    assert str(document.error("points[0].size", "no")) == "my.yaml:2:5: points[0].size: no"


def test_a_dataclass_is_a_schema_and_its_own_refusal_gets_a_place():
    assert load("planner: {sigma: [1, 2]}\n", "p.yaml", Preset).planner == Planner(sigma=(1.0, 2.0))
    with pytest.raises(FileError) as error:
        load("title: t\nplanner: {sigma: [1, -2]}\n", "p.yaml", Preset)
    assert str(error.value) == "p.yaml:2:10: planner: sigma: expected numbers > 0, got (1.0, -2.0)"


def test_long_lines_are_cut_around_the_caret():
    with pytest.raises(FileError) as error:
        load("points: [" + "{at: [0, 0, 0]}, " * 200 + "7]\n", "my.yaml", TextTable)
    source, caret = error.value.excerpt.split("\n")
    assert len(source) <= 100
    assert source[len(caret) - 1] == "7"


def test_files_that_cannot_be_read_say_why(tmp_path):
    (tmp_path / "latin.yaml").write_bytes(b"laps: 1\nname: caf\xe9\n")
    (tmp_path / "large.yaml").write_bytes(b"#" * (SIZE_MAX + 1))
    cases = {
        "missing.yaml": ": no such file",
        ".": ": expected a YAML file, got a folder",
        "latin.yaml": ":2:10: expected UTF-8, got byte 0xe9",
        "large.yaml": ": expected at most 1000000 bytes, got more",
    }
    for name, message in cases.items():
        path = tmp_path / name
        with pytest.raises(FileError) as error:
            read_text(path)
        assert str(error.value) == f"{path}{message}"


def test_a_byte_order_mark_is_no_part_of_the_text(tmp_path):
    (tmp_path / "bom.yaml").write_bytes(b"\xef\xbb\xbfname: a\n")
    assert read_text(tmp_path / "bom.yaml") == "name: a\n"


def test_a_name_is_looked_up_and_a_path_is_taken_as_it_stands(tmp_path):
    (tmp_path / "oval.yaml").write_text("")
    assert locate("oval", tmp_path, "course") == tmp_path / "oval.yaml"
    assert str(locate("oval.yaml", tmp_path, "course")) == "oval.yaml"
    assert str(locate("a/oval", tmp_path, "course")) == "a/oval"
