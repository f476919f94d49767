"""A track as a reader of foreign files returns it: gates in the axes and units of the file."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated, Any, Literal

import numpy as np

from quadsim.files.strict_yaml import setting, unit
from quadsim.files.values import check_fields
from quadsim.rotation import Vec3

Frame = Literal["enu", "ned"]
Unit = Literal["m", "cm", "mm", "ft"]
Angles = Literal["deg", "rad"]
Passage = Literal["x", "-x", "y", "-y", "auto", "either"]
Size = Annotated[float, unit("m", gt=0, le=100)]
Coordinate = Annotated[float, unit("m", ge=-10_000, le=10_000)]
Degree = Annotated[float, unit("deg", ge=-360, le=360)]


@dataclass(frozen=True, kw_only=True)
class Reading:
    """The axes, units and openings with which a foreign file is read.

    None stands for the format's usual value.

    Examples:
        >>> from quadsim.course.foreign import Reading
        >>> Reading(frame="ned", unit="cm").unit
        'cm'
    """

    frame: Annotated[
        Frame | None, setting("axes of the file: enu (east, north, up) or ned (north, east, down)")
    ] = None
    unit: Annotated[Unit, setting("unit of lengths in the file")] = "m"
    angles: Annotated[Angles | None, setting("unit of angles in the file")] = None
    passage: Annotated[
        Passage | None,
        setting(
            "axis of a gate along which it is passed; auto: the axis of all gates that agrees best"
            " with the way from gate to gate; either: x or -x, for each gate on its own"
        ),
    ] = None
    opening: Annotated[
        tuple[Size, Size] | None, setting("width and height of all openings, not the file's")
    ] = None
    gates: Annotated[
        tuple[str, ...],
        setting("names or numbers of gates in the order of flight; -NAME: flown the other way"),
    ] = ()
    start: Annotated[
        tuple[Coordinate, Coordinate, Coordinate, Degree] | None,
        setting("x, y, z [m] and heading [deg] of the start, in the axes of the result"),
    ] = None
    offset: Annotated[
        tuple[Coordinate, Coordinate, Coordinate],
        setting("is added to all positions, in the axes of the result"),
    ] = (0.0, 0.0, 0.0)
    loop: Annotated[
        bool | None, setting("whether the first gate comes after the last; default: the file's")
    ] = None

    def __post_init__(self) -> None:
        check_fields(self)


def opening_of(given: Any) -> Any:
    """Return width and height of an opening that is given as one number, or as a list with one.

    Any other value is returned unchanged, and `Reading` checks it.
    """
    if isinstance(given, int | float):
        return given, given
    if isinstance(given, list):
        return tuple(given) * (2 if len(given) == 1 else 1)
    return given


@dataclass(frozen=True)
class ForeignGate:
    """A gate in the axes of its file."""

    name: str
    # key or line of the gate in the file, for errors
    place: str
    # [unit of the file]
    position: Vec3
    # its own axes as columns  (3, 3)
    axes: np.ndarray
    # sizes of the opening along its own x, y and z; the one along the passage is not used
    # [unit of the file]; None: the file has none
    sizes: Vec3 | None
    # whether it is passed against the axis that is the passage of the others
    reverse: bool = False


@dataclass(frozen=True)
class ForeignPole:
    """An upright pole on the ground, in the axes of its file."""

    # centre of its upper end, and its radius [unit of the file]
    top: Vec3
    radius: float


@dataclass(frozen=True)
class ForeignStart:
    """A start in the axes of its file."""

    # [unit of the file]
    position: Vec3
    # direction of the vehicle's x axis; None: it looks at the first gate
    forward: Vec3 | None


@dataclass(frozen=True)
class ForeignTrack:
    """A course in the axes and units of its file."""

    gates: tuple[ForeignGate, ...]
    frame: Frame
    passage: Passage
    # simulator, for the course's source
    simulator: str
    start: ForeignStart | None = None
    poles: tuple[ForeignPole, ...] = ()
    # two opposite corners [unit of the file]
    bounds: tuple[Vec3, Vec3] | None = None
    # [unit of the file]; None: the file has none
    frame_width: float | None = None
    loop: bool = False
    # parts that the reader has left out, and assumptions
    notes: list[str] = field(default_factory=list)
