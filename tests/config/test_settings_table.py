"""The tables of settings and keys are those of the code, and units do not mix."""

import re

import pytest

import quadsim
from quadsim.cli.cli import race
from quadsim.config.settings import SETTINGS
from quadsim.controllers import PRESETS
from quadsim.course.course_file import CourseFile
from quadsim.sensing.camera import Camera
from quadsim.sensing.sensing_file import SensingFile
from quadsim.tables.settings_table import key_rows, setting_rows
from quadsim.tables.write_tables import COMMAND, DOCS, TABLE, tables, written
from quadsim.vehicle.vehicle import VehicleFile

PAGES = {page.name: page.read_text() for page in DOCS.glob("*.md")}
FILES = {"course": CourseFile, "vehicle": VehicleFile, "sensing": SensingFile, "camera": Camera}
KEYS = [(kind, row) for kind, schema in FILES.items() for row in key_rows(schema)]
ANGLE = re.compile(r"\bdeg|degree")


def test_the_tables_of_the_docs_are_up_to_date():
    assert [name for name, text in PAGES.items() if written(text) != text] == [], f"run {COMMAND}"


def test_every_table_is_on_a_page_and_a_changed_one_is_found():
    found = [name for text in PAGES.values() for _, name, _, _ in TABLE.findall(text)]
    assert sorted(found) == sorted(tables())
    page = PAGES["settings.md"]
    assert written(page.replace("`horizon` | steps", "`horizon` | s")) == page
    assert page.count("`horizon` | steps") == 1


def test_the_table_has_every_setting_once_with_a_meaning():
    rows = setting_rows()
    assert [row.name for row in rows] == list(SETTINGS) == list(quadsim.settings())
    assert all(row.meaning and row.default for row in rows)
    row = next(row for row in rows if row.name == "horizon")
    assert (row.unit, row.range, row.default) == ("steps", ">= 2 and <= 10000", "100")
    assert "race_informed: 60" in row.presets


def test_a_key_is_in_degrees_if_its_name_says_so_and_no_meaning_repeats_a_unit():
    assert len(KEYS) > 50
    for kind, row in KEYS:
        where = f"{kind}: {row.name}"
        is_in_degrees = row.name.endswith("_deg")
        assert (row.unit == "deg") == is_in_degrees, where
        assert is_in_degrees or not ANGLE.search(row.unit), where
        assert not ANGLE.search(row.meaning), where


def test_a_setting_is_never_in_degrees_and_in_milliseconds_where_its_name_says_so():
    for setting in SETTINGS.values():
        assert not ANGLE.search(setting.unit), setting.name
        assert not setting.name.endswith("_deg"), setting.name
        assert (setting.unit == "ms") == setting.name.endswith("_ms"), setting.name


def test_a_key_without_its_degrees_is_asked_for_them():
    keys = [row.name for kind, row in KEYS if kind == "sensing" and row.name.endswith("_deg")]
    assert len(keys) > 1
    sensing = quadsim.load_sensing("lab")
    for key in keys:
        sensor, _, name = key.partition(".")
        wanted = rf"did you mean '{name}' \(in degrees\)"
        with pytest.raises(quadsim.SettingError, match=wanted):
            sensing.but(**{sensor: {name.removesuffix("_deg"): 1.0}})


LISTINGS = {
    "courses": (quadsim.courses, quadsim.load_course),
    "vehicles": (quadsim.vehicles, quadsim.load_vehicle),
    "sensings": (quadsim.sensings, quadsim.load_sensing),
    "competitions": (quadsim.competitions, quadsim.load_competition),
}


def test_a_listing_has_the_names_and_the_table_of_the_command(capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "120")
    for command, (listed, load) in LISTINGS.items():
        listing = listed()
        assert [load(name).name for name in listing] == list(listing)
        assert listing[0] in listing
        assert len(listing) == len(list(listing))
        assert race([command]) == 0
        assert capsys.readouterr().out.rstrip("\n") == str(listing) == repr(listing)


def test_every_preset_is_listed():
    assert list(quadsim.presets()) == list(PRESETS)
    assert all(name in str(quadsim.presets()) for name in PRESETS)
