"""A comparison with pytorch-mppi and JAX, with the same model and cost, without gates.

All planners are timed in the same run. A library is timed only after its costs have agreed with
this project's costs for the same noise.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from importlib.util import find_spec
from types import FunctionType, ModuleType
from typing import Any, NamedTuple

import numpy as np
from numpy import sqrt

from quadsim.bench.cases import median_ms, paper_case, starting
from quadsim.console import UsageError
from quadsim.controllers.costs import Cost, Term
from quadsim.controllers.lanes.lanes import Rollout
from quadsim.controllers.lanes.layout import LANES
from quadsim.controllers.lanes.threads import threads
from quadsim.controllers.mppi import MPPI
from quadsim.controllers.presets import preset
from quadsim.files.extras import needs_extra

AGREEMENT = 1e-3  # relative tolerance of float32 costs over 150 steps
# Standard deviations of the noise that the other libraries draw [rad/s, rad/s, rad/s, m/s^2].
SIGMA = (0.3, 0.3, 0.3, 3.5)
POINT = (50.0, 0.0, 2.0)  # [m]


class PeerTime(NamedTuple):
    """The time of a control step with another library and with this project."""

    name: str
    ms_p50: float
    ours_ms: float
    ratio: float  # ratio of the two times
    largest_difference: float  # largest relative difference of the costs for the same noise


def require_peers() -> None:
    """Raise UsageError if the extra is not installed."""
    missing = [name for name in ("torch", "pytorch_mppi", "jax") if find_spec(name) is None]
    if missing:
        raise UsageError(f"--peers: {needs_extra(' and '.join(missing), 'peers')}")


def compare(seconds: float) -> list[PeerTime]:
    """Return the times of each library and of this project's planner.

    Each is timed for about the given number of seconds."""
    mppi, x = starting(paper_case("quadrotor", "gaussian"))
    config = replace(mppi.config, rest_fraction=0.0)
    ours = MPPI(mppi.system, point_cost(), preset("paper", "gaussian").sampling, config)
    rows = []
    for name, load in PEERS.items():
        peer = load(ours)
        difference = largest_difference(ours, peer.costs, x)
        ours_ms = median_ms(partial(ours.control, x), seconds)
        peer_ms = median_ms(partial(peer.control, x), seconds)
        rows.append(PeerTime(name, peer_ms, ours_ms, peer_ms / ours_ms, difference))
    return rows


def largest_difference(ours: MPPI, costs: Callable, x: np.ndarray) -> float:
    """Return the largest relative difference between a library's costs and this project's.

    Args:
        ours: this project's planner.
        costs: function of the library that returns the costs J (M,) of a state x and controls v
            (M, T, n_u).
        x: initial state  (n_x,).

    Raises:
        ValueError: the difference exceeds AGREEMENT.
    """
    z = ours.sampler.sample(7).copy()  # (blocks, n_u, T, LANES)
    mine = np.empty((len(z), LANES), np.float32)
    Rollout(ours.system, ours.cost)(x, ours.plan, z, 0, mine)
    samples = z.transpose(0, 3, 2, 1).reshape(-1, z.shape[2], z.shape[1])  # (M, T, n_u)
    v = samples + ours.plan.astype(np.float32)
    theirs = costs(x, np.clip(v, np.float32(ours.low), np.float32(ours.high)))
    difference = float(np.max(np.abs(theirs - mine.ravel()) / np.abs(mine.ravel())))
    if difference > AGREEMENT:
        raise ValueError(
            "bench: expected equal costs for equal noise,"
            f" got a relative difference of {difference:g}"
        )
    return difference


class Point(NamedTuple):
    """A point to fly to [m]."""

    x: float
    y: float
    z: float


class Desired(NamedTuple):
    """The parameters of the terms."""

    speed: float  # [m/s]


def point_cost() -> Cost:
    """Return the cost of eq. (8) without gates, for flying to a point at a height and a speed.

    The point is never reached, and nothing crashes.
    """
    terms = (
        Term(progress, 8.0),
        Term(heading, 40.0),
        Term(height, 4.0),
        Term(speed, 0.5),
        Term(stabilize, 10.0),
    )
    return Cost("point", terms, Point, np.array([POINT]), Desired(speed=9.0))


def progress(x, x_next, u, point, p):
    """Return the distance to the point [m]."""
    dx = x_next.px - point.x
    dy = x_next.py - point.y
    dz = x_next.pz - point.z
    return sqrt(dx * dx + dy * dy + dz * dz + 1e-6)


def heading(x, x_next, u, point, p):
    """Return 1 + cos of the angle between horizontal velocity and the vector from the point."""
    dx = x_next.px - point.x
    dy = x_next.py - point.y
    d_xy = sqrt(dx * dx + dy * dy + 1e-6)
    v_xy = sqrt(x_next.vx * x_next.vx + x_next.vy * x_next.vy + 1e-6)
    return 1.0 + (x_next.vx * dx + x_next.vy * dy) / (v_xy * d_xy)


def height(x, x_next, u, point, p):
    """Return the square of the height difference to the point [m^2]."""
    dz = x_next.pz - point.z
    return dz * dz


def speed(x, x_next, u, point, p):
    """Return the squared difference of horizontal and desired speed [(m/s)^2]."""
    off = sqrt(x_next.vx * x_next.vx + x_next.vy * x_next.vy + 1e-6) - p.speed
    return off * off


def stabilize(x, x_next, u, point, p):
    """Return 1 - cos of the tilt."""
    return 2.0 * (x_next.qx * x_next.qx + x_next.qy * x_next.qy)


def array_backend(library: ModuleType) -> dict[str, Callable]:
    """Return a library's equivalents of the NumPy functions that are called here, by name."""
    functions = {name: getattr(library, name) for name in ("minimum", "maximum", "sqrt", "where")}
    if library.__name__ == "torch":  # torch's minimum and maximum take no plain numbers
        for name in ("minimum", "maximum"):
            functions[name] = _of_tensors(library, functions[name])
    return functions


