"""Fly a user's own policy as a pilot, from a file of numbers or as a Python function.

    quadsim.save_pilot(network, "mine.npz", vehicle="swift", hold=2)    layers, in a file
    quadsim.fly(controller=quadsim.PolicyController(function, hold=2))  any function, not in a file

A network is given as pairs (matrix, bias), as a `Sequential` of PyTorch, or as a model of
Stable-Baselines3. PyTorch is not imported here; the user's network has imported it already.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol, get_args

import numpy as np

from quadsim.controllers.learned.observation import SIZE
from quadsim.controllers.learned.pilot import (
    ACTIONS,
    LARGEST_WEIGHT,
    MOST_LAYERS,
    About,
    Actions,
    Activation,
    Output,
    Pilot,
    PilotController,
    activations,
    pilot_bytes,
    pilot_of,
    write_file,
)
from quadsim.dynamics import System
from quadsim.dynamics.quadrotor import Control, ModelParams, quadrotor
from quadsim.files.values import SettingError, checked_object, kinds_of
from quadsim.files.yaml_errors import shown_value
from quadsim.vehicle import Vehicle, load_vehicle

if TYPE_CHECKING:
    from quadsim.course import Course

WANTED = "expected pairs (matrix, bias), a Sequential of PyTorch or a model of Stable-Baselines3"
# class of PyTorch -> activation
OF_TORCH: dict[str, Activation] = {"Tanh": "tanh", "ReLU": "relu", "Identity": "identity"}


class Network(NamedTuple):
    """The layers of a network."""

    layers: list[tuple[np.ndarray, np.ndarray]]  # matrix (inputs, outputs), bias (outputs,)
    activation: tuple[Activation, ...]  # of each hidden layer
    output: Output


def save_pilot(
    policy: object,
    path: str | Path,
    *,
    vehicle: str | Path | Vehicle,
    course: str = "",
    dt: float = 0.01,
    hold: int = 1,
    activation: Activation | Sequence[Activation] | None = None,
    output: Output | None = None,
) -> Pilot:
    """Write a user's own policy as a pilot, which `race fly --pilot` flies.

    The input of the network has the 38 numbers of the learning environments, its output the 4
    numbers of an action, see docs/learning.md. The layers are stored unchanged.

    Args:
        policy: the network. Pairs (matrix, bias), one for each layer, of shapes (inputs, outputs)
            and (outputs,); or a `Sequential` of PyTorch with Linear, Tanh, ReLU and Identity; or a
            model of Stable-Baselines3 (PPO, A2C, SAC, TD3, DDPG), whose mean is stored; or a Pilot.
        path: FILE.npz to write.
        vehicle: vehicle of the training. Its limits are the commands at -1 and 1.
        course: name of the training's course, for information.
        dt: control period [s].
        hold: number of control periods for which an action is held, as in the training.
        activation: activation of all hidden layers of pairs, or one for each of them: "tanh"
            (default), "relu" or "identity". Other networks have their own.
        output: conversion of the last layer's outputs to actions in -1..1: "clip" (default) or
            "tanh". Other networks have their own.

    Returns:
        The pilot in the file.

    Raises:
        SettingError: the policy or a number cannot be stored (a ValueError).
        FileError: the vehicle cannot be read, or the file cannot be written (a ValueError).

    Examples:
        >>> import numpy as np
        >>> import quadsim
        >>> rng = np.random.default_rng(0)
        >>> layers = [(rng.normal(size=(38, 16)), np.zeros(16)), (np.zeros((16, 4)), np.zeros(4))]
        >>> quadsim.save_pilot(layers, "mine.npz", vehicle="swift", hold=2)
        <Pilot mine: 38-16-4 tanh clip, an action held for 20 ms, vehicle swift>
        >>> run = quadsim.fly("figure8", pilot="mine.npz", timeout=0.5)
    """
    path = Path(path)
    if path.suffix != ".npz":
        raise SettingError("path", f"expected FILE.npz, got {str(path)!r}")
    network = network_of(policy, activation, output)
    weights = [array for layer in network.layers for array in layer]
    flown = vehicle if isinstance(vehicle, Vehicle) else load_vehicle(str(vehicle))
    kinds = kinds_of(About)
    dt = checked_object("dt", dt, kinds["dt"])
    if not isinstance(course, str):
        raise SettingError("course", f"expected a text, got {shown_value(course)}")
    system = _environment(flown, dt)
    same = set(network.activation)
    about = About(
        vehicle=flown.name,
        dt=dt,
        hold=checked_object("hold", hold, kinds["hold"]),
        low=Control(*system.low),
        high=Control(*system.high),
        course=course,
        activation=same.pop() if len(same) == 1 else network.activation,
        output=network.output,
        vehicle_sha256=vehicle_digest(flown),
    )
    data = pilot_bytes(weights, about)
    pilot = pilot_of(data, path, str(path))
    write_file(path, data)
    return pilot


def vehicle_digest(vehicle: Vehicle) -> str:
    """Return the sha256 [hex] of a vehicle's numbers for a pilot's file."""
    return hashlib.sha256(json.dumps(asdict(vehicle)).encode()).hexdigest()


def _environment(vehicle: Vehicle, dt: float) -> System:
    """Return the system whose limits are the commands at the actions -1 and 1."""
    return quadrotor(ModelParams.of(vehicle), dt)


def network_of(
    policy: object,
    activation: Activation | Sequence[Activation] | None = None,
    output: Output | None = None,
) -> Network:
    """Return the layers of a policy; see `save_pilot` for the arguments. Raises SettingError."""
    if isinstance(policy, Pilot):
        arrays = policy.weights
        pairs = list(zip(arrays[::2], arrays[1::2], strict=True))
        found = _checked(pairs, policy.about.activation, policy.about.output)
    elif isinstance(policy, list | tuple):
        return _checked(policy, activation or "tanh", output or "clip")
    else:
        found = _of_modules(policy)
    for name, given in (("activation", activation), ("output", output)):
        if given is not None:
            wanted = f"expected none beside {shown_value(policy)}, which has its own"
            raise SettingError(name, f"{wanted}, got {given!r}")
    return found


def _of_modules(policy: object) -> Network:
    """Return the layers of a network of PyTorch, or of a model of Stable-Baselines3."""
    modules = list(_modules(policy))
    pairs: list[tuple[Any, Any]] = []
    after: list[Activation | None] = []  # the activation after each layer; None if none was named
    for module in modules:
        kind = type(module).__name__
        if kind == "Linear":
            layer: Any = module
            matrix = np.asarray(layer.weight.detach().cpu()).T
            has_bias = layer.bias is not None
            bias = np.asarray(layer.bias.detach().cpu()) if has_bias else np.zeros(matrix.shape[1])
            pairs.append((matrix, bias))
            after.append(None)
        elif kind in OF_TORCH and pairs and after[-1] in (None, "identity"):
            after[-1] = OF_TORCH[kind]
        elif kind not in ("Flatten", "FlattenExtractor", "Dropout", "Identity"):
            wanted = f"{WANTED}: Linear layers, each with one of {', '.join(OF_TORCH)} behind it"
            raise SettingError("policy", f"{wanted}, got {kind}")
    if not pairs:
        raise SettingError("policy", f"{WANTED}, got {shown_value(policy)} without a Linear layer")
    last = after.pop()
    if last == "relu":
        raise SettingError("policy", "expected no ReLU behind the last layer, as actions are -1..1")
    hidden: list[Activation] = [one or "identity" for one in after]
    return _checked(pairs, hidden, "tanh" if last == "tanh" else "clip")


def _modules(policy: object) -> Iterator[object]:
    """Yield the layers of a network in order. Raises SettingError."""
    # A model of Stable-Baselines3 has a policy, whose parts depend on the algorithm.
    inner: Any = getattr(policy, "policy", policy)
    actor: Any = getattr(inner, "actor", None)
    if hasattr(inner, "mlp_extractor") and hasattr(inner, "action_net"):
        yield from _modules(inner.mlp_extractor.policy_net)
        yield from _modules(inner.action_net)
        if getattr(inner, "squash_output", False):
            yield Tanh()
    elif hasattr(actor, "latent_pi"):  # SAC, whose mean is squashed
        yield from _modules(actor.latent_pi)
        yield from _modules(actor.mu)
        yield Tanh()
    elif hasattr(actor, "mu"):  # TD3, DDPG
        yield from _modules(actor.mu)
    elif type(inner).__name__ == "Sequential":
        for module in inner.children():
            yield from _modules(module)
    elif callable(getattr(inner, "children", None)):
        yield inner
    else:
        hint = ": fly it as controller=quadsim.PolicyController(...)" if callable(policy) else ""
        raise SettingError("policy", f"{WANTED}, got {shown_value(policy)}{hint}")


class Tanh:
    """A placeholder for the tanh after the last layer, which the algorithm itself applies."""


def _checked(
    pairs: Sequence[Any], activation: Activation | Sequence[Activation], output: Output
) -> Network:
    """Return the network of pairs (matrix, bias). Raises SettingError."""
    if not 1 <= len(pairs) <= MOST_LAYERS:
        raise SettingError("policy", f"expected 1 to {MOST_LAYERS} layers, got {len(pairs)}")
    layers = [_layer(number, pair) for number, pair in enumerate(pairs, 1)]
    widths = [SIZE, *(len(bias) for _, bias in layers)]
    for number, ((inputs, outputs), (matrix, _)) in enumerate(
        zip(pairwise(widths), layers, strict=True), 1
    ):
        if matrix.shape != (inputs, outputs):
            wanted = f"layer {number}: expected a matrix of shape ({inputs}, {outputs})"
            raise SettingError("policy", f"{wanted}, got {matrix.shape}")
    if widths[-1] != ACTIONS:
        wanted = f"expected {ACTIONS} outputs: body rates about x, y, z and thrust"
        raise SettingError("policy", f"{wanted}, got {widths[-1]}")
    several = isinstance(activation, list | tuple)
    for one in activation if several else (activation,):
        if one not in get_args(Activation):
            known = ", ".join(get_args(Activation))
            raise SettingError("activation", f"expected one of {known}, got {one!r}")
    if output not in get_args(Output):
        known = " or ".join(get_args(Output))
        raise SettingError("output", f"expected {known}, got {output!r}")
    try:
        return Network(layers, activations(activation, len(layers) - 1), output)
    except ValueError as error:
        name, _, problem = str(error).partition(": ")
        raise SettingError(name, problem) from None


def _layer(number: int, pair: Any) -> tuple[np.ndarray, np.ndarray]:
    """Return matrix and bias of a layer as float32. Raises SettingError."""
    place = f"layer {number}"
    if not isinstance(pair, list | tuple) or len(pair) != 2:
        raise SettingError("policy", f"{place}: expected (matrix, bias), got {shown_value(pair)}")
    arrays = []
    for name, value, dimensions in zip(("matrix", "bias"), pair, (2, 1), strict=True):
        try:
            array = np.asarray(value)
        except ValueError:  # lists of different lengths
            array = np.array(None)
        if array.dtype.kind not in "fiu" or array.ndim != dimensions or not array.size:
            wanted = f"{place}: expected a {name} of {dimensions} dimension{'s'[: dimensions - 1]}"
            raise SettingError("policy", f"{wanted}, got {shown_value(value)}")
        if not (abs(array) <= LARGEST_WEIGHT).all():
            wanted = f"{place}: expected finite numbers up to {LARGEST_WEIGHT:g} in the {name}"
            raise SettingError("policy", wanted)
        arrays.append(array.astype(np.float32))
    return arrays[0], arrays[1]


class FlownSpec(Protocol):
    """The attributes of a Spec that a PolicyController reads."""

    @property
    def course(self) -> Course:
        """The course."""
        ...

    @property
    def laps(self) -> int:
        """The number of laps."""
        ...

    @property
    def vehicle(self) -> Vehicle:
        """The vehicle."""
        ...

    @property
    def planner(self) -> Any:
        """The planner's numbers, including the control period `mppi.dt` [s]."""
        ...


