"""Sensing files: the sensors of a vehicle with their parameters, read into a Sensing.

    imu: {rate: 250, gyro_noise: 0.01}
    pose: {rate: 100, latency: 0.01, position_noise: 0.002, attitude_noise_deg: 0.3}

With `exact: true` and no sensor the planner is given the true state.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import MISSING, dataclass, fields, replace
from pathlib import Path
from typing import Annotated, Any, TypedDict, Unpack

from msgspec import Struct

from quadsim.files.data_files import locate, names, read_text
from quadsim.files.strict_yaml import parse, setting
from quadsim.files.values import FieldProblem
from quadsim.files.yaml_text import dump, remade, written
from quadsim.sensing.config import (
    BarometerConfig,
    CornerCamera,
    GateCameraConfig,
    ImuConfig,
    PixelCameraConfig,
    PoseConfig,
    RotorConfig,
)

SENSINGS = Path(__file__).parent
PERFECT = "perfect"


class SensingChanges(TypedDict, total=False):
    """The keys of a sensing file, and the name of the sensing."""

    name: str
    source: str
    exact: bool
    imu: Mapping[str, Any] | ImuConfig | None
    pose: Mapping[str, Any] | PoseConfig | None
    rotors: Mapping[str, Any] | RotorConfig | None
    camera: Mapping[str, Any] | GateCameraConfig | None
    pixels: Mapping[str, Any] | PixelCameraConfig | None
    barometer: Mapping[str, Any] | BarometerConfig | None


@dataclass(frozen=True)
class Sensing:
    """The sensors of a vehicle; None for each kind that it lacks.

    Examples:
        >>> import quadsim
        >>> mocap = quadsim.load_sensing("mocap")
        >>> slow = mocap.but(pose={"rate": 50, "latency": 0.03}, rotors=None)
        >>> run = quadsim.fly("figure8", sensing=slow, laps=1, samples=512)
        >>> run.outcome
        'finished'
    """

    name: str
    source: str = ""
    imu: ImuConfig | None = None
    pose: PoseConfig | None = None
    rotors: RotorConfig | None = None
    camera: GateCameraConfig | None = None
    pixels: PixelCameraConfig | None = None
    barometer: BarometerConfig | None = None

    @property
    def exact(self) -> bool:
        """Whether the planner is given the true state."""
        return self.imu is None

    @property
    def corner_camera(self) -> CornerCamera | None:
        """The camera in whose pictures corners of gates are found; None without one."""
        return self.camera or self.pixels

    @property
    def latest(self) -> float:
        """The longest time from a measurement to its arrival [s]."""
        sensors = (getattr(self, key) for key in SENSORS)
        return max((sensor.latency for sensor in sensors if sensor), default=0.0)

    def but(self, **changes: Unpack[SensingChanges]) -> Sensing:
        """Return a copy with changed sensors or numbers, checked as in a file.

        Args:
            changes: keys of a sensing file, see docs/sensing_files.md, and `name`. A sensor takes
                the keys that change, a whole new configuration, or None, which removes it.

        Raises:
            SettingError: a number cannot be used, or sensors do not fit together (a ValueError).
        """
        given: dict[str, Any] = dict(changes)
        name = str(given.pop("name", self.name))
        entries = _entries(self)
        for key, value in given.items():
            if isinstance(value, Mapping) and key in SENSORS:
                given[key] = {**entries.get(key, {}), **value}
            elif isinstance(value, CONFIGS):
                given[key] = _sensor_entry(value)
        if any(given.get(key) for key in SENSORS):
            entries.pop("exact", None)
        return replace(remade({**entries, **given}, parse_sensing, name), name=name)

    def to_yaml(self, path: str | Path | None = None) -> str:
        """Return the text of a sensing file that `load_sensing` reads to an equal sensing.

        Args:
            path: file to write, after which the sensing is named; None writes nothing.

        Raises:
            SettingError: the sensors do not fit together (a ValueError).
            FileError: the file cannot be written.
        """
        entries = _entries(self)
        remade(entries, parse_sensing, self.name)
        return written(dump(entries), path)


class SensingFile(Struct, frozen=True, kw_only=True):
    """The keys of a sensing file. All but the first two are sensors, as in `Sensing`."""

    source: Annotated[str, setting("origin of the numbers")] = ""
    exact: Annotated[bool, setting("whether the true state is known, without sensors")] = False
    imu: ImuConfig | None = None
    pose: PoseConfig | None = None
    rotors: RotorConfig | None = None
    camera: GateCameraConfig | None = None
    pixels: PixelCameraConfig | None = None
    barometer: BarometerConfig | None = None


CONFIGS = (
    ImuConfig,
    PoseConfig,
    RotorConfig,
    GateCameraConfig,
    PixelCameraConfig,
    BarometerConfig,
)
SENSORS = tuple(key for key in SensingFile.__struct_fields__ if key not in ("source", "exact"))


def sensing_names() -> tuple[str, ...]:
    """Return the names of the sensings that come with the project."""
    return names(SENSINGS)


def load_sensing(name_or_path: str | Path) -> Sensing:
    """Return a sensing by name ("mocap") or path ("mine.yaml").

    Raises:
        FileError: there is no such sensing, or the file is not a sensing file.

    Examples:
        >>> import quadsim
        >>> sensing = quadsim.load_sensing("mocap")
        >>> sensing.pose.rate, sensing.pose.position_noise  # [Hz, m]
        (100.0, 0.002)
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
    document.check(_problems(entry))
    sensors = {key: getattr(entry, key) for key in SENSORS}
    return Sensing(name=Path(file).stem, source=entry.source, **sensors)


