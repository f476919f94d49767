"""Tables of settings and of the keys of files, made from the annotations that check them.

    python -m quadsim.tables.write_tables

writes the tables into the pages of docs/; a test fails if a page is out of date.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import fields
from typing import Any, NamedTuple, get_type_hints

from msgspec import inspect

from quadsim.config.settings import (
    SETTINGS,
    FlightSettings,
    Setting,
    description,
    unit_of,
    values_of,
)
from quadsim.controllers.presets import PRESETS, Planner
from quadsim.dynamics.quadrotor import ModelParams
from quadsim.files.values import Kind, bare
from quadsim.files.yaml_errors import limits
from quadsim.vehicle import load_vehicle

# A default within a help text, such as "(default: the preset's)"
NAMED_DEFAULT = re.compile(r"(?: \(default: (.*)\)|; default: (.*))$")
STRUCTS = inspect.StructType | inspect.DataclassType
LISTS = inspect.TupleType | inspect.VarTupleType


class SettingRow(NamedTuple):
    """A setting, or a key of a file."""

    name: str
    unit: str
    range: str  # or the choices
    default: str
    # "horizon 60 in race_informed": presets whose number differs from the default preset's
    presets: str
    meaning: str


def setting_rows() -> tuple[SettingRow, ...]:
    """Return the rows of all settings, in the order of `race fly --help`."""
    base = PRESETS[FlightSettings.preset][FlightSettings.sampler]
    planners = {name: of_sampler[FlightSettings.sampler] for name, of_sampler in PRESETS.items()}
    values = {name: _values(planner) for name, planner in planners.items()}
    defaults = _values(base) | {
        field.name: getattr(FlightSettings(), field.name) for field in fields(FlightSettings)
    }
    return tuple(_setting_row(setting, defaults, values) for setting in SETTINGS.values())


def _values(planner: Planner) -> dict[str, object]:
    """Return the values of a planner's settings; the model's values come from the vehicle."""
    model = ModelParams.of(load_vehicle(planner.vehicle))
    return {
        name: found.value
        for name, found in values_of(planner, model).items()
        if found.setting.group != "model"
    }


def _setting_row(
    setting: Setting, defaults: dict[str, object], values: dict[str, dict[str, object]]
) -> SettingRow:
    """Return the row of one setting.

    Args:
        setting: the setting.
        defaults: the values of the default flight.
        values: values of each preset's planner.
    """
    name = setting.name
    default = "the vehicle's" if setting.group == "model" else _of_others(setting)
    if name in defaults:
        default = shown(defaults[name])
    others = {
        preset: shown(found[name])
        for preset, found in values.items()
        if name in found and shown(found[name]) != default
    }
    texts = [f"{preset}: {value}" for preset, value in others.items()]
    meaning, default = _with_named_default(setting.help, default)
    return SettingRow(name, setting.unit, allowed(setting.kind), default, "; ".join(texts), meaning)


def _with_named_default(text: str, default: str) -> tuple[str, str]:
    """Return text and default; "text (default: x)" is split if `default` is "none"."""
    found = NAMED_DEFAULT.search(text)
    if default != "none" or found is None:
        return text, default
    return text[: found.start()], found[1] or found[2]


def _of_others(setting: Setting) -> str:
    """Return the default of a setting that the default sampler and cost do not have."""
    owners = [owner.__name__ for owner in setting.kinds]
    return f"of {' and '.join(owners)} only"


def key_rows(schema: type, parent: str = "") -> Iterator[SettingRow]:
    """Yield the rows of a file's keys, such as "gates[].position", in the order of its schema.

    Args:
        schema: a msgspec Struct, or a dataclass.
        parent: prefix of the names, such as "gates[].".
    """
    info: Any = inspect.type_info(schema)
    # msgspec has the required fields of a dataclass first
    order = list(get_type_hints(schema))
    for field in sorted(info.fields, key=lambda field: order.index(field.name)):
        name = f"{parent}{field.encode_name}"
        kind = bare(field.type)
        inner = kind
        brackets = ""
        if isinstance(kind, inspect.VarTupleType):
            inner = bare(kind.item_type)
            brackets = "[]"
        text = description(field.type)
        if text or not isinstance(inner, STRUCTS):
            unit = unit_of(field.type)
            meaning, default = _with_named_default(_without_unit(text, unit), _default(field))
            yield SettingRow(name, unit, allowed(field.type), default, "", meaning)
        if isinstance(inner, STRUCTS):
            yield from key_rows(inner.cls, f"{name}{brackets}.")


def _default(field: inspect.Field) -> str:
    """Return the default of a key; "required" if it has none."""
    if field.required:
        return "required"
    return shown(field.default)


def _without_unit(text: str, unit: str) -> str:
    """Return the help of a key without its unit, which has its own column."""
    return text.replace(f" [{unit}]", "") if unit else text


def allowed(kind: Kind) -> str:
    """Return the range of a number or of a list's numbers, or the choices, as text."""
    inner = bare(kind)
    match inner:
        case inspect.TupleType() if inner.item_types:
            found = allowed(inner.item_types[0])
            counted = f"{len(inner.item_types)} numbers"
            if isinstance(bare(inner.item_types[0]), LISTS):
                counted = f"{len(inner.item_types)} lists of {found}"
                return counted
            return f"{counted} {found}".rstrip()
        case inspect.BoolType():
            return "true or false"
        case inspect.LiteralType(values):
            return " or ".join(map(str, values))
        case inspect.IntType() | inspect.FloatType():
            return limits(inner)
    return ""


def shown(value: object) -> str:
    """Return a value as text for the table and `--help`."""
    if isinstance(value, tuple):
        return " ".join(map(shown, value)) or "none"
    if isinstance(value, bool):
        return str(value).lower()
    if value is None or value == "":
        return "none"
    return f"{value:g}" if isinstance(value, float) else str(value)


def markdown(
    rows: Iterator[SettingRow] | tuple[SettingRow, ...], first: str, with_presets: bool
) -> str:
    """Return rows as a table of Markdown.

    Args:
        rows: the rows.
        first: heading of the first column.
        with_presets: whether a column lists presets with other values.
    """
    heads = [first, "unit", "range", "default"]
    heads += ["in other presets"] if with_presets else []
    heads.append("meaning")
    lines = [_line(heads), "|" + "---|" * len(heads)]
    for row in rows:
        cells = [f"`{row.name}`", row.unit, row.range, row.default]
        cells += [row.presets] if with_presets else []
        lines.append(_line([*cells, row.meaning]))
    return "\n".join(lines) + "\n"


def _line(cells: list[str]) -> str:
    return "| " + " | ".join(cell.replace("|", r"\|") for cell in cells) + " |"
