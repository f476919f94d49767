"""Every mistake in a file is one line with place, key, unit and what was found."""

from dataclasses import dataclass
from typing import Annotated, Literal, NamedTuple

import pytest
from msgspec import Meta, Struct, inspect

from quadsim.files.data_files import SIZE_MAX, locate, read_text
from quadsim.files.strict_yaml import FileError, load, parse, unit
from quadsim.files.yaml_values import misfits

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


class Mistake(NamedTuple):
    """A text with a mistake, and what its error names."""

    text: str
    place: str  # line, column and key
    names: tuple[str, ...]  # unit, what was expected, what was found


BAD = {
    "unknown key": Mistake(
        "points:\n  - at: [0, 0, 0]\n    yaw: 3\n",
        "3:5: points[0].yaw:",
        ("'yaw_deg'",),
    ),
    "nothing near": Mistake(
        GOOD + "q: 3\n",
        "3:1: q:",
        ("points, laps, loop",),
    ),
    "duplicate key": Mistake(
        GOOD + "laps: 1\nlaps: 2\n",
        "4:1: laps:",
        (
            "duplicate",
            "line 3",
        ),
    ),
    "missing key": Mistake(
        "points:\n  - {yaw_deg: 3}\n",
        "2:5: points[0].at:",
        (
            "missing",
            "3 numbers [m]",
        ),
    ),
    "missing list": Mistake(
        "laps: 2\n",
        "1:1: points:",
        (
            "missing",
            "1 or more",
        ),
    ),
    "no items": Mistake(
        "points: []\n",
        "1:9: points:",
        (
            "1 or more",
            "got 0",
        ),
    ),
    "not a list": Mistake(
        "points: 3\n",
        "1:9: points:",
        ("'3'",),
    ),
    "not a mapping": Mistake(
        "points: [3]\n",
        "1:10: points[0]:",
        (
            "mapping",
            "'3'",
        ),
    ),
    "wrong length": Mistake(
        "points: [{at: [1, 2]}]\n",
        "1:15: points[0].at:",
        (
            "3 numbers [m]",
            "got 2",
        ),
    ),
    "nested length": Mistake(
        GOOD + "box: [[1, 2]]\n",
        "3:6: box:",
        (
            "2 lists of 2 numbers [m]",
            "got 1",
        ),
    ),
    "word": Mistake(
        "points: [{at: [1, 2, up]}]\n",
        "1:22: points[0].at[2]:",
        (
            "[m]",
            "'up'",
        ),
    ),
    "list for a number": Mistake(
        GOOD + "    yaw_deg: [1]\n",
        "3:14: points[0].yaw_deg:",
        (
            "[deg]",
            "list of 1",
        ),
    ),
    "nothing": Mistake(
        GOOD + "    yaw_deg:\n",
        "3:13: points[0].yaw_deg:",
        (
            "[deg]",
            "nothing",
        ),
    ),
    "quoted": Mistake(
        GOOD + "    yaw_deg: '3'\n",
        "3:14: points[0].yaw_deg:",
        (
            "[deg]",
            "quoted",
            "'3'",
        ),
    ),
    "nan": Mistake(
        GOOD + "    yaw_deg: .nan\n",
        "3:14: points[0].yaw_deg:",
        (
            "[deg]",
            "not finite",
        ),
    ),
    "inf": Mistake(
        GOOD + "    yaw_deg: -.inf\n",
        "3:14: points[0].yaw_deg:",
        (
            "[deg]",
            "not finite",
        ),
    ),
    "overflow": Mistake(
        GOOD + "    yaw_deg: 1e999\n",
        "3:14: points[0].yaw_deg:",
        (
            "[deg]",
            "'1e999'",
        ),
    ),
    "zero": Mistake(
        GOOD + "    size: 0\n",
        "3:11: points[0].size:",
        (
            "[m] > 0",
            "got 0",
        ),
    ),
    "negative": Mistake(
        GOOD + "    size: -2\n",
        "3:11: points[0].size:",
        (
            "[m] > 0",
            "got -2",
        ),
    ),
    "yes for a number": Mistake(
        GOOD + "    yaw_deg: yes\n",
        "3:14: points[0].yaw_deg:",
        (
            "[deg]",
            "'yes'",
            "true or false",
        ),
    ),
    "octal": Mistake(
        GOOD + "    yaw_deg: 012\n",
        "3:14: points[0].yaw_deg:",
        (
            "[deg]",
            "'012'",
            "octal",
        ),
    ),
    "base 60": Mistake(
        GOOD + "    yaw_deg: 22:30\n",
        "3:14: points[0].yaw_deg:",
        (
            "[deg]",
            "'22:30'",
            "base 60",
        ),
    ),
    "hexadecimal": Mistake(
        GOOD + "    yaw_deg: 0x1F\n",
        "3:14: points[0].yaw_deg:",
        (
            "[deg]",
            "'0x1F'",
        ),
    ),
    "underscores": Mistake(
        GOOD + "laps: 1_0\n",
        "3:7: laps:",
        ("'1_0'",),
    ),
    "fraction": Mistake(
        GOOD + "laps: 2.5\n",
        "3:7: laps:",
        ("'2.5'",),
    ),
    "huge": Mistake(
        GOOD + f"laps: {'9' * 5000}\n",
        "3:7: laps:",
        (
            "whole number",
            "...",
        ),
    ),
    "yes for a truth": Mistake(
        GOOD + "loop: yes\n",
        "3:7: loop:",
        ("'yes'",),
    ),
    "on for a text": Mistake(
        GOOD + "name: on\n",
        "3:7: name:",
        (
            "'on'",
            "true or false",
            "quotes",
        ),
    ),
    "number for a text": Mistake(
        GOOD + "name: 12\n",
        "3:7: name:",
        (
            "'12'",
            "int",
            "quotes",
        ),
    ),
    "date for a text": Mistake(
        GOOD + "name: 2024-01-31\n",
        "3:7: name:",
        (
            "timestamp",
            "quotes",
        ),
    ),
    "no such choice": Mistake(
        GOOD + "law: exakt\n",
        "3:6: law:",
        (
            "'exact'",
            "'paper'",
            "'exakt'",
        ),
    ),
    "number as key": Mistake(
        GOOD + "1: 2\n",
        "3:1: '1':",
        ("unknown",),
    ),
    "list as key": Mistake(
        GOOD + "? [1, 2]\n: 3\n",
        "3:3:",
        (
            "key",
            "list of 2",
        ),
    ),
    "merge key": Mistake(
        GOOD + "<<: {laps: 2}\n",
        "3:1: '<<':",
        ("unknown",),
    ),
    "key that would break the line": Mistake(
        GOOD + '"a\\nb\\e[31m": 1\n',
        "3:1: 'a\\nb\\x1b[31m':",
        ("unknown",),
    ),
    "empty": Mistake(
        "",
        "1:1:",
        ("empty",),
    ),
    "comments only": Mistake(
        "# nothing\n\n",
        "1:1:",
        ("empty",),
    ),
    "list as document": Mistake(
        "- 1\n- 2\n",
        "1:1:",
        (
            "mapping",
            "list of 2",
        ),
    ),
    "text as document": Mistake(
        "hello\n",
        "1:1:",
        (
            "mapping",
            "'hello'",
        ),
    ),
    "two documents": Mistake(
        GOOD + "---\n" + GOOD,
        "3:1:",
        ("one document",),
    ),
    "alias": Mistake(
        "points: &p [{at: [0, 0, 0]}]\nname: *p\n",
        "1:9:",
        ("aliases",),
    ),
    "alias alone": Mistake(
        GOOD + "name: *p\n",
        "3:7:",
        ("aliases",),
    ),
    "tag": Mistake(
        GOOD + "name: !!python/object/apply:os.getcwd []\n",
        "3:7:",
        ("tags",),
    ),
    "depth": Mistake(
        "points: " + "[" * 5000,
        "1:20:",
        ("at most 12",),
    ),
    "tab": Mistake(
        "points:\n\t- at: [0, 0, 0]\n",
        "2:1:",
        ("tab",),
    ),
    "unclosed": Mistake(
        "points: [{at: [0, 0, 0]}\nlaps: 1\n",
        "2:1:",
        (
            "not YAML",
            "line 1",
        ),
    ),
    "control character": Mistake(
        GOOD + "name: a\x07b\n",
        "3:8:",
        ("'\\x07'",),
    ),
}


