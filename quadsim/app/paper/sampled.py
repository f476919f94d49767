"""Samples apart from a planner: controls drawn by a sampler, and where they lead the off-road vehicle."""

from __future__ import annotations

import numpy as np

from controllers.rollout.layout import from_lanes
from controllers.samplers import Sampling
from controllers.samplers.lane_sampler import stream_key
from quadsim.systems.offroad import NOMINAL, offroad

DT = 0.02  # [s]
HORIZON = 250  # steps
SPEED = 5.0  # of the vehicle at the start [m/s]


def draw(sampling: Sampling, samples: int, horizon: int = HORIZON, seed: int = 0) -> np.ndarray:
    """Perturbations, one row a sample.  (samples, n_u, horizon)"""
    z = sampling.build(samples, horizon, stream_key(seed), DT).sample(1)
    return from_lanes(z, samples, horizon)


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
