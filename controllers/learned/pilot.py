"""Pilots: learned policies in files of numbers and JSON, which are evaluated by NumPy alone.

The file is an .npz with the weights of each layer and `about`, the JSON of an `About`: observations
and commands of the pilot, its vehicle and its training. The file has no code. `layer_0` and
`layer_1` are the matrix (inputs, outputs) and the bias (outputs,) of the first layer, `layer_2` and
`layer_3` those of the second, and so on.

A file is accepted if all numbers are plausible: control periods of 1 to 100 ms, actions held for at
most 100 periods, body rates up to 100 rad/s, thrust up to 1000 m/s^2, each lower limit below its
upper limit, and weights up to 1e6, which cannot overflow in flight.
"""

from __future__ import annotations

import hashlib
import io
import json
import os
import zipfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple

import numpy as np
from msgspec import Meta, Struct, structs

from quadsim.controllers.learned.observation import (
    SIZE,
    UNITS,
    command,
    gate_rows,
    normalised,
    observe,
)
from quadsim.controllers.plan import PlanStats
from quadsim.course import Course
from quadsim.dynamics.control_periods import ControlPeriods
from quadsim.dynamics.estimate import Estimate
from quadsim.dynamics.quadrotor import CONTROL
from quadsim.files.arrays import (
    TEXT,
    Declared,
    arrays_of,
    expect_format,
    npz_bytes,
    read_bytes,
    record_of,
)
from quadsim.files.atomic import replace_file
from quadsim.files.strict_yaml import FileError

PILOTS = Path(__file__).parent / "pilots"
FORMAT = "quadsim pilot 1"
WHAT = "a pilot as `race train` and `quadsim.save_pilot` write it"
LARGEST = 50_000_000  # largest accepted file [bytes]
ACTIONS = 4
# greatest absolute value of a weight; sums of such products are far below float32's limit
LARGEST_WEIGHT = 1e6
MOST_LAYERS = 100

Activation = Literal["relu", "tanh", "identity"]
Output = Literal["clip", "tanh"]
Name = Annotated[str, Meta(pattern=r"^[^/]{1,200}\Z")]
Rate = Annotated[float, Meta(ge=-100, le=100)]
Thrust = Annotated[float, Meta(ge=0, le=1000)]
# the commands of a Control
Limits = tuple[Rate, Rate, Rate, Thrust]


class Actions(NamedTuple):
    """How an action becomes a command."""

    dt: float  # control period [s]
    hold: int  # control periods for which an action is held
    low: Sequence[float]  # command at -1 [rad/s, m/s^2]  (4,)
    high: Sequence[float]  # command at 1  (4,)


