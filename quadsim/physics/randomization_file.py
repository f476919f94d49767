"""Randomization files, which say how widely domain randomization varies each number.

    mass: 0.1
    start: [0.1, 0.1, 0]

The numbers apply at size 1, `--randomize 1`, and scale with the size. Numbers that a file leaves
out are not varied. The default, `outdoor`, has no file: it is OUTDOOR, with the same tolerances of
a vehicle that the estimators assume.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from math import radians
from pathlib import Path
from typing import Annotated

from msgspec import Meta

from quadsim.dynamics.named_tuples import units_of
from quadsim.dynamics.quadrotor import Control
from quadsim.files.data_files import locate, names, read_text
from quadsim.files.strict_yaml import parse, setting, unit
from quadsim.files.yaml_text import remade
from quadsim.rotation import Vec3
from quadsim.vehicle.tolerances import VehicleTolerances

RANDOMIZATIONS = Path(__file__).parent / "randomizations"
VEHICLE = VehicleTolerances()
OUTDOOR_NAME = "outdoor"

Metre = Annotated[float, unit("m", ge=0, le=5)]
Degree = Annotated[float, unit("deg", ge=0, le=90)]
Share = Annotated[float, unit("1", ge=0, le=0.5)]
Noise = Annotated[float, Meta(ge=0, le=10)]
COMMAND_UNITS = ", ".join(units_of(Control).values())
NOTHING: Vec3 = (0.0, 0.0, 0.0)


@dataclass(frozen=True, kw_only=True)
class RandomizationRanges:
    """Half widths of the uniform distributions that domain randomization draws from at size 1.

    Examples:
        >>> import quadsim
        >>> from quadsim.physics.randomization_file import load_randomization
        >>> ranges = load_randomization("lsy_level2")
        >>> ranges.gates, ranges.gates_height  # [m]
        (0.15, 0.1)
    """

    name: Annotated[str, setting("name; that of its file counts before it")] = OUTDOOR_NAME
    source: Annotated[str, setting("origin of the numbers")] = ""
    start: Annotated[
        tuple[Metre, Metre, Metre], setting("displacement of the start along x, y, z [m]")
    ] = NOTHING
    start_turn_deg: Annotated[Degree, setting("change of the start's heading [deg]")] = 0.0
    mass: Annotated[Share, setting("mass, a share of the nominal one")] = 0.0
    inertia: Annotated[
        tuple[Share, Share, Share] | None,
        setting("moments of inertia, each by itself; null: in proportion to the mass"),
    ] = None
    thrust: Annotated[Share, setting("full thrust, a share")] = 0.0
    lag: Annotated[Share, setting("lags of the body rates and of the rotors, a share")] = 0.0
    drag: Annotated[Share, setting("drag, a share")] = 0.0
    gust: Annotated[
        float,
        setting(
            "standard deviation of gusts on each axis, correlated over 0.5 s [m/s^2]",
            unit="m/s^2",
            ge=0,
            le=20,
        ),
    ] = 0.0
    force: Annotated[
        float,
        setting(
            "force on each axis of the world, drawn anew in each physics step [N]",
            unit="N",
            ge=0,
            le=100,
        ),
    ] = 0.0
    command_noise: Annotated[
        tuple[Noise, Noise, Noise, Noise],
        setting(
            "standard deviation of the noise on each command, drawn anew in each control period",
            unit=COMMAND_UNITS,
        ),
    ] = (0.0, 0.0, 0.0, 0.0)
    gates: Annotated[Metre, setting("displacement of each gate along x and y [m]")] = 0.0
    gates_height: Annotated[Metre, setting("displacement of each gate along z [m]")] = 0.0
    gates_turn_deg: Annotated[
        tuple[Degree, Degree, Degree], setting("changes of each gate's roll, pitch and yaw [deg]")
    ] = NOTHING
    obstacles: Annotated[Metre, setting("displacement of each obstacle along x and y [m]")] = 0.0
    obstacles_height: Annotated[Metre, setting("displacement of each obstacle along z [m]")] = 0.0

    @property
    def gates_turn(self) -> Vec3:
        """The changes of each gate's roll, pitch and yaw [rad]."""
        roll, pitch, yaw = map(radians, self.gates_turn_deg)
        return roll, pitch, yaw


# Half widths of the start: 0.2 m on each axis, and 10 degrees
OUTDOOR = RandomizationRanges(
    start=(0.2, 0.2, 0.2),
    start_turn_deg=10.0,
    mass=VEHICLE.mass,
    thrust=VEHICLE.thrust,
    lag=VEHICLE.lag,
    drag=VEHICLE.drag,
    gust=VEHICLE.gust,
)


def randomization_names() -> tuple[str, ...]:
    """Return the names of the randomizations that come with the project."""
    return (OUTDOOR_NAME, *names(RANDOMIZATIONS))


def load_randomization(name_or_path: str | Path) -> RandomizationRanges:
    """Return a randomization by name ("lsy_level2") or path ("mine.yaml").

    Raises:
        FileError: there is no such randomization, or the file is not one.

    Examples:
        >>> from quadsim.physics.randomization_file import load_randomization
        >>> load_randomization("outdoor").mass
        0.05
    """
    if str(name_or_path) == OUTDOOR_NAME:
        return OUTDOOR
    path = locate(name_or_path, RANDOMIZATIONS, "randomization", listed=False)
    return parse_randomization(read_text(path), str(path))


def parse_randomization(text: str, file: str) -> RandomizationRanges:
    """Return the randomization of a YAML text, named after `file`, which errors mention.

    Raises:
        FileError: the text is not a randomization.
    """
    ranges = parse(text, file).fill(RandomizationRanges)
    return replace(ranges, name=Path(file).stem)


def check_randomization(ranges: RandomizationRanges) -> None:
    """Check the numbers of a randomization that comes from no file.

    Raises:
        SettingError: a number is out of range.
    """
    entries = {
        f.name: getattr(ranges, f.name)
        for f in fields(ranges)
        if f.name != "name" and getattr(ranges, f.name) != f.default
    }
    remade(entries, parse_randomization, ranges.name)
