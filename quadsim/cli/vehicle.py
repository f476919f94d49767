"""`race vehicle`: a vehicle file for those who have no log of their vehicle."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Annotated

from msgspec import Meta
from rich.markup import escape

from quadsim.cli.flags import Help, Json, settings_as_flags
from quadsim.console import UsageError, emit, emit_json
from quadsim.record.whole_files import expect_new_file, expect_writable
from quadsim.vehicle.flying import flying_numbers
from quadsim.vehicle.scaling import KnownNumbers, diameter, scaled_vehicle

NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_-]{0,63}")


def vehicle(
    *,
    mass: Annotated[float, Help("of the whole vehicle, with its battery [kg]")],
    thrust_to_weight: Annotated[float, Help("full thrust over weight")],
    arm: Annotated[
        float | None,
        Help("from the centre to a rotor [m]; default: by the mass"),
    ] = None,
    prop: Annotated[
        str | None,
        Help("diameter of the propellers, such as 5in or 127mm; default: by the arm"),
    ] = None,
    name: Annotated[
        Annotated[str, Meta(min_length=1)], Help("name of the vehicle, and of its file NAME.yaml")
    ],
    out: Annotated[str | None, Help("FILE.yaml to write; default: NAME.yaml")] = None,
    json: Json = False,
) -> int:
    """Write a vehicle file from a few numbers; the others are scaled from a shipped vehicle.

    A comment says where each number comes from. `race fit` fits a vehicle to a log.

    race vehicle --mass .6 --thrust-to-weight 5 --arm .11 --prop 5in --name myquad

    race fly --vehicle myquad.yaml
    """
    file = file_of(name, out)
    with settings_as_flags():
        known = KnownNumbers(
            mass=mass,
            thrust_to_weight=thrust_to_weight,
            arm=arm,
            propeller=None if prop is None else diameter(prop),
        )
        scaled = scaled_vehicle(known, name)
    expect_new_file(file)
    expect_writable(file.parent)
    scaled.to_yaml(file)
    numbers = flying_numbers(scaled.vehicle)
    if json:
        emit_json({"file": str(file), "sources": dict(scaled.sources), **numbers._asdict()})
    else:
        emit(f"{escape(str(file))}: {scaled.vehicle.mass:g} kg, {numbers.text()}")
    return 0


def file_of(name: str, out: str | None) -> Path:
    """Return the new file of a vehicle.

    Args:
        name: name of the vehicle.
        out: the file; None: NAME.yaml.

    Raises:
        UsageError: the name or the file cannot be used.
    """
    if not NAME.fullmatch(name):
        raise UsageError(f"--name: expected letters, digits, - and _, got {name!r}")
    file = Path(out or f"{name}.yaml")
    if file.suffix not in (".yaml", ".yml"):
        raise UsageError(f"--out: expected FILE.yaml, got {str(file)!r}")
    return file