class About(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """The record in a pilot's file: its purpose and its training."""

    vehicle: Name
    dt: Annotated[float, Meta(ge=1e-3, le=0.1)]  # control period [s]
    hold: Annotated[int, Meta(ge=1, le=100)]  # control periods for which an action is held
    low: Limits  # commands at -1 [rad/s, m/s^2]
    high: Limits  # commands at 1
    course: str  # course of the training
    # activation of the hidden layers, or of each of them
    activation: Activation | tuple[Activation, ...]
    # how the last layer's outputs become actions in -1..1
    output: Output
    # sha256 of the training vehicle, hexadecimal. A flight may use a changed vehicle, and its
    # record says so.
    vehicle_sha256: str
    training: dict[str, Any] = {}  # seed, steps, time, settings, command
    observes: tuple[str, ...] = tuple(UNITS)

    @property
    def actions(self) -> Actions:
        """How an action becomes a command."""
        return Actions(self.dt, self.hold, self.low, self.high)


class AboutFile(About, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """The record in a pilot's file, together with the format of the file."""

    format: str


@dataclass(frozen=True, eq=False, repr=False)
class Pilot:
    """A learned pilot: the weights of a policy's mean, and the record of its file."""

    name: str
    about: About
    weights: tuple[np.ndarray, ...]  # matrix (inputs, outputs) and bias (outputs,) of each layer
    digest: str = ""  # sha256 of the file, hexadecimal
    path: str = ""  # path of the file, or the name of a pilot that comes with the project

    def __call__(self, obs: np.ndarray) -> np.ndarray:
        """Return the action in -1..1.

        Args:
            obs: an observation (SIZE,), or several (n, SIZE).

        Returns:
            An action (4,), or several (n, 4).
        """
        outputs = forward(self.weights, obs, self.about.activation)
        return np.tanh(outputs) if self.about.output == "tanh" else np.clip(outputs, -1.0, 1.0)

    def __repr__(self) -> str:
        """Return one line: layers, output, vehicle and course of the training."""
        about = self.about
        sizes = "-".join(str(len(array)) for array in (*self.weights[::2], self.weights[-1]))
        given = about.activation
        activation = given if isinstance(given, str) else "-".join(given)
        network = " ".join(filter(None, (sizes, activation, about.output)))
        hold = f"an action held for {1e3 * about.hold * about.dt:g} ms"
        course = f", trained on {about.course}" if about.course else ""
        return f"<Pilot {self.name}: {network}, {hold}, vehicle {about.vehicle}{course}>"

    @property
    def place(self) -> str:
        """The absolute path of the file, or the name of a pilot that comes with the project."""
        return self.path if self.path in pilot_names() else str(Path(self.path).absolute())

    def check(self, vehicle: str, dt: float) -> None:
        """Raise FileError unless the pilot fits a vehicle and a control period [s]."""
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
    """The controller of one flight by a pilot, or by another policy.

    Each action is held for as many control periods as in the training.
    """

    def __init__(
        self,
        policy: Callable[[np.ndarray], np.ndarray],
        actions: Actions,
        course: Course,
        laps: int,
        rest: Sequence[float],
    ):
        """Prepare a flight.

        Args:
            policy: function that returns the action in -1..1 (4,) for an observation (SIZE,).
            actions: conversion of an action to a command.
            course, laps: course and number of laps of the race.
            rest: the control that acts until the first action  (4,).
        """
        self.rest = np.array(rest)
        self._policy = policy
        self._actions = actions
        self._gates = gate_rows(course, laps)
        self._last = normalised(rest, actions.low, actions.high)
        self._periods = ControlPeriods(actions.dt)
        self._until_next = 0  # control periods until the next action

    def control(self, estimate: Estimate) -> tuple[np.ndarray, PlanStats]:
        """Return the command, and zero statistics, as there is no plan.

        See quadsim.racing.flight.Controller.
        """
        actions = self._actions
        self._until_next -= self._periods.advance(estimate.t)
        if self._until_next <= 0:
            gates = self._gates[min(estimate.target, len(self._gates) - 1)]
            self._last = self._policy(observe(estimate.x, gates, self._last))
            self._until_next = actions.hold
        return command(self._last, actions.low, actions.high), PlanStats(0.0, 0.0, 0.0)


def forward(
    weights: Sequence[np.ndarray], x: np.ndarray, activation: Activation | Sequence[Activation]
) -> np.ndarray:
    """Return the outputs of a multilayer perceptron.

    Args:
        weights: matrix (inputs, outputs) and bias (outputs,) of each layer in turn.
        x: inputs  (inputs,) or (rows, inputs).
        activation: activation of all hidden layers, or one for each of them: "relu", max(0, x),
            "tanh" or "identity".
    """
    *hidden, matrix, bias = weights
    for k, one in enumerate(activations(activation, len(hidden) // 2)):
        x = x @ hidden[2 * k] + hidden[2 * k + 1]
        if one == "tanh":
            x = np.tanh(x)
        elif one == "relu":
            x = np.maximum(x, 0.0)
    return x @ matrix + bias


def activations(
    activation: Activation | Sequence[Activation], hidden: int
) -> tuple[Activation, ...]:
    """Return the activation of each of the `hidden` hidden layers.

    Raises:
        ValueError: another number of activations is given.
    """
    if isinstance(activation, str):
        return (activation,) * hidden
    if len(activation) != hidden:
        raise ValueError(
            f"activation: expected one for each of {hidden} hidden layers, got {len(activation)}"
        )
    return tuple(activation)


def layers(count: int) -> dict[str, Declared]:
    """Return the declarations of the arrays in a file with a number of layers."""
    widths = [SIZE, *(f"width of hidden layer {k}" for k in range(1, count)), ACTIONS]
    found = {}
    for k, (inputs, outputs) in enumerate(pairwise(widths)):
        found[f"layer_{2 * k}"] = Declared("float32", (inputs, outputs), most=LARGEST_WEIGHT)
        found[f"layer_{2 * k + 1}"] = Declared("float32", (outputs,), most=LARGEST_WEIGHT)
    return found


def _layer_count(data: bytes) -> int:
    """Return the number of layers in a file's content, 1 if there are none or it is damaged."""
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            names = [name for name in archive.namelist() if name.startswith("layer_")]
    except Exception:  # a damaged archive fails in a dozen ways; its arrays are read next
        return 1
    return min(max((len(names) + 1) // 2, 1), MOST_LAYERS)


def pilot_bytes(weights: Sequence[np.ndarray], about: About) -> bytes:
    """Return the content of a pilot's file."""
    record = {"format": FORMAT} | structs.asdict(about)
    arrays = {"about": np.array(json.dumps(record, allow_nan=False))}
    for name, layer in zip(layers(len(weights) // 2), weights, strict=True):
        arrays[name] = np.asarray(layer, np.float32)
    return npz_bytes(arrays)


def write_file(path: Path, data: bytes) -> None:
    """Write a pilot's file completely or not at all; make a missing folder.

    Raises:
        FileError: the file cannot be written (a ValueError).
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        replace_file(path, data)
    except OSError as error:
        raise FileError(f"{path}: cannot write: {error.strerror or error}") from None


def pilot_names() -> tuple[str, ...]:
    """Return the names of the pilots that come with the project."""
    return tuple(sorted(file.stem for file in PILOTS.glob("*.npz")))


def load_pilot(path: str | Path) -> Pilot:
    """Return a pilot by name, if it comes with the project, or by the path of its file.

    Raises:
        FileError: there is no such pilot, or its file is damaged.

    Examples:
        >>> from quadsim.controllers.learned.pilot import load_pilot
        >>> pilot = load_pilot("split_s_swift")
        >>> print(pilot)
        <Pilot split_s_swift: 38-64-64-4 relu clip, ... vehicle swift, trained on split_s_swift>
    """
    given = str(path)
    if given in pilot_names():
        path = PILOTS / f"{path}.npz"
    path = Path(path)
    if not os.path.lexists(path):
        names = ", ".join(pilot_names())
        wanted = f"expected FILE.npz, or one that comes with quadsim: {names}"
        raise FileError(f"no pilot {str(path)!r}: {wanted}")
    return pilot_of(read_bytes(path, WHAT, LARGEST), path, given)


def pilot_of(data: bytes, path: Path, given: str) -> Pilot:
    """Return the pilot in the content of a file.

    Args:
        data: content of the file.
        path: path of the file.
        given: the path as given, or the name of a pilot that comes with the project.

    Raises:
        FileError: the content is damaged.
    """
    declared = layers(_layer_count(data))
    arrays = arrays_of(data, {"about": TEXT} | declared, path, WHAT, LARGEST)
    about = _about(path, arrays["about"])
    try:
        activations(about.activation, len(declared) // 2 - 1)
    except ValueError as error:
        raise FileError(f"{path}: expected {WHAT}: about: {error}") from None
    weights = tuple(arrays[name] for name in declared)
    return Pilot(path.stem, about, weights, hashlib.sha256(data).hexdigest(), given)


def _about(path: Path, text: np.ndarray) -> About:
    """Return the checked record of a pilot's file. Raises FileError."""
    expect_format(text, FORMAT, path, WHAT, "it was written by another version")
    about = record_of(text, AboutFile, path, WHAT)
    if about.observes != tuple(UNITS):
        wanted = f"expected a pilot that observes the {SIZE} numbers of this version"
        raise FileError(f"{path}: {wanted}, got other ones")
    for name, low, high in zip(CONTROL, about.low, about.high, strict=True):
        if low >= high:
            wanted = f"expected a lower limit of {name} below its upper one"
            raise FileError(f"{path}: expected {WHAT}: about: {wanted}, got {low:g} and {high:g}")
    return about
