"""A pilot: a learned policy in a file of numbers and JSON, evaluated by numpy alone.

The file is an .npz with the weights of each layer and `about`, the JSON of an `About`: observations
and commands of the pilot, its vehicle and its training. Nothing in the file is executed.

A file is accepted if all numbers are plausible: control periods of 1 to 100 ms, actions held for at
most 100 periods, body rates up to 100 rad/s, thrust up to 1000 m/s^2, each lower limit below its
upper limit, and weights up to 1e6, which cannot overflow in flight.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from msgspec import Meta, Struct, structs

from controllers.learned.observation import SIZE, UNITS, command, gate_rows, normalised, observe
from controllers.plan import PlanStats
from quadsim.course import Course
from quadsim.dynamics.control_periods import ControlPeriods
from quadsim.dynamics.estimate import Estimate
from quadsim.dynamics.quadrotor import CONTROL
from quadsim.files.arrays import TEXT, Declared, arrays_of, npz_bytes, read_bytes, record_of
from quadsim.files.strict_yaml import FileError

PILOTS = Path(__file__).parent / "pilots"
FORMAT = "quadsim pilot 1"
WHAT = "a pilot as `race train` writes it"
LARGEST = 50_000_000  # largest accepted file [bytes]
ACTIONS = 4
# greatest absolute value of a weight; sums of such products are far below float32's limit
LARGEST_WEIGHT = 1e6
# matrix (inputs, outputs) and bias of each of three layers
LAYERS = {
    "layer_0": Declared("float32", (SIZE, "first hidden"), most=LARGEST_WEIGHT),
    "layer_1": Declared("float32", ("first hidden",), most=LARGEST_WEIGHT),
    "layer_2": Declared("float32", ("first hidden", "second hidden"), most=LARGEST_WEIGHT),
    "layer_3": Declared("float32", ("second hidden",), most=LARGEST_WEIGHT),
    "layer_4": Declared("float32", ("second hidden", ACTIONS), most=LARGEST_WEIGHT),
    "layer_5": Declared("float32", (ACTIONS,), most=LARGEST_WEIGHT),
}

Activation = Literal["relu", "tanh"]
Name = Annotated[str, Meta(pattern=r"^[^/]{1,200}\Z")]
Rate = Annotated[float, Meta(ge=-100, le=100)]
Thrust = Annotated[float, Meta(ge=0, le=1000)]
# the commands of a Control
Limits = tuple[Rate, Rate, Rate, Thrust]


class About(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """The record in a pilot's file: its purpose and its training."""

    vehicle: Name
    dt: Annotated[float, Meta(ge=1e-3, le=0.1)]  # control period [s]
    hold: Annotated[int, Meta(ge=1, le=100)]  # control periods for which an action is held
    low: Limits  # commands at -1 [rad/s, m/s^2]
    high: Limits  # commands at 1
    course: str  # course of the training
    training: dict[str, Any] = {}  # seed, steps, time, settings, command
    observes: tuple[str, ...] = tuple(UNITS)
    # activation of the hidden layers, tanh in an older file
    activation: Activation = "tanh"
    # sha256 of the training vehicle, hexadecimal, "" in an older file. A flight may use a changed
    # vehicle, and its record says so.
    vehicle_sha256: str = ""