def _of_tensors(torch: ModuleType, choose: Callable) -> Callable:
    """Return torch's minimum or maximum, extended to accept plain numbers."""

    def chosen(a: Any, b: Any) -> Any:
        return choose(torch.as_tensor(a), torch.as_tensor(b))

    return chosen


def rebind(function: Callable, backend: dict[str, Callable]) -> FunctionType:
    """Return the function with its globals replaced by the backend's functions, by name."""
    assert isinstance(function, FunctionType)
    return FunctionType(function.__code__, {**function.__globals__, **backend})


class Model(NamedTuple):
    """This project's model and cost in another library, on sequences of arrays."""

    step: Callable  # (x, u) -> the next state
    cost: Callable  # (x, u) -> the cost of x


def model(ours: MPPI, library: ModuleType) -> Model:
    """Return this project's model and cost with the library's functions."""
    system = ours.system
    cost = ours.cost
    backend = array_backend(library)
    step = rebind(system.step, backend)
    terms = [(term.weight, rebind(term.function, backend)) for term in cost.terms]
    point = Point(*POINT)

    def next_state(x: Sequence, u: Sequence) -> Any:
        return step(system.state(*x), system.control(*u), system.params, system.dt)

    def state_cost(x: Sequence, u: Sequence) -> Any:
        state = system.state(*x)
        return sum(weight * term(None, state, u, point, cost.params) for weight, term in terms)

    return Model(next_state, state_cost)