def error_of(text):
    with pytest.raises(FileError) as error:
        load(text, "my.yaml", TextTable)
    return error.value


def test_each_mistake_is_one_line_with_its_place():
    for name, mistake in BAD.items():
        line = str(error_of(mistake.text))
        assert line.startswith(f"my.yaml:{mistake.place} "), name
        assert line.isprintable(), name
        for expected in mistake.names:
            assert expected in line, name


def test_the_first_error_has_all_others_of_the_file_in_their_order():
    text = "points:\n  - {at: [0, 0], yaw_deg: north}\n  - {yaw: 3}\nnames: x\nbox: 7\n"
    first = error_of(text)
    lines = [str(error) for error in (first, *first.others)]
    assert [line.split(":")[3].strip() for line in lines] == [
        *("points[0].at", "points[0].yaw_deg", "points[1].yaw", "points[1].at", "names", "box")
    ]
    assert all(error.excerpt for error in first.others)


def test_each_mistake_is_the_first_of_all_and_a_right_file_has_none():
    for name, mistake in BAD.items():
        error = error_of(mistake.text)
        assert all(str(other) != str(error) for other in error.others), name
    kind = inspect.type_info(TextTable)
    assert misfits(parse(GOOD, "my.yaml").root, kind) == []


def test_checks_beyond_the_schema_raise_the_first_problem_of_each_key():
    document = parse(GOOD, "my.yaml")
    document.check([])
    with pytest.raises(FileError) as error:
        document.check([("points[0].at", "no"), ("points[0].at", "nor this"), ("points", "few")])
    assert [error.value.problem, *(o.problem for o in error.value.others)] == ["no", "few"]


def test_excerpt_puts_the_caret_under_the_named_column():
    for name, mistake in BAD.items():
        excerpt = error_of(mistake.text).excerpt
        line, column = (int(number) for number in mistake.place.split(":")[:2])
        if "empty" in mistake.names:
            assert excerpt == "", name
            continue
        source, caret = excerpt.split("\n")
        assert caret == " " * (column - 1) + "^", name
        written = [*mistake.text.split("\n"), ""][line - 1]
        assert written.replace("\t", " ").replace("\x07", " ").startswith(source), name


def test_a_number_in_a_numbers_place_is_that_number():
    for text in ("1e-3", "1.0e-3", ".001", "+0.001", "1E-3", "0.1e-2"):
        sheet = load(f"points:\n  - {{at: [0, 0, 0], yaw_deg: {text}}}\n", "my.yaml", TextTable)
        assert sheet.points[0].yaw_deg == 0.001, text


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


@pytest.mark.slow
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
