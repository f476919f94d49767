"""A pilot: a learned policy in a file of numbers and JSON, flown by NumPy alone.

The file is an .npz, and nothing in it is executed. It holds the weights of each layer, and `about`,
the JSON of an `About`: the pilot's observation and commands, the vehicle it was trained for, and
the training.
"""

from __future__ import annotations

import hashlib
import json
import zipfile
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from io import BytesIO
from pathlib import Path
from typing import Any
from zlib import error as zlib_error

import numpy as np

from controllers.learned import network
from controllers.learned.observation import SIZE, UNITS, command, gate_rows, normalised, observe
from controllers.plan import PlanStats
from quadsim.course import Course
from quadsim.dynamics.control_periods import ControlPeriods
from quadsim.dynamics.estimate import Estimate
from quadsim.files.strict_yaml import FileError

PILOTS = Path(__file__).parent / "pilots"
FORMAT = "quadsim pilot 1"
LARGEST = 50_000_000  # bytes of a file that is read
LAYERS = 6  # arrays: weights and biases of three layers
# Errors that NumPy raises for a damaged file
DAMAGED = (
    OSError,
    ValueError,
    KeyError,
    EOFError,
    NotImplementedError,
    zipfile.BadZipFile,
    zlib_error,
)


@dataclass(frozen=True)
class About:
    """The purpose of a pilot and its training."""

    vehicle: str
    dt: float  # control period [s]
    hold: int  # control periods for which an action is held
    low: tuple[float, ...]  # command at an action of -1 [rad/s, m/s^2]
    high: tuple[float, ...]  # command at an action of 1 [rad/s, m/s^2]
    course: str  # the course that it was trained on
    training: dict = field(default_factory=dict)  # seed, steps, time, settings, command
    observes: tuple[str, ...] = tuple(UNITS)


@dataclass(frozen=True, eq=False)
class Pilot:
    """The weights of a policy's mean, and their purpose."""

    name: str
    about: About
    weights: tuple[np.ndarray, ...]
    digest: str = ""  # sha256 of the file, hexadecimal

    def __call__(self, obs: np.ndarray) -> np.ndarray:
        """Return the action in -1..1 for an observation.  (4,)"""
        return np.clip(network.forward(list(self.weights), obs), -1.0, 1.0)

    def check(self, vehicle: str, dt: float) -> None:
        """Raise FileError unless the pilot is for this vehicle and control period dt [s]."""
        about = self.about
        if vehicle != about.vehicle:
            raise FileError(
                f"pilot {self.name}: expected the vehicle it was trained for, {about.vehicle}, "
                f"got {vehicle}"
            )
        if dt != about.dt:
            raise FileError(
                f"pilot {self.name}: dt: expected the {about.dt:g} s it was trained for, got {dt:g}"
            )

    def record(self) -> dict[str, Any]:
        """Return the pilot's name and digest, which a run keeps."""
        return {"name": self.name, "sha256": self.digest}


class PilotController:
    """A pilot in one flight, which holds each action for as many periods as in its training.

    Args:
        pilot: the pilot.
        course: the course.
        laps: number of laps.
        rest: the control at rest  (n_u,).
    """

    def __init__(self, pilot: Pilot, course: Course, laps: int, rest: Sequence[float]):
        self.pilot = pilot
        self.rest = np.array(rest)
        self._gates = gate_rows(course, laps)
        self._last = normalised(rest, pilot.about.low, pilot.about.high)
        self._periods = ControlPeriods(pilot.about.dt)
        self._until_next = 0  # control periods until it observes again

    def control(self, estimate: Estimate) -> tuple[np.ndarray, PlanStats]:
        """Return the command, see quadsim.race.flight.Controller.

        There is no plan, so its statistics are zero.
        """
        self._until_next -= self._periods.advance(estimate.t)
        if self._until_next <= 0:
            gates = self._gates[min(estimate.target, len(self._gates) - 1)]
            self._last = self.pilot(observe(estimate.x, gates, self._last))
            self._until_next = self.pilot.about.hold
        u = command(self._last, self.pilot.about.low, self.pilot.about.high)
        return u, PlanStats(cost=0.0, ess=0.0, temperature=0.0)


