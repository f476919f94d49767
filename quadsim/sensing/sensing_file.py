"""Sensing files: the sensors of a vehicle, each with its numbers, and how they become a Sensing.

    imu: {rate: 250, gyro_noise: 0.01}
    pose: {rate: 100, latency: 0.01, position_noise: 0.002, attitude_noise_deg: 0.3}

With `exact: true` and no sensor the planner is given the true state.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, NamedTuple

from msgspec import Struct

from quadsim.files.data_files import locate, names, read_text
from quadsim.files.strict_yaml import parse, setting
from quadsim.sensing.config import GateCameraConfig, ImuConfig, PoseConfig, RotorConfig

SENSINGS = Path(__file__).parent
PERFECT = "perfect"


@dataclass(frozen=True)
class Sensing:
    """The sensors of a vehicle, None where it has none of a kind."""

    name: str
    source: str = ""
    imu: ImuConfig | None = None
    pose: PoseConfig | None = None
    rotors: RotorConfig | None = None
    camera: GateCameraConfig | None = None

    @property
    def exact(self) -> bool:
        """Whether the planner is given the true state."""
        return self.imu is None

    @property
    def latest(self) -> float:
        """The longest time from a measurement to its arrival [s]."""
        sensors = (getattr(self, key) for key in SENSORS)
        return max((sensor.latency for sensor in sensors if sensor), default=0.0)


class SensingFile(Struct, frozen=True, kw_only=True):
    """The keys of a sensing file. All but the first two are sensors, as `Sensing` has them."""

    source: Annotated[str, setting("origin of the numbers")] = ""
    exact: Annotated[bool, setting("whether the true state is known, without sensors")] = False
    imu: ImuConfig | None = None
    pose: PoseConfig | None = None
    rotors: RotorConfig | None = None
    camera: GateCameraConfig | None = None


SENSORS = tuple(key for key in SensingFile.__struct_fields__ if key not in ("source", "exact"))


def sensing_names() -> tuple[str, ...]:
    """Return the names of the sensings that come with the project."""
    return names(SENSINGS)


def load_sensing(name_or_path: str | Path) -> Sensing:
    """Return a sensing by name ("mocap") or path ("mine.yaml").

    Raises:
        FileError: there is no such sensing, or the file is not a sensing file.
    """
    path = locate(name_or_path, SENSINGS, "sensing")
    return parse_sensing(read_text(path), str(path))


def parse_sensing(text: str, file: str) -> Sensing:
    """Return the sensing of a YAML text.

    Args:
        text: the YAML.
        file: shown in errors; gives the sensing its name.

    Raises:
        FileError: the text is not a sensing file.
    """
    document = parse(text, file)
    entry = document.fill(SensingFile)
    for fault in _faults(entry):
        raise document.error(fault.key, fault.problem)
    sensors = {key: getattr(entry, key) for key in SENSORS}
    return Sensing(name=Path(file).stem, source=entry.source, **sensors)


class Fault(NamedTuple):
    """A key of the sensing file, and the problem with it."""

    key: str
    problem: str


def _faults(entry: SensingFile) -> Iterator[Fault]:
    """Yield all faults of a sensing; the first is the one to show."""
    given = [key for key in SENSORS if getattr(entry, key)]
    if entry.exact and given:
        problem = f"expected no sensor beside exact: true, got {given[0]}: remove one"
        yield Fault(given[0], problem)
    if not entry.exact and entry.imu is None:
        expected = "expected an inertial measurement unit: {rate: 250}, or exact: true"
        yield Fault("imu", f"missing, {expected}")
    if entry.imu and not (entry.pose or entry.camera):
        problem = "expected a pose or a camera beside it, as without one positions run away"
        yield Fault("imu", problem)
    if entry.pose and entry.pose.spikes > 0.0 and entry.pose.spike == 0.0:
        yield Fault("pose.spike", "expected how far off spikes are [m], got 0")
    if entry.pose and entry.pose.dropouts > 0.0 and entry.pose.dropout == 0.0:
        yield Fault("pose.dropout", "expected how long dropouts last [s], got 0")