@dataclass(frozen=True)
class PolicyController:
    """A controller made of any policy: a function, a network, or a policy with a memory.

    The policy gets the observations of the learning environments and returns an action, four
    numbers in -1..1 for body rates about x, y, z and thrust; -1 and 1 are the vehicle's limits.
    Numbers outside this range are clipped.

    Args:
        policy: function of an observation (38,), float32, that returns an action (4,). For a policy
            with a memory give a class, which is instantiated without arguments for each flight.
        hold: number of control periods for which an action is held, as in the training.

    Examples:
        >>> import numpy as np
        >>> import quadsim
        >>> def hover(observation):
        ...     height = 10.0 * observation[9]  # [m]
        ...     return np.array([0.0, 0.0, 0.0, -0.5 + 0.1 * (1.0 - height)])
        >>> run = quadsim.fly("figure8", controller=quadsim.PolicyController(hover), timeout=0.5)
        >>> run.outcome
        'timeout'
    """

    policy: Callable[[np.ndarray], Any]
    hold: int = 1

    def __post_init__(self) -> None:
        """Check the arguments. Raises SettingError."""
        if not callable(self.policy):
            wanted = "expected a function of an observation, or a class that makes one"
            raise SettingError("policy", f"{wanted}, got {shown_value(self.policy)}")
        checked_object("hold", self.hold, kinds_of(About)["hold"])

    def __call__(self, spec: FlownSpec) -> PilotController:
        """Return the controller of one flight."""
        dt = spec.planner.mppi.dt
        system = _environment(spec.vehicle, dt)
        actions = Actions(dt, self.hold, Control(*system.low), Control(*system.high))
        policy = self.policy() if isinstance(self.policy, type) else self.policy
        return PilotController(
            lambda observation: checked_action(policy, policy(observation)),
            actions,
            spec.course,
            spec.laps,
            system.rest,
        )


def checked_action(policy: object, given: object) -> np.ndarray:
    """Return an action, clipped to -1..1.  (4,)

    Raises:
        SettingError: the action is not four finite numbers.
    """
    try:
        action = np.asarray(given)
    except (TypeError, ValueError, RuntimeError):
        action = np.array(None)
    is_row = action.dtype.kind in "fiu" and action.shape == (ACTIONS,)
    if not is_row or not np.isfinite(action).all():
        name = getattr(policy, "__name__", type(policy).__name__)
        wanted = f"{name}: expected an action of {ACTIONS} finite numbers"
        raise SettingError("controller", f"{wanted}, got {shown_value(given)}")
    return np.clip(action, -1.0, 1.0)
