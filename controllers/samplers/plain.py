"""A user's own sampler: any object with a method `sample` over plain numpy arrays.

    class Uniform:
        def sample(self, rng, samples, horizon, controls):
            return rng.uniform(-1.0, 1.0, (samples, horizon, controls))

At most CHUNK = 2048 samples are drawn at a time. The same samples may be drawn again, from a
generator in the same state, so the sampler should be stateless. Its draws then depend only on
(seed, call, chunk), never on threads.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol, runtime_checkable

import numpy as np

from quadsim.controllers.lanes.layout import LANES, blocks, in_lanes
from quadsim.controllers.samplers.lane_sampler import LaneSampler
from quadsim.controllers.steps import Steps
from quadsim.files.values import SettingError
from quadsim.files.yaml_errors import shown_value


@runtime_checkable
class PlainSampler(Protocol):
    """The interface of a user's own sampler, which should be stateless.

    Examples:
        >>> import numpy as np
        >>> import quadsim
        >>> class Uniform:
        ...     def sample(self, rng, samples, horizon, controls):
        ...         size = (samples, horizon, controls)
        ...         return np.array([1.0, 1.0, 0.2, 5.0]) * rng.uniform(-1.0, 1.0, size)
        >>> run = quadsim.fly("figure8", sampler=Uniform(), laps=1, samples=512)
        >>> run.outcome
        'finished'
    """

    def sample(
        self, rng: np.random.Generator, samples: int, horizon: int, controls: int
    ) -> np.ndarray:
        """Return perturbations of the controls around the plan, in the units of the controls.

        Args:
            rng: the generator, which may also spawn generators or be passed to SciPy:
                `qmc.Halton(d, seed=rng)`.
            samples: number of samples, at most 2048.
            horizon: number of control periods.
            controls: number of controls.

        Returns:
            Finite perturbations  (samples, horizon, controls). Otherwise MPPI raises SettingError,
            a ValueError.
        """
        ...


def lanes_of(
    sampler: PlainSampler, samples: int, lengths: Sequence[int], controls: int, key: np.ndarray
) -> LaneSampler:
    """Return a source of a plain sampler's perturbations in lanes.

    Drawing raises SettingError for an array of a wrong shape, and for numbers that are not finite.

    Args:
        sampler: the sampler.
        samples: largest number of samples drawn at a time.
        lengths: number of control periods of each step of the rollouts  (T,).
        controls: n_u, number of controls.
        key: key of the random numbers  (2,) uint32.
    """
    steps = Steps(lengths)
    noise = np.empty((blocks(samples), controls, steps.number, LANES), np.float32)

    def sample(call: int, first: int = 0, samples: int = samples) -> np.ndarray:
        shape = (samples, steps.periods, controls)
        drawn = sampler.sample(_generator(key, call, first), *shape)
        z = checked(drawn, shape, type(sampler).__name__)
        return in_lanes(steps.mean(z), noise[: blocks(samples)])

    return LaneSampler(sample, loop=None)


def _generator(key: np.ndarray, call: int, first: int) -> np.random.Generator:
    """Return the generator of the chunk that begins with sample `first`.

    The generator can spawn generators, as SciPy's quasi-Monte Carlo engines require.
    """
    stream = np.random.Philox(np.random.SeedSequence([*map(int, key), call, first]))
    # Philox increments the counter's first word, so no two calls or chunks share a number.
    state = np.random.Philox(
        key=key.astype(np.uint64), counter=np.array([0, first, call, 0], np.uint64)
    ).state
    stream.state = state
    return np.random.Generator(stream)


def checked(z: object, shape: tuple[int, int, int], name: str) -> np.ndarray:
    """Return drawn perturbations as float32.

    Args:
        z: the perturbations.
        shape: the expected shape.
        name: name of the sampler, for errors.

    Raises:
        SettingError: the array has a wrong shape or type, or numbers that are not finite (a
            ValueError).
    """
    wanted = (
        f"{name}.sample: expected finite numbers of shape {shape}, samples x horizon x controls"
    )
    try:
        given = np.asarray(z)
    except ValueError:  # lists of different lengths
        raise SettingError("sampler", f"{wanted}, got {shown_value(z)}") from None
    if given.dtype.kind not in "fiub":
        got = f"an array of {given.dtype}" if isinstance(z, np.ndarray) else shown_value(z)
        raise SettingError("sampler", f"{wanted}, got {got}")
    with np.errstate(over="ignore"):
        found = given.astype(np.float32)
    if found.shape != shape:
        raise SettingError("sampler", f"{wanted}, got shape {found.shape}")
    if not np.isfinite(found).all():
        count = np.count_nonzero(~np.isfinite(found))
        raise SettingError("sampler", f"{wanted}, got {count} that are not finite as float32")
    return found
