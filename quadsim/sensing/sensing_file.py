"""Sensing files: which sensors a vehicle has, each with its numbers; how they become a Sensing.

imu: {rate: 250, gyro_noise: 0.01}
pose: {rate: 100, latency: 0.01, position_noise: 0.002, attitude_noise_deg: 0.3}

`exact: true` and no sensor: the planner is given the true state.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from msgspec import Struct

from quadsim.files.data_files import locate, names, read_text
from quadsim.files.strict_yaml import parse
from quadsim.sensing.camera_model import GateCameraConfig
from quadsim.sensing.config import ImuConfig, PoseConfig, RotorConfig

SENSINGS = Path(__file__).parent
PERFECT = "perfect"
SENSORS = ("imu", "pose", "rotors", "camera")


@dataclass(frozen=True)
class Sensing:
    """The sensors of a vehicle; None: it has none of the kind."""

    name: str
    source: str = ""
    imu: ImuConfig | None = None
    pose: PoseConfig | None = None
    rotors: RotorConfig | None = None
    camera: GateCameraConfig | None = None

    @property
    def exact(self) -> bool:
        """The planner is given the true state."""
        return self.imu is None

    @property
    def latest(self) -> float:
        """The longest time from a measurement to its arrival [s]."""
        return max((s.latency for s in (self.imu, self.pose, self.camera) if s), default=0.0)


class SensingFile(Struct, frozen=True, kw_only=True):
    source: str = ""
    exact: bool = False  # the true state, without sensors
    imu: ImuConfig | None = None
    pose: PoseConfig | None = None
    rotors: RotorConfig | None = None
    camera: GateCameraConfig | None = None


def sensing_names() -> tuple[str, ...]:
    """The sensings that come with the project."""
    return names(SENSINGS)


def load_sensing(name_or_path: str | Path) -> Sensing:
    """A sensing by name ("mocap") or path ("mine.yaml"). Raises FileError."""
    path = locate(name_or_path, SENSINGS, "sensing")
    return parse_sensing(read_text(path), str(path))


def parse_sensing(text: str, file: str) -> Sensing:
    """A sensing from its text; `file` is shown in errors and gives it its name. Raises
    FileError."""
    document = parse(text, file)
    entry = document.fill(SensingFile)
    for path, problem in _faults(entry):
        raise document.error(path, problem)
    return Sensing(Path(file).stem, entry.source, **{s: getattr(entry, s) for s in SENSORS})


def _faults(entry: SensingFile) -> Iterator[tuple[str, str]]:
    """Everything that does not fit together, as (key, problem)."""
    given = [s for s in SENSORS if getattr(entry, s)]
    if entry.exact and given:
        yield given[0], f"expected no sensor beside exact: true, got {given[0]}: remove one"
    if not entry.exact and entry.imu is None:
        yield "imu", "missing, expected an inertial measurement unit: {rate: 250}, or exact: true"
    if entry.imu and not (entry.pose or entry.camera):
        yield "imu", "expected a pose or a camera beside it, as positions by an imu alone run away"
    if entry.pose and entry.pose.spikes > 0.0 and entry.pose.spike == 0.0:
        yield "pose.spike", "expected how far off spikes are [m], got 0"
    if entry.pose and entry.pose.dropouts > 0.0 and entry.pose.dropout == 0.0:
        yield "pose.dropout", "expected how long dropouts last [s], got 0"