def pilot_bytes(weights: Sequence[np.ndarray], about: About) -> bytes:
    """Return the bytes of a pilot's file."""
    buffer = BytesIO()
    arrays = {f"layer_{k}": np.asarray(w, np.float32) for k, w in enumerate(weights)}
    text = json.dumps({"format": FORMAT} | asdict(about), allow_nan=False)
    np.savez(buffer, allow_pickle=False, about=np.array(text), **arrays)
    return buffer.getvalue()


def pilot_names() -> tuple[str, ...]:
    """Return the names of the pilots that come with the project."""
    return tuple(sorted(file.stem for file in PILOTS.glob("*.npz")))


def load_pilot(path: str | Path) -> Pilot:
    """Read a pilot.

    Args:
        path: a file, or the name of a pilot that comes with the project.

    Raises:
        FileError: the file is missing, cannot be read, or holds no pilot.
    """
    path = PILOTS / f"{path}.npz" if str(path) in pilot_names() else Path(path)
    data = _read(path)
    try:
        with np.load(BytesIO(data), allow_pickle=False) as arrays:
            written = json.loads(str(arrays["about"][()]))
            weights = tuple(np.asarray(arrays[f"layer_{k}"], np.float32) for k in range(LAYERS))
    except DAMAGED as error:
        raise FileError(
            f"{path}: expected a pilot as `race train` writes it, cannot be read: {error}"
        ) from None
    about = _about(path, written)
    _check_weights(path, weights)
    return Pilot(path.stem, about, weights, hashlib.sha256(data).hexdigest())


def _read(path: Path) -> bytes:
    """Return the bytes of an .npz file. Raise FileError where there is none."""
    try:
        size = path.stat().st_size
        if size > LARGEST:
            raise FileError(f"{path}: expected a pilot of at most {LARGEST:,} bytes, got {size:,}")
        data = path.read_bytes()
    except FileNotFoundError:
        names = ", ".join(pilot_names())
        raise FileError(
            f"no pilot {str(path)!r}: expected FILE.npz, or one that comes with quadsim: {names}"
        ) from None
    except OSError as error:
        raise FileError(f"{path}: expected a pilot's file: {error.strerror}") from None
    # NumPy's own error would be about pickle.
    if not zipfile.is_zipfile(BytesIO(data)):
        raise FileError(
            f"{path}: expected a pilot as `race train` writes it, got a file that is no .npz"
        )
    return data


def _about(path: Path, written: Any) -> About:
    """Return the About of a file's JSON. Raise FileError where it does not fit."""
    if not isinstance(written, dict) or written.pop("format", None) != FORMAT:
        raise FileError(f"{path}: expected format {FORMAT!r}: it was written by another version")
    try:
        values: dict[str, Any] = {
            k: tuple(v) if isinstance(v, list) else v for k, v in written.items()
        }
        about = About(**values)
        numbers = np.array([about.dt, about.hold, *about.low, *about.high], float)
    except (TypeError, ValueError) as error:
        raise FileError(f"{path}: about: expected the fields of a pilot: {error}") from None
    if about.observes != tuple(UNITS):
        raise FileError(
            f"{path}: expected a pilot that observes the {SIZE} numbers of this version"
        )
    fits = (
        len(about.low) == len(about.high) == 4
        and np.isfinite(numbers).all()
        and about.dt > 0
        and about.hold >= 1
    )
    if not fits or not isinstance(about.vehicle, str) or not isinstance(about.course, str):
        raise FileError(f"{path}: about: expected limits, a control period, a vehicle and a course")
    return about


def _check_weights(path: Path, weights: Sequence[np.ndarray]) -> None:
    """Raise FileError unless the layers fit together and are finite."""
    width = SIZE
    for k in range(0, LAYERS, 2):
        matrix, bias = weights[k], weights[k + 1]
        if matrix.ndim != 2 or matrix.shape[0] != width or bias.shape != matrix.shape[1:]:
            raise FileError(
                f"{path}: expected layer {k // 2 + 1} with {width} inputs, "
                f"got shapes {matrix.shape} and {bias.shape}"
            )
        if not (np.isfinite(matrix).all() and np.isfinite(bias).all()):
            raise FileError(f"{path}: expected finite weights in layer {k // 2 + 1}")
        width = matrix.shape[1]
    if width != 4:
        raise FileError(f"{path}: expected 4 outputs, got {width}")
