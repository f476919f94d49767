"""Sensing files: the sensors of a vehicle with their parameters. A Sensing has their keys.

    imu: {rate: 250, gyro_noise: 0.01}
    pose: {rate: 100, latency: 0.01, position_noise: 0.002, attitude_noise_deg: 0.3}

A file with `exact: true` and no sensor gives the planner the true state.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Annotated, Any, TypedDict, Unpack

from quadsim.files.data_files import locate, names, read_text
from quadsim.files.strict_yaml import FileError, parse, setting
from quadsim.files.values import FieldProblem
from quadsim.files.yaml_text import dump, entries_of, remade, written
from quadsim.sensing.camera import Camera, load_camera
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


@dataclass(frozen=True, kw_only=True)
class SensingFile:
    """The keys of a sensing file; a sensor is None if the vehicle does not have it."""

    source: Annotated[str, setting("origin of the numbers")] = ""
    exact: Annotated[bool, setting("whether the true state is known, without sensors")] = False
    imu: ImuConfig | None = None
    pose: PoseConfig | None = None
    rotors: RotorConfig | None = None
    camera: GateCameraConfig | None = None
    pixels: PixelCameraConfig | None = None
    barometer: BarometerConfig | None = None


@dataclass(frozen=True, kw_only=True)
class Sensing(SensingFile):
    """The sensors of a vehicle: the values of a sensing file, and its name.

    Examples:
        >>> import quadsim
        >>> mocap = quadsim.load_sensing("mocap")
        >>> slow = mocap.but(pose={"rate": 50, "latency": 0.03}, rotors=None)
        >>> run = quadsim.fly("figure8", sensing=slow, laps=1, samples=512)
        >>> run.outcome
        'finished'
    """

    name: str

    @property
    def corner_camera(self) -> CornerCamera | None:
        """The camera in whose pictures corners of gates are found; None if there is no camera."""
        return self.camera or self.pixels

    @property
    def latest(self) -> float:
        """The longest time from a measurement to its arrival [s]."""
        sensors = (getattr(self, key) for key in SENSORS)
        return max((sensor.latency for sensor in sensors if sensor), default=0.0)

    def but(self, **changes: Unpack[SensingChanges]) -> Sensing:
        """Return a copy with changed sensors or numbers, checked as a sensing file is.

        Args:
            changes: keys of a sensing file, see docs/sensing_files.md, and `name`. A sensor takes
                the keys that change, a whole new configuration, or None, which removes it.

        Raises:
            SettingError: a number cannot be used, or sensors do not fit together (a ValueError).
        """
        given: dict[str, Any] = dict(changes)
        name = str(given.pop("name", self.name))
        entries = entries_of(self, SensingFile)
        for key, value in given.items():
            if isinstance(value, Mapping) and key in SENSORS:
                given[key] = {**entries.get(key, {}), **value}
            elif isinstance(value, CONFIGS):
                given[key] = entries_of(value)
        if any(given.get(key) for key in SENSORS):
            entries.pop("exact", None)
        return replace(remade({**entries, **given}, parse_sensing, name), name=name)

    def to_yaml(self, path: str | Path | None = None) -> str:
        """Return the text of a sensing file that `load_sensing` reads to an equal sensing.

        Args:
            path: file to write, whose name becomes the sensing's; None writes nothing.

        Raises:
            SettingError: the sensors do not fit together (a ValueError).
            FileError: the file cannot be written.
        """
        entries = entries_of(self, SensingFile)
        remade(entries, parse_sensing, self.name)
        return written(dump(entries), path)


CONFIGS = (
    ImuConfig,
    PoseConfig,
    RotorConfig,
    GateCameraConfig,
    PixelCameraConfig,
    BarometerConfig,
)
SENSORS = tuple(f.name for f in fields(SensingFile) if f.name not in ("source", "exact"))


def sensing_names() -> tuple[str, ...]:
    """Return the names of the sets of sensors that come with the project."""
    return names(SENSINGS)


def load_sensing(name_or_path: str | Path) -> Sensing:
    """Return a set of sensors by name ("mocap") or path ("mine.yaml").

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


def camera_named(name_or_path: str | Path) -> Camera:
    """Return a camera by name or path, or the camera of a set of sensors by the set's name.

    Raises:
        FileError: there is no such camera, or the set of sensors has none.
    """
    if name_or_path not in sensing_names():
        return load_camera(name_or_path)
    found = load_sensing(name_or_path).corner_camera
    if found is None:
        raise FileError(f"{name_or_path}: expected a set of sensors with a camera, got none")
    return found


def parse_sensing(text: str, file: str) -> Sensing:
    """Return the set of sensors of a YAML text.

    Args:
        text: the YAML.
        file: name of the file, for errors and for the set of sensors.

    Raises:
        FileError: the text is not a sensing file.
    """
    document = parse(text, file)
    sensing = document.fill(SensingFile)
    document.check(_problems(sensing))
    return Sensing(name=Path(file).stem, **vars(sensing))


def _problems(sensing: SensingFile) -> Iterator[FieldProblem]:
    """Yield all problems of a sensing file, the most important first."""
    given = [key for key in SENSORS if getattr(sensing, key)]
    if sensing.exact and given:
        problem = f"expected no sensor beside exact: true, got {given[0]}: remove one"
        yield FieldProblem(given[0], problem)
    if not sensing.exact and sensing.imu is None:
        expected = "expected an inertial measurement unit: {rate: 250}, or exact: true"
        yield FieldProblem("imu", f"missing, {expected}")
    if sensing.camera and sensing.pixels:
        yield FieldProblem("pixels", "expected no camera beside it, got one: remove one of the two")
    if sensing.imu and not (sensing.pose or sensing.camera or sensing.pixels):
        problem = "expected a pose or a camera beside it, as without one positions run away"
        yield FieldProblem("imu", problem)
    if sensing.pose:
        yield from _pose_problems(sensing.pose)
    if sensing.camera:
        yield from _camera_problems(sensing.camera)


def _camera_problems(camera: GateCameraConfig) -> Iterator[FieldProblem]:
    """Yield the problems of a gate camera: it sees nothing, or its bursts are impossible."""
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
    """Yield the problems of a pose sensor: spikes and dropouts need both a share and a size."""
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
