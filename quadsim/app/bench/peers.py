"""The same model and cost, without gates, through pytorch-mppi and through JAX, in the same run as ours.

The text of step() and terms() is the same for all: only the words sqrt, where, minimum and maximum are
bound to each library's own. Before anything is timed, every one of them must find the same costs for
the same noise.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from types import FunctionType, ModuleType

import numpy as np

from controllers.costs import Cost
from controllers.mppi import MPPI
from controllers.rollout.lanes import LANES, Rollout
from controllers.rollout.threads import threads
from quadsim.app.bench.cases import Case, controller
from quadsim.app.bench.point_cost import point_cost
from quadsim.app.bench.timing import median_ms
from quadsim.app.flags import UsageError
from quadsim.systems import System

AGREEMENT = 1e-3  # relative, of float32 costs over 150 steps


def compare(seconds: float) -> list[dict]:
    """One row a peer: {name, ms_p50, ours_ms, ratio, largest_difference}. Raises UsageError without the extra."""
    mppi, x = controller(Case("gaussian"))
    ours = MPPI(mppi.system, point_cost(), mppi.sampler, replace(mppi.config, rest_fraction=0.0))
    rows = []
    for name, load in {"pytorch-mppi": TorchPeer, "JAX": JaxPeer}.items():
        try:
            peer = load(ours.system, ours.cost, ours)
        except ImportError as error:
            raise UsageError(f"--peers: {error.name} is not installed: pip install 'quadsim[peers]'") from None
        difference = largest_difference(ours, peer.costs, x)
        # one after the other in one run, ours again beside each
        ours_ms = median_ms(lambda: ours.control(x), seconds)
        theirs = median_ms(lambda p=peer: p.control(x), seconds)
        rows.append(
            {
                "name": name,
                "ms_p50": theirs,
                "ours_ms": ours_ms,
                "ratio": theirs / ours_ms,
                "largest_difference": difference,
            }
        )
    return rows


def largest_difference(ours: MPPI, costs: Callable, x: np.ndarray) -> float:
    """Between their costs and ours for the same noise, relative. Raises ValueError beyond AGREEMENT."""
    z = ours.sampler.sample(7).copy()  # (blocks, n_u, T, LANES)
    mine = np.empty((len(z), LANES), np.float32)
    Rollout(ours.system, ours.cost)(x, ours.plan, z, 0, mine)
    v = z.transpose(0, 3, 2, 1).reshape(-1, z.shape[2], z.shape[1]) + ours.plan.astype(np.float32)  # (M, T, n_u)
    theirs = costs(x, np.clip(v, np.float32(ours.low), np.float32(ours.high)))
    difference = float(np.max(np.abs(theirs - mine.ravel()) / np.abs(mine.ravel())))
    if difference > AGREEMENT:
        raise ValueError(f"bench: expected equal costs for equal noise, got a relative difference of {difference:g}")
    return difference


def speaking(function: Callable, words: dict[str, object]) -> FunctionType:
    """The same function with its words bound anew."""
    assert isinstance(function, FunctionType)
    return FunctionType(function.__code__, {**function.__globals__, **words})


class TorchPeer:
    """pytorch_mppi.MPPI, as its users call it: float32, batched dynamics, all our threads."""

    def __init__(self, system: System, cost: Cost, ours: MPPI):
        import pytorch_mppi
        import torch

        torch.set_num_threads(threads())
        words = {"sqrt": torch.sqrt, "where": torch.where}
        step, terms, n = speaking(system.step, words), speaking(cost.terms, words), len(cost.term_names)
        self._torch = torch

        def dynamics(x, u):
            return torch.stack(step(x.unbind(1), u.unbind(1), system.params, system.dt), dim=1)

        def running_cost(x, u):
            # the cost of a state, as ours counts it: of the state that each step leads to
            return sum(terms(None, x.unbind(1), u.unbind(1), (), 0.0, cost.params)[:n])

        self._dynamics, self._cost, self._horizon = dynamics, running_cost, ours.config.horizon
        sigma = torch.diag(torch.tensor([0.3, 0.3, 0.3, 3.5]) ** 2)
        self._mppi = pytorch_mppi.MPPI(
            dynamics,
            running_cost,
            len(system.states),
            sigma,
            num_samples=ours.config.samples,
            horizon=ours.config.horizon,
            lambda_=ours.config.temperature * ours.config.horizon,  # on the summed cost
            u_min=torch.tensor(system.low, dtype=torch.float32),
            u_max=torch.tensor(system.high, dtype=torch.float32),
            u_init=torch.tensor(system.rest, dtype=torch.float32),
        )
        self._iterations = ours.config.iterations

    def control(self, x: np.ndarray) -> object:
        state = self._torch.tensor(x, dtype=self._torch.float32)
        for i in range(self._iterations):
            u = self._mppi.command(state, shift_nominal_trajectory=i == 0)
        return u

    def costs(self, x: np.ndarray, v: np.ndarray) -> np.ndarray:
        torch = self._torch
        state = torch.tensor(x, dtype=torch.float32).expand(len(v), -1)
        total = torch.zeros(len(v))
        for t in range(self._horizon):
            u = torch.from_numpy(np.ascontiguousarray(v[:, t]))
            state = self._dynamics(state, u)
            total = total + self._cost(state, u)
        return (total / self._horizon).numpy()


class JaxPeer:
    """The same algorithm in JAX: one compiled function, a scan over the horizon, rows of samples."""

    def __init__(self, system: System, cost: Cost, ours: MPPI):
        import jax

        self._jax = jax
        self._key = jax.random.PRNGKey(0)
        self._plan = np.tile(np.array(system.rest, np.float32), (ours.config.horizon, 1))
        rollout = jax_rollout(jax, system, cost)
        self._costs = jax.jit(rollout)
        self._step = jax.jit(jax_control(jax, rollout, system, ours))

    def control(self, x: np.ndarray) -> object:
        self._plan, self._key = self._step(np.float32(x), self._plan, self._key)
        return self._jax.block_until_ready(self._plan)

    def costs(self, x: np.ndarray, v: np.ndarray) -> np.ndarray:
        return np.asarray(self._costs(np.float32(x), v.transpose(1, 2, 0)))


def jax_rollout(jax: ModuleType, system: System, cost: Cost) -> Callable:
    """x (n_x,), v (T, n_u, M) -> J (M,)"""
    jnp = jax.numpy
    words = {"sqrt": jnp.sqrt, "where": jnp.where}
    step, terms, n = speaking(system.step, words), speaking(cost.terms, words), len(cost.term_names)

    def rollout(x, v):
        def advance(state, u):
            after = step(state, tuple(u), system.params, system.dt)
            return after, sum(terms(None, after, tuple(u), (), 0.0, cost.params)[:n])

        start = tuple(jnp.full(v.shape[2], xi) for xi in x)
        return jax.lax.scan(advance, start, v)[1].mean(axis=0)

    return rollout


def jax_control(jax: ModuleType, rollout: Callable, system: System, ours: MPPI) -> Callable:
    """(x, plan, key) -> (plan, key): shift, then the iterations of Algorithm 1."""
    jnp = jax.numpy
    low, high, rest = (jnp.float32(jnp.array(a)) for a in (system.low, system.high, system.rest))
    sigma = jnp.array([0.3, 0.3, 0.3, 3.5])
    config = ours.config

    def control(x, plan, key):
        plan = jnp.vstack([plan[1:], rest])
        for _ in range(config.iterations):
            key, now = jax.random.split(key)
            z = sigma[:, None] * jax.random.normal(now, (config.horizon, len(system.low), config.samples))
            v = jnp.clip(plan[:, :, None] + z, low[:, None], high[:, None])
            J = rollout(x, v)
            w = jax.nn.softmax(-J / config.temperature)
            plan = plan + config.step_size * jnp.einsum("m,tum->tu", w, v - plan[:, :, None])
        return plan, key

    return control
