"""A pilot: a learned policy in a file of numbers and JSON, flown by numpy alone. Nothing in it is
executed.

The file is an .npz: the weights of each layer, and `about`, the JSON of a `About`: what it observes
and commands, which vehicle it was trained for, and how.
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
LAYERS = 6  # weights and biases of three


@dataclass(frozen=True)
class About:
    """What a pilot was made for and how."""

    vehicle: str
    dt: float  # control period [s]
    hold: int  # control periods for which an action is held
    low: tuple[float, ...]  # of the commands at -1 [rad/s, m/s^2]
    high: tuple[float, ...]  # at 1
    course: str  # that it was trained on
    training: dict = field(default_factory=dict)  # seed, steps, time, settings, command
    observes: tuple[str, ...] = tuple(UNITS)


@dataclass(frozen=True, eq=False)
class Pilot:
    """The weights of a policy's mean, and what they are for."""

    name: str
    about: About
    weights: tuple[np.ndarray, ...]
    digest: str = ""  # sha256 of the file, hexadecimal

    def __call__(self, obs: np.ndarray) -> np.ndarray:
        """The action in -1..1.  (4,)"""
        return np.clip(network.forward(list(self.weights), obs), -1.0, 1.0)

    def check(self, vehicle: str, dt: float) -> None:
        """Raises FileError unless the pilot is for this vehicle and control period."""
        if vehicle != self.about.vehicle:
            raise FileError(
                f"pilot {self.name}: expected the vehicle it was trained for, {self.about.vehicle}, got {vehicle}"
            )
        if dt != self.about.dt:
            raise FileError(
                f"pilot {self.name}: dt: expected the {self.about.dt:g} s it was trained for, got {dt:g}"
            )

    def record(self) -> dict[str, Any]:
        """What a run keeps of it."""
        return {"name": self.name, "sha256": self.digest}


class PilotController:
    """A pilot in one flight: observes, and holds each action for as many control periods as in its
    training."""

    def __init__(self, pilot: Pilot, course: Course, laps: int, rest: Sequence[float]):
        self.pilot, self.rest = pilot, np.array(rest)
        self._gates = gate_rows(course, laps)
        self._last = normalised(rest, pilot.about.low, pilot.about.high)
        self._periods = ControlPeriods(pilot.about.dt)
        self._until_next = 0  # control periods until it observes again

    def control(self, estimate: Estimate) -> tuple[np.ndarray, PlanStats]:
        """Return the command; see quadsim.race.flight.Controller. There is no plan: its statistics
        are zero."""
        self._until_next -= self._periods.advance(estimate.t)
        if self._until_next <= 0:
            gates = self._gates[min(estimate.target, len(self._gates) - 1)]
            self._last = self.pilot(observe(estimate.x, gates, self._last))
            self._until_next = self.pilot.about.hold
        return command(self._last, self.pilot.about.low, self.pilot.about.high), PlanStats(
            0.0, 0.0, 0.0
        )


def pilot_bytes(weights: Sequence[np.ndarray], about: About) -> bytes:
    """A pilot's file."""
    buffer = BytesIO()
    arrays = {f"layer_{k}": np.asarray(w, np.float32) for k, w in enumerate(weights)}
    text = json.dumps({"format": FORMAT} | asdict(about), allow_nan=False)
    np.savez(buffer, allow_pickle=False, about=np.array(text), **arrays)
    return buffer.getvalue()


def pilot_names() -> tuple[str, ...]:
    """The pilots that come with the project."""
    return tuple(sorted(file.stem for file in PILOTS.glob("*.npz")))


def load_pilot(path: str | Path) -> Pilot:
    """Read a pilot's file, or one that comes with the project by its name. Raises FileError of one
    line."""
    path = PILOTS / f"{path}.npz" if str(path) in pilot_names() else Path(path)
    try:
        if path.stat().st_size > LARGEST:
            raise FileError(
                f"{path}: expected a pilot of at most {LARGEST:,} bytes, got {path.stat().st_size:,}"
            )
        data = path.read_bytes()
    except FileNotFoundError:
        names = ", ".join(pilot_names())
        raise FileError(
            f"no pilot {str(path)!r}: expected FILE.npz, or one that comes with quadsim: {names}"
        ) from None
    except OSError as error:
        raise FileError(f"{path}: expected a pilot's file: {error.strerror}") from None
    if not zipfile.is_zipfile(BytesIO(data)):  # or numpy speaks of pickle
        raise FileError(
            f"{path}: expected a pilot as `race train` writes it, got a file that is no .npz"
        )
    try:
        with np.load(BytesIO(data), allow_pickle=False) as arrays:
            written = json.loads(str(arrays["about"][()]))
            weights = tuple(np.asarray(arrays[f"layer_{k}"], np.float32) for k in range(LAYERS))
    except (
        OSError,
        ValueError,
        KeyError,
        EOFError,
        NotImplementedError,
        zipfile.BadZipFile,
        zlib_error,
    ) as error:
        raise FileError(
            f"{path}: expected a pilot as `race train` writes it, cannot be read: {error}"
        ) from None
    about = _about(path, written)
    _check_weights(path, weights)
    return Pilot(path.stem, about, weights, hashlib.sha256(data).hexdigest())


def _about(path: Path, written: Any) -> About:
    if not isinstance(written, dict) or written.pop("format", None) != FORMAT:
        raise FileError(f"{path}: expected format {FORMAT!r}: it was written by another version")
    try:
        values: dict[str, Any] = {
            k: tuple(v) if isinstance(v, list) else v for k, v in written.items()
        }
        about = About(**values)
        numbers = np.array([about.dt, about.hold, *about.low, *about.high], float)
    except (TypeError, ValueError) as error:
        raise FileError(f"{path}: expected what a pilot says of itself: {error}") from None
    if about.observes != tuple(UNITS):
        raise FileError(
            f"{path}: expected a pilot that observes the {SIZE} numbers of this version, got other ones"
        )
    fits = (
        len(about.low) == len(about.high) == 4
        and np.isfinite(numbers).all()
        and about.dt > 0
        and about.hold >= 1
    )
    if not fits or not isinstance(about.vehicle, str) or not isinstance(about.course, str):
        raise FileError(
            f"{path}: expected limits, a control period and names in what a pilot says of itself"
        )
    return about


def _check_weights(path: Path, weights: Sequence[np.ndarray]) -> None:
    width = SIZE
    for k in range(0, LAYERS, 2):
        matrix, bias = weights[k], weights[k + 1]
        if matrix.ndim != 2 or matrix.shape[0] != width or bias.shape != matrix.shape[1:]:
            raise FileError(
                f"{path}: expected layer {k // 2 + 1} with {width} inputs, got {matrix.shape} and {bias.shape}"
            )
        if not (np.isfinite(matrix).all() and np.isfinite(bias).all()):
            raise FileError(f"{path}: expected finite weights in layer {k // 2 + 1}")
        width = matrix.shape[1]
    if width != 4:
        raise FileError(f"{path}: expected 4 outputs, got {width}")