class AboutFile(About, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """The record with the format of the file."""

    format: str


class Header(Struct):
    """The format key of the record."""

    format: str = ""


@dataclass(frozen=True, eq=False)
class Pilot:
    """The weights of a policy's mean, and what they are for."""

    name: str
    about: About
    weights: tuple[np.ndarray, ...]  # of LAYERS
    digest: str = ""  # sha256 of the file, hexadecimal
    path: str = ""  # path of the file, or the name of a pilot that comes with the project

    def __call__(self, obs: np.ndarray) -> np.ndarray:
        """Return the action in -1..1.

        Args:
            obs: (SIZE,), or rows of it.

        Returns:
            (4,), or rows of it.
        """
        return np.clip(forward(self.weights, obs, self.about.activation), -1.0, 1.0)

    @property
    def place(self) -> str:
        """The absolute path of the file, or the name of a pilot that comes with the project."""
        return self.path if self.path in pilot_names() else str(Path(self.path).absolute())

    def check(self, vehicle: str, dt: float) -> None:
        """Raise FileError unless the pilot fits this vehicle and control period."""
        if vehicle != self.about.vehicle:
            wanted = f"expected the vehicle it was trained for, {self.about.vehicle}"
            raise FileError(f"pilot {self.name}: {wanted}, got {vehicle}")
        if dt != self.about.dt:
            wanted = f"expected the {self.about.dt:g} s it was trained for"
            raise FileError(f"pilot {self.name}: dt: {wanted}, got {dt:g}")

    def record(self) -> dict[str, Any]:
        """Return the record of the pilot that a run stores."""
        return {"name": self.name, "sha256": self.digest}


class PilotController:
    """The controller of one flight by a pilot.

    Each action is held for as many control periods as in the training.
    """

    def __init__(self, pilot: Pilot, course: Course, laps: int, rest: Sequence[float]):
        self.pilot = pilot
        self.rest = np.array(rest)
        self._gates = gate_rows(course, laps)
        self._last = normalised(rest, pilot.about.low, pilot.about.high)
        self._periods = ControlPeriods(pilot.about.dt)
        self._until_next = 0  # control periods until the next action

    def control(self, estimate: Estimate) -> tuple[np.ndarray, PlanStats]:
        """Return the command and zero statistics, as there is no plan.

        See quadsim.racing.flight.Controller.
        """
        about = self.pilot.about
        self._until_next -= self._periods.advance(estimate.t)
        if self._until_next <= 0:
            gates = self._gates[min(estimate.target, len(self._gates) - 1)]
            self._last = self.pilot(observe(estimate.x, gates, self._last))
            self._until_next = about.hold
        return command(self._last, about.low, about.high), PlanStats(0.0, 0.0, 0.0)


def forward(weights: Sequence[np.ndarray], x: np.ndarray, activation: Activation) -> np.ndarray:
    """Return the outputs of a multilayer perceptron.

    Args:
        weights: matrix (inputs, outputs) and bias (outputs,) of each layer in turn.
        x: inputs, (inputs,) or (rows, inputs).
        activation: activation of the hidden layers: relu, max(0, x), or tanh.
    """
    *hidden, matrix, bias = weights
    for k in range(0, len(hidden), 2):
        x = x @ hidden[k] + hidden[k + 1]
        x = np.tanh(x) if activation == "tanh" else np.maximum(x, 0.0)
    return x @ matrix + bias


def pilot_bytes(weights: Sequence[np.ndarray], about: About) -> bytes:
    """Return the content of a pilot's file."""
    text = json.dumps({"format": FORMAT} | structs.asdict(about), allow_nan=False)
    arrays = {"about": np.array(text)}
    for name, layer in zip(LAYERS, weights, strict=True):
        arrays[name] = np.asarray(layer, np.float32)
    return npz_bytes(arrays)


def pilot_names() -> tuple[str, ...]:
    """Return the names of the pilots that come with the project."""
    return tuple(sorted(file.stem for file in PILOTS.glob("*.npz")))


def load_pilot(path: str | Path) -> Pilot:
    """Return a pilot by name, if it comes with the project, or by the path of its file.

    Raises:
        FileError: there is no such pilot, or its file is damaged.

    Examples:
        >>> from controllers.learned.pilot import load_pilot
        >>> pilot = load_pilot("split_s_swift")
        >>> pilot.about.vehicle, pilot.about.course
        ('swift', 'split_s_swift')
    """
    given = str(path)
    if given in pilot_names():
        path = PILOTS / f"{path}.npz"
    path = Path(path)
    if not os.path.lexists(path):
        names = ", ".join(pilot_names())
        wanted = f"expected FILE.npz, or one that comes with quadsim: {names}"
        raise FileError(f"no pilot {str(path)!r}: {wanted}")
    data = read_bytes(path, WHAT, LARGEST)
    arrays = arrays_of(data, {"about": TEXT} | LAYERS, path, WHAT, LARGEST)
    about = _about(path, arrays["about"])
    weights = tuple(arrays[name] for name in LAYERS)
    return Pilot(path.stem, about, weights, hashlib.sha256(data).hexdigest(), given)


def _about(path: Path, text: np.ndarray) -> About:
    """Return the checked record of a pilot's file. Raises FileError."""
    if record_of(text, Header, path, WHAT).format != FORMAT:
        raise FileError(f"{path}: expected format {FORMAT!r}: it was written by another version")
    about = record_of(text, AboutFile, path, WHAT)
    if about.observes != tuple(UNITS):
        wanted = f"expected a pilot that observes the {SIZE} numbers of this version"
        raise FileError(f"{path}: {wanted}, got other ones")
    for name, low, high in zip(CONTROL, about.low, about.high, strict=True):
        if low >= high:
            wanted = f"expected a lower limit of {name} below its upper one"
            raise FileError(f"{path}: expected {WHAT}: about: {wanted}, got {low:g} and {high:g}")
    return about
