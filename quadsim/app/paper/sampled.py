"""Samples apart from a planner: controls drawn by a sampler, and where they lead the off-road vehicle."""

from __future__ import annotations

import numpy as np

from controllers.rollout.lanes import LANES
from controllers.samplers import SAMPLERS, Channels
from quadsim.systems.offroad import NOMINAL, offroad

DT = 0.02  # [s]
HORIZON = 250  # steps
SPEED = 5.0  # of the vehicle at the start [m/s]


def draw(sampler: str, sampling: Channels, samples: int, horizon: int = HORIZON, seed: int = 0) -> np.ndarray:
    """Perturbations, one row a sample.  (samples, n_u, horizon)"""
    key = np.random.SeedSequence(seed).generate_state(2, np.uint32)
    z = SAMPLERS[sampler](sampling, samples, horizon, key, DT).sample(1)
    series, n_u, steps, _ = z.shape
    apart = z.reshape(series, n_u, steps // horizon, horizon, LANES).transpose(0, 2, 4, 1, 3)
    return apart.reshape(-1, n_u, horizon)[:samples]


def paths(controls: np.ndarray) -> np.ndarray:
    """Where they lead from the origin, driving east.  (samples, 2, horizon) -> (samples, horizon + 1, 2) [m]"""
    system = offroad(NOMINAL, DT)
    u = np.clip(controls, -1.0, 1.0)
    x = tuple(np.full(len(u), v) for v in (0.0, 0.0, 1.0, 0.0, SPEED, 0.0, 0.0, 0.0))
    places = [np.stack(x[:2], axis=1)]
    for t in range(u.shape[2]):
        x = system.step(x, tuple(u[:, :, t].T), system.params, DT)
        places.append(np.stack(x[:2], axis=1))
    return np.stack(places, axis=1)
