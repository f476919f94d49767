"""A sampler of one's own: any object with a method `sample` over plain numpy arrays.

    class Uniform:
        def sample(self, rng, samples, horizon, controls):
            return rng.uniform(-1.0, 1.0, (samples, horizon, controls))

It is asked for at most CHUNK = 2048 samples at a time and may be asked for the same ones again,
with the same state of the generator: it should keep no state of its own. What it draws depends on
(seed, call, chunk) alone, never on threads.
"""

from __future__ import annotations

from typing import Protocol, runtime_checkable

import numpy as np

from controllers.lanes.layout import LANES, blocks, in_lanes
from controllers.samplers.lane_sampler import LaneSampler


@runtime_checkable
class PlainSampler(Protocol):
    """What a sampler of one's own must have. At most 2048 samples are asked for at a time; it
    should keep no state."""

    def sample(
        self, rng: np.random.Generator, samples: int, horizon: int, controls: int
    ) -> np.ndarray:
        """Perturbations of the controls around the plan, in the units of the controls.

        Returns:
            (samples, horizon, controls), finite. MPPI raises ValueError for anything else.
        """
        ...


def lanes_of(
    sampler: PlainSampler, samples: int, horizon: int, controls: int, key: np.ndarray
) -> LaneSampler:
    """The same perturbations in lanes. Drawing raises ValueError for another shape and for numbers
    not finite."""
    noise = np.empty((blocks(samples), controls, horizon, LANES), np.float32)

    def sample(call: int, first: int = 0, samples: int = samples) -> np.ndarray:
        # Philox counts up from the counter's first word, so that no two calls or chunks share a
        # number
        stream = np.random.Philox(
            key=key.astype(np.uint64), counter=np.array([0, first, call, 0], np.uint64)
        )
        shape = (samples, horizon, controls)
        z = checked(
            sampler.sample(np.random.Generator(stream), *shape), shape, type(sampler).__name__
        )
        return in_lanes(z, noise[: blocks(samples)])

    return LaneSampler(sample, loop=None)


def checked(z: np.ndarray, shape: tuple[int, int, int], name: str) -> np.ndarray:
    """As float32. Raises ValueError."""
    wanted = (
        f"{name}.sample: expected finite numbers of shape {shape}, samples x horizon x controls"
    )
    with np.errstate(over="ignore"):
        z = np.asarray(z).astype(np.float32)
    if z.shape != shape:
        raise ValueError(f"{wanted}, got shape {z.shape}")
    if not np.isfinite(z).all():
        raise ValueError(
            f"{wanted}, got {np.count_nonzero(~np.isfinite(z))} that are not finite as float32"
        )
    return z