def _entries(sensing: Sensing) -> dict[str, Any]:
    """Return the entries of a sensing file without the ones at their default."""
    entries: dict[str, Any] = {"source": sensing.source} if sensing.source else {}
    sensors = {key: getattr(sensing, key) for key in SENSORS}
    if not any(sensors.values()):
        entries["exact"] = True
    return entries | {key: _sensor_entry(config) for key, config in sensors.items() if config}


def _sensor_entry(config: Any) -> dict[str, Any]:
    """Return the entry of one sensor without the numbers at their default."""
    values = {field: getattr(config, field.name) for field in fields(config)}
    return {
        field.name: value
        for field, value in values.items()
        if field.default is MISSING or value != field.default
    }


def _problems(entry: SensingFile) -> Iterator[FieldProblem]:
    """Yield all faults of a sensing, the most important first."""
    given = [key for key in SENSORS if getattr(entry, key)]
    if entry.exact and given:
        problem = f"expected no sensor beside exact: true, got {given[0]}: remove one"
        yield FieldProblem(given[0], problem)
    if not entry.exact and entry.imu is None:
        expected = "expected an inertial measurement unit: {rate: 250}, or exact: true"
        yield FieldProblem("imu", f"missing, {expected}")
    if entry.camera and entry.pixels:
        yield FieldProblem("pixels", "expected no camera beside it, got one: remove one of the two")
    if entry.imu and not (entry.pose or entry.camera or entry.pixels):
        problem = "expected a pose or a camera beside it, as without one positions run away"
        yield FieldProblem("imu", problem)
    if entry.pose:
        yield from _pose_problems(entry.pose)
    if entry.camera:
        yield from _camera_problems(entry.camera)


def _camera_problems(camera: GateCameraConfig) -> Iterator[FieldProblem]:
    """Yield the faults of a gate camera: blind everywhere, bursts that cannot be."""
    if camera.blind_within >= camera.range:
        expected = f"expected less than the range of {camera.range:g} m"
        yield FieldProblem("camera.blind_within", f"{expected}, got {camera.blind_within:g}")
    if camera.miss_burst is None:
        return
    if not 0.0 < camera.misses < 1.0:
        expected = "expected misses beside it, a share above 0 and below 1"
        yield FieldProblem("camera.miss_burst", f"{expected}, got {camera.misses:g}")
        return
    # A channel that is bad after each good picture has bursts of no less than this.
    shortest = camera.misses / (1.0 - camera.misses)
    if camera.miss_burst < shortest:
        expected = f"expected at least {shortest:.3g} pictures with these misses"
        yield FieldProblem("camera.miss_burst", f"{expected}, got {camera.miss_burst:g}")


def _pose_problems(pose: PoseConfig) -> Iterator[FieldProblem]:
    """Yield the faults of a pose sensor: spikes and dropouts need both a share and a size."""
    if pose.spikes > 0.0 and pose.spike == 0.0:
        yield FieldProblem("pose.spike", "expected how far off spikes are [m], got 0")
    if pose.spike > 0.0 and pose.spikes == 0.0:
        expected = "expected spikes beside it, the share of samples that are off by so much"
        yield FieldProblem("pose.spike", f"{expected}, got none")
    if pose.dropouts > 0.0 and pose.dropout == 0.0:
        yield FieldProblem("pose.dropout", "expected how long dropouts last [s], got 0")
    if pose.dropout > 0.0 and pose.dropouts == 0.0:
        expected = "expected dropouts beside it, the probability per sample that one begins"
        yield FieldProblem("pose.dropout", f"{expected}, got none")
