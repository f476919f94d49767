"""`race convert`: the course of another simulator, or a table of gates, as a course file."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated, Literal

from rich.markup import escape

from quadsim.cli.flags import Help, Json, Switch, settings_as_flags
from quadsim.console import UsageError, complain, emit, emit_json
from quadsim.course.course import summary
from quadsim.course.foreign import FORMATS, Reading
from quadsim.course.foreign import convert as converted
from quadsim.course.foreign.track import Angles, Frame, Passage, Unit, opening_of
from quadsim.record.whole_files import expect_writable

Format = Literal["lsy", "airsim", "flightgoggles", "uzh", "csv"]


def convert(
    file: Annotated[str, Help("a file of gates")],
    /,
    *,
    from_: Annotated[Format, Help(f"format of the file: {', '.join(FORMATS)}", name="--from")],
    out: Annotated[str | None, Help("FILE.yaml to write; default: printed")] = None,
    frame: Annotated[
        Frame | None,
        Help("axes of the file: enu (east, north, up) or ned (north, east, down); default: usual"),
    ] = None,
    unit: Annotated[Unit, Help("unit of lengths in the file")] = "m",
    angles: Annotated[Angles | None, Help("unit of angles in the file; default: usual")] = None,
    passage: Annotated[
        Passage | None,
        Help(
            "axis of a gate along which it is passed; auto: the one that fits the way from gate to"
            " gate; either: x or -x, for each gate; default: usual"
        ),
    ] = None,
    opening: Annotated[
        list[float] | None,
        Help(
            "width and height of all openings [m]; one number for both",
            metavar="X [X]",
            consume_multiple=True,
            negative_iterable="",
        ),
    ] = None,
    gates: Annotated[
        str | None,
        Help("names or numbers of gates in the order of flight, joined by commas; -NAME: reversed"),
    ] = None,
    start: Annotated[
        tuple[float, float, float, float] | None,
        Help(
            "x, y, z [m] and heading [deg] of the start, in the result",
            metavar="X X X X",
            negative_iterable="",
        ),
    ] = None,
    offset: Annotated[
        tuple[float, float, float],
        Help("added to all positions of the result [m]", metavar="X X X", negative_iterable=""),
    ] = (0.0, 0.0, 0.0),
    loop: Annotated[bool, Switch("the first gate comes after the last")] = False,
    json: Json = False,
) -> int:
    """Convert gates of LSY, AirSim, FlightGoggles, UZH or a CSV table to a course.

    The result has x east, y north and z up in metres, and passes `race check`.
    What had to be assumed is said: look at it.

    race convert level2.toml --from lsy --out level2.yaml

    race convert gates.csv --from csv --frame ned --unit cm --opening 1.5 1.5
    """
    with settings_as_flags():
        reading = Reading(
            frame=frame,
            unit=unit,
            angles=angles,
            passage=passage,
            opening=opening_of(opening),
            gates=tuple(gates.split(",")) if gates else (),
            start=start,
            offset=offset,
            loop=loop or None,
        )
    course, notes = converted(file, from_, reading)
    if out is not None:
        if not out.endswith((".yaml", ".yml")):
            raise UsageError(f"--out: expected FILE.yaml, got {out!r}")
        if Path(out).exists():
            raise UsageError(f"--out: expected a new file, got {out!r}, which is there")
        expect_writable(Path(out).parent)
        course.to_yaml(out)
    if json:
        emit_json({"course": course.to_yaml(), "notes": notes, "file": out})
        return 0
    if out is None:
        sys.stdout.write(course.to_yaml())
        sys.stdout.flush()
    else:
        emit(f"{escape(out)}: {escape(summary(course))}")
    for note in notes:
        complain(note)
    return 0
