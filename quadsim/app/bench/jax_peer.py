"""The model through JAX."""

from __future__ import annotations

from collections.abc import Callable
from types import ModuleType

import numpy as np

from controllers.costs import Cost
from controllers.mppi import MPPI
from quadsim.app.bench.array_backend import functions_of, rebind
from quadsim.systems import System


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
    words = functions_of(jnp)
    step, terms, n = rebind(system.step, words), rebind(cost.terms, words), len(cost.term_names)

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