class TorchPeer:
    """A planner of pytorch_mppi with float32, batched dynamics, and the same number of threads."""

    def __init__(self, ours: MPPI):
        """Use a planner's model, cost and budget.

        ours: the planner.
        """
        import pytorch_mppi
        import torch

        torch.set_num_threads(threads())
        system = ours.system
        config = ours.config
        in_torch = model(ours, torch)

        def dynamics(x: Any, u: Any) -> Any:
            return torch.stack(in_torch.step(x.unbind(1), u.unbind(1)), dim=1)

        def cost(x: Any, u: Any) -> Any:
            return in_torch.cost(x.unbind(1), u.unbind(1))

        self._torch = torch
        self._config = config
        self._dynamics = dynamics
        self._cost = cost
        self._mppi = pytorch_mppi.MPPI(
            self._dynamics,
            self._cost,
            len(system.states),
            torch.diag(torch.tensor(SIGMA) ** 2),
            num_samples=config.samples,
            horizon=config.horizon,
            lambda_=config.temperature * config.horizon,  # on the summed cost
            u_min=torch.tensor(system.low, dtype=torch.float32),
            u_max=torch.tensor(system.high, dtype=torch.float32),
            u_init=torch.tensor(system.rest, dtype=torch.float32),
        )

    def control(self, x: np.ndarray) -> object:
        """Return the control at the state x (n_x,)."""
        state = self._torch.tensor(x, dtype=self._torch.float32)
        for i in range(self._config.iterations):
            u = self._mppi.command(state, shift_nominal_trajectory=i == 0)
        return u

    def costs(self, x: np.ndarray, v: np.ndarray) -> np.ndarray:
        """Return the costs J (M,) of controls v (M, T, n_u) from the state x (n_x,).

        As in this project, J is the mean over the next states of all steps.
        """
        torch = self._torch
        state = torch.tensor(x, dtype=torch.float32).expand(len(v), -1)
        total = torch.zeros(len(v))
        for t in range(self._config.horizon):
            u = torch.from_numpy(np.ascontiguousarray(v[:, t]))
            state = self._dynamics(state, u)
            total = total + self._cost(state, u)
        return (total / self._config.horizon).numpy()


class JaxPeer:
    """The same algorithm in JAX, as one compiled function with a scan over the horizon."""

    def __init__(self, ours: MPPI):
        """Use a planner's model, cost and budget.

        ours: the planner.
        """
        import jax

        self._jax = jax
        self._key = jax.random.PRNGKey(0)
        self._plan = np.tile(np.array(ours.system.rest, np.float32), (ours.config.horizon, 1))
        rollout = jax_rollout(jax, ours)
        self._costs = jax.jit(rollout)
        self._step = jax.jit(jax_control(jax, rollout, ours))

    def control(self, x: np.ndarray) -> object:
        """Return the plan at the state x (n_x,)."""
        self._plan, self._key = self._step(np.float32(x), self._plan, self._key)
        return self._jax.block_until_ready(self._plan)

    def costs(self, x: np.ndarray, v: np.ndarray) -> np.ndarray:
        """Return the costs J (M,) of controls v (M, T, n_u) from the state x (n_x,)."""
        return np.asarray(self._costs(np.float32(x), v.transpose(1, 2, 0)))


def jax_rollout(jax: ModuleType, ours: MPPI) -> Callable:
    """Return the function (x (n_x,), v (T, n_u, M)) -> J (M,)."""
    in_jax = model(ours, jax.numpy)

    def advance(x, u):
        x_next = in_jax.step(x, tuple(u))
        return x_next, in_jax.cost(x_next, tuple(u))

    def rollout(x, v):
        start = ours.system.state(*(jax.numpy.full(v.shape[2], xi) for xi in x))
        return jax.lax.scan(advance, start, v)[1].mean(axis=0)

    return rollout


def jax_control(jax: ModuleType, rollout: Callable, ours: MPPI) -> Callable:
    """Return the function (x, plan, key) -> (plan, key) of one control step."""
    jnp = jax.numpy
    config = ours.config
    low = jnp.float32(jnp.array(ours.system.low))
    high = jnp.float32(jnp.array(ours.system.high))
    rest = jnp.float32(jnp.array(ours.system.rest))
    sigma = jnp.array(SIGMA)

    def control(x, plan, key):
        plan = jnp.vstack([plan[1:], rest])
        for _ in range(config.iterations):
            key, now = jax.random.split(key)
            z = sigma[:, None] * jax.random.normal(
                now, (config.horizon, len(SIGMA), config.samples)
            )
            v = jnp.clip(plan[:, :, None] + z, low[:, None], high[:, None])
            J = rollout(x, v)
            w = jax.nn.softmax(-J / config.temperature)
            plan = plan + jnp.einsum("m,tum->tu", w, v - plan[:, :, None])
        return plan, key

    return control


PEERS = {"pytorch-mppi": TorchPeer, "JAX": JaxPeer}
